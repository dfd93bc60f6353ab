r"""A rectangle for a sawtooth foundation, with nodes at all tips and valleys, or with matching teeth itself.

::

                   top                                 top
        +----------------------+            +----------------------+
   left |                      | right      |                      | right    height
        |                      |            |  /\    /\    /\    |
        +--+--+--+--+--+--+--+-+            +/    \/    \/    \-+
          bottom                               bottom
        /\  /\  /\  the gap has the teeth     depth > 0: the body has them, they rise from x[1] = 0

Tips are at pitch / 2, 3 pitch / 2 and so on, with pitch = length / teeth.  For a flat body over teeth of the foundation
give the distance to them as the gap, for pitch 1 and depth 0.1:
``0.2 * min(abs(x[0] - 0.5), abs(x[0] - 1.5), abs(x[0] - 2.5))``.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from mpi4py import MPI
from pydantic import Field

from signorini_fx.meshes import Length, generator, refuse
from signorini_fx.meshes.rectangle import structured

Depth = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Count = Annotated[int, Field(gt=0, le=5_000)]


@generator(counts=("facets", "ny"), simplices="triangle")
def generate(
    comm: MPI.Comm,
    /,
    *,
    length: Length = 3.0,
    height: Length = 1.0,
    teeth: Count = 3,
    depth: Depth = 0.0,
    facets: Count = 10,
    ny: Count = 20,
    cell: Literal["quadrilateral", "triangle"] = "quadrilateral",
) -> Any:
    """A structured mesh whose columns match the teeth.

    Args:
        comm: the ranks that share the mesh.
        length: extent along x[0], from 0.
        height: extent along x[1], from 0.
        teeth: their number along the length.
        depth: of the teeth of the body, less than the height; 0: its bottom is flat.
        facets: along each flank of a tooth.
        ny: cells along x[1].
        cell: shape of the cells.

    Returns:
        The mesh with the boundaries left, right, bottom, top.
    """
    if depth >= height:
        refuse("depth", f"depth must be less than height, got {depth:g} and {height:g}")
    tagged = structured(comm, (length, height), (2 * teeth * facets, ny), cell)
    if depth > 0.0:
        x = tagged.mesh.geometry.x
        half = length / teeth / 2
        rise = depth * (1 - np.abs(x[:, 0] / half % 2 - 1))
        x[:, 1] += rise * (1 - x[:, 1] / height)
    return tagged
