"""The distances of a pair whose bodies slide and turn, and their derivatives, in 2D and 3D.

A point of the slave sees the master along N, half-way between the normals of both sides,

    x_s + g N = x_m(xi),   a^a . x_m,b = delta_ab,   a^a . N = 0,   m = nu / (nu . N),

with nu the normal of the master at xi.  A displacement d changes

    dg = m . (d_m - d_s - g dN),   dxi_a = a^a . (d_s + g dN - d_m),
    d2g = 2 m . (d_m,a dxi_a - dg dN) + m . x_m,ab dxi_a dxi_b

and where a vertex of the master, in 3D an edge, passes by, the slope of its height over the slave jumps, see ``Kinks``.
All rows of a piece of the overlap are of the vectors at the nodes of both of its facets and dN, which ``spread`` makes
of displacements.  The places of points are in ``sliding_places``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.mechanics.pairs.mortar_coupling import Tested
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.mechanics.pairs.sliding_places import (
    Kinks,
    Projection,
    seen_edges,
    seen_vertices,
    ways_in_plane,
    ways_in_space,
)

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

# Pieces whose products are made at once: few, for memory.
_AT_ONCE = 2048


@dataclass(frozen=True)
class SlidingPieces:
    """The pieces of an overlap, p of them with q points each, c vectors each.

    Attributes:
        mean: from moments of the functions of the nodes of the slave to means at the n points, sparse, shape (n, N).
        points: nodes of the slave whose functions a piece meets, shape (p, t).
        weighted: these functions times areas, shape (p, q, t).
        blocks: which vectors of ``spread`` a piece depends on: those at the nodes of both facets, and what turns N,
            shape (p, c).
        spread: all vectors from the displacements of the nodes of both sides, sparse, shape (d v, d m).
        share: with which each of them is in d_m - d_s - g dN, but for what turns N along itself, shape (p, q, c).
        turns: the share of what turns N in dN, likewise, shape (p, q, r).
        slope: with which the vectors at the l nodes of the master are in d_m,a, shape (d - 1, p, q, l).
        facing: m, shape (p, q, d).
        across: m - N, likewise.
        dual: a^a, shape (d - 1, p, q, d).
        distance: g, length, shape (p, q).
        curved: m . x_m,aa in 2D, shape (p, q); zero in 3D, where facets are flat but for their twist.
        bend: the normals of the master at the nodes of the facet of each piece, shape (p, l, d).
        kinks: where the normal of the master turns at once.
    """

    mean: sp.csr_array
    points: Indices
    weighted: Array = field(repr=False)
    blocks: Indices
    spread: sp.csr_array
    share: Array = field(repr=False)
    turns: Array = field(repr=False)
    slope: Array = field(repr=False)
    facing: Array = field(repr=False)
    across: Array = field(repr=False)
    dual: Array = field(repr=False)
    distance: Array
    curved: Array = field(repr=False)
    bend: Array = field(repr=False)
    kinks: Kinks = field(repr=False)

    @classmethod
    def of(
        cls, slave: PairSurface, master: PairSurface, tested: Tested, directions: Array, mean: sp.csr_array
    ) -> SlidingPieces:
        """Those of two sides.

        Args:
            slave: the side with the points.
            master: the other one.
            tested: their overlap.
            directions: of projection at the nodes of the slave, of length one, shape (N, d).
            mean: see ``SlidingPieces``.
        """
        overlap, dim, first = tested.overlap, slave.dimension, len(slave.x)
        projection: Projection = (ways_in_plane if dim == 2 else ways_in_space)(slave, overlap, directions)
        total, way = first + len(master.x), projection.way
        turning = sp.hstack((projection.turning, sp.csr_array((projection.turning.shape[0], dim * len(master.x)))))
        spread = sp.csr_array(sp.vstack((sp.eye_array(dim * total), turning)))
        seen, over = slave.nodes[overlap.slave], master.nodes[overlap.master]
        blocks = np.column_stack((seen, first + over, total + projection.numbers))
        distance = np.einsum("pqd,pqd->pq", overlap.distance(slave, master), way)
        shape, shape_over = slave.functions.values(overlap.at), master.functions.values(overlap.over)
        share = np.concatenate((-shape, shape_over, -distance[..., None] * projection.turns), axis=2)
        slope, corners = master.functions.slopes(overlap.over), master.corners[overlap.master]
        along = np.einsum("apqk,pkd->pqad", slope, corners)
        inverse = np.linalg.inv(np.concatenate((along, way[:, :, None]), axis=2))
        facing, dual = inverse[..., -1], np.moveaxis(inverse[..., :-1], 3, 0)
        curvatures = master.functions.curvatures if dim == 2 else np.zeros(corners.shape[1])
        curved = np.einsum("pqd,k,pkd->pq", facing, curvatures, corners, optimize=True)
        kinks = (seen_vertices if dim == 2 else seen_edges)(slave, master, tested, directions)
        points, turns, bend = slave.points[overlap.slave], projection.turns, master.directions[over]
        directed = (facing, facing - way, dual, distance)
        return cls(mean, points, tested.weighted, blocks, spread, share, turns, slope, *directed, curved, bend, kinks)

    @property
    def gap(self) -> Array:
        """At the points, length, shape (n,)."""
        moments = np.einsum("pqt,pq->pt", self.weighted, self.distance)
        return np.asarray(self.mean @ np.bincount(self.points.ravel(), moments.ravel(), self.mean.shape[1]))

    @property
    def rows(self) -> sp.csr_array:
        """Of the derivative of the gap, sparse, shape (n, d m)."""
        entries = np.matmul(self.weighted.swapaxes(1, 2), self._rows(self.share, self.facing, self.across))
        return self._at_points(entries)

    @property
    def passing(self) -> sp.csr_array:
        """What the places that shift change of the normal of the master, at the points, sparse, shape (d n, d m)."""
        components = []
        for normal in np.moveaxis(self.bend, 2, 0):
            total = np.zeros((*self.points.shape, self.facing.shape[2] * self.blocks.shape[1]))
            for k, slope in enumerate(self.slope):
                bend = np.einsum("pql,pl->pq", slope, normal)[..., None]
                rows = self._rows(self.share, self.dual[k], self.dual[k])
                total -= np.matmul((self.weighted * bend).swapaxes(1, 2), rows)
            components.append(self._at_points(total))
        rows = np.arange(len(components) * components[0].shape[0]).reshape(len(components), -1)
        return sp.csr_array(sp.csr_array(sp.vstack(components))[rows.T.ravel()])

    def stiffness(self, pressing: Array) -> sp.csr_array:
        """Minus the second derivative of the gaps with forces at the points, shape (n,), sparse, shape (d m, d m)."""
        nodal = self.mean.T @ pressing
        forces = np.einsum("pqt,pt->pq", self.weighted, nodal[self.points])
        touched, dim = np.flatnonzero(forces.any(axis=1)), self.facing.shape[2]
        size = dim * self.blocks.shape[1]
        values = np.zeros((touched.size, size, size))
        for first in range(0, touched.size, _AT_ONCE):
            chosen = touched[first : first + _AT_ONCE]
            values[first : first + chosen.size] = self._second(chosen, forces[chosen])
        at = (dim * self.blocks[touched][..., None] + np.arange(dim)).reshape(touched.size, size)
        rows, columns = np.repeat(at, size, axis=1), np.tile(at, (1, size))
        count = self.spread.shape[0]
        joint = sp.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count))
        passing = self.kinks.passing(count) @ self.spread
        jumps = passing.T @ sp.diags_array(self.kinks.functions.T @ nodal) @ passing
        return sp.csr_array(self.spread.T @ joint @ self.spread - jumps)

    def _second(self, pieces: Indices, forces: Array) -> Array:
        """The products of some pieces, shape (k, d c, d c)."""
        share, facing, across = self.share[pieces], self.facing[pieces], self.across[pieces]
        first = self._of_master
        last = first + self.slope.shape[3]
        shifts = [-self._rows(share, dual[pieces], dual[pieces]) for dual in self.dual]
        turning, along = np.zeros_like(share), np.zeros_like(share)
        turning[..., last:] = self.turns[pieces] * forces[..., None]
        half = np.matmul(self._rows(share, facing, across).swapaxes(1, 2), self._rows(turning, facing, across))
        for k, shift in enumerate(shifts):
            along[..., first:last] = self.slope[k, pieces] * forces[..., None]
            half -= np.matmul(self._rows(along, facing, across).swapaxes(1, 2), shift)
        total = half + half.swapaxes(1, 2)
        if self.curved.any():
            scaled = (forces * self.curved[pieces])[..., None] * shifts[0]
            total -= np.matmul(shifts[0].swapaxes(1, 2), scaled)
        return np.asarray(total)

    @property
    def _of_master(self) -> int:
        """Which of the vectors of a piece is the first one of the master."""
        return self.blocks.shape[1] - self.turns.shape[2] - self.slope.shape[3]

    def _rows(self, factor: Array, vectors: Array, across: Array) -> Array:
        """Vectors at points, shape (p, q, d), times factors, shape (p, q, c), as rows, shape (p, q, d c); ``across``:
        without their part along N, for what turns N, by which N does not change.
        """
        count = factor.shape[2] - self.turns.shape[2]
        parts = factor[..., :count, None] * vectors[:, :, None], factor[..., count:, None] * across[:, :, None]
        return np.concatenate(parts, axis=2).reshape(*factor.shape[:2], -1)

    def _at_points(self, entries: Array) -> sp.csr_array:
        """The matrix of moments of the functions, shape (p, t, d c), at the points, of displacements."""
        dim = self.facing.shape[2]
        components = (dim * self.blocks[..., None] + np.arange(dim)).reshape(len(self.blocks), 1, -1)
        rows, columns = (np.broadcast_to(at, entries.shape).ravel() for at in (self.points[:, :, None], components))
        shape = (self.mean.shape[1], self.spread.shape[0])
        moments = sp.csr_array((entries.ravel(), (rows, columns)), shape=shape)
        return sp.csr_array(self.mean @ moments @ self.spread)
