r"""The lower half of a sphere that stands on the origin, meshed by gmsh, with small cells where
contact begins.

::

       (-R,0,R)    top    (R,0,R)           (0,0,R)  top
          +--------+--------+                  +--------+            x[2]
           \      :       /                    |       /              |
            \    body    /  sphere  symmetry_x |      /  sphere       |
              `-. : .-'                        |  .-'                 +--- x[0]
                 `+'                           +'
               (0,0,0)                      (0,0,0)

            whole, or half                   quarter

Half of it has x[1] >= 0 and ends at symmetry_y; a quarter has x[0] >= 0 as well and ends at
symmetry_x too.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from mpi4py import MPI

from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Length, generator
from signorini_fx.meshes._drawing import Drawing, Sizes, mesh_solid, plane


@generator(sizes=("size", "contact_size"))
def generate(
    comm: MPI.Comm,
    /,
    *,
    radius: Length = 8.0,
    size: Length = 2.0,
    contact_size: Length = 0.2,
    contact_zone: Length = 1.0,
    part: Literal["whole", "half", "quarter"] = "whole",
    cell: Literal["tetrahedron", "hexahedron"] = "tetrahedron",
    order: Literal[1, 2] = 1,
) -> Any:
    """Half a sphere whose cells are small near the origin and grow with the distance from there.

    Args:
        comm: the ranks that share the mesh.
        radius: R, a length.
        size: length of the edges at the distance ``radius`` from the origin and beyond.
        contact_size: length of the edges at the origin.
        contact_zone: distance from the origin up to which cells are of that size.
        part: all of it, its half with x[1] >= 0, or its quarter with x[0] >= 0 as well.
        cell: shape of the cells; hexahedra are divided tetrahedra, whose shape is not as good.
        order: degree of the geometry: 1: the facets of the sphere are plane, only their corners are
            on it.

    Returns:
        The mesh with the boundaries sphere, top, and where it is cut symmetry_y (at x[1] = 0) and
        symmetry_x.
    """
    unit = radius / 8.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        occ = gmsh.model.occ
        # The poles of the sphere, where its surface is hard to mesh, are on the rim of the top.
        body = occ.addSphere(0.0, 0.0, _R, _R)
        occ.rotate([(3, body)], 0.0, 0.0, _R, 1.0, 0.0, 0.0, math.pi / 2)
        occ.intersect([(3, body)], [(3, occ.addBox(-2 * _R, -2 * _R, -_R, 4 * _R, 4 * _R, 2 * _R))])
        names = {"top": plane(2, _R)}
        if part != "whole":
            low = 0.0 if part == "quarter" else -4 * _R
            box = occ.addBox(low, 0.0, -4 * _R, 4 * _R - low, 4 * _R, 8 * _R)
            occ.intersect([(3, body)], [(3, box)])
            names["symmetry_y"] = plane(1, 0.0)
        if part == "quarter":
            names["symmetry_x"] = plane(0, 0.0)
        names["sphere"] = lambda x: np.abs(x[0] ** 2 + x[1] ** 2 + (x[2] - _R) ** 2 - _R**2) < 1e-5
        if part == "whole":
            lowest = occ.addPoint(0.0, 0.0, 0.0)
            occ.synchronize()
            (bowl,) = (
                tag for _, tag in gmsh.model.getEntities(2) if gmsh.model.getType(2, tag) != "Plane"
            )
            gmsh.model.mesh.embed(0, [lowest], 2, bowl)
        mesh_solid(
            drawing,
            names,
            sizes,
            lambda x, y, z: math.sqrt(x * x + y * y + z * z),
            cell=cell,
            order=order,
        )

    sizes = Sizes(contact_size, size, zone=min(contact_zone, 0.99 * radius), reach=radius)
    return gmsh_mesh(comm, draw, name="half_sphere", unit=unit)


# Radius of the gmsh model.
_R = 8.0
