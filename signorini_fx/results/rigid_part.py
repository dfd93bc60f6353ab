"""What the displacement of each body is without its rigid part: the length that a certificate compares others with."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx import parallel
from signorini_fx.body.pieces import find_pieces

Array = npt.NDArray[np.float64]


class RigidPart:
    """The nearest rigid motions of the pieces of a mesh; pieces that can touch move independently of each other.

    Args:
        space: of the displacement; collective.
        x: positions of the owned nodes, length, shape (owned nodes, d).
    """

    def __init__(self, space: fem.FunctionSpace, x: Array) -> None:
        pieces, self._comm, dim = find_pieces(space.mesh), space.mesh.comm, x.shape[1]
        self._count, nodes = pieces.count, space.dofmap.index_map
        of_node = np.zeros(nodes.size_local + nodes.num_ghosts, dtype=np.int64)
        of_node[space.dofmap.list] = pieces.of_cell[:, None]  # at a hinge either of both, which move there alike
        self._piece = of_node[: len(x)]
        arm = self._without_mean(x)
        turns = dim * (dim - 1) // 2
        self._turned = np.zeros((*x.shape, turns))
        for k, (i, j) in enumerate(combinations(range(dim), 2)):
            self._turned[:, i, k], self._turned[:, j, k] = -arm[:, j], arm[:, i]
        gram = self._sums(np.einsum("nik,nil->nkl", self._turned, self._turned).reshape(-1, turns**2))
        self._inverse = np.linalg.pinv(gram.reshape(-1, turns, turns), hermitian=True)

    def largest_beside(self, y: Array) -> float:
        """The largest displacement of a node after the nearest rigid motion of its piece is subtracted; collective.

        Args:
            y: displacements of the owned nodes, length, shape (owned nodes, d).
        """
        motion = self._without_mean(y)
        moment = self._sums(np.einsum("nik,ni->nk", self._turned, motion))
        angles = np.einsum("pkl,pl->pk", self._inverse, moment)
        left = np.linalg.norm(motion - np.einsum("nik,nk->ni", self._turned, angles[self._piece]), axis=1)
        return parallel.global_max(self._comm, float(np.nan_to_num(left.max(initial=0.0), nan=np.inf)))

    def _without_mean(self, values: Array) -> Array:
        sums = self._sums(np.column_stack((np.ones(len(values)), values)))
        return np.asarray(values - (sums[:, 1:] / np.maximum(sums[:, :1], 1.0))[self._piece])

    def _sums(self, values: Array) -> Array:
        """Sums over the nodes of each piece, shape (pieces, ...)."""
        return parallel.sums_by(self._comm, self._piece, values, self._count)
