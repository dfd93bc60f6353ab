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

from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.meshes import Count, Length, generator, refuse, refuse_too_large


@generator(counts=("nx", "ny"), simplices="triangle")
def generate(
    comm: MPI.Comm,
    /,
    *,
    length: Length = 3.0,
    height: Length = 1.0,
    lower: Annotated[float, Field(ge=0)] = 0.0,
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
        lower: where left and right begin, at nodes: lower / height is a multiple of 1 / ny.
        nx: cells along x[0].
        ny: cells along x[1].
        cell: shape of the cells.
        diagonal: how a quadrilateral is cut into triangles.

    Returns:
        The mesh with the boundaries left, right, bottom, top; what is below left and right has no
        name.

    Raises:
        SceneError: left and right would begin elsewhere than at ``lower``, so that the body would
            be held elsewhere.
    """
    row = round(lower / height * ny)
    near = 1e-9 * max(length, height)
    if not row < ny or abs(lower - row * height / ny) > near:
        refuse(
            "lower",
            f"there are no nodes at {lower:g}: with ny = {ny} it must be a multiple of "
            f"{height / ny:g}",
        )
    refuse_too_large(comm, nx * ny, cell)
    corners = [np.zeros(2), np.array([length, height])]
    mesh = dmesh.create_rectangle(
        comm, corners, [nx, ny], dmesh.CellType[cell], diagonal=dmesh.DiagonalType[diagonal]
    )
    return tag_boundaries(
        mesh,
        {
            "left": lambda x: (np.abs(x[0]) < near) & (x[1] > lower - near),
            "right": lambda x: (np.abs(x[0] - length) < near) & (x[1] > lower - near),
            "bottom": lambda x: np.abs(x[1]) < near,
            "top": lambda x: np.abs(x[1] - height) < near,
        },
    )
