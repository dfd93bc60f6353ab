r"""A plate with a round hole, for a pin or a shaft in it, meshed by gmsh, with small cells along
the hole.

::

                   top                              top
         +--------------------+           +--------------------+
         |        .--.        |           |      body          |
    left |       ( +  ) hole  | right     |        .--.  hole  | right
         |   body `--'        |           +-------'    `-------+
         +--------------------+                 symmetry
                 bottom

         whole, the origin at the +       symmetric: x[1] >= 0
"""

from __future__ import annotations

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
    length: Length = 8.0,
    height: Length = 4.0,
    radius: Length = 1.0,
    size: Length = 0.4,
    contact_size: Length = 0.08,
    contact_zone: Length = 0.1,
    symmetric: bool = False,
    cell: Literal["triangle", "quadrilateral"] = "triangle",
    order: Literal[1, 2] = 1,
) -> Any:
    """A plate with a hole at the origin, its middle.

    Args:
        comm: the ranks that share the mesh.
        length: extent along x[0], from minus to plus half of it.
        height: extent along x[1] of the whole plate, from minus to plus half of it.
        radius: of the hole.
        size: length of the facets far from the hole.
        contact_size: length of the facets of the hole.
        contact_zone: distance from the hole up to which cells are of that size.
        symmetric: only the upper half of it.
        cell: shape of the cells.
        order: degree of the geometry: 1: the facets of the hole are straight, only their ends are
            on the circle.

    Returns:
        The mesh with the boundaries hole, right, top, left, and bottom or, if it is symmetric,
        symmetry.
    """
    if 2 * radius >= min(length, height):
        refuse(
            "radius",
            "the hole does not fit: radius must be less than half of length and height, got "
            f"{radius:g}",
        )

    unit = radius  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        geo = gmsh.model.geo
        x = length / 2
        y = height / 2
        low = 0.0 if symmetric else -y
        corners = [drawing.point(*position) for position in ((-x, low), (x, low), (x, y), (-x, y))]
        centre = drawing.point(0.0, 0.0)
        around = [(-radius, 0.0), (0.0, radius), (radius, 0.0), (0.0, -radius)][
            : 3 if symmetric else 4
        ]
        rim = [drawing.point(*position) for position in around]
        nexts = rim[1:] if symmetric else rim[1:] + rim[:1]
        hole = [geo.addCircleArc(a, centre, b) for a, b in zip(rim, nexts, strict=False)]
        right, top, left = (geo.addLine(corners[k], corners[(k + 1) % 4]) for k in (1, 2, 3))
        if symmetric:
            flat = [geo.addLine(corners[0], rim[0]), geo.addLine(rim[2], corners[1])]
            loops = [geo.addCurveLoop([flat[0], *hole, flat[1], right, top, left])]
        else:
            flat = [geo.addLine(corners[0], corners[1])]
            loops = [geo.addCurveLoop([*flat, right, top, left]), geo.addCurveLoop(hole)]
        names = {"hole": hole, "right": [right], "top": [top], "left": [left]}
        names["symmetry" if symmetric else "bottom"] = flat
        sizes = Sizes(contact_size, size, zone=contact_zone, reach=max(length, height) / 2)
        mesh_surface(
            drawing, [geo.addPlaneSurface(loops)], names, sizes, curves=hole, cell=cell, order=order
        )

    return gmsh_mesh(comm, draw, name="plate_with_hole", unit=unit)
