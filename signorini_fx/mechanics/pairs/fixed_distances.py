"""Distances of two sides that supports of both fix, and what of them the points beside are free of.

Where supports hold both sides, no pressure changes their distance.  The functions of finite elements carry that of the
last held nodes on to the facets beside them, where it is no distance of anything that moves: points there test

    g - e,   e = v_s sum_b theta_b g_b N_b + v_m sum_l theta_l g_l N_l,   v_s + v_m = 1,

with the held nodes b of the slave and l of the master.  The place of a node on the other side is held by the share
theta that functions of held nodes have there, and theta g is what these nodes have of the distance g.  Of meshes that
match a point so has the distance of its own node.  Of two facets over each other that which is held less has more of v,

    v_s : v_m = (r_m / (1 - r_m))^4 : (r_s / (1 - r_s))^4,

with the mean square r of the sum of the functions of held nodes: if all nodes of one facet are held, e is that of the
other side.  From held nodes to a place between them and others it is as far as in the undeformed body, which turns with
all held nodes of its side: where linear sides have too few of these to tell how they turn, such places do not count.
But for that e is continuous in the places of nodes.  It is zero where held nodes touch, and at points that no such
function reaches.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI

from signorini_fx.machine import parallel
from signorini_fx.mechanics.pairs.dual_functions import HeldSides
from signorini_fx.mechanics.pairs.mean_rotation import turning_of
from signorini_fx.mechanics.pairs.overlap_quadrature import Overlap, over_ranks
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.mechanics.pairs.sparse_scaling import scaled_rows
from signorini_fx.tuned import HELD_LESS, LAST_STEP_BUT_ONE, SAME_DIRECTION, SAME_PLACE_IN_CELL, SINGULAR

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

# Steps of Newton's method to places on facets at most; of affine facets the first one is exact.
_STEPS = 12


@dataclass(frozen=True)
class FixedDistances:
    """Places at which supports fix the distance of both sides: nodes of the slave first, then nodes of the master, k.

    Attributes:
        slave: shares of the held nodes of the slave in its place, with the sum theta, sparse, shape (k, N).
        master: those of the master, likewise, shape (k, M).
        direction: from the slave to the master, of length one, shape (k, d).
        offset: what the distance of the place has more than that of held nodes, length, shape (k,).
        turning: what of the distance changes as the held nodes turn, of undeformed sides, from displacements of the
            nodes of both, slave first, sparse, shape (k, d m); None: it is in ``offset``.
        held: theta of the places of the nodes of the slave, zero where these are none, shape (N,).
        met: integrals of the functions of the nodes of the slave times what e has of each distance, of all ranks,
            sparse, shape (N, k).
    """

    slave: sp.csr_array
    master: sp.csr_array
    direction: Array
    offset: Array
    turning: sp.csr_array | None
    held: Array
    met: sp.csr_array

    @classmethod
    def of(
        cls,
        sides: tuple[PairSurface, PairSurface],
        held: HeldSides,
        overlaps: tuple[Overlap, Overlap],
        weighted: Array,
        directions: Array | None,
        comm: MPI.Comm = MPI.COMM_SELF,
    ) -> FixedDistances | None:
        """Those of two sides; None: there are none; collective.

        Args:
            sides: slave and master.
            held: their nodes that supports hold.
            overlaps: of both, also where both are held, and where one of them can move, as far as this rank has found
                them.
            weighted: functions of the nodes of the slave times areas on the latter, see ``Tested``.
            directions: of projection at the nodes of the slave, shape (N, d); None: its normals.
            comm: the ranks that share the overlap.
        """
        slave, master = sides
        pairs = np.column_stack((overlaps[0].slave, overlaps[0].master))
        with_held = held.slave[slave.nodes[pairs[:, 0]]].any(axis=1) & held.master[master.nodes[pairs[:, 1]]].any(
            axis=1
        )
        pairs = np.unique(parallel.gather_rows(comm, np.unique(pairs[with_held], axis=0)), axis=0).astype(np.int64)
        if not len(pairs):
            return None
        directions = slave.nodal_normals if directions is None else directions
        seen = _seen_by_slave(sides, held, pairs, directions), _seen_by_master(sides, held, pairs, directions)
        places = [_held_places(sides, held, *part, of_master=bool(k)) for k, part in enumerate(seen)]
        if slave.undeformed is None:
            places = [part.chosen(part.turning_with(sides)) for part in places]
        nodes = places[0].nodes, places[1].nodes
        if not nodes[0].size + nodes[1].size:
            return None
        shares = [sp.csr_array(sp.vstack([part.shares[side] for part in places])) for side in range(2)]
        met = over_ranks(comm, _met(sides, held, overlaps[1], weighted, nodes))
        direction, offset = (
            np.concatenate([getattr(part, name) for part in places]) for name in ("direction", "offset")
        )
        turning = sp.csr_array(sp.vstack([part.turning for part in places])) if slave.undeformed is None else None
        held_share = np.zeros(len(slave.x))
        held_share[nodes[0]] = np.asarray(places[0].shares[0].sum(axis=1)).ravel()
        return cls(shares[0], shares[1], direction, offset, turning, held_share, met)

    def distance(self, slave: Array, master: Array) -> Array:
        """Of both sides along the directions, times theta, from positions of their nodes, length, shape (k,)."""
        return self.offset + np.einsum("kd,kd->k", self.direction, self.master @ master - self.slave @ slave)

    @property
    def counted(self) -> Array:
        """Theta: what has of it a distance that is the same all over, shape (k,)."""
        return np.asarray(self.slave.sum(axis=1)).ravel()

    @property
    def rows(self) -> sp.csr_array:
        """The distance from displacements of the nodes of undeformed sides, slave first, sparse, shape (k, d m)."""
        assert self.turning is not None
        return sp.csr_array(_along(self.direction, self.slave, self.master) + self.turning)


_Missed = Callable[[Array, Array], tuple[Array, Array]]
_Seen = tuple[Indices, tuple[sp.csr_array, sp.csr_array], Array]


def _seen_by_slave(sides: tuple[PairSurface, PairSurface], held: HeldSides, pairs: Indices, directions: Array) -> _Seen:
    """Held nodes of the slave with places on facets of the master, several for some: the nodes, shape (m,), the shares
    of the nodes of both sides, shapes (m, N) and (m, M), and the directions, shape (m, d).
    """
    slave, master = sides
    row, local = np.nonzero(held.slave[slave.nodes[pairs[:, 0]]])
    facet, over = pairs[row].T
    tests = slave.tests.values(slave.functions.places)[local]
    ways = _unit(np.einsum("mt,mtd->md", tests, directions[slave.points[facet]]))
    nodes = slave.nodes[facet, local]

    def missed(at: Array, far: Array) -> tuple[Array, Array]:
        """What the master misses of the end of the ray, and the derivatives by the place and by how far it is."""
        values, slopes = _at(master, master.x, over, at)
        return values - slave.x[nodes] - far[:, None] * ways, np.concatenate((slopes, -ways[:, :, None]), axis=2)

    at, inside = _places(master, missed, nodes.size)
    chosen = np.flatnonzero(inside)
    itself = np.ones((chosen.size, 1))
    shares = (
        _shares(nodes[chosen, None], itself, len(slave.x)),
        _shares(master.nodes[over[chosen]], master.functions.values(at[chosen]), len(master.x)),
    )
    return nodes[chosen], shares, ways[chosen]


def _seen_by_master(
    sides: tuple[PairSurface, PairSurface], held: HeldSides, pairs: Indices, directions: Array
) -> _Seen:
    """Held nodes of the master with the places on facets of the slave that see them, likewise."""
    slave, master = sides
    row, local = np.nonzero(held.master[master.nodes[pairs[:, 1]]])
    facet, over = pairs[row].T
    nodes = master.nodes[over, local]

    def ways_at(at: Array) -> tuple[Array, Array]:
        """Directions at places, and their derivatives."""
        vectors = directions[slave.points[facet]]
        slopes = np.einsum("amt,mtd->mda", slave.tests.slopes(at), vectors)
        return np.einsum("mt,mtd->md", slave.tests.values(at), vectors), slopes

    def missed(at: Array, far: Array) -> tuple[Array, Array]:
        values, slopes = _at(slave, slave.x, facet, at)
        ways, turns = ways_at(at)
        slopes = slopes + far[:, None, None] * turns
        return values + far[:, None] * ways - master.x[nodes], np.concatenate((slopes, ways[:, :, None]), axis=2)

    at, inside = _places(slave, missed, nodes.size)
    chosen = np.flatnonzero(inside)
    itself = np.ones((chosen.size, 1))
    shares = (
        _shares(slave.nodes[facet[chosen]], slave.functions.values(at[chosen]), len(slave.x)),
        _shares(nodes[chosen, None], itself, len(master.x)),
    )
    return nodes[chosen], shares, _unit(ways_at(at)[0][chosen])


@dataclass(frozen=True)
class _HeldPlaces:
    """Nodes of one side with a place each, m of them, see ``FixedDistances``.

    Attributes:
        nodes: shape (m,).
        shares: of the held nodes of slave and master, sparse, shapes (m, N) and (m, M).
        direction: shape (m, d).
        offset: length, shape (m,).
        turning: see ``FixedDistances``.
    """

    nodes: Indices
    shares: tuple[sp.csr_array, sp.csr_array]
    direction: Array
    offset: Array
    turning: sp.csr_array

    def turning_with(self, sides: tuple[PairSurface, PairSurface]) -> Flags:
        """Of which places a joint rotation leaves the distances, shape (m,)."""
        x = np.concatenate([side.x for side in sides])
        arm, rows = x - x.mean(axis=0), _along(self.direction, *self.shares) + self.turning
        turns = np.ones(self.nodes.size, dtype=bool)
        for first, second in combinations(range(x.shape[1]), 2):
            turned = np.zeros_like(arm)
            turned[:, first], turned[:, second] = -arm[:, second], arm[:, first]
            turns &= np.abs(rows @ turned.ravel()) <= SINGULAR * np.ptp(x, axis=0).max()
        return turns

    def chosen(self, flags: Flags) -> _HeldPlaces:
        """Some of them."""
        shares = sp.csr_array(self.shares[0][flags]), sp.csr_array(self.shares[1][flags])
        return _HeldPlaces(
            self.nodes[flags], shares, self.direction[flags], self.offset[flags], sp.csr_array(self.turning[flags])
        )


def _held_places(
    sides: tuple[PairSurface, PairSurface],
    held: HeldSides,
    nodes: Indices,
    shares: tuple[sp.csr_array, sp.csr_array],
    ways: Array,
    *,
    of_master: bool,
) -> _HeldPlaces:
    """Those of them of which some nodes on both sides are held along the direction: of each node the first place of
    those that are held most.
    """
    still, dim = [], ways.shape[1]
    for part, flags, loose in zip(shares, (held.slave, held.master), held.loose or (None, None), strict=True):
        entries = part.tocoo()
        holds = flags[entries.col]
        if loose is not None:
            along = np.einsum("mij,mj->mi", loose[entries.col], ways[entries.row])
            holds = holds & (np.linalg.norm(along, axis=1) <= SAME_DIRECTION)
        places = entries.row, entries.col
        still.append(sp.csr_array((np.where(holds, entries.data, 0.0), places), shape=part.shape))
    sums = [np.clip(np.asarray(part.sum(axis=1)).ravel(), 0.0, 1.0) for part in still]
    theta = sums[0] * sums[1]  # of the node itself the sum is zero or one
    largest_theta = np.zeros(max(len(side.x) for side in sides))
    np.maximum.at(largest_theta, nodes, theta)
    most_held = np.flatnonzero((theta > SAME_PLACE_IN_CELL) & (theta >= largest_theta[nodes] - SAME_PLACE_IN_CELL))
    chosen = most_held[np.unique(nodes[most_held], return_index=True)[1]]
    nodes, ways, theta, place_side = nodes[chosen], ways[chosen], theta[chosen], int(not of_master)
    of_held = sp.csr_array(still[place_side][chosen])
    of_held = scaled_rows(theta / np.asarray(of_held.sum(axis=1)).ravel(), of_held)
    itself = scaled_rows(theta, sp.csr_array(shares[1 - place_side][chosen]))
    # From the held nodes to the place it is as far as in the undeformed body.
    side, flags = sides[place_side], (held.slave, held.master)[place_side]
    start = side.x if side.undeformed is None else side.undeformed
    ahead = theta[:, None] * (shares[place_side][chosen] @ start) - of_held @ start
    ahead[np.abs(ahead).max(axis=1, initial=0.0) <= SINGULAR * np.ptp(start, axis=0).max()] = 0.0
    signed = ways if place_side else -ways
    offset = np.einsum("md,md->m", signed, ahead @ _turn(side, flags).T)
    turning = sp.csr_array((nodes.size, dim * sum(len(part.x) for part in sides)))
    between = np.flatnonzero(ahead.any(axis=1))
    if side.undeformed is None and flags.sum() > 1 and between.size:
        entries = np.repeat(np.arange(between.size), flags.sum()), np.tile(np.flatnonzero(flags), between.size)
        arms = sp.csr_array((np.ones(entries[0].size), entries), shape=(between.size, flags.size))
        turned = _inward(signed[between]) @ turning_of(arms, side.x, ahead[between])
        places = between, np.arange(between.size)
        placing = sp.coo_array((np.ones(between.size), places), shape=(nodes.size, between.size))
        turned = sp.csr_array(sp.csr_array(placing) @ turned)
        zero_columns = sp.csr_array((nodes.size, turning.shape[1] - turned.shape[1]))
        turning = sp.csr_array(sp.hstack((zero_columns, turned) if place_side else (turned, zero_columns)))
    of_sides = (itself, of_held) if place_side else (of_held, itself)
    return _HeldPlaces(nodes, of_sides, ways, offset, turning)


def _inward(vectors: Array) -> sp.csr_array:
    """Products with vectors, from components, sparse, shape (m, d m)."""
    count, dim = vectors.shape
    entries = vectors.ravel(), np.arange(count * dim), dim * np.arange(count + 1)
    return sp.csr_array(entries, shape=(count, count * dim))


def _along(direction: Array, slave: sp.csr_array, master: sp.csr_array) -> sp.csr_array:
    """Differences of displacements of both sides along directions, from shares of nodes, sparse, shape (k, d m)."""
    differences = sp.csr_array(sp.hstack((-slave, master)))
    return sp.csr_array(_inward(direction) @ sp.kron(differences, sp.eye_array(direction.shape[1])))


def _turn(side: PairSurface, held: Flags) -> Array:
    """The rotation of the held nodes of a displaced side, where they leave it open that of their normals, and nearest
    to none where these do, shape (d, d).
    """
    dim = side.dimension
    if side.undeformed is None or not held.any():
        return np.eye(dim)
    undeformed_side = replace(side, x=side.undeformed, undeformed=None)
    start_arms, arms = (part.x[held] - part.x[held].mean(axis=0) for part in (undeformed_side, side))
    normals = side.directions[held].T @ undeformed_side.directions[held]
    size = np.ptp(undeformed_side.x, axis=0).max()
    turned_axes, _, axes = np.linalg.svd(arms.T @ start_arms / size**2 + SINGULAR * (normals + SINGULAR * np.eye(dim)))
    signs = np.ones(dim)
    signs[-1] = np.sign(np.linalg.det(turned_axes @ axes))
    return np.asarray((turned_axes * signs) @ axes)


def _at(side: PairSurface, x: Array, facets: Indices, at: Array) -> tuple[Array, Array]:
    """Positions of one place on each facet, shape (m, d), and their derivatives, shape (m, d, d - 1)."""
    corners = x[side.nodes[facets]]
    slopes = np.einsum("amk,mkd->mda", side.functions.slopes(at), corners)
    return np.einsum("mk,mkd->md", side.functions.values(at), corners), slopes


def _places(
    side: PairSurface, missed: Callable[[Array, Array], tuple[Array, Array]], count: int
) -> tuple[Array, Flags]:
    """The places at which nothing is missed, by Newton's method, shape (m, d - 1), and whether they are on the facets.

    Args:
        side: with the facets.
        missed: what is missed at places and distances, shape (m, d), and its derivatives, shape (m, d, d).
        count: m.
    """
    at: Array = np.tile(side.functions.places.mean(axis=0), (count, 1))
    far: Array = np.zeros(count)
    step: Array = np.ones((count, side.dimension))
    regular = np.ones(count, dtype=bool)
    for _ in range(_STEPS):
        value, slopes = missed(at, far)
        regular &= np.abs(np.linalg.det(slopes)) > 0.0
        step[regular] = np.linalg.solve(slopes[regular], -value[regular][..., None])[..., 0]
        step[:, :-1] = np.clip(step[:, :-1], -1.0, 1.0)  # places off the facet are of no interest
        at[regular] += step[regular, :-1]
        far[regular] += step[regular, -1]
        if not (np.abs(step[regular, :-1]) > LAST_STEP_BUT_ONE).any():
            break
    met = regular & (np.abs(step[:, :-1]) <= SAME_PLACE_IN_CELL).all(axis=1)
    ends = at.sum(axis=1) if side.functions.simplex else at.max(axis=1)
    return at, met & (at.min(axis=1) >= -SAME_PLACE_IN_CELL) & (ends <= 1.0 + SAME_PLACE_IN_CELL)


def _shares(nodes: Indices, values: Array, count: int) -> sp.csr_array:
    """Shares of the nodes of facets in places, sparse, shape (m, count)."""
    rows = np.broadcast_to(np.arange(len(nodes))[:, None], values.shape)
    return sp.csr_array((values.ravel(), (rows.ravel(), nodes.ravel())), shape=(len(nodes), count))


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _met(
    sides: tuple[PairSurface, PairSurface],
    held: HeldSides,
    overlap: Overlap,
    weighted: Array,
    places: tuple[Indices, Indices],
) -> sp.csr_array:
    """See ``FixedDistances``, as far as this rank has found the overlap; ``places``: nodes of both sides."""
    slave, master = sides
    slave_nodes, master_nodes = slave.nodes[overlap.slave], master.nodes[overlap.master]
    pieces = np.asarray(held.slave[slave_nodes].any(axis=1) & held.master[master_nodes].any(axis=1))
    overlap, weighted = overlap.chosen(pieces), weighted[pieces]
    slave_nodes, master_nodes, points = slave_nodes[pieces], master_nodes[pieces], slave.points[overlap.slave]
    shape, over = slave.functions.values(overlap.at), master.functions.values(overlap.over)
    _, pair = np.unique(np.column_stack((overlap.slave, overlap.master)), axis=0, return_inverse=True)
    pair = pair.ravel()  # whose shape differs between versions of NumPy
    squares = [
        np.bincount(pair, np.sum(overlap.weight * np.einsum("pqk,pk->pq", values, flags[nodes] * 1.0) ** 2, axis=1))
        for values, flags, nodes in ((shape, held.slave, slave_nodes), (over, held.master, master_nodes))
    ]
    of_slave = _part_of_slave(*(square / np.bincount(pair, overlap.weight.sum(axis=1)) for square in squares))[pair]
    parts = []
    for side, nodes, values, part, numbers in (
        (slave, slave_nodes, shape, of_slave, places[0]),
        (master, master_nodes, over, 1.0 - of_slave, places[1]),
    ):
        products = np.einsum("pqi,pqj->pij", weighted * part[:, None, None], values)
        at = tuple(np.broadcast_to(rows, products.shape).ravel() for rows in (points[:, :, None], nodes[:, None]))
        integrals = sp.csr_array((products.ravel(), at), shape=(len(slave.x), len(side.x)))
        parts.append(sp.csr_array(integrals[:, numbers]))
    return sp.csr_array(sp.hstack(parts))


def _part_of_slave(slave: Array, master: Array) -> Array:
    """v_s from the mean squares of the functions of the held nodes of both sides, of each pair of facets."""
    slave_part, master_part = (
        (r * np.maximum(1.0 - q, 0.0)) ** HELD_LESS for r, q in ((master, slave), (slave, master))
    )
    return np.divide(
        slave_part, slave_part + master_part, out=np.full_like(slave_part, 0.5), where=slave_part + master_part > 0.0
    )
