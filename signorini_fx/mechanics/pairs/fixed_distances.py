"""Distances of two sides that supports of both fix, and what of them the points beside are free of.

Where supports hold both sides, no pressure changes their distance.  The functions of finite elements carry that of the
last held nodes on to the facets beside them, where it is no distance of anything that moves: points there test

    g - e,   e = sum_b g_b N_b of that side whose functions of held nodes sum up to less in both facets over each other,

with g_b the distance at node b of one side whose place on the other is held, too.  Of matching meshes a point so has
the distance of its own node.  The sum e is zero where held nodes touch, and at points that no such function reaches.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI

from signorini_fx.machine import parallel
from signorini_fx.mechanics.pairs.dual_functions import HeldSides
from signorini_fx.mechanics.pairs.overlap_quadrature import Overlap, over_ranks
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.tuned import LAST_STEP_BUT_ONE, SAME_DIRECTION, SAME_PLACE_IN_CELL

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

# Steps of Newton's method to places on facets at most; of affine facets the first one is exact.
_STEPS = 12


@dataclass(frozen=True)
class FixedDistances:
    """Places at which supports fix the distance of both sides: nodes of the slave first, then nodes of the master, k.

    Attributes:
        slave: shares of the nodes of the slave in its place, sparse, shape (k, N).
        master: those of the master, sparse, shape (k, M).
        direction: from the slave to the master, of length one, shape (k, d).
        met: integrals of the functions of the nodes of the slave times what e has of each distance, of all ranks,
            sparse, shape (N, k).
    """

    slave: sp.csr_array
    master: sp.csr_array
    direction: Array
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
        """Those of two sides; None: there are none that a function meets; collective.

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
        kept_places = [_kept(sides, held, numbers, shares, ways) for numbers, shares, ways in seen]
        nodes = [numbers for numbers, _, _ in kept_places]
        if not sum(part.size for part in nodes):
            return None
        slave_shares, master_shares = (
            sp.csr_array(sp.vstack([part[side] for _, part, _ in kept_places])) for side in range(2)
        )
        met = over_ranks(comm, _met(sides, held, overlaps[1], weighted, (nodes[0], nodes[1])))
        return (
            cls(slave_shares, master_shares, np.concatenate([ways for _, _, ways in kept_places]), met)
            if met.nnz
            else None
        )

    def distance(self, slave: Array, master: Array) -> Array:
        """Of both sides along the directions, from positions of their nodes, length, shape (k,)."""
        return np.einsum("kd,kd->k", self.direction, self.master @ master - self.slave @ slave)

    @property
    def rows(self) -> sp.csr_array:
        """The distance from displacements of the nodes of both sides, slave first, sparse, shape (k, d m)."""
        dim, both = self.direction.shape[1], sp.csr_array(sp.hstack((-self.slave, self.master)))
        entries = both.tocoo()
        values = entries.data[:, None] * self.direction[entries.row]
        places = np.repeat(entries.row, dim), (dim * entries.col[:, None] + np.arange(dim)).ravel()
        return sp.csr_array(sp.coo_array((values.ravel(), places), shape=(both.shape[0], dim * both.shape[1])))


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


def _kept(
    sides: tuple[PairSurface, PairSurface],
    held: HeldSides,
    nodes: Indices,
    shares: tuple[sp.csr_array, sp.csr_array],
    ways: Array,
) -> _Seen:
    """Those of them of which all nodes are held along the direction, one place for each node."""
    free: Array = np.zeros(nodes.size)
    for part, flags, loose in zip(shares, (held.slave, held.master), held.loose or (None, None), strict=True):
        entries = part.tocoo()
        moves = ~flags[entries.col]
        if loose is not None:
            along = np.einsum("mij,mj->mi", loose[entries.col], ways[entries.row])
            moves |= np.linalg.norm(along, axis=1) > SAME_DIRECTION
        np.maximum.at(free, entries.row, moves.astype(np.float64))
    fixed = np.flatnonzero(free == 0.0)
    chosen = fixed[np.unique(nodes[fixed], return_index=True)[1]]
    return nodes[chosen], (sp.csr_array(shares[0][chosen]), sp.csr_array(shares[1][chosen])), ways[chosen]


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
    """Shares of the nodes of facets in places, without what is round-off there, sparse, shape (m, count)."""
    rows = np.broadcast_to(np.arange(len(nodes))[:, None], values.shape)
    large = np.abs(values) > SAME_PLACE_IN_CELL
    entries = values[large], (rows[large], nodes[large])
    shares = sp.csr_array(sp.coo_array(entries, shape=(len(nodes), count)))
    return sp.csr_array(sp.diags_array(1.0 / np.asarray(shares.sum(axis=1)).ravel()) @ shares)


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
    less = (squares[0] <= squares[1])[pair]
    parts = []
    for side, nodes, values, chosen, numbers in (
        (slave, slave_nodes, shape, less, places[0]),
        (master, master_nodes, over, ~less, places[1]),
    ):
        products = np.einsum("pqi,pqj->pij", weighted * chosen[:, None, None], values)
        at = tuple(np.broadcast_to(rows, products.shape).ravel() for rows in (points[:, :, None], nodes[:, None]))
        integrals = sp.csr_array(sp.coo_array((products.ravel(), at), shape=(len(slave.x), len(side.x))))
        parts.append(sp.csr_array(integrals[:, numbers]))
    return sp.csr_array(sp.hstack(parts))
