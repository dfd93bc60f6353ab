"""The distances of a pair in 3D whose bodies slide and turn, and their derivatives: facets of degree 1.

A point of a facet e of the slave sees the master along the direction N_e of this facet, see ``overlap_space``,

    x_s + g N_e = x_m(xi),   a^a . x_m,b = delta_ab,   a^a . N_e = 0,   m = nu / (nu . N_e),

with nu the normal of the master at xi.  A displacement d changes

    dg = m . (d_m - d_s - g dN),   dxi_a = a^a . (d_s + g dN - d_m),   dN_e = the rotation of the slave around e x N_e,
    d2g = 2 m . (d_m,a dxi_a - dg dN) + m . x_m,ab dxi_a dxi_b

and where an edge of the master passes by, across which its height h over the facet of the slave has the slopes h',

    d2 int g = ... + int (jump of h' along n) (n . (d_m - d_s - g dN))^2     along the edge, n across it.

Where points slide far, the normals of the master turn evenly along its facets instead, as those at its nodes do.  All
rows of a piece of the overlap are of the vectors at the nodes of both of its facets and dN, which ``spread`` makes of
displacements.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.mechanics.pairs.mean_rotation import turning_of
from signorini_fx.mechanics.pairs.mortar_coupling import Tested
from signorini_fx.mechanics.pairs.overlap_quadrature import Overlap
from signorini_fx.mechanics.pairs.overlap_space import axes_across
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.tuned import LAST_STEP_BUT_ONE, NO_PART

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

# Points of a part of an edge, and steps of Newton's method to places of quadrilaterals at most.
_ON_EDGE, _STEPS = 3, 12
# Pieces whose products are made at once: few, for memory.
_AT_ONCE = 2048


@dataclass(frozen=True)
class SpacePieces:
    """The pieces of an overlap in 3D, p of them with q points each, c vectors each.

    Attributes:
        mean: from moments of the functions of the nodes of the slave to means at the n points, sparse, shape (n, N).
        points: nodes of the slave whose functions a piece meets, shape (p, t).
        weighted: these functions times areas, shape (p, q, t).
        blocks: which vectors of ``spread`` a piece depends on: those at the nodes of both facets, and dN, shape (p, c).
        spread: all vectors from the displacements of the nodes of both sides, sparse, shape (3 v, 3 m).
        share: with which each of them is in d_m - d_s - g dN, shape (p, q, c).
        slope: with which in d_m,a, shape (2, p, q, c).
        facing: m, shape (p, q, 3).
        dual: a^a, shape (2, p, q, 3).
        distance: g, length, shape (p, q).
        curved: what bilinear facets of the master turn, m . x_m,ab, symmetric, shape (p, q, 2, 2).
        edges: the functions at the points of edges of the master times lengths and the jumps of the slope of its height
            there, sparse, shape (N, v).
        passing_edges: by how much each of them passes by, sparse, shape (v, 3 m).
        overlap: the pieces.
    """

    mean: sp.csr_array
    points: Indices
    weighted: Array = field(repr=False)
    blocks: Indices
    spread: sp.csr_array
    share: Array = field(repr=False)
    slope: Array = field(repr=False)
    facing: Array = field(repr=False)
    dual: Array = field(repr=False)
    distance: Array
    curved: Array = field(repr=False)
    edges: sp.csr_array
    passing_edges: sp.csr_array
    overlap: Overlap = field(repr=False)

    @classmethod
    def of(
        cls, slave: PairSurface, master: PairSurface, tested: Tested, directions: Array, mean: sp.csr_array
    ) -> SpacePieces:
        """Those of two sides.

        Args:
            slave: the side with the points.
            master: the other one.
            tested: their overlap.
            directions: of projection at the nodes of the slave, of length one, shape (N, 3).
            mean: see ``SpacePieces``.
        """
        overlap, facets = tested.overlap, len(slave.nodes)
        ways, turning = _facet_directions(slave, directions)
        nodes = len(slave.x), len(master.x)
        total, width = nodes[0] + nodes[1], slave.nodes.shape[1]
        number = np.unique(overlap.slave)
        of_facet = np.full(facets, -1)
        of_facet[number] = np.arange(number.size)
        rows = (3 * number[:, None] + np.arange(3)).ravel()
        padded = sp.hstack((turning[rows], sp.csr_array((rows.size, 3 * nodes[1]))))
        spread = sp.csr_array(sp.vstack((sp.eye_array(3 * total), padded)))
        blocks = np.column_stack(
            (slave.nodes[overlap.slave], nodes[0] + master.nodes[overlap.master], total + of_facet[overlap.slave])
        )
        way = ways[overlap.slave]
        distance = np.einsum("pqd,pd->pq", overlap.distance(slave, master), way)
        shape, shape_over = slave.functions.values(overlap.at), master.functions.values(overlap.over)
        slope_over = master.functions.slopes(overlap.over)
        share = np.concatenate((-shape, shape_over, -distance[..., None]), axis=2)
        slope = np.zeros((2, *share.shape))
        slope[..., width:-1] = slope_over
        corners = master.corners[overlap.master]
        along = np.einsum("apqk,pkd->apqd", slope_over, corners)
        normal = np.cross(along[0], along[1])
        inclination = np.einsum("pqd,pd->pq", normal, way)[..., None]
        facing = normal / inclination
        over_way = np.broadcast_to(way[:, None], normal.shape)
        dual = np.stack((np.cross(along[1], over_way), np.cross(over_way, along[0]))) / inclination
        corners_at = master.functions.slopes(np.array([[0.0, 1.0], [0.0, 0.0]]))[0]
        twist = np.zeros(corners_at.shape[1]) if master.functions.simplex else corners_at[0] - corners_at[1]
        curved = np.zeros((*distance.shape, 2, 2))
        curved[..., 0, 1] = curved[..., 1, 0] = np.einsum("pqd,k,pkd->pq", facing, twist, corners)
        edges = _Edges.of(slave, master, tested, ways)
        passing = edges.passing(total, of_facet, spread.shape[0]) @ spread
        points = slave.points[overlap.slave]
        geometry = share, slope, facing, dual, distance, curved, edges.functions, sp.csr_array(passing)
        return cls(mean, points, tested.weighted, blocks, spread, *geometry, overlap)

    @property
    def gap(self) -> Array:
        """At the points, length, shape (n,)."""
        return np.asarray(self.mean @ self._moments(self.distance[..., None])[:, 0])

    @property
    def rows(self) -> sp.csr_array:
        """Of the derivative of the gap, sparse, shape (n, 3 m)."""
        entries = np.matmul(self.weighted.swapaxes(1, 2), _rows(self.share, self.facing))
        return self._at_points(entries.reshape(*entries.shape[:2], -1, 3))

    def passing(self, normals: Array) -> sp.csr_array:
        """What the places that shift change of the normal of the master, at the points, sparse, shape (3 n, 3 m);
        ``normals``: at the nodes of the master facet of each piece, shape (p, l, 3).
        """
        width, (pieces, count, tests) = self.points.shape[1], self.weighted.shape
        total = np.zeros((pieces, 3 * tests, 3 * self.blocks.shape[1]))
        for a in range(2):
            bend = self.slope[a][..., width:-1] @ normals
            turned = (self.weighted[..., None] * bend[:, :, None]).reshape(pieces, count, -1)
            total -= np.matmul(turned.swapaxes(1, 2), _rows(self.share, self.dual[a]))
        entries = total.reshape(pieces, tests, 3, -1, 3)
        components = [self._at_points(entries[:, :, axis]) for axis in range(3)]
        identity = sp.eye_array(len(components[0].indptr) - 1)
        outward = [sp.kron(identity, axis[:, None]) for axis in np.eye(3)]
        return sp.csr_array(sum(axis @ matrix for axis, matrix in zip(outward, components, strict=True)))

    def stiffness(self, pressing: Array) -> sp.csr_array:
        """Minus the second derivative of the gaps with forces at the points, shape (n,), sparse, shape (3 m, 3 m)."""
        forces = np.einsum("pqt,pt->pq", self.weighted, (self.mean.T @ pressing)[self.points])
        touched = np.flatnonzero(forces.any(axis=1))
        size = 3 * self.blocks.shape[1]
        values = np.zeros((touched.size, size, size))
        for first in range(0, touched.size, _AT_ONCE):
            pieces = touched[first : first + _AT_ONCE]
            values[first : first + pieces.size] = self._second(pieces, forces[pieces])
        at = (3 * self.blocks[touched][..., None] + np.arange(3)).reshape(touched.size, size)
        rows, columns = np.repeat(at, size, axis=1), np.tile(at, (1, size))
        count = self.spread.shape[0]
        joint = sp.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count))
        kinks = sp.diags_array(self.edges.T @ (self.mean.T @ pressing))
        passing = self.passing_edges.T @ kinks @ self.passing_edges
        return sp.csr_array(self.spread.T @ joint @ self.spread - passing)

    def _second(self, pieces: Indices, forces: Array) -> Array:
        """The products of some pieces, shape (k, 3 c, 3 c)."""
        share, facing = self.share[pieces], self.facing[pieces]
        shifts = [-_rows(share, self.dual[a][pieces]) for a in range(2)]
        turn = np.zeros_like(share)
        turn[..., -1] = forces
        half = np.matmul(_rows(share, facing).swapaxes(1, 2), _rows(turn, facing))
        for a in range(2):
            along = _rows(self.slope[a][pieces] * forces[..., None], facing)
            half = half - np.matmul(along.swapaxes(1, 2), shifts[a])
        total, turns = half + half.swapaxes(1, 2), -self.curved
        for a in range(2):
            for b in range(2):
                scaled = (forces * turns[pieces, :, a, b])[..., None] * shifts[b]
                total = total + np.matmul(shifts[a].swapaxes(1, 2), scaled)
        return np.asarray(total)

    def _moments(self, values: Array) -> Array:
        """Integrals of functions times values at the points of quadrature, shape (p, q, k), by nodes, shape (N, k)."""
        sums = np.zeros((self.mean.shape[1], values.shape[2]))
        np.add.at(sums, self.points, np.einsum("pqt,pqk->ptk", self.weighted, values))
        return sums

    def _at_points(self, entries: Array) -> sp.csr_array:
        """The matrix of moments of the functions, shape (p, t, c, 3), at the points, of displacements."""
        rows = np.broadcast_to(self.points[:, :, None, None], entries.shape)
        columns = np.broadcast_to((3 * self.blocks[..., None] + np.arange(3))[:, None], entries.shape)
        shape = (self.mean.shape[1], self.spread.shape[0])
        moments = sp.csr_array((entries.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
        return sp.csr_array(self.mean @ moments @ self.spread)


def _rows(factor: Array, vectors: Array) -> Array:
    """Vectors at points, shape (p, q, 3), times factors, shape (p, q, c), as rows, shape (p, q, 3 c)."""
    return np.asarray((factor[..., None] * vectors[:, :, None]).reshape(*factor.shape[:2], -1))


@dataclass(frozen=True)
class _Edges:
    """Points of edges between facets of the master that facets of the slave see, v of them.

    Attributes:
        functions: see ``SpacePieces.edges``.
        facet: of the slave, shape (v,).
        nodes: of the slave and of the edge, those of the master numbered behind, shape (v, k + 2).
        share: of displacements there in d_m - d_s, shape (v, k + 2).
        distance: g, length, shape (v,).
        across: n, of length one, shape (v, 3).
    """

    functions: sp.csr_array
    facet: Indices
    nodes: Indices
    share: Array
    distance: Array
    across: Array

    @classmethod
    def of(cls, slave: PairSurface, master: PairSurface, tested: Tested, ways: Array) -> _Edges:
        """Those of two sides; ``ways``: directions of the facets of the slave, of length one, shape (f, 3)."""
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
        crossed = np.flatnonzero(leaves - enters > NO_PART)
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
        at = _places(slave, flat_nodes[rows], p)
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
        return cls(
            sp.csr_array(entries, shape=(len(slave.x), len(at))),
            facet[rows],
            nodes,
            np.column_stack((-shape, of_edge)),
            np.einsum("vd,vd->v", over - under, way[rows]),
            across[rows],
        )

    def passing(self, total: int, of_facet: Indices, count: int) -> sp.csr_array:
        """The rows of n . (d_m - d_s - g dN) of ``SpacePieces.spread``, sparse, shape (v, count).

        Args:
            total: nodes of both sides.
            of_facet: of each facet of the slave its number behind these.
            count: of all components.
        """
        blocks = np.column_stack((self.nodes, total + of_facet[self.facet]))
        values = np.column_stack((self.share, -self.distance))[..., None] * self.across[:, None]
        columns = 3 * blocks[..., None] + np.arange(3)
        rows = np.broadcast_to(np.arange(len(blocks))[:, None, None], values.shape)
        entries = values.ravel(), (rows.ravel(), columns.ravel())
        return sp.csr_array(entries, shape=(len(blocks), count))


def _around_facet(side: PairSurface) -> Indices:
    """The corners of each facet in order around it, shape (f, k)."""
    places = side.functions.places - side.functions.places.mean(axis=0)
    return np.asarray(side.nodes[:, np.argsort(np.arctan2(places[:, 1], places[:, 0]))])


def _within(corners: Array, start: Array, along: Array) -> tuple[Array, Array]:
    """Where lines of the plane enter convex polygons and leave them, as shares of the lines, shape (m,) each.

    Args:
        corners: of the polygons, in order, shape (m, c, 2).
        start: shape (m, 2).
        along: to their ends, shape (m, 2).
    """
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


def _places(side: PairSurface, flat: Array, p: Array) -> Array:
    """The places of points of the plane, shape (v, 2), on facets with nodes there, shape (v, k, 2)."""
    at = np.full(p.shape, 1.0 / 3.0)
    for _ in range(_STEPS):
        residual = p - np.einsum("vk,vkd->vd", side.functions.values(at), flat)
        first, second = np.einsum("avk,vkd->avd", side.functions.slopes(at), flat)
        size = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        step = (
            residual[:, 0] * second[:, 1] - residual[:, 1] * second[:, 0],
            first[:, 0] * residual[:, 1] - first[:, 1] * residual[:, 0],
        )
        at = at + np.column_stack(step) / size[:, None]
        if np.abs(residual).max(initial=0.0) <= LAST_STEP_BUT_ONE * np.abs(flat).max(initial=0.0):
            break
    return at


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
    numbers = np.arange(facets + 1)
    projector = sp.bsr_array((across, numbers[:-1], numbers), shape=(3 * facets, 3 * facets))
    return ways, sp.csr_array(projector @ sp.kron(mean, sp.eye_array(3)) @ turned)


def _around(side: PairSurface) -> sp.csr_array:
    """The area of the facets around a node that are around another one, too, sparse, shape (N, N)."""
    count = side.nodes.shape[1]
    areas = np.repeat(side.facet_areas, count * count)
    rows, columns = np.repeat(side.nodes, count, axis=1), np.tile(side.nodes, (1, count))
    return sp.csr_array((areas, (rows.ravel(), columns.ravel())), shape=(len(side.x), len(side.x)))


def turned_normals_in_space(side: PairSurface) -> sp.csr_array:
    """How displacements of the nodes of a side turn its normals at the nodes, sparse, shape (3 N, 3 N).

    The normal of a node is along the integral of x,1 x x,2 of its facets times its function, without what it has across
    planes of symmetry.
    """
    functions, count = side.functions, len(side.x)
    at, weights = functions.rule(2 * functions.degree + 2)
    values, slopes = functions.values(at) * weights[:, None], functions.slopes(at)
    along = np.einsum("aqk,fkd->afqd", slopes, side.corners)
    arms = slopes[1][None, :, :, None] * along[0][:, :, None] - slopes[0][None, :, :, None] * along[1][:, :, None]
    vectors = np.einsum("qk,fqld->fkld", values, arms, optimize=True) * side.sign[:, None, None, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    crossing = np.zeros((*vectors.shape, 3))
    crossing[..., 0, 1], crossing[..., 0, 2], crossing[..., 1, 2] = -z, y, -x
    crossing = crossing - crossing.swapaxes(-1, -2)
    rows = 3 * side.nodes[:, :, None, None, None] + np.arange(3)[:, None]
    columns = 3 * side.nodes[:, None, :, None, None] + np.arange(3)
    places = tuple(np.broadcast_to(numbers, crossing.shape).ravel() for numbers in (rows, columns))
    moments = sp.csr_array((crossing.ravel(), places), shape=(3 * count, 3 * count))
    sums = np.zeros((count, 3))
    normal = np.cross(along[0], along[1]) * side.sign[:, None, None]
    np.add.at(sums, side.nodes, np.einsum("qk,fqd->fkd", values, normal))
    within = np.eye(3) - side.across
    size = np.linalg.norm(np.einsum("nij,nj->ni", within, sums), axis=1)
    inverse = np.divide(1.0, size, out=np.zeros(count), where=size > 0)
    normals = side.nodal_normals
    across = inverse[:, None, None] * (within - np.einsum("ni,nj->nij", normals, normals))
    numbers = np.arange(count + 1)
    projector: Any = sp.bsr_array((across, numbers[:-1], numbers), shape=(3 * count, 3 * count))
    return sp.csr_array(projector @ moments)


def rotations_at_nodes(side: PairSurface, nodes: Indices) -> Array:
    """How far the facets around some nodes have turned since the side was undeformed, by least squares with areas,
    shape (n, 3, 3).
    """
    if side.undeformed is None:
        return np.tile(np.eye(3), (len(nodes), 1, 1))
    around = sp.csr_array(_around(side)[nodes])
    row = np.repeat(np.arange(len(nodes)), np.diff(around.indptr))
    undeformed_arms, arms = (x[around.indices] - x[nodes[row]] for x in (side.undeformed, side.x))
    products = np.zeros((len(nodes), 3, 3))
    np.add.at(products, row, around.data[:, None, None] * arms[:, :, None] * undeformed_arms[:, None])
    left_vectors, _, right_vectors = np.linalg.svd(products)
    left_vectors[:, :, 2] *= np.linalg.det(left_vectors @ right_vectors)[:, None]  # no reflection
    return np.asarray(left_vectors @ right_vectors)
