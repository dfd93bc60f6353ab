r"""A wedge for a groove, with a structured mesh by gmsh.

::

                  top
        +---------------------+
         \                   /
     left \       body      / right     height
           \        :angle /
            +-------+-----+
          tip     (0,0)
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from mpi4py import MPI
from pydantic import Field

from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Count, Length, generator, refuse_too_large
from signorini_fx.meshes._drawing import Drawing

Angle = Annotated[float, Field(gt=0, lt=90, allow_inf_nan=False)]


@generator(counts=("nx", "ny"), simplices="triangle")
def generate(
    comm: MPI.Comm,
    /,
    *,
    tip: Length = 1.0,
    height: Length = 2.0,
    angle: Angle = 15.0,
    nx: Count = 20,
    ny: Count = 40,
    cell: Literal["quadrilateral", "triangle"] = "quadrilateral",
) -> Any:
    """A wedge that points down.

    Args:
        comm: the ranks that share the mesh.
        tip: width of the tip.
        height: extent along x[1], from 0.
        angle: of each flank, from the vertical, degrees; with friction in a groove the wedge sticks
            by itself where its tangent is less than the coefficient.
        nx: facets along tip and top.
        ny: facets along the flanks.
        cell: shape of the cells.

    Returns:
        The mesh with the boundaries tip, right, top, left.
    """
    unit = height / 2.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        geo = gmsh.model.geo
        low = tip / 2
        high = tip / 2 + height * math.tan(math.radians(angle))
        corners = [
            drawing.point(x, y) for x, y in ((-low, 0), (low, 0), (high, height), (-high, height))
        ]
        sides = [geo.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
        body = geo.addPlaneSurface([geo.addCurveLoop(sides)])
        for side, count in zip(sides, (nx, ny, nx, ny), strict=True):
            geo.mesh.setTransfiniteCurve(side, count + 1)
        geo.mesh.setTransfiniteSurface(body)
        if cell == "quadrilateral":
            geo.mesh.setRecombine(2, body)
        geo.synchronize()
        gmsh.model.addPhysicalGroup(2, [body], name="body")
        for name, side in zip(("tip", "right", "top", "left"), sides, strict=True):
            gmsh.model.addPhysicalGroup(1, [side], name=name)
        gmsh.model.mesh.generate(2)

    refuse_too_large(comm, nx * ny, cell)
    return gmsh_mesh(comm, draw, name="wedge", unit=unit)
