r"""A punch with a flat foot and rounded edges, meshed by gmsh, with small cells where the edges
begin to rise.

::

                 top                         top
           +-------------+                +-------+
           |             |                |       |
      left |    body     | right          | body  | right    height
           |             |      symmetry  |       |
            \           /                 |      /
             `----+----'   rounding       +-----'  rounding
                (0,0)  foot             (0,0)  foot
           |-- width ----|                |-------| width / 2

               whole                      symmetric

The boundary foot is the flat part and both roundings.
"""

from __future__ import annotations

import math
from typing import Any, Literal

from mpi4py import MPI

from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Length, generator, refuse
from signorini_fx.meshes._drawing import Drawing, Sizes, mesh_surface


@generator(sizes=("size", "contact_size"))
def generate(
    comm: MPI.Comm,
    /,
    *,
    width: Length = 4.0,
    height: Length = 3.0,
    rounding: Length = 0.5,
    size: Length = 0.25,
    contact_size: Length = 0.02,
    contact_zone: Length = 0.2,
    symmetric: bool = False,
    cell: Literal["triangle", "quadrilateral"] = "triangle",
    order: Literal[1, 2] = 1,
) -> Any:
    """A punch that stands on the origin.

    Args:
        comm: the ranks that share the mesh.
        width: extent along x[0], from minus to plus half of it.
        height: extent along x[1], from 0.
        rounding: radius of the edges, less than half the width and than the height.
        size: length of the facets far from the edges.
        contact_size: length of the facets where the roundings begin.
        contact_zone: distance from there up to which cells are of that size.
        symmetric: only the right half of it.
        cell: shape of the cells.
        order: degree of the geometry: 1: the facets of the roundings are straight, only their ends
            are on the arcs.

    Returns:
        The mesh with the boundaries foot, right, top, and left or, if it is symmetric, symmetry.
    """
    if rounding >= min(width / 2, height):
        refuse("rounding", f"rounding must be less than height and half of width, got {rounding:g}")

    unit = width / 4.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        geo = gmsh.model.geo
        end = width / 2 - rounding  # of the flat part of the foot
        # A tangent of the rounding is so long; a mesh depends on every last bit.
        up = rounding / math.tan(math.pi / 4)

        def edge(*places: tuple[float, float]) -> tuple[int, int, int]:
            """The arc around the first place, from the second to the third, and before and after it
            its ends.
            """
            centre, first, last = (drawing.point(x, y) for x, y in places)
            return first, geo.addCircleArc(first, centre, last), last

        arcs = []
        if symmetric:
            start = low = drawing.point(0.0, 0.0)
        else:
            start, arc, low = edge((-end, rounding), (-width / 2, up), (-end, 0.0))
            arcs.append(arc)
        right, arc, side = edge((end, rounding), (end, 0.0), (width / 2, up))
        high, last = (
            drawing.point(x, height) for x in (width / 2, 0.0 if symmetric else -width / 2)
        )
        ends = ((low, right), (side, high), (high, last), (last, start))
        flat, *others = (geo.addLine(*points) for points in ends)
        foot = [*arcs, flat, arc]
        body = geo.addPlaneSurface([geo.addCurveLoop([*foot, *others])])
        sides = ("right", "top", "symmetry" if symmetric else "left")
        names = {"foot": foot} | {name: [line] for name, line in zip(sides, others, strict=True)}
        edges = [drawing.point(x, 0.0) for x in ((end,) if symmetric else (-end, end))]
        sizes = Sizes(contact_size, size, zone=contact_zone, reach=max(width, height) / 2)
        mesh_surface(drawing, [body], names, sizes, points=edges, cell=cell, order=order)

    return gmsh_mesh(comm, draw, name="punch", unit=unit)
