r"""A punch with a flat foot and rounded edges, meshed by gmsh, with small cells where the edges begin to rise.

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

from typing import Any, Literal

from mpi4py import MPI

from signorini_fx.mechanics.mesh.drawing import Corner, Drawing, Sizes, draw_outline, mesh_surface
from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Length, generator, refuse


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
        order: degree of the geometry: 1: the facets of the roundings are straight, only their ends are on the arcs.

    Returns:
        The mesh with the boundaries foot, right, top, and left or, if it is symmetric, symmetry.
    """
    if rounding >= min(width / 2, height):
        refuse("rounding", f"rounding must be less than height and half of width, got {rounding:g}")

    unit = width / 4.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        low = Corner(0.0, 0.0, "foot") if symmetric else Corner(-width / 2, 0.0, "foot", rounding, "foot")
        outline = [
            low,
            Corner(width / 2, 0.0, "right", rounding, "foot"),
            Corner(width / 2, height, "top"),
            Corner(low.x, height, "symmetry" if symmetric else "left"),
        ]
        body, names = draw_outline(drawing, outline)
        ends = [sign * (width / 2 - rounding) for sign in ((1,) if symmetric else (-1, 1))]
        edges = [drawing.point(x, 0.0) for x in ends]
        sizes = Sizes(contact_size, size, zone=contact_zone, reach=max(width, height) / 2)
        mesh_surface(drawing, [body], names, sizes, points=edges, cell=cell, order=order)

    return gmsh_mesh(comm, draw, name="punch", unit=unit)
