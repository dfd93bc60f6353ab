"""A rectangle with a uniform structured mesh, made in parallel by dolfinx itself.

::

              top
        +------------+
        |            |
   left |            | right      height
        |            |
        +------------+
     (0,0)  bottom
           length
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from pydantic import ConfigDict, Field, validate_call

from signorini_fx.mesh.tagged import TaggedMesh, tag_boundaries
from signorini_fx.meshes import Length, cells_of_grid, coarser_grid, refuse_too_large

Count = Annotated[int, Field(gt=0, le=20_000)]


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
    diagonal: Literal["left", "right", "left_right", "right_left", "crossed"] = "right",
) -> Any:
    """Nx by ny quadrilaterals, or each of them cut into triangles along the diagonal.

    Args:
        comm: the ranks that share the mesh.
        length: extent along x[0].
        height: extent along x[1].
        nx: cells along x[0].
        ny: cells along x[1].
        cell: shape of the cells.
        diagonal: how a quadrilateral is cut into triangles.

    Returns:
        The mesh with the boundaries left, right, bottom, top.
    """
    refuse_too_large(comm, cells_of_grid(nx, ny, cell))
    mesh = dmesh.create_rectangle(
        comm,
        [np.zeros(2), np.array([length, height])],
        [nx, ny],
        dmesh.CellType[cell],
        diagonal=dmesh.DiagonalType[diagonal],
    )
    return name_sides(mesh, length, height)


def name_sides(mesh: dmesh.Mesh, length: float, height: float) -> TaggedMesh:
    """Name the four sides of the rectangle [0, length] x [0, height]."""
    near = 1e-9 * max(length, height)
    return tag_boundaries(
        mesh,
        {
            "left": lambda x: np.abs(x[0]) < near,
            "right": lambda x: np.abs(x[0] - length) < near,
            "bottom": lambda x: np.abs(x[1]) < near,
            "top": lambda x: np.abs(x[1] - height) < near,
        },
    )


def coarser(parameters: dict[str, Any], factor: float) -> dict[str, Any]:
    """The parameters for cells ``factor`` times as large; see ``generate``."""
    return coarser_grid(generate, parameters, factor)


def simplices(parameters: dict[str, Any]) -> dict[str, Any]:
    """The parameters for triangles; see ``generate``."""
    return parameters | {"cell": "triangle"}
