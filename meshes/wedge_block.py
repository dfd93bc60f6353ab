r"""A wedge in space for a straight groove, with a structured mesh by gmsh.

::

                  top
        +---------------------+
         \                   /
     left \       body      / right     height     x[2]
           \        :angle /                        |
            +-------+-----+                         |    length along x[1],
          tip     (0,0,0)                           +--- x[0]     front to back
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from mpi4py import MPI
from pydantic import ConfigDict, Field, validate_call

from signorini_fx.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Drawing, Length, coarser_grid, mesh_extruded, refuse_too_large

Angle = Annotated[float, Field(gt=0, lt=90, allow_inf_nan=False)]
Count = Annotated[int, Field(gt=0, le=2_000)]


@validate_call(config=ConfigDict(arbitrary_types_allowed=True))
def generate(
    comm: MPI.Comm,
    /,
    *,
    tip: Length = 1.0,
    length: Length = 2.0,
    height: Length = 2.0,
    angle: Angle = 15.0,
    nx: Count = 8,
    ny: Count = 8,
    nz: Count = 12,
    cell: Literal["hexahedron", "tetrahedron"] = "hexahedron",
) -> Any:
    """A wedge that points down.

    Args:
        comm: the ranks that share the mesh.
        tip: width of the tip, along x[0].
        length: extent along x[1], from 0.
        height: extent along x[2], from 0.
        angle: of each flank, from the vertical, degrees; with friction in a groove the wedge sticks by itself where
            its tangent is less than the coefficient.
        nx: facets across tip and top.
        ny: facets along x[1].
        nz: facets up the flanks.
        cell: shape of the cells.

    Returns:
        The mesh with the boundaries tip, right, top, left, front, back.
    """
    unit = height / 2.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit, upright=True)
        geo = gmsh.model.geo
        low, high = tip / 2, tip / 2 + height * math.tan(math.radians(angle))
        corners = [drawing.point(x, z) for x, z in ((-low, 0), (low, 0), (high, height), (-high, height))]
        sides = [geo.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
        section = geo.addPlaneSurface([geo.addCurveLoop(sides)])
        for side, count in zip(sides, (nx, nz, nx, nz), strict=True):
            geo.mesh.setTransfiniteCurve(side, count + 1)
        geo.mesh.setTransfiniteSurface(section)
        names = {name: [side] for side, name in zip(sides, ("tip", "right", "top", "left"), strict=True)}
        mesh_extruded(drawing, [section], names, (0.0, length, 0.0), ny, ("front", "back"), cell=cell)

    refuse_too_large(comm, nx * ny * nz * (6 if cell == "tetrahedron" else 1))
    return gmsh_mesh(comm, draw, name="wedge_block", unit=unit)


def coarser(parameters: dict[str, Any], factor: float) -> dict[str, Any]:
    """The parameters for cells ``factor`` times as large; see ``generate``."""
    return coarser_grid(generate, parameters, factor, ("nx", "ny", "nz"))


def simplices(parameters: dict[str, Any]) -> dict[str, Any]:
    """The parameters for tetrahedra; see ``generate``."""
    return parameters | {"cell": "tetrahedron"}
