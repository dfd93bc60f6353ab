"""Cells of one triangle, or of four similar ones, with unknowns on their edges only: those inside are eliminated."""

from __future__ import annotations

import numpy as np

from signorini_fx.bounds.arrays import Array, Ints
from signorini_fx.bounds.local_stress import LocalStress
from signorini_fx.bounds.triangles import Triangles


class DividedCells:
    """The cells of ``Triangles.parts`` triangles, m of them.

    The unknowns are displacements at both ends of the triangles' edges on each edge of a cell: 2 or, at the ends of its
    halves, 4 places, in its order from the lower vertex to the higher one.

    Attributes:
        nodes: the places on each edge of a cell among those of all triangles, edge and end, shape (edges, 2 or 4).
        places: the unknowns of each cell, x and y of one place after the other, shape (m, 12 or 24).
        matrix: forces on these per displacement without those inside, force per length, shape (m, 12 or 24, the same).
    """

    def __init__(self, t: Triangles, local: LocalStress) -> None:
        parts, m = t.parts, len(t.corners) // t.parts
        self._parts, self._count = parts, m
        corners = (
            t.corners[:m] if parts == 1 else np.column_stack([t.corners[i * m : (i + 1) * m, i] for i in range(3)])
        )
        ends = corners[:, [[1, 2], [2, 0], [0, 1]]]
        keys, inverse = np.unique(ends.min(axis=2) * len(t.x) + ends.max(axis=2), return_inverse=True)
        inverse, q = inverse.reshape(m, 3), 2 if parts == 1 else 4
        # Moments of each triangle of a cell among those on the edges of the cell, and among those inside.
        by_part = local.places.reshape(parts, m, 3, 2)
        if parts == 1:
            edge_moments = by_part[0]
            self._outer: list[tuple[Ints, Ints]] = [(np.arange(12), np.arange(12))]
            self._inner: list[tuple[Ints, Ints]] = [(np.arange(0), np.arange(0))]
        else:
            edge_moments = np.zeros((m, 3, 4), dtype=np.int64)
            self._outer, self._inner = [], []
            for part in range(4):
                outer: list[tuple[int, int]] = []
                inner: list[tuple[int, int]] = []
                for i in range(3):
                    first, second = (i + 1) % 3, (i + 2) % 3
                    for end in (0, 1):
                        for k in (0, 1):
                            at = 4 * i + 2 * end + k
                            if part == 3:
                                inner.append((at, 4 * i + 2 * end + k))
                            elif part == i:  # seen from the other side
                                inner.append((at, 4 * i + 2 * (1 - end) + k))
                            else:
                                outer.append((at, 8 * i + 2 * (2 * (part == second) + end) + k))
                    if part in (first, second):
                        edge_moments[:, i, 2 * (part == second) : 2 * (part == second) + 2] = by_part[part, :, i]
                for index_pairs, rows in ((self._outer, outer), (self._inner, inner)):
                    pairs = np.array(rows, dtype=np.int64).reshape(-1, 2)
                    index_pairs.append((pairs[:, 0], pairs[:, 1]))
        backwards = (ends[:, :, 0] > ends[:, :, 1])[:, :, None]
        position = np.where(backwards, np.arange(q)[::-1], np.arange(q))
        self.nodes = np.zeros((len(keys), q), dtype=np.int64)
        self.nodes[inverse[:, :, None], position] = edge_moments
        unknowns = inverse[:, :, None] * q + position
        self.places: Ints = (2 * unknowns[:, :, :, None] + [0, 1]).reshape(m, 6 * q)
        self._compliance = local.compliance
        self._condense()

    def _condense(self) -> None:
        """Eliminate the displacements inside the cells."""
        size, inside = self.places.shape[1], 0 if self._parts == 1 else 12
        matrices = np.zeros((self._count, size + inside, size + inside))
        self._simplices = []
        for (at_outer, outer), (at_inner, inner) in zip(self._outer, self._inner, strict=True):
            at, to = np.concatenate((at_outer, at_inner)), np.concatenate((outer, size + inner))
            matrices[:, to[:, None], to] += self._compliance[:, at[:, None], at]
            self._simplices.append((at, to))
        self.matrix: Array = matrices[:, :size, :size]
        if inside:
            # Displacements inside per displacement on the edges and per force inside.
            inverse = np.linalg.inv(matrices[:, size:, size:])
            self._follow, self._give = -inverse @ matrices[:, size:, :size], inverse
            self.matrix = self.matrix + matrices[:, :size, size:] @ self._follow

    def _gathered(self, alone: Array) -> Array:
        """Moments of the triangles summed up on the edges and inside each cell, force, shape (m, 12 or 36)."""
        gathered = np.zeros((self._count, max(to.max() for _, to in self._simplices) + 1))
        for (at, to), part in zip(self._simplices, alone.reshape(self._parts, self._count, 12), strict=True):
            gathered[:, to] += part[:, at]
        return gathered

    def condensed(self, alone: Array) -> Array:
        """Forces on the edges of the cells while these do not move, force, shape (m, 12 or 24).

        Args:
            alone: moments of each triangle whose edges do not move, force, shape (n, 12).
        """
        forces, size = self._gathered(alone), self.places.shape[1]
        edge_forces = forces[:, :size]
        if self._parts > 1:
            edge_forces = edge_forces + (forces[:, None, size:] @ self._follow)[:, 0]
        return edge_forces

    def moments(self, displacement: Array, alone: Array) -> Array:
        """Of each triangle, force, shape (n, 3, 2, 2).

        Args:
            displacement: on the edges of each cell, length, shape (m, 12 or 24).
            alone: see ``condensed``.
        """
        if self._parts > 1:
            forces = self._gathered(alone)[:, self.places.shape[1] :]
            inside = self._follow @ displacement[:, :, None] - self._give @ forces[:, :, None]
            displacement = np.concatenate((displacement, inside[:, :, 0]), axis=1)
        displacements = np.zeros((self._parts, self._count, 12))
        for part, (at, to) in enumerate(self._simplices):
            displacements[part][:, at] = displacement[:, to]
        moments = alone.reshape(displacements.shape) + (self._compliance @ displacements[..., None])[..., 0]
        return np.asarray(moments.reshape(-1, 3, 2, 2))
