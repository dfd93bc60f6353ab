r"""A rectangle with a uniform structured mesh whose sides have a name only above a given height.

::

              top
        +------------+
   left |            | right
        |            |          height
        :            :
        :            :  lower
        +------------+
     (0,0)  bottom
           length
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from mpi4py import MPI
from pydantic import Field

from signorini_fx.meshes import Length, generator, refuse
from signorini_fx.meshes.rectangle import structured

Count = Annotated[int, Field(gt=0, le=20_000)]


@generator(counts=("nx", "ny"), simplices="triangle")
def generate(
    comm: MPI.Comm,
    /,
    *,
    length: Length = 3.0,
    height: Length = 1.0,
    lower: Length = 0.2,
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
        The mesh with the boundaries left, right, bottom, top; the lower parts of the sides have no name.

    Raises:
        SceneError: left and right would begin elsewhere than at ``lower``, so that the body would be held elsewhere.
    """
    row = round(lower / height * ny)
    if not 0 < row < ny or abs(lower - row * height / ny) > 1e-9 * max(length, height):
        refuse("lower", f"there are no nodes at {lower:g}: with ny = {ny} it must be a multiple of {height / ny:g}")
    return structured(comm, (length, height), (nx, ny), cell, diagonal, lower)
