"""What the sides of a pair that slides have of their own in 2D and in 3D, see ``sliding_pieces``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Projection:
    """The directions N along which the points of p pieces see the other side, and what turns them.

    Attributes:
        way: N, shape (p, q, d).
        turning: vectors that turn N, from displacements of the slave, sparse, shape (d v, d N).
        numbers: which of them a piece depends on, shape (p, r).
        turns: their shares in dN, which has no part along N, shape (p, q, r).
    """

    way: Array
    turning: sp.csr_array
    numbers: Indices
    turns: Array


@dataclass(frozen=True)
class Kinks:
    """Where points of the slave see vertices of the master, in 3D its edges, at which its normal turns, v of them.

    There the derivative of the distance jumps as they pass by.

    Attributes:
        functions: of the nodes of the slave there, times lengths and the jump, sparse, shape (N, v).
        blocks: the vectors that they pass by with, numbered as those of ``SlidingPieces``, shape (v, c).
        share: of these, shape (v, c).
        across: the direction in which they pass by, of length one, shape (v, d).
    """

    functions: sp.csr_array
    blocks: Indices
    share: Array
    across: Array

    def passing(self, count: int) -> sp.csr_array:
        """How far they pass by, (d_m - d_s - g dN) . n, of so many components of vectors, sparse, shape (v, count)."""
        values = self.share[..., None] * self.across[:, None]
        dim = self.across.shape[1]
        columns = dim * self.blocks[..., None] + np.arange(dim)
        rows = np.broadcast_to(np.arange(len(values))[:, None, None], values.shape)
        return sp.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(len(values), count))
