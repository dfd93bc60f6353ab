"""A rectangular block, meshed by gmsh: structured or unstructured, triangles or quadrilaterals.

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
from pydantic import ConfigDict, Field, validate_call

from signorini_fx.mesh import gmsh_mesh

Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Count = Annotated[int, Field(gt=0, le=5_000)]


@validate_call(config=ConfigDict(arbitrary_types_allowed=True))
def generate(
    comm: MPI.Comm,
    /,
    *,
    length: Length = 3.0,
    height: Length = 1.0,
    nx: Count = 120,
    ny: Count = 40,
    cell: Literal["quadrilateral", "triangle"] = "quadrilateral",
    layout: Literal["structured", "unstructured"] = "structured",
) -> Any:
    """A block with nx facets along bottom and top and ny along the sides.

    Args:
        comm: the ranks that share the mesh.
        length: extent along x[0].
        height: extent along x[1].
        nx: facets along x[0].
        ny: facets along x[1].
        cell: shape of the cells.
        layout: a regular grid, or what gmsh makes of the sides' divisions.

    Returns:
        The mesh with the boundaries left, right, bottom, top.
    """

    def draw(gmsh: Any) -> None:
        geo = gmsh.model.geo
        corners = [geo.addPoint(x, y, 0.0) for x, y in ((0, 0), (length, 0), (length, height), (0, height))]
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
            # Blossom leaves some triangles behind; a subdivision of all cells makes a pure quadrilateral mesh, so the
            # sides are first divided into half as many facets.
            for side, count in zip(sides, (nx, ny, nx, ny), strict=True):
                gmsh.model.mesh.setTransfiniteCurve(side, max(count // 2, 1) + 1)
            gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 1)
        gmsh.model.addPhysicalGroup(2, [body], name="body")
        for side, name in zip(sides, ("bottom", "right", "top", "left"), strict=True):
            gmsh.model.addPhysicalGroup(1, [side], name=name)
        gmsh.model.mesh.generate(2)

    return gmsh_mesh(comm, draw, name="block")
