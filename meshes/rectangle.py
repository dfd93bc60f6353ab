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

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from pydantic import Field

from signorini_fx.mechanics.mesh.tagged import TaggedMesh, tag_boundaries
from signorini_fx.meshes import Length, cells_of_grid, generator, refuse_too_large

Count = Annotated[int, Field(gt=0, le=20_000)]


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
    return structured(comm, (length, height), (nx, ny), cell, diagonal)


def structured(
    comm: MPI.Comm,
    extent: tuple[float, float],
    counts: tuple[int, int],
    cell: str,
    diagonal: str = "right",
    lower: float = 0.0,
) -> TaggedMesh:
    """The rectangle from the origin to ``extent`` with names on its four sides, on left and right from ``lower`` up."""
    refuse_too_large(comm, cells_of_grid(*counts, cell))
    corners = [np.zeros(2), np.array(extent)]
    mesh = dmesh.create_rectangle(
        comm, corners, list(counts), dmesh.CellType[cell], diagonal=dmesh.DiagonalType[diagonal]
    )
    (length, height), near = extent, 1e-9 * max(extent)
    return tag_boundaries(
        mesh,
        {
            "left": lambda x: (np.abs(x[0]) < near) & (x[1] > lower - near),
            "right": lambda x: (np.abs(x[0] - length) < near) & (x[1] > lower - near),
            "bottom": lambda x: np.abs(x[1]) < near,
            "top": lambda x: np.abs(x[1] - height) < near,
        },
    )
