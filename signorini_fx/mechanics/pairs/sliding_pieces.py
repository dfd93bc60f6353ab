"""The distances of a pair whose bodies slide and turn, and their derivatives, in 2D and 3D.

A point of the slave sees the master along N, half-way between the normals of both sides,

    x_s + g N = x_m(xi),   a^a . x_m,b = delta_ab,   a^a . N = 0,   m = nu / (nu . N),

with nu the normal of the master at xi.  A displacement d changes

    dg = m . (d_m - d_s - g dN),   dxi_a = a^a . (d_s + g dN - d_m),
    d2g = 2 m . (d_m,a dxi_a - dg dN) + m . x_m,ab dxi_a dxi_b

Where a vertex of the master, in 3D an edge, passes by, the slopes h' of its height over the slave jump:

    d2 int g = ... + int (jump of h' along n) (n . (d_m - d_s - g dN))^2     along the edge, n across it.

All rows of a piece of the overlap are of the vectors at the nodes of both of its facets and dN, which ``spread`` makes
of displacements.  In 3D facets are of degree 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.mechanics.pairs.mortar_coupling import Tested
from signorini_fx.mechanics.pairs.overlap import PLACES_OF_RULE, axes_across, projected_places
from signorini_fx.mechanics.pairs.pair_side import Overlap, PairSurface, of_blocks, turned_normals, turning_of
from signorini_fx.tuned import NOTHING_LEFT

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

# Pieces whose products are made at once: few, for memory.
_AT_ONCE = 2048
# Points of a part of an edge.
_ON_EDGE = 3


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
        last = self.blocks.shape[1] - self.turns.shape[2]
        first = last - self.slope.shape[3]  # of the vectors of the master
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


def ways_in_plane(slave: PairSurface, overlap: Overlap, directions: Array) -> Projection:
    """N between the directions at the nodes of a facet, of length one, shape (N, 2), which turn as its normals do."""
    nodes, shape = slave.nodes[overlap.slave], slave.functions.values(overlap.at)
    ways = shape @ directions[nodes]
    length = np.linalg.norm(ways, axis=2, keepdims=True)
    turns = of_blocks(np.einsum("ni,nj->nij", _turned(directions), _turned(slave.nodal_normals)))
    return Projection(ways / length, sp.csr_array(turns @ turned_normals(slave)), nodes, shape / length)


def seen_vertices(slave: PairSurface, master: PairSurface, tested: Tested, directions: Array) -> Kinks:
    """Those of an overlap; for the arguments see ``SlidingPieces.of``."""
    overlap = tested.overlap
    at, over = overlap.at[..., 0], overlap.over[..., 0]
    half = (at[:, -1] - at[:, 0]) / (2 * PLACES_OF_RULE[-1])
    middle = (at[:, 0] + at[:, -1]) / 2
    rises = over[:, -1] > over[:, 0]
    ends, places = np.concatenate((middle - half, middle + half)), master.functions.places[:, 0]
    first = np.concatenate((rises, ~rises))  # whether the vertex is at the beginning of the facet
    piece = np.tile(np.arange(len(at)), 2)
    vertex = master.nodes[overlap.master[piece], np.where(first, places.argmin(), places.argmax())]
    upper = np.repeat([False, True], len(at))
    inside = (ends > NOTHING_LEFT) & (ends < 1.0 - NOTHING_LEFT)
    facet = overlap.slave[piece]
    key = facet * len(master.x) + vertex
    below, above = (np.flatnonzero(inside & side) for side in (upper, ~upper))
    _, from_below, from_above = np.intersect1d(key[below], key[above], return_indices=True)
    below, above = below[from_below], above[from_above]
    facets, s = facet[below], ends[below]
    shape, slope = slave.functions.values(s[:, None]), slave.functions.slopes(s[:, None])[0]
    nodes, vertices = slave.nodes[facets], vertex[below]
    ways, turns = (np.einsum("vk,vkd->vd", values, directions[nodes]) for values in (shape, slope))
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    ways = ways / length
    across = _turned(ways)
    distance = np.einsum("vd,vd->v", master.x[vertices] - np.einsum("vk,vkd->vd", shape, slave.x[nodes]), ways)

    def inclination(rows: Indices) -> Array:
        """The normal of a facet at its vertex along N^ over that along N."""
        numbers, end = overlap.master[piece[rows]], np.where(first[rows], 0.0, 1.0)
        normal = master.normals(numbers, end[:, None, None])[:, 0]
        return np.asarray(np.einsum("vd,vd->v", normal, across) / np.einsum("vd,vd->v", normal, ways))

    kink = inclination(below) - inclination(above)
    stretch = np.einsum("vk,vkd->vd", slope, slave.x[nodes]) + distance[:, None] * turns / length
    rate = kink / np.einsum("vd,vd->v", stretch, across)
    functions = np.einsum("vij,vj->vi", tested.coefficients[facets], slave.tests.values(s[:, None]))
    at_vertices = s[:, None, None]
    functions *= rate[:, None] * slave.measured(facets, at_vertices, slave.sizes(facets, at_vertices))
    numbers = np.broadcast_to(np.arange(len(s))[:, None], functions.shape)
    entries = functions.ravel(), (slave.points[facets].ravel(), numbers.ravel())
    count = len(slave.x)
    blocks = np.column_stack((nodes, count + vertices, count + len(master.x) + nodes))
    share = np.column_stack((-shape, np.ones(len(s)), -distance[:, None] * shape / length))
    return Kinks(sp.csr_array(entries, shape=(count, len(s))), blocks, share, across)


def _turned(vectors: Array) -> Array:
    """Vectors, shape (..., 2), turned by 90 degrees."""
    return np.stack((-vectors[..., 1], vectors[..., 0]), axis=-1)


def ways_in_space(slave: PairSurface, overlap: Overlap, directions: Array) -> Projection:
    """N of each facet, see ``overlap``, which turns as the slave does around its nodes."""
    ways, turning = _facet_directions(slave, directions)
    number, of_piece = np.unique(overlap.slave, return_inverse=True)
    rows = (3 * number[:, None] + np.arange(3)).ravel()
    points = overlap.at.shape[:2]
    way = np.broadcast_to(ways[overlap.slave][:, None], (*points, 3))
    return Projection(way, sp.csr_array(turning[rows]), of_piece.reshape(-1, 1), np.ones((*points, 1)))


def seen_edges(slave: PairSurface, master: PairSurface, tested: Tested, directions: Array) -> Kinks:
    """Edges between facets of the master; for the arguments see ``SlidingPieces.of``."""
    ways, of_facet = _facet_directions(slave, directions)[0], np.full(len(slave.nodes), -1)
    seen = np.unique(tested.overlap.slave)
    of_facet[seen] = np.arange(seen.size)
    overlap, around = tested.overlap, _around_facet(master)
    pairs_seen = np.unique(np.column_stack((overlap.slave, overlap.master)), axis=0)
    facets, partners = np.asarray(pairs_seen[:, 0]), np.asarray(pairs_seen[:, 1])
    edges = np.stack((around, np.roll(around, -1, axis=1)), axis=2)[partners].reshape(-1, 2)
    facet, partner = np.repeat(facets, around.shape[1]), np.repeat(partners, around.shape[1])
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((high, low, facet))
    keys = np.column_stack((facet, low, high))[order]
    shared = np.flatnonzero((keys[1:] == keys[:-1]).all(axis=1))
    first, second = order[shared], order[shared + 1]
    facet, ends = facet[first], np.column_stack((low[first], high[first]))
    way = ways[facet]
    corners = slave.x[_around_facet(slave)[facet]]
    middle = corners.mean(axis=1)
    axes = axes_across(way)
    flat, line = (np.einsum("mcd,mkd->mck", places - middle[:, None], axes) for places in (corners, master.x[ends]))
    start, along = line[:, 0], line[:, 1] - line[:, 0]
    enters, leaves = _within(flat, start, along)
    crossed = np.flatnonzero(leaves - enters > NOTHING_LEFT)
    facet, ends = facet[crossed], ends[crossed]
    way, middle, axes, start, along = (values[crossed] for values in (way, middle, axes, start, along))
    enters, leaves, pairs = enters[crossed], leaves[crossed], (partner[first[crossed]], partner[second[crossed]])
    places, weights = np.polynomial.legendre.leggauss(_ON_EDGE)
    count = places.size
    at_edge = (enters[:, None] + (leaves - enters)[:, None] * (places + 1) / 2).ravel()
    rows = np.repeat(np.arange(crossed.size), count)
    length = np.linalg.norm(along, axis=1)
    lengths = ((leaves - enters) * length / 2)[rows] * np.tile(weights, crossed.size)
    across = np.einsum("mk,mkd->md", np.column_stack((along[:, 1], -along[:, 0])) / length[:, None], axes)
    # Which of both facets is behind the edge as seen along n: from the middles of both.
    middles = [master.corners[numbers].mean(axis=1) for numbers in pairs]
    swapped = np.einsum("md,md->m", middles[1] - middles[0], across) < 0
    p = start[rows] + at_edge[:, None] * along[rows]
    flat_nodes = np.einsum("mcd,mkd->mck", slave.corners[facet] - middle[:, None], axes)
    start = np.full((len(p), 1, 2), 1.0 / 3.0)
    at = projected_places(slave, facet[rows], start, p[:, None], middle[rows], axes[rows])[:, 0]
    slopes = slave.functions.slopes(at)
    image = np.einsum("avk,vkd->avd", slopes, flat_nodes[rows])
    projected = np.abs(image[0, :, 0] * image[1, :, 1] - image[0, :, 1] * image[1, :, 0])
    true = slave.measured(facet[rows], at[:, None], slave.sizes(facet[rows], at[:, None]))[:, 0]
    coefficients = tested.coefficients[facet[rows]]
    functions = np.einsum("vij,vj->vi", coefficients, slave.tests.values(at))
    functions = functions * (lengths * true / projected)[:, None]
    steep = []
    for numbers in pairs:
        on_facet = _at_edge(master, numbers[rows], ends[rows], at_edge)
        normal = master.normals(numbers[rows], on_facet[:, None])[:, 0]
        steep.append(-np.einsum("vd,vd->v", normal, across[rows]) / np.einsum("vd,vd->v", normal, way[rows]))
    jump = np.where(swapped[rows], steep[0] - steep[1], steep[1] - steep[0])
    shape, of_edge = slave.functions.values(at), np.column_stack((1 - at_edge, at_edge))
    nodes = np.column_stack((slave.nodes[facet][rows], len(slave.x) + ends[rows]))
    under = np.einsum("vk,vkd->vd", shape, slave.corners[facet][rows])
    over = np.einsum("vk,vkd->vd", of_edge, master.x[ends][rows])
    numbers = np.broadcast_to(np.arange(len(at))[:, None], functions.shape)
    entries = (functions * jump[:, None]).ravel(), (slave.points[facet[rows]].ravel(), numbers.ravel())
    total = len(slave.x) + len(master.x)
    blocks = np.column_stack((nodes, total + of_facet[facet[rows]]))
    distance = np.einsum("vd,vd->v", over - under, way[rows])
    share = np.column_stack((-shape, of_edge, -distance))
    return Kinks(sp.csr_array(entries, shape=(len(slave.x), len(at))), blocks, share, across[rows])


def _around_facet(side: PairSurface) -> Indices:
    """The corners of each facet in order around it, shape (f, k)."""
    places = side.functions.places - side.functions.places.mean(axis=0)
    return np.asarray(side.nodes[:, np.argsort(np.arctan2(places[:, 1], places[:, 0]))])


def _within(corners: Array, start: Array, along: Array) -> tuple[Array, Array]:
    """Where lines of the plane enter convex polygons and leave them, as shares of the lines, shape (m,) each."""
    sides = np.roll(corners, -1, axis=1) - corners
    area = np.sum(corners[..., 0] * np.roll(corners[..., 1], -1, axis=1), axis=1)
    area = area - np.sum(corners[..., 1] * np.roll(corners[..., 0], -1, axis=1), axis=1)
    turn = np.sign(area)[:, None]
    away = start[:, None] - corners
    height = turn * (sides[..., 0] * away[..., 1] - sides[..., 1] * away[..., 0])
    rise = turn * (sides[..., 0] * along[:, None, 1] - sides[..., 1] * along[:, None, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        at = -height / rise
    enters = np.where(rise > 0, at, np.where((rise == 0) & (height < 0), np.inf, -np.inf)).max(axis=1)
    leaves = np.where(rise < 0, at, np.inf).min(axis=1)
    return np.maximum(enters, 0.0), np.minimum(leaves, 1.0)


def _at_edge(side: PairSurface, facets: Indices, ends: Indices, share: Array) -> Array:
    """Places on facets at a share of an edge between two of its nodes, shape (v, 2)."""
    first, last = ((side.nodes[facets] == ends[:, [k]]).argmax(axis=1) for k in range(2))
    places = side.functions.places
    return np.asarray(places[first] + share[:, None] * (places[last] - places[first]))


def _facet_directions(slave: PairSurface, directions: Array) -> tuple[Array, sp.csr_array]:
    """N_e of each facet, of length one, shape (f, 3), and how displacements of the nodes turn it, with the rotation of
    the facets around each node, sparse, shape (3 f, 3 N).
    """
    functions, facets = slave.functions, len(slave.nodes)
    shape = functions.values(functions.parts[0].mean(axis=0))
    sums = np.einsum("k,fkd->fd", shape, directions[slave.nodes])
    length = np.linalg.norm(sums, axis=1)
    ways = sums / length[:, None]
    at = np.repeat(np.arange(facets), len(shape)), slave.nodes.ravel()
    mean = sp.csr_array((np.tile(shape, facets), at), shape=(facets, len(slave.x)))
    turned = turning_of(_around(slave), slave.x, directions)
    across = (np.eye(3) - ways[:, :, None] * ways[:, None]) / length[:, None, None]
    return ways, sp.csr_array(of_blocks(across) @ sp.kron(mean, sp.eye_array(3)) @ turned)


def _around(side: PairSurface) -> sp.csr_array:
    """The area of the facets around a node that are around another one, too, sparse, shape (N, N)."""
    count = side.nodes.shape[1]
    areas = np.repeat(side.facet_areas, count * count)
    rows, columns = np.repeat(side.nodes, count, axis=1), np.tile(side.nodes, (1, count))
    return sp.csr_array((areas, (rows.ravel(), columns.ravel())), shape=(len(side.x), len(side.x)))


def rotations_at_nodes(side: PairSurface, nodes: Indices) -> Array:
    """How far the facets around some nodes have turned since the side was undeformed, by least squares with areas,
    shape (n, 3, 3).
    """
    assert side.undeformed is not None
    around = sp.csr_array(_around(side)[nodes])
    row = np.repeat(np.arange(len(nodes)), np.diff(around.indptr))
    undeformed_arms, arms = (x[around.indices] - x[nodes[row]] for x in (side.undeformed, side.x))
    products = np.zeros((len(nodes), 3, 3))
    np.add.at(products, row, around.data[:, None, None] * arms[:, :, None] * undeformed_arms[:, None])
    left_vectors, _, right_vectors = np.linalg.svd(products)
    left_vectors[:, :, 2] *= np.linalg.det(left_vectors @ right_vectors)[:, None]  # no reflection
    return np.asarray(left_vectors @ right_vectors)
