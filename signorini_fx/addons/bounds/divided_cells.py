"""Cells of one triangle, or of four similar ones, with unknowns on their edges only: those inside are eliminated."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.johnson_mercier import LocalStress
from signorini_fx.addons.bounds.simplices import FACETS, Simplices

# Corners of the triangles of a cell among its own, 0 to 2, and the middles opposite these, 3 to 5.
_CORNERS: dict[int, list[list[int]]] = {1: [[0, 1, 2]], 4: [[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]]}
# The corners of the edge opposite each corner, as ``FACETS``.
_EDGES = ((1, 2), (0, 2), (0, 1))


class DividedCells:
    """The cells of ``Simplices.parts`` triangles, m of them.

    The unknowns are displacements at both ends of the triangles' edges on each edge of a cell: 2 or, at the ends of its
    halves, 4 places, in its order from the lower vertex to the higher one.

    Attributes:
        nodes: the places on each edge of a cell among those of all triangles, edge and end, shape (edges, 2 or 4).
        places: the unknowns of each cell, x and y of one place after the other, shape (m, 12 or 24).
        matrix: forces on these per displacement without those inside, force per length, shape (m, 12 or 24, the same).
    """

    def __init__(self, t: Simplices, local: LocalStress) -> None:
        self._parts, self._count = t.parts, len(t.corners) // t.parts
        m = self._count
        corners = (
            t.corners[:m] if t.parts == 1 else np.column_stack([t.corners[i * m : (i + 1) * m, i] for i in range(3)])
        )
        ends = corners[:, FACETS[2]]
        keys, inverse = np.unique(t.keys(np.sort(ends, axis=2)), return_inverse=True)
        inverse = inverse.reshape(m, 3)
        # Each place of a cell by the edge of a triangle and its end: those on edges of the cell, and those inside.
        outer: dict[tuple[frozenset[int], int], int] = {}
        for opposite, (first, second) in enumerate(_EDGES):
            path = [first, second] if t.parts == 1 else [first, 3 + opposite, second]
            for pair in pairwise(path):
                for end in pair:
                    outer[frozenset(pair), end] = len(outer)
        size, q = 2 * len(outer), len(outer) // 3
        numbers, edge_moments = dict(outer), np.zeros((m, 3 * q), dtype=np.int64)
        self._to: list[Ints] = []
        by_part = local.places.reshape(t.parts, m, 6)
        for part, nodes in enumerate(_CORNERS[t.parts]):
            edges = [[nodes[k] for k in edge] for edge in _EDGES]
            ordered = [(frozenset(edge), end) for edge in edges for end in edge]
            place = np.array([numbers.setdefault(key, len(numbers)) for key in ordered])
            self._to.append((2 * place[:, None] + [0, 1]).ravel())
            on_cell = place < len(outer)
            edge_moments[:, place[on_cell]] = by_part[part][:, on_cell]
        backwards = (ends[:, :, 0] > ends[:, :, 1])[:, :, None]
        position = np.where(backwards, np.arange(q)[::-1], np.arange(q))
        self.nodes = np.zeros((len(keys), q), dtype=np.int64)
        self.nodes[inverse[:, :, None], position] = edge_moments.reshape(m, 3, q)
        unknowns = inverse[:, :, None] * q + position
        self.places: Ints = (2 * unknowns[:, :, :, None] + [0, 1]).reshape(m, size)
        self._compliance, self._total = local.compliance, 2 * len(numbers)
        matrices = np.zeros((m, self._total, self._total))
        for to in self._to:
            matrices[:, to[:, None], to] += self._compliance
        # Displacements inside per displacement on the edges and per force inside.
        self._give = np.linalg.inv(matrices[:, size:, size:])
        self._follow = -self._give @ matrices[:, size:, :size]
        self.matrix: Array = matrices[:, :size, :size] + matrices[:, :size, size:] @ self._follow

    def _gathered(self, alone: Array) -> Array:
        """Moments of the triangles summed up on the edges and inside each cell, force, shape (m, 12 or 36)."""
        gathered = np.zeros((self._count, self._total))
        for to, part in zip(self._to, alone.reshape(self._parts, self._count, 12), strict=True):
            gathered[:, to] += part
        return gathered

    def condensed(self, alone: Array) -> Array:
        """Forces on the edges of the cells while these do not move, force, shape (m, 12 or 24).

        Args:
            alone: moments of each triangle whose edges do not move, force, shape (n, 12).
        """
        forces, size = self._gathered(alone), self.places.shape[1]
        return forces[:, :size] + (forces[:, None, size:] @ self._follow)[:, 0]

    def moments(self, displacement: Array, alone: Array) -> Array:
        """Of each triangle, force, shape (n, 3, 2, 2).

        Args:
            displacement: on the edges of each cell, length, shape (m, 12 or 24).
            alone: see ``condensed``.
        """
        forces = self._gathered(alone)[:, self.places.shape[1] :]
        inside = self._follow @ displacement[:, :, None] - self._give @ forces[:, :, None]
        displacement = np.concatenate((displacement, inside[:, :, 0]), axis=1)
        displacements = np.stack([displacement[:, to] for to in self._to])
        moments = alone.reshape(displacements.shape) + (self._compliance @ displacements[..., None])[..., 0]
        return np.asarray(moments.reshape(-1, 3, 2, 2))
