r"""A round punch in 3D with a flat foot and a rounded edge, meshed by gmsh, with small cells where the edge rises.

::

                  top                                  top
           +---------------+                       +-------+         x[2]
           |               |                       |       |          |
      side |     body      |  height    symmetry_x | body  | side     |
           |               |                       |       |          +--- x[0]
            \             /                        |      /
             `-----+-----'  rounding               +-----'  rounding
                (0,0,0)  foot                   (0,0,0)  foot
                   |-radius|

            whole, or half                       quarter

The boundary foot is the flat part and the rounding.  Half of it has x[1] >= 0 and ends at symmetry_y; a quarter has
x[0] >= 0 as well and ends at symmetry_x too.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from mpi4py import MPI

from signorini_fx.mechanics.mesh.drawing import Drawing, Part, Sizes, approximate_cells, cut_to_part, mesh_solid, plane
from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Length, generator, refuse, refuse_too_large


@generator(sizes=("size", "contact_size"))
def generate(
    comm: MPI.Comm,
    /,
    *,
    radius: Length = 2.0,
    height: Length = 3.0,
    rounding: Length = 0.5,
    size: Length = 0.6,
    contact_size: Length = 0.15,
    contact_zone: Length = 0.3,
    part: Part = "whole",
    cell: Literal["tetrahedron", "hexahedron"] = "tetrahedron",
    order: Literal[1, 2] = 1,
) -> Any:
    """A punch that stands on the origin.

    Args:
        comm: the ranks that share the mesh.
        radius: of the punch, around the axis x[2].
        height: extent along x[2], from 0.
        rounding: radius of the edge, less than radius and height.
        size: length of the edges of cells far from there.
        contact_size: length of the edges of cells where the rounding begins.
        contact_zone: distance from there up to which cells are of that size.
        part: all of it, its half with x[1] >= 0, or its quarter with x[0] >= 0 as well.
        cell: shape of the cells; hexahedra are divided tetrahedra, whose shape is not as good.
        order: degree of the geometry: 1: the facets of round surfaces are plane, only their corners are on them.

    Returns:
        The mesh with the boundaries foot, side, top, and where it is cut symmetry_y (at x[1] = 0) and symmetry_x.
    """
    if rounding >= min(radius, height):
        refuse("rounding", f"rounding must be less than radius and height, got {rounding:g}")

    unit = radius / 2.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing, occ = Drawing(gmsh, unit), gmsh.model.occ
        r, up, edge = (drawing.length(value) for value in (radius, height, rounding))
        body = occ.addCylinder(0.0, 0.0, 0.0, 0.0, 0.0, up, r)
        occ.synchronize()
        rims = [tag for _, tag in gmsh.model.getEntities(1) if gmsh.model.getType(1, tag) == "Circle"]
        (low,) = (tag for tag in rims if gmsh.model.getBoundingBox(1, tag)[5] < 0.5 * up)
        ((_, body),) = occ.fillet([body], [low], [edge])
        names = {"top": plane(2, up)} | cut_to_part(drawing, body, part, 2 * (r + up))
        names["side"] = lambda x: np.abs(np.hypot(x[0], x[1]) - r) < 1e-5
        names["foot"] = lambda x: x[2] < edge + 1e-5

        def distance(x: float, y: float, z: float) -> float:
            return math.hypot(math.hypot(x, y) - (r - edge), z)

        mesh_solid(drawing, names, sizes, distance, cell=cell, order=order)

    sizes = Sizes(contact_size, size, zone=contact_zone, reach=max(radius, height))
    share = {"whole": 1.0, "half": 0.5, "quarter": 0.25}[part]
    most = math.pi * radius**2 * height
    # Around the circle where the rounding begins, half a torus.
    around = math.pi**2 * max(radius - rounding, 0.1 * radius)
    refuse_too_large(comm, share * approximate_cells(sizes, lambda d: np.minimum(around * d**2, most), cell))
    return gmsh_mesh(comm, draw, name="cylindrical_punch", unit=unit)
