"""Test functions of the contact points on the covered part of the slave side.

Dual functions psi = A_e N with A_e = diag(int N) (int N N^T)^-1 on the covered part of each facet: (psi_i, N_k) =
delta_ik (1, N_k), and they sum to one (Wohlmuth 2000; of partly covered facets Popp et al. 2013).  Integrals of
quadratic functions over a part of a facet may be negative: functions that keep too little of their weight, or that
belong to nodes that cannot carry a point, are added to their neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from signorini_fx.mechanics.pairs.pair_side import Overlap, PairSurface
from signorini_fx.mechanics.pairs.sparse_maps import scaled_columns, scaled_rows
from signorini_fx.tuned import KEPT_WEIGHT, MOSTLY_HELD, NEGLIGIBLE, NOTHING_LEFT, SAME_NUMBER, WHOLE_WEIGHT

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class HeldSides:
    """Nodes of both sides that supports hold along their normals.

    Contact is where at least one side can move: both sides end where facets of which all nodes are held lie over each
    other.  Anywhere else a held node of the slave carries a point as any other: its function moves the master.  Where
    most of the master that it sees there is held, too, nothing can move it, and its neighbours take over its function.

    Attributes:
        slave: shape (N,).
        master: shape (M,).
    """

    slave: Flags
    master: Flags

    def still(self, slave: Indices, master: Indices) -> Flags:
        """Where nothing can move: all nodes of both facets over each other are held, shape (p,).

        Args:
            slave: the nodes of the facets of the slave, shape (p, k).
            master: those of the facets over them, shape (p, l).
        """
        return np.asarray(self.slave[slave].all(axis=1) & self.master[master].all(axis=1))

    def movable(self, met: Any) -> Array:
        """By which share nodes of the slave are what can move, or see that, shape (N,).

        Args:
            met: integrals of the functions of the nodes of the slave times those of the master, sparse or dense, shape
                (N, M).
        """
        of_held, weight = (np.asarray(met @ flags).ravel() for flags in (self.master * 1.0, np.ones(self.master.size)))
        # On a part of a facet a quadratic function may have a negative weight, which says nothing.
        seen = np.divide(of_held, weight, out=np.zeros_like(weight), where=weight > 0.0)
        return np.where(self.slave, 1.0 - np.clip(seen, 0.0, 1.0), 1.0)


def constrained(movable: Array) -> Flags:
    """Nodes that are held over what is held of the master, by more than half; see ``HeldSides.movable``."""
    return np.asarray(movable < 1.0 - MOSTLY_HELD - SAME_NUMBER)


def dual_coefficients(side: PairSurface, overlap: Overlap) -> Array:
    """A_e of each facet, shape (f, t, t); zero where it is not covered."""
    tests = side.tests.values(overlap.at)
    products = np.einsum("pq,pqi,pqj->pij", overlap.weight, tests, tests)
    mass = np.zeros((len(side.nodes), *products.shape[1:]))
    np.add.at(mass, overlap.slave, products)
    covered = np.zeros(len(mass), dtype=bool)
    covered[overlap.slave] = True
    coefficients = np.zeros_like(mass)
    inverse = np.linalg.pinv(mass[covered], rcond=NOTHING_LEFT, hermitian=True)
    coefficients[covered] = mass[covered].sum(axis=2)[:, :, None] * inverse
    return coefficients


def carried(
    side: PairSurface, covered: Indices, weight: Array, unable: npt.NDArray[np.bool_]
) -> tuple[Indices, sp.csr_array]:
    """Which nodes carry a point, and how these take over the functions of the others.

    Args:
        side: the slave.
        covered: its facets that meet the other side.
        weight: the integral of the function of each node, shape (N,).
        unable: nodes that cannot carry a point, shape (N,).

    Returns:
        The nodes, shape (n,), and the share of the function of each node in each point, columns with the sum one,
        sparse, shape (n, N).
    """
    together = _Beside.of(side, covered)
    tested_nodes, beside = together.tested_nodes, together.matrix
    unable = unable | side.without_area
    for threshold in (KEPT_WEIGHT + SAME_NUMBER, 0.0):  # shares of simple meshes are this one but for round-off
        able = tested_nodes & ~unable & (weight > threshold * side.area)
        while able.any():
            nodes, shares = _taken_over(beside, tested_nodes, able)
            # What a point takes over may have a negative weight.
            weak = shares @ weight <= threshold * side.area[nodes]
            if not weak.any():
                return nodes, shares
            able[nodes[weak]] = False
    return np.zeros(0, dtype=np.int64), sp.csr_array((0, len(weight)))


def carried_evenly(
    side: PairSurface, covered: Indices, weight: Array, unable: Flags, movable: Array
) -> tuple[Indices, sp.csr_array]:
    """The same of a side that slides, evenly as weights change; ``movable``: see ``HeldSides``.

    Between two shares of its area the function of a node at the rim turns into a mean of those beside it, so that what
    it adds to their conditions vanishes before it is no point any more.  So does that of a node that supports hold, by
    how much of the other side is held there, too.
    """
    beside = _Beside.of(side, covered)
    tested_nodes = beside.tested_nodes
    able = tested_nodes & ~unable & ~side.without_area & (side.area > 0)
    share = np.divide(weight, side.area, out=np.zeros_like(weight), where=able)
    part = np.clip((share - KEPT_WEIGHT) / (WHOLE_WEIGHT - KEPT_WEIGHT), 0.0, 1.0)
    portion = np.where(able, part**2 * (3.0 - 2.0 * part), 0.0)
    portion *= movable**2 * (3.0 - 2.0 * movable)
    portion[portion <= SAME_NUMBER] = 0.0  # what keeps nothing but round-off passes all on
    while portion.any():
        nodes = np.flatnonzero(portion)
        taken = _absorbed(beside, tested_nodes, portion, nodes)
        mixed = _mixed(taken, nodes, (weight, movable[nodes] * weight[nodes]), portion[nodes])
        # What a point takes over may have a negative weight.
        weak = mixed @ weight <= 0.0
        if not weak.any():
            return nodes, mixed
        portion[nodes[weak]] = 0.0
    return carried(side, covered, weight, unable | constrained(movable))


def _absorbed(beside: _Beside, tested_nodes: Flags, portion: Array, nodes: Indices) -> sp.csr_array:
    """How nodes take over functions: each keeps its own share, and passes on the rest to those beside it, which do
    likewise; columns with the sum one, sparse, shape (n, N).
    """
    count = tested_nodes.size
    takes = np.where(tested_nodes, portion + NEGLIGIBLE, 0.0)
    row, column, piece = beside.row, beside.column, beside.piece
    sums = np.bincount(column, takes[row], minlength=count)
    reached = np.bincount(piece, portion) > 0
    passing = np.where(tested_nodes & reached[piece] & (sums > 0), 1.0 - portion, 0.0)
    step = takes[row] * np.divide(passing, sums, out=np.zeros(count), where=sums > 0)[column]
    own = np.where(passing > 0, 0.0, portion)
    steps = sp.csr_array((step, (row, column)), shape=(count, count))
    shares = sp.csr_array(sp.diags_array(own))
    chain = np.flatnonzero(passing)
    if chain.size:  # what is kept of what these hand on, in any number of steps
        handed = (scaled_rows(own, steps) + sp.diags_array(portion - own))[:, chain]
        keeping = np.flatnonzero(np.diff(handed.indptr))
        within = sp.csc_array((sp.eye_array(chain.size) - steps[chain][:, chain]).T)
        values = splu(within).solve(handed[keeping].toarray().T).T
        of_keeping, of_chain = np.nonzero(values > SAME_NUMBER**2)
        places = keeping[of_keeping], chain[of_chain]
        shares = shares + sp.csr_array((values[of_keeping, of_chain], places), shape=(count, count))
    columns = np.asarray(shares.sum(axis=0)).ravel()
    inverse = np.divide(1.0, columns, out=np.zeros(count), where=columns > 0)
    return scaled_columns(shares, inverse)[nodes]


def _mixed(shares: sp.csr_array, nodes: Indices, weights: tuple[Array, Array], portion: Array) -> sp.csr_array:
    """The shares of points that are not all their own with those of the points that took over the rest of them."""
    weak = np.flatnonzero(portion < 1.0)
    if not weak.size:
        return shares
    number = np.full(shares.shape[1], -1)
    number[nodes[weak]] = np.arange(weak.size)
    of_weak = np.flatnonzero(number[shares.indices] >= 0)
    point = np.repeat(np.arange(nodes.size), np.diff(shares.indptr))[of_weak]
    to = np.zeros((weak.size, nodes.size))  # which points the function of each of them is in
    to[number[shares.indices[of_weak]], point] = shares.data[of_weak]
    at = np.arange(weak.size), weak
    remainder = np.maximum(1.0 - to[at], 0.0)
    to[at] = 0.0
    mean = to * np.divide(1.0, remainder, out=np.zeros_like(remainder), where=remainder > SAME_NUMBER)[:, None]
    sizes = shares @ weights[0]
    added = ((1.0 - portion[weak]) * weights[1][weak])[:, None] * mean
    added *= np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0)
    added /= np.maximum(1.0, 2.0 * added.sum(axis=0))
    kept = 1.0 - added.sum(axis=0)
    (row, column), own = np.nonzero(added), np.flatnonzero(kept)
    entries = np.concatenate((kept[own], added[row, column]))
    places = np.concatenate((own, weak[row])), np.concatenate((own, column))
    return sp.csr_array(sp.csr_array((entries, places), shape=(nodes.size, nodes.size)) @ shares)


def extended(side: PairSurface, nodes: Indices, values: Array) -> Array:
    """Values at some nodes, ascending, shape (n, k), and at all others with test functions the means of those beside
    them, ring by ring, shape (N, k); zero where no ring arrives.

    Args:
        side: with the nodes.
        nodes: some of them.
        values: of these.
    """
    beside = _Beside.of(side, np.arange(len(side.nodes))).matrix
    done, extension = np.zeros(len(side.x)), np.zeros((len(side.x), values.shape[1]))
    done[nodes], extension[nodes] = 1.0, values
    while True:
        count = beside @ done
        ring = np.flatnonzero((count > 0) & (done == 0))
        if not ring.size:
            return extension
        extension[ring] = (beside @ extension)[ring] / count[ring, None]
        done[ring] = 1.0


@dataclass(frozen=True)
class _Beside:
    """Which nodes of a side are together on some facets.

    Attributes:
        tested_nodes: which nodes have test functions on them, shape (N,).
        matrix: one where two nodes, or the same, are on one of them, sparse, shape (N, N).
        row, column: two different nodes of its entries, row by row, shape (e,).
        piece: number of the connected piece that each node is in, shape (N,).
    """

    tested_nodes: Flags
    matrix: sp.csr_array
    row: Indices
    column: Indices
    piece: Indices

    @classmethod
    def of(cls, side: PairSurface, facets: Indices) -> _Beside:
        """Those of some facets."""
        tests, count = side.points[facets], len(side.area)
        tested_nodes = np.zeros(count, dtype=bool)
        tested_nodes[tests] = True
        rows = np.repeat(tests, tests.shape[1], axis=1).ravel()
        columns = np.tile(tests, (1, tests.shape[1])).ravel()
        beside = sp.csr_array((np.ones(rows.size), (rows, columns)), shape=(count, count))
        beside.data[:] = 1.0
        row = np.repeat(np.arange(count), np.diff(beside.indptr))
        apart = np.flatnonzero(row != beside.indices)
        _, piece = connected_components(beside, directed=False)
        return cls(tested_nodes, beside, row[apart], beside.indices[apart].astype(np.int64), piece)


def _taken_over(
    beside: sp.csr_array, tested_nodes: npt.NDArray[np.bool_], able: npt.NDArray[np.bool_]
) -> tuple[Indices, sp.csr_array]:
    """Nodes that carry a point, and how they take over the functions of others, ring by ring."""
    nodes, count = np.flatnonzero(able), tested_nodes.size
    shares = sp.csr_array((np.ones(nodes.size), (np.arange(nodes.size), nodes)), shape=(nodes.size, count))
    done, remaining = able.copy(), tested_nodes & ~able
    while remaining.any():
        done_diagonal = sp.diags_array(done.astype(np.float64))
        known_beside = sp.csr_array(done_diagonal @ beside @ sp.diags_array(remaining.astype(np.float64)))
        number = np.asarray(known_beside.sum(axis=0)).ravel()
        reached = remaining & (number > 0)
        if not reached.any():
            break
        mean = sp.diags_array(np.divide(1.0, number, out=np.zeros(count), where=reached))
        shares = sp.csr_array(shares + shares @ known_beside @ mean)
        done, remaining = done | reached, remaining & ~reached
    return nodes, shares
