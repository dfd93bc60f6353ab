"""Test functions of the contact points on the covered part of the slave side.

Dual functions psi = A_e N with A_e = diag(int N) (int N N^T)^-1 on the covered part of each facet: (psi_i, N_k) =
delta_ik (1, N_k), and they sum to one (Wohlmuth 2000; of partly covered facets Popp et al. 2013).  Integrals of
quadratic functions over a part of a facet may be negative: functions that keep too little of their weight, or that
belong to nodes that cannot carry a point, are added to their neighbours.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from signorini_fx.mechanics.pairs.pair_side import Overlap, PairSurface, scaled_columns, scaled_rows
from signorini_fx.tuned import KEPT_WEIGHT, NEGLIGIBLE, NOTHING_LEFT, SAME_NUMBER, WHOLE_WEIGHT

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


def constrained(movable: Array) -> Flags:
    """Nodes of the slave that are held over what is held of the master, by more than half; see ``Tested.movable``."""
    return np.asarray(movable < 0.5 - SAME_NUMBER)


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
    """Which nodes of the slave, of which some are ``unable``, shape (N,), carry a point, shape (n,), and the share of
    the function of each node in each point, columns with the sum one, sparse, shape (n, N), from the facets that are
    ``covered`` and the integral of the function of each node, shape (N,).
    """
    together = _together(side, covered)
    tested_nodes = together.diagonal() > 0
    unable = unable | side.without_area
    for threshold in (KEPT_WEIGHT + SAME_NUMBER, 0.0):  # shares of simple meshes are this one but for round-off
        able = tested_nodes & ~unable & (weight > threshold * side.area)
        while able.any():
            nodes, shares = _taken_over(together, able)
            # What a point takes over may have a negative weight.
            weak = shares @ weight <= threshold * side.area[nodes]
            if not weak.any():
                return nodes, shares
            able[nodes[weak]] = False
    return np.zeros(0, dtype=np.int64), sp.csr_array((0, len(weight)))


def carried_evenly(side: PairSurface, covered: Indices, weight: Array, movable: Array) -> tuple[Indices, sp.csr_array]:
    """The same of a side that slides, evenly as weights change; ``movable``: see ``Tested``.

    Between two shares of its area the function of a node at the rim turns into a mean of those beside it, so that what
    it adds to their conditions vanishes before it is no point any more.  So does that of a node that supports hold, by
    how much of the other side is held there, too.
    """
    together = _together(side, covered)
    tested_nodes = together.diagonal() > 0
    able = tested_nodes & ~side.unable & ~side.without_area & (side.area > 0)
    share = np.divide(weight, side.area, out=np.zeros_like(weight), where=able)
    part = np.clip((share - KEPT_WEIGHT) / (WHOLE_WEIGHT - KEPT_WEIGHT), 0.0, 1.0)
    portion = np.where(able, part**2 * (3.0 - 2.0 * part), 0.0)
    portion *= movable**2 * (3.0 - 2.0 * movable)
    portion[portion <= SAME_NUMBER] = 0.0  # what keeps nothing but round-off passes all on
    while portion.any():
        nodes = np.flatnonzero(portion)
        taken = _absorbed(together, portion, nodes)
        mixed = _mixed(taken, nodes, (weight, movable[nodes] * weight[nodes]), portion[nodes])
        # What a point takes over may have a negative weight.
        weak = mixed @ weight <= 0.0
        if not weak.any():
            return nodes, mixed
        portion[nodes[weak]] = 0.0
    return carried(side, covered, weight, side.unable | constrained(movable))


def _absorbed(together: sp.csr_array, portion: Array, nodes: Indices) -> sp.csr_array:
    """How nodes take over functions: each keeps a share, nodes beside it get the rest; columns of sum one, (n, N)."""
    tested_nodes = together.diagonal() > 0
    takes = np.where(tested_nodes, portion + NEGLIGIBLE, 0.0)
    others = sp.csr_array(together - sp.diags_array(together.diagonal()))
    sums = np.asarray(others.T @ takes)
    piece = connected_components(together, directed=False)[1]
    reached = np.bincount(piece, portion) > 0
    passing = np.where(tested_nodes & reached[piece] & (sums > 0), 1.0 - portion, 0.0)
    handing = np.divide(passing, sums, out=np.zeros(sums.size), where=sums > 0)
    steps = scaled_columns(scaled_rows(takes, others), handing)
    own = np.where(passing > 0, 0.0, portion)
    shares = sp.csr_array(sp.diags_array(own))
    chain = np.flatnonzero(passing)
    if chain.size:  # what is kept of what these hand on, in any number of steps
        handed = (scaled_rows(own, steps) + sp.diags_array(portion - own))[:, chain]
        keeping = np.flatnonzero(np.diff(handed.indptr))
        within = sp.csc_array((sp.eye_array(chain.size) - steps[chain][:, chain]).T)
        values = splu(within).solve(handed[keeping].toarray().T).T
        of_keeping, of_chain = np.nonzero(values > SAME_NUMBER**2)
        places = keeping[of_keeping], chain[of_chain]
        shares = shares + sp.csr_array((values[of_keeping, of_chain], places), shape=together.shape)
    columns = np.asarray(shares.sum(axis=0)).ravel()
    inverse = np.divide(1.0, columns, out=np.zeros(columns.size), where=columns > 0)
    return scaled_columns(shares, inverse)[nodes]


def _mixed(shares: sp.csr_array, nodes: Indices, weights: tuple[Array, Array], portion: Array) -> sp.csr_array:
    """The shares of points that are not all their own with those of the points that took over the rest of them."""
    weak = np.flatnonzero(portion < 1.0)
    if not weak.size:
        return shares
    to = shares[:, nodes[weak]].T.toarray()  # which points the function of each of them is in
    at = np.arange(weak.size), weak
    remainder = np.maximum(1.0 - to[at], 0.0)
    to[at] = 0.0
    mean = to * np.divide(1.0, remainder, out=np.zeros_like(remainder), where=remainder > SAME_NUMBER)[:, None]
    sizes = shares @ weights[0]
    added = ((1.0 - portion[weak]) * weights[1][weak])[:, None] * mean
    added *= np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0)
    added /= np.maximum(1.0, 2.0 * added.sum(axis=0))
    kept = 1.0 - added.sum(axis=0)
    mixing = sp.diags_array(kept) + sp.eye_array(nodes.size, format="csc")[:, weak] @ sp.csr_array(added)
    return sp.csr_array(mixing @ shares)


def extended(side: PairSurface, nodes: Indices, values: Array) -> Array:
    """Values at some nodes, ascending, shape (n, k), and at all others with test functions the means of those beside
    them, ring by ring, shape (N, k); zero where no ring arrives.
    """
    together = _together(side, np.arange(len(side.nodes)))
    extension, known = np.zeros((len(side.x), values.shape[1])), np.zeros(len(side.x), dtype=bool)
    extension[nodes], known[nodes] = values, True
    ring = known
    while ring.any():
        number = together @ known.astype(np.float64)
        ring = (number > 0) & ~known
        extension[ring] = (together @ extension)[ring] / number[ring, None]
        known = known | ring
    return extension


def _together(side: PairSurface, facets: Indices) -> sp.csr_array:
    """One where two nodes of a side, or the same, have test functions on one of some facets, sparse, shape (N, N)."""
    tests, count = side.points[facets], len(side.area)
    rows = np.repeat(tests, tests.shape[1], axis=1).ravel()
    columns = np.tile(tests, (1, tests.shape[1])).ravel()
    together = sp.csr_array((np.ones(rows.size), (rows, columns)), shape=(count, count))
    together.data[:] = 1.0
    return together


def _taken_over(together: sp.csr_array, able: Flags) -> tuple[Indices, sp.csr_array]:
    """Nodes that carry a point, and how they take over the functions of others, ring by ring."""
    nodes, count = np.flatnonzero(able), able.size
    shares = sp.csr_array((np.ones(nodes.size), (np.arange(nodes.size), nodes)), shape=(nodes.size, count))
    done, ring = able, able
    while ring.any():
        beside_done = scaled_rows(done.astype(np.float64), together)
        number = np.asarray(beside_done.sum(axis=0)).ravel()
        ring = (number > 0) & ~done
        mean = np.divide(1.0, number, out=np.zeros(count), where=ring)
        shares = sp.csr_array(shares + shares @ scaled_columns(beside_done, mean))
        done = done | ring
    return nodes, shares
