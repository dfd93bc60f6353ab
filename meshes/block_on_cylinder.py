r"""A block with a round seat in its bottom that sits on a cylinder, like a saddle on a pipe, meshed by gmsh.

::

                      top
           +----------------------+
           |                      |
      left |         body         | right     height
           |       (0,0)          |
           |      .--+--.         |
           +-----'  seat `--------+
            bottom  \ | /  bottom
                  angle: of each half, seen from the centre (0, -radius)

A block with a flat bottom on a cylinder is ``block`` with ``layout = "graded"``: there the gap has the shape of the
cylinder.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from mpi4py import MPI
from pydantic import Field

from signorini_fx.mechanics.mesh.drawing import Drawing, Sizes, mesh_surface
from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Length, generator, refuse

Angle = Annotated[float, Field(gt=0, le=90, allow_inf_nan=False)]


@generator(sizes=("size", "contact_size"))
def generate(
    comm: MPI.Comm,
    /,
    *,
    length: Length = 10.0,
    height: Length = 5.0,
    radius: Length = 4.0,
    angle: Angle = 60.0,
    size: Length = 0.5,
    contact_size: Length = 0.1,
    contact_zone: Length = 0.3,
    cell: Literal["triangle", "quadrilateral"] = "triangle",
    order: Literal[1, 2] = 1,
) -> Any:
    """A block with a seat, the cells small along the seat.

    Args:
        comm: the ranks that share the mesh.
        length: extent along x[0], from minus to plus half of it.
        height: of the block over the crown of its seat, which is the origin.
        radius: of the seat.
        angle: of each half of the seat, from the vertical, degrees.
        size: length of the facets far from the seat.
        contact_size: length of the facets of the seat.
        contact_zone: distance from the seat up to which cells are of that size.
        cell: shape of the cells.
        order: degree of the geometry: 1: the facets of the seat are straight, only their ends are on the arc.

    Returns:
        The mesh with the boundaries seat, bottom (on both sides of it), right, top, left.
    """
    turn = math.radians(angle)
    across, down = radius * math.sin(turn), radius * (1 - math.cos(turn))
    if across >= length / 2:
        refuse("length", f"the seat is {2 * across:g} wide: length must be more, got {length:g}")

    unit = radius / 4.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        geo = gmsh.model.geo
        x = length / 2
        corners = ((-x, -down), (-across, -down), (0.0, 0.0), (across, -down), (x, -down), (x, height), (-x, height))
        points = [drawing.point(*corner) for corner in corners]
        centre = drawing.point(0.0, -radius)
        seat = [geo.addCircleArc(points[k], centre, points[k + 1]) for k in (1, 2)]
        bottom = [geo.addLine(points[k], points[k + 1]) for k in (0, 3)]
        right, top, left = (geo.addLine(points[k], points[(k + 1) % 7]) for k in (4, 5, 6))
        body = geo.addPlaneSurface([geo.addCurveLoop([bottom[0], *seat, bottom[1], right, top, left])])
        names = {"seat": seat, "bottom": bottom, "right": [right], "top": [top], "left": [left]}
        sizes = Sizes(contact_size, size, zone=contact_zone, reach=max(length, height) / 2)
        mesh_surface(drawing, [body], names, sizes, curves=seat, cell=cell, order=order)

    return gmsh_mesh(comm, draw, name="block_on_cylinder", unit=unit)
