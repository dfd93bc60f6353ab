r"""A segment of a ring that stands on the origin, like a brake shoe or a tyre, meshed by gmsh.

::

        inner radius          centre (0, R)            +
           __                       +                  |\   inner
     left /  `-._  inner  _.-'\ right        symmetry  | `-._
         /_      `-------'     \                       |     `-._ right
           `-._     body    _.-'                       | body   /
        outer  `-----+-----'                           +-------'  outer
                   (0,0)                             (0,0)

                   whole                             symmetric
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Any, Literal

from mpi4py import MPI
from pydantic import Field

from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Length, generator, refuse
from signorini_fx.meshes._drawing import Drawing, Sizes, mesh_surface

Angle = Annotated[float, Field(gt=0, le=170, allow_inf_nan=False)]


@generator(sizes=("size", "contact_size"))
def generate(
    comm: MPI.Comm,
    /,
    *,
    radius: Length = 8.0,
    thickness: Length = 2.0,
    angle: Angle = 60.0,
    size: Length = 0.5,
    contact_size: Length = 0.05,
    contact_zone: Length = 0.5,
    symmetric: bool = False,
    cell: Literal["triangle", "quadrilateral"] = "triangle",
    order: Literal[1, 2] = 1,
) -> Any:
    """A ring segment whose cells are small near the origin and grow with the distance from there.

    Args:
        comm: the ranks that share the mesh.
        radius: outer radius R, a length; the centre is at (0, R).
        thickness: outer less inner radius, less than R.
        angle: of each half, from the vertical, degrees.
        size: length of the facets far from the origin.
        contact_size: length of the facets at the origin.
        contact_zone: distance from the origin up to which cells are of that size.
        symmetric: only the right half of it.
        cell: shape of the cells.
        order: degree of the geometry: 1: facets are straight, only their ends are on the arcs.

    Returns:
        The mesh with the boundaries outer, inner, right, and left or, if it is symmetric, symmetry.
    """
    if thickness >= radius:
        refuse("thickness", f"thickness must be less than radius, got {thickness:g} and {radius:g}")

    unit = radius / 8.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        geo = gmsh.model.geo
        turn = math.radians(angle)
        centre = drawing.point(0.0, radius)

        def ray(at: float) -> tuple[int, int]:
            """Its outer and inner point."""
            radii = (radius, radius - thickness)
            outer, inner = (
                drawing.point(r * math.sin(at), radius - r * math.cos(at)) for r in radii
            )
            return outer, inner

        rays = [ray(at) for at in ((0.0, turn) if symmetric else (-turn, 0.0, turn))]
        outer = [geo.addCircleArc(a[0], centre, b[0]) for a, b in pairwise(rays)]
        inner = [geo.addCircleArc(a[1], centre, b[1]) for a, b in pairwise(rays)]
        left, right = (geo.addLine(*ends) for ends in (rays[0], rays[-1]))
        body = geo.addPlaneSurface(
            [geo.addCurveLoop([*outer, right, *(-arc for arc in reversed(inner)), -left])]
        )
        names = {
            "outer": outer,
            "inner": inner,
            "right": [right],
            "symmetry" if symmetric else "left": [left],
        }
        sizes = Sizes(contact_size, size, zone=contact_zone, reach=radius)
        lowest = rays[0 if symmetric else 1][0]
        mesh_surface(drawing, [body], names, sizes, points=[lowest], cell=cell, order=order)

    return gmsh_mesh(comm, draw, name="ring_segment", unit=unit)
