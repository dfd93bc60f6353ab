"""A rectangular block, meshed by gmsh: structured, graded or unstructured, triangles or
quadrilaterals.

::

              top
        +------------+
        |            |
   left |    body    | right      height
        |            |
        +------------+
     (0,0)  bottom
           length
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from mpi4py import MPI
from pydantic import Field

from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Count, Length, generator, refuse_too_large

Ratio = Annotated[float, Field(ge=1, le=1e6, allow_inf_nan=False)]
# gmsh is given the block with this length.
_DRAWN_LENGTH = 3.0


@generator(counts=("nx", "ny"), simplices="triangle")
def generate(
    comm: MPI.Comm,
    /,
    *,
    length: Length = 3.0,
    height: Length = 1.0,
    nx: Count = 120,
    ny: Count = 40,
    cell: Literal["quadrilateral", "triangle"] = "quadrilateral",
    layout: Literal["structured", "graded", "unstructured"] = "structured",
    grading: Ratio = 20.0,
) -> Any:
    """A block with nx facets along bottom and top and ny along the sides.

    Args:
        comm: the ranks that share the mesh.
        length: extent along x[0].
        height: extent along x[1].
        nx: facets along x[0].
        ny: facets along x[1].
        cell: shape of the cells.
        layout: a regular grid; a grid that is finest at the middle of the bottom, with an even
            number of facets along it (an odd number above one is reduced by one); or gmsh's
            unstructured mesh for the divisions of the sides.
        grading: graded: ratio of the last facet to the first, counted from there, in both
            directions.

    Returns:
        The mesh with the boundaries left, right, bottom, top.
    """
    unit = length / _DRAWN_LENGTH
    up = height / unit

    def draw(gmsh: Any) -> None:
        geo = gmsh.model.geo
        if layout == "graded":
            _draw_graded(gmsh, _DRAWN_LENGTH, up, nx, ny, grading, cell)
            return
        corners = [
            geo.addPoint(x, y, 0.0)
            for x, y in ((0, 0), (_DRAWN_LENGTH, 0), (_DRAWN_LENGTH, up), (0, up))
        ]
        sides = [geo.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
        body = geo.addPlaneSurface([geo.addCurveLoop(sides)])
        for side, count in zip(sides, (nx, ny, nx, ny), strict=True):
            geo.mesh.setTransfiniteCurve(side, count + 1)
        if layout == "structured":
            geo.mesh.setTransfiniteSurface(body)
        if cell == "quadrilateral":
            geo.mesh.setRecombine(2, body)
        geo.synchronize()
        if cell == "quadrilateral" and layout == "unstructured":
            # Blossom leaves some triangles; a subdivision of all cells makes a pure quadrilateral
            # mesh, so the
            # sides are first divided into half as many facets.
            for side, count in zip(sides, (nx, ny, nx, ny), strict=True):
                gmsh.model.mesh.setTransfiniteCurve(side, max(count // 2, 1) + 1)
            gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 1)
        gmsh.model.addPhysicalGroup(2, [body], name="body")
        for side, name in zip(sides, ("bottom", "right", "top", "left"), strict=True):
            gmsh.model.addPhysicalGroup(1, [side], name=name)
        gmsh.model.mesh.generate(2)

    refuse_too_large(comm, nx * ny, cell)
    return gmsh_mesh(comm, draw, name="block", unit=unit)


def _draw_graded(
    gmsh: Any, length: float, height: float, nx: int, ny: int, grading: float, cell: str
) -> None:
    """Two grids side by side, their lines in geometric progression from the middle and from the
    bottom.
    """
    geo = gmsh.model.geo
    across = max(nx // 2, 1)
    up = ny
    low, high = (
        [geo.addPoint(x, y, 0.0) for x in (0.0, length / 2, length)] for y in (0.0, height)
    )
    bottom, top = ([geo.addLine(row[1], row[end]) for end in (0, 2)] for row in (low, high))
    uprights = [geo.addLine(a, b) for a, b in zip(low, high, strict=True)]
    for lines, count in ((bottom + top, across), (uprights, up)):
        for line in lines:
            geo.mesh.setTransfiniteCurve(
                line, count + 1, "Progression", grading ** (1 / max(count - 1, 1))
            )
    left, middle, right = uprights
    loops = [[left, -top[0], -middle, bottom[0]], [bottom[1], right, -top[1], -middle]]
    body = [geo.addPlaneSurface([geo.addCurveLoop(loop)]) for loop in loops]
    for part in body:
        geo.mesh.setTransfiniteSurface(part)
        if cell == "quadrilateral":
            geo.mesh.setRecombine(2, part)
    geo.synchronize()
    gmsh.model.addPhysicalGroup(2, body, name="body")
    for lines, name in ((bottom, "bottom"), ([right], "right"), (top, "top"), ([left], "left")):
        gmsh.model.addPhysicalGroup(1, lines, name=name)
    gmsh.model.mesh.generate(2)
