"""The distances of a pair whose bodies slide and rotate, and their derivatives, in 2D and 3D.

A slave point is projected onto the master along N, half-way between the normals of both sides,

    x_s + g N = x_m(xi),   a^a . x_m,b = delta_ab,   a^a . N = 0,   m = nu / (nu . N),

with nu the normal of the master at xi.  A displacement d changes

    dg = m . (d_m - d_s - g dN),   dxi_a = a^a . (d_s + g dN - d_m),
    d2g = 2 m . (d_m,a dxi_a - dg dN) + m . x_m,ab dxi_a dxi_b

Where a vertex of the master, in 3D an edge, passes by, the slope h' of its height over the slave
jumps:

    d2 int g = ... + int (jump of h' along n) (n . (d_m - d_s - g dN))^2,

along the edge, with n perpendicular to it.

Each piece of the overlap has rows for a local set of vectors: those at the nodes of both of its
facets, and those that make up dN.  The matrix ``spread`` computes them from the displacements.  In
3D facets are of degree 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from signorini_fx.arrays import Array, Ints, inner, matvec, rmatvec
from signorini_fx.machine import parallel
from signorini_fx.mechanics.pairs.mortar_coupling import Tested
from signorini_fx.mechanics.pairs.overlap import (
    axes_across,
    clip,
    counterclockwise,
    place_under,
    projected_places,
)
from signorini_fx.mechanics.pairs.pair_side import (
    PairSurface,
    along_vectors,
    components,
    in_blocks,
    in_rows,
    means_along,
    summed,
    turned_normals,
    turning_of,
)
from signorini_fx.tuned import NOTHING_LEFT

# Pieces whose products are made at once: few, for memory.
_AT_ONCE = 2048
# Points of a part of an edge.
_ON_EDGE = 3


@dataclass(frozen=True)
class SlidingPieces:
    """The pieces of an overlap on this rank, p of them with q points each, on f pairs of facets;
    each pair depends on c local vectors.

    Attributes:
        points: the slave nodes of the contact points of all ranks, shape (n,).
        mean: from integrals of functions on the pairs to means at the points, sparse, shape (n, f
            t).
        tested: the overlap with these functions.
        projection: the directions along which slave points are projected onto the master.
        blocks: numbers of the local vectors of each pair in ``spread``: those at the nodes of both
            facets, then those that turn N, shape (f, c).
        spread: all local vectors from the displacements of the nodes of both sides, sparse, shape
            (d v, d m).
        share: coefficients of the local vectors in d_m - d_s - g dN, except that the part of dN
            along N is not yet removed, shape (p, q, c).
        turns: coefficients of the r vectors that turn N in dN, except for the part along N, shape
            (p, q, r).
        slope: coefficients of the vectors at the l nodes of the master in d_m,a, shape (d - 1, p,
            q, l).
        facing: m, shape (p, q, d).
        across: m - N, shape (p, q, d).
        dual: a^a, shape (d - 1, p, q, d).
        distance: g, length, shape (p, q).
        curved: m . x_m,aa in 2D, shape (p, q); zero in 3D, where facets are taken as flat (the
            twist of quadrilaterals is neglected).
    """

    points: Ints
    mean: sp.csr_array
    tested: Tested = field(repr=False)
    projection: Projection = field(repr=False)
    blocks: Ints
    spread: sp.csr_array
    share: Array = field(repr=False)
    turns: Array = field(repr=False)
    slope: Array = field(repr=False)
    facing: Array = field(repr=False)
    across: Array = field(repr=False)
    dual: Array = field(repr=False)
    distance: Array
    curved: Array = field(repr=False)

    @classmethod
    def of(
        cls, tested: Tested, directions: Array, points: Ints, mean: sp.csr_array
    ) -> SlidingPieces:
        """Return the pieces of two sides.

        ``directions``: unit directions of projection at the slave nodes, shape (N, d); for
        ``points`` and
            ``mean`` see the attributes.
        """
        slave = tested.slave
        master = tested.master
        overlap = tested.overlap
        dim = slave.dimension
        first = len(slave.x)
        projection = Projection.of(slave, directions, np.unique(overlap.slave))
        total = first + len(master.x)
        turning = projection.turning
        themselves = np.arange(dim * total)
        entries = (
            np.append(np.ones(themselves.size), turning.data),
            np.append(themselves, turning.indices),
        )
        ends = np.append(themselves, themselves.size + turning.indptr)
        spread = sp.csr_array((*entries, ends), shape=(ends.size - 1, themselves.size))
        facet = overlap.slave[overlap.first]
        over = first + master.nodes[overlap.master[overlap.first]]
        blocks = np.column_stack((slave.nodes[facet], over, total + projection.numbers[facet]))
        way, turns = projection.at(overlap.slave, tested.shapes[0])
        distance = np.einsum("pqd,pqd->pq", tested.distance, way)
        share = np.concatenate(
            (-tested.shapes[0], tested.shapes[1], -distance[..., None] * turns), axis=2
        )
        slope = master.functions.slopes(overlap.over)
        corners = master.corners[overlap.master]
        along = np.einsum("apqk,pkd->pqad", slope, corners)
        inverse = np.linalg.inv(np.concatenate((along, way[:, :, None]), axis=2))
        facing = inverse[..., -1]
        dual = np.moveaxis(inverse[..., :-1], 3, 0)
        curvatures = master.functions.curvatures if dim == 2 else np.zeros(corners.shape[1])
        curved = matvec(facing, curvatures @ corners)
        directed = facing, facing - way, dual, distance, curved
        at_points = points, mean, tested
        return cls(*at_points, projection, blocks, spread, share, turns, slope, *directed)

    @cached_property
    def kinks(self) -> Kinks:
        """The places where the normal of the master jumps."""
        return Kinks.of(self.tested, self.projection)

    @property
    def gap(self) -> Array:
        """The gap at the points of this rank, length, shape (n,); collective."""
        integrals = rmatvec(self.tested.weighted, self.distance)
        gap = self.mean @ self.tested.overlap.of_pairs(integrals).ravel()
        sharing = self.tested.sharing
        return parallel.global_sum(sharing.comm, gap)[sharing.own(self.points)]

    @property
    def rows(self) -> sp.csr_array:
        """The derivative of the gap at the points of this rank with respect to the displacements,
        sparse, shape (n, d m); collective.
        """
        entries = np.matmul(
            self.tested.weighted.swapaxes(1, 2), self._rows(self.share, self.facing, self.across)
        )
        return self._at_points(self.mean, entries)

    def passing(self, along: Array) -> sp.csr_array:
        """Return the change of the master's normal as projected points shift on the master, sparse,
        shape (n, d m); collective.

        Args:
            along: vectors at the points whose product with the change is returned, shape (n, d).
        """
        along = self.tested.sharing.everywhere(along, self.points)
        total: Array = np.zeros(1)
        master = self.tested.master
        normals = master.directions[master.nodes[self.tested.overlap.master]]
        for k, slope in enumerate(self.slope):
            bent = _along(self.tested.weighted, slope @ normals).swapaxes(1, 2)
            total = total - np.matmul(bent, self._rows(self.share, self.dual[k], self.dual[k]))
        return self._at_points(means_along(along, self.mean), total)

    def stiffness(self, acting: Array) -> sp.csr_array:
        """Return the contribution of contact forces to the tangent, sparse, shape (d m, d m), which
        is to be summed over the ranks; collective.

        It is minus the second derivative of the gaps times the normal forces, plus the change of
        the shear forces on the master as projected points shift.

        Args:
            acting: normal force and shear force at the points of this rank, shape (n, 1 + d).
        """
        tests = self.tested.weighted.shape[2]
        pair = self.tested.overlap.pair
        dim = self.facing.shape[2]
        everywhere = self.tested.sharing.everywhere(acting, self.points)
        nodal = (self.mean.T @ everywhere).reshape(len(self.blocks), tests, 1 + dim)
        acting = self.tested.weighted @ nodal[pair]
        forces = acting[..., 0]
        shearing = acting[..., 1:]
        touched = np.flatnonzero(acting.any(axis=(1, 2)))
        pairs, place = np.unique(pair[touched], return_inverse=True)
        values = np.zeros((pairs.size, *[dim * self.blocks.shape[1]] * 2))

        def second(chosen: slice) -> Array:
            pieces = touched[chosen]
            return self._second(pieces, forces[pieces], shearing[pieces])

        _add(values, place, second)
        kinks = self.kinks
        jumping = np.flatnonzero(np.isin(kinks.pairs, pairs))
        jumps = -inner(kinks.functions, nodal[kinks.pairs, :, 0])

        def jump(chosen: slice) -> Array:
            rows = jumping[chosen]
            passing = _along(kinks.share[rows, None], kinks.across[rows, None])
            return np.matmul(passing.swapaxes(1, 2), jumps[rows, None, None] * passing)

        _add(values, np.searchsorted(pairs, kinks.pairs[jumping]), jump)
        at = components(self.blocks[pairs], dim)
        joint = summed((self.spread.shape[0],) * 2, values, at[:, :, None], at[:, None])
        return self.spread.T.tocsr() @ joint @ self.spread

    def _second(self, pieces: Ints, forces: Array, shears: Array) -> Array:
        """Return the stiffness of some pieces in their local vectors, shape (k, d c, d c)."""
        share = self.share[pieces]
        facing = self.facing[pieces]
        across = self.across[pieces]
        dim = facing.shape[2]
        size = dim * self.blocks.shape[1]
        last = size - dim * self.turns.shape[2]
        first = last - dim * self.slope.shape[3]  # of vectors of the master
        # A mixed derivative stands once in ``half``, whose transpose has the other order.
        half = np.zeros((pieces.size, size, size))
        # The change of the parameters of the projected point on the master, one for each.
        shifts = [-self._rows(share, dual[pieces], dual[pieces]) for dual in self.dual]
        # The direction of projection turns while the distance changes.
        turning = _along(self.turns[pieces] * forces[..., None], across)
        half[:, :, last:] = np.matmul(self._rows(share, facing, across).swapaxes(1, 2), turning)
        # The projected point shifts while the tangents of the master change.
        for k, shift in enumerate(shifts):
            along = _along(self.slope[k, pieces] * forces[..., None], facing)
            half[:, first:last] -= np.matmul(along.swapaxes(1, 2), shift)
        total = half + half.swapaxes(1, 2)
        if self.curved.any():  # the projected point shifts along a curved facet
            scaled = (forces * self.curved[pieces])[..., None] * shifts[0]
            total -= np.matmul(shifts[0].swapaxes(1, 2), scaled)
        if shears.any():  # the shear of the projected point acts on other nodes of the master
            for k, shift in enumerate(shifts):
                total[:, first:last] -= np.matmul(
                    _along(self.slope[k, pieces], shears).swapaxes(1, 2), shift
                )
        return total

    def _rows(self, factor: Array, vectors: Array, across: Array) -> Array:
        """Return vectors (p, q, d) times factors (p, q, c) as rows, shape (p, q, d c).

        ``across``: the vectors without their part along N, used for the local vectors that turn N.
        """
        count = factor.shape[2] - self.turns.shape[2]
        return np.concatenate(
            (_along(factor[..., :count], vectors), _along(factor[..., count:], across)), axis=2
        )

    def _at_points(self, mean: sp.csr_array, entries: Array) -> sp.csr_array:
        """Return rows at the points of this rank, in displacements, from integrals on pieces;
        collective.

        ``mean``: means of the integrals at the points; ``entries``: integrals, shape (p, i, d c).
        """
        columns = components(self.blocks, self.facing.shape[2])
        integrals = self.tested.overlap.of_pairs(entries)
        rows = mean @ in_rows(integrals, columns, self.spread.shape[0]) @ self.spread
        return self.tested.sharing.rows(rows, self.points)


@dataclass(frozen=True)
class Projection:
    """The directions N along which slave points are projected onto the master, and what turns them.

    In 2D N is interpolated between the directions at the nodes of a facet, which turn with the
    nodal normals.  In 3D N is constant on a facet, as in ``overlap``, and turns with the slave
    around its nodes; other ranks' facets have no vectors.

    Attributes:
        vectors: unit vectors, shape (v, d).
        numbers: the numbers of those vectors from which N of each facet is made, shape (f, r).
        turning: changes of the vectors from displacements of the slave, sparse, shape (d v, d N).
    """

    vectors: Array
    numbers: Ints
    turning: sp.csr_array

    @classmethod
    def of(cls, slave: PairSurface, directions: Array, facets: Ints) -> Projection:
        """Return the projection of a slave side.

        Args:
            slave: the side.
            directions: unit directions of projection at its nodes, shape (N, d).
            facets: in 3D the facets that have vectors.
        """
        if slave.dimension == 2:
            turns = np.einsum("ni,nj->nij", _turned(directions), _turned(slave.nodal_normals))
            return cls(directions, slave.nodes, turned_normals(slave, turned_too=turns))
        numbers = np.zeros((len(slave.nodes), 1), dtype=np.int64)
        numbers[facets, 0] = np.arange(facets.size)
        shape = slave.functions.values(slave.functions.parts[0].mean(axis=0))
        nodes, corners = np.unique(slave.nodes[facets], return_inverse=True)
        mean = in_rows(np.tile(shape, (facets.size, 1, 1)), corners, nodes.size)
        directions = directions[nodes]
        sums = mean @ directions
        length = np.linalg.norm(sums, axis=1)[:, None]
        ways = sums / length
        across = (np.eye(3) - ways[:, :, None] * ways[:, None]) / length[..., None]
        around = sp.csr_array(slave.around[nodes])
        turning = sp.csr_array(turning_of(around, (slave.x,), (directions,)))
        return cls(ways, numbers, along_vectors(across, in_blocks(mean, 3)) @ turning)

    def at(self, facets: Ints, shape: Array) -> tuple[Array, Array]:
        """Return N at points of facets, shape (m, q, d), and the coefficients of the vectors in dN
        before its part along N is removed, shape (m, q, r).

        ``shape``: functions of the slave at the points, shape (m, q, k).
        """
        if self.numbers.shape[1] == 1:
            shape = np.ones((*shape.shape[:2], 1))
        ways = shape @ self.vectors[self.numbers[facets]]
        length = np.linalg.norm(ways, axis=2, keepdims=True)
        return ways / length, shape / length


@dataclass(frozen=True)
class Kinks:
    """The v slave points opposite vertices of the master, in 3D points opposite its edges, where
    its normal jumps.

    The derivative of the distance jumps there as they pass by.

    Attributes:
        pairs: number of a pair of facets that has the same functions, shape (v,).
        functions: the dual functions there, times lengths and the jump, shape (v, t).
        share: coefficients of the local vectors of the pair, see ``SlidingPieces``, in d_m - d_s -
            g dN, the displacement with which they pass by, shape (v, c).
        across: unit vector in the direction of passing, shape (v, d).
    """

    pairs: Ints
    functions: Array
    share: Array
    across: Array

    @classmethod
    def of(cls, tested: Tested, projection: Projection) -> Kinks:
        """Return the kinks between two adjacent facets of the master opposite one facet of the
        slave.
        """
        slave = tested.slave
        master = tested.master
        overlap = tested.overlap
        dim = slave.dimension
        around = master.nodes[overlap.master[overlap.first]][:, master.functions.vertices]
        ends = np.stack([np.roll(around, -k, axis=1) for k in range(dim - 1)], axis=2)
        number = np.repeat(np.arange(len(around)), ends.shape[1])
        facet = overlap.slave[overlap.first][number]
        partner = overlap.master[overlap.first][number]
        ends = np.sort(ends.reshape(-1, dim - 1), axis=1)
        order = np.lexsort((*ends.T, facet))
        keys = np.column_stack((facet, ends))[order]
        shared = np.flatnonzero((keys[1:] == keys[:-1]).all(axis=1))
        number = number[order[shared]]
        ends = ends[order[shared]]
        pairs = partner[order[[shared, shared + 1]]]
        facet = facet[order[shared]]
        rows, at, of_end, lengths = (_at_vertices if dim == 2 else _on_edges)(
            slave, projection, facet, master.x[ends]
        )
        facet = facet[rows]
        ends = ends[rows]
        pairs = pairs[:, rows]
        shape = slave.functions.values(at)
        (way,), (turns,) = (
            values.swapaxes(0, 1) for values in projection.at(facet, shape[:, None])
        )
        across = (
            _turned(way) if dim == 2 else np.cross(master.x[ends[:, 1]] - master.x[ends[:, 0]], way)
        )
        across /= np.linalg.norm(across, axis=1)[:, None]
        # Which of both facets is behind as seen along n: from the middles of both.
        middles = master.corners[pairs].mean(axis=2)
        swapped = inner(middles[1] - middles[0], across) < 0
        corner = (master.nodes[pairs][..., None] == ends[:, None]).argmax(axis=2)
        on_facets = np.einsum("ve,sved->svd", of_end, master.functions.places[corner]).reshape(
            -1, 1, dim - 1
        )
        normals = master.normals(pairs.ravel(), on_facets).reshape(*pairs.shape, dim)
        steep = -np.einsum("svd,vd->sv", normals, across) / np.einsum("svd,vd->sv", normals, way)
        jump = np.where(swapped, steep[0] - steep[1], steep[1] - steep[0])
        apart = np.einsum("ve,ved->vd", of_end, master.x[ends]) - np.einsum(
            "vk,vkd->vd", shape, slave.corners[facet]
        )
        distance = inner(apart, way)
        projected = inner(slave.normals(facet, at[:, None])[:, 0], way)
        if dim == 2:  # N turns along a facet
            bent = np.einsum(
                "vk,vkd->vd", slave.functions.slopes(at)[0], projection.vectors[slave.nodes[facet]]
            )
            turn = inner(bent, across) * turns.sum(axis=1)
            projected = projected + slave.sign[facet] * distance * turn
        true = slave.sizes(facet, at[:, None])[:, 0]
        functions = matvec(tested.coefficients[facet], slave.functions.tests.values(at))
        functions *= (jump * lengths * true / np.abs(projected))[:, None]
        on_master = np.zeros((len(shape), master.nodes.shape[1]))
        np.put_along_axis(on_master, corner[0], of_end, axis=1)
        share = np.column_stack((-shape, on_master, -distance[:, None] * turns))
        number = number[rows]
        order = np.argsort(number, kind="stable")
        return cls(number[order], functions[order], share[order], across[order])


def _add(values: Array, place: Ints, products: Callable[[slice], Array]) -> None:
    """Add products, computed in batches, to the entries of ``values`` at ``place``, in ascending
    order.
    """
    for first in range(0, place.size, _AT_ONCE):
        chosen = slice(first, first + _AT_ONCE)
        met, starts = np.unique(place[chosen], return_index=True)
        values[met] += np.add.reduceat(products(chosen), starts, axis=0)


def _along(factor: Array, vectors: Array) -> Array:
    """Return vectors (p, q, d) times factors (p, q, c), shape (p, q, d c)."""
    return np.einsum("pqc,pqd->pqcd", factor, vectors).reshape(
        *factor.shape[:2], factor.shape[2] * vectors.shape[2]
    )


def _turned(vectors: Array) -> Array:
    """Return vectors, shape (..., 2), rotated by +90 degrees."""
    return np.stack((-vectors[..., 1], vectors[..., 0]), axis=-1)


def _at_vertices(
    slave: PairSurface, projection: Projection, facet: Ints, x: Array
) -> tuple[Ints, Array, Array, Array]:
    """Return the master vertices that project inside slave facets: their rows in ``x``, the
    reference coordinates, the shares of the vertex (one) and lengths (one).
    """
    ways = slave.functions.polynomials(projection.vectors[slave.nodes[facet]])[:, :, None]
    place = place_under(slave.functions, slave.corners[facet], ways, x)[:, 0]
    rows = np.flatnonzero((place > NOTHING_LEFT) & (place < 1.0 - NOTHING_LEFT))
    return rows, place[rows, None], np.ones((rows.size, 1)), np.ones(rows.size)


def _on_edges(
    slave: PairSurface, projection: Projection, facet: Ints, x: Array
) -> tuple[Ints, Array, Array, Array]:
    """Return quadrature points where master edges are opposite slave facets: the row of each edge
    in ``x``, the reference coordinates on the facet, the shares of the two ends, and weights,
    length.
    """
    corners = slave.corners[facet][:, slave.functions.vertices]
    ways = projection.vectors[projection.numbers[facet, 0]]
    middle = corners.mean(axis=1)
    axes = axes_across(ways)
    flat, line = (
        np.einsum("mcd,mkd->mck", places - middle[:, None], axes) for places in (corners, x)
    )
    start = line[:, 0]
    along = line[:, 1] - line[:, 0]
    within, count = clip(line, counterclockwise(flat))
    shares = matvec(within - start[:, None], along / np.sum(along**2, axis=1)[:, None])
    valid = np.arange(within.shape[1]) < count[:, None]
    enters = np.where(valid, shares, np.inf).min(axis=1)
    leaves = np.where(valid, shares, -np.inf).max(axis=1)
    places, weights = np.polynomial.legendre.leggauss(_ON_EDGE)
    rows = np.repeat(np.flatnonzero(leaves - enters > NOTHING_LEFT), places.size)
    cut = rows.size // places.size
    width = (leaves - enters)[rows] / 2
    start = start[rows]
    along = along[rows]
    at_edge = enters[rows] + width * np.tile(places + 1, cut)
    length = np.linalg.norm(along, axis=1)
    p = start + at_edge[:, None] * along
    first = np.full((rows.size, 1, 2), 1.0 / 3.0)
    at = projected_places(slave, facet[rows], first, p[:, None], middle[rows], axes[rows])[:, 0]
    return rows, at, np.column_stack((1 - at_edge, at_edge)), width * length * np.tile(weights, cut)


def rotations_at_nodes(side: PairSurface, nodes: Ints) -> Array:
    """Return the mean rotation, from the undeformed state, of the facets around each node: the
    area-weighted least-squares fit, shape (n, 3, 3).
    """
    assert side.undeformed is not None
    around = sp.csr_array(side.around[nodes])
    row = np.repeat(np.arange(len(nodes)), np.diff(around.indptr))
    undeformed_arms, arms = (x[around.indices] - x[nodes[row]] for x in (side.undeformed.x, side.x))
    products = np.zeros((len(nodes), 3, 3))
    np.add.at(
        products, row, around.data[:, None, None] * arms[:, :, None] * undeformed_arms[:, None]
    )
    left_vectors, _, right_vectors = np.linalg.svd(products)
    left_vectors[:, :, 2] *= np.linalg.det(left_vectors @ right_vectors)[:, None]  # no reflection
    return left_vectors @ right_vectors
