"""Test functions of the contact points on the covered part of the slave side.

Dual functions psi = A_e N with A_e = diag(int N) (int N N^T)^-1 on the covered part of each facet:
(psi_i, N_k) = delta_ik (1, N_k), and they sum to one (Wohlmuth 2000; of partly covered facets Popp
et al. 2013).  Integrals of quadratic functions over a part of a facet may be negative: functions
that keep too little of their weight, or that belong to nodes that cannot carry a point, are added
to their neighbours.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from signorini_fx.arrays import Array, Flags, Ints, quotient
from signorini_fx.mechanics.pairs.pair_side import Overlap, PairSurface
from signorini_fx.tuned import KEPT_WEIGHT, NEGLIGIBLE, NOTHING_LEFT, SAME_NUMBER, WHOLE_WEIGHT

Pairs = tuple[Ints, Ints]


def constrained(movable: Array) -> Flags:
    """Return the flags of slave nodes that can move by less than one half, see ``Tested.movable``:
    held nodes opposite held master nodes.
    """
    return movable < 0.5 - SAME_NUMBER


def dual_coefficients(tests: Array, overlap: Overlap, count: int) -> Array:
    """Return A_e of each facet, shape (f, t, t), from the values of N at the points of the overlap;
    zero on uncovered facets.
    """
    products = (tests * overlap.weight[..., None]).swapaxes(1, 2) @ tests
    mass = np.zeros((count, *products.shape[1:]))
    np.add.at(mass, overlap.slave, products)
    covered = np.zeros(len(mass), dtype=bool)
    covered[overlap.slave] = True
    coefficients = np.zeros_like(mass)
    inverse = np.linalg.pinv(mass[covered], rcond=NOTHING_LEFT, hermitian=True)
    coefficients[covered] = mass[covered].sum(axis=2)[:, :, None] * inverse
    return coefficients


def carried(
    side: PairSurface, covered: Ints, weight: Array, unable: Flags
) -> tuple[Ints, sp.csr_array]:
    """Return the slave nodes that carry a point, shape (n,), and the share of each node's function
    in each point, sparse, shape (n, N); its columns sum to one.

    Args:
        side: the slave.
        covered: numbers of the facets that overlap the other side.
        weight: the integral of the function of each node, shape (N,).
        unable: flags of the nodes that cannot carry a point, shape (N,).
    """
    pairs, tested_nodes = _together(side, covered)
    unable = unable | side.without_area
    for threshold in (
        KEPT_WEIGHT + SAME_NUMBER,
        0.0,
    ):  # shares of simple meshes are this one but for round-off
        able = tested_nodes & ~unable & (weight > threshold * side.area)
        while able.any():
            nodes, shares = _taken_over(pairs, able)
            # What a point takes over may have a negative weight.
            weak = shares @ weight <= threshold * side.area[nodes]
            if not weak.any():
                return nodes, shares
            able[nodes[weak]] = False
    return np.zeros(0, dtype=np.int64), sp.csr_array((0, len(weight)))


def carried_evenly(
    side: PairSurface, covered: Ints, weight: Array, movable: Array
) -> tuple[Ints, sp.csr_array]:
    """Return nodes and shares as ``carried`` does, for a side that slides: the shares change
    continuously with the weights.

    While the covered share of its area falls between two thresholds, the function of a node at the
    rim turns gradually into a mean of its neighbours', so that its own contribution has vanished
    when it ceases to be a point.  The same applies to a supported node, by how much the opposite
    side is held.

    ``movable``: see ``Tested``; for the other arguments see ``carried``.
    """
    pairs, tested_nodes = _together(side, covered)
    able = tested_nodes & ~side.unable & ~side.without_area & (side.area > 0)
    share = quotient(weight, side.area, able)
    part = np.clip((share - KEPT_WEIGHT) / (WHOLE_WEIGHT - KEPT_WEIGHT), 0.0, 1.0)
    portion = np.where(able, part**2 * (3.0 - 2.0 * part), 0.0)
    portion *= movable**2 * (3.0 - 2.0 * movable)
    portion[portion <= SAME_NUMBER] = 0.0  # what keeps nothing but round-off passes all on
    while portion.any():
        nodes = np.flatnonzero(portion)
        taken = _absorbed(pairs, portion, nodes)
        mixed = _mixed(taken, nodes, (weight, movable[nodes] * weight[nodes]), portion[nodes])
        # What a point takes over may have a negative weight.
        weak = mixed @ weight <= 0.0
        if not weak.any():
            return nodes, mixed
        portion[nodes[weak]] = 0.0
    return carried(side, covered, weight, side.unable | constrained(movable))


def _absorbed(pairs: Pairs, portion: Array, nodes: Ints) -> sp.csr_array:
    """Return the shares of functions that ``nodes`` take over, shape (n, N); columns sum to one.

    Each node keeps its ``portion``, and adjacent nodes receive the rest: an absorbing Markov chain,
    solved directly.
    """
    to, of = pairs
    takes = portion + NEGLIGIBLE
    reached = portion > 0
    sums = np.bincount(of, takes[to], portion.size)
    while (further := ~reached & (np.bincount(of, reached[to], portion.size) > 0)).any():
        reached = reached | further
    chain = np.flatnonzero(reached & (portion < 1) & (sums > 0))
    number = np.full(portion.size, -1)
    number[chain] = np.arange(chain.size)
    alone = np.flatnonzero(number[nodes] < 0)
    if not chain.size:
        return _by_rows(np.ones(alone.size), alone, nodes, (nodes.size, portion.size))
    steps = takes[to] * (1.0 - portion[of]) / sums[of]
    inside = (number[of] >= 0) & (number[to] >= 0)
    rows = np.append(number[chain], number[of[inside]])
    columns = np.append(number[chain], number[to[inside]])
    entries = np.append(np.ones(chain.size), -steps[inside])
    on_itself = sp.csc_array((entries, (rows, columns)))
    # What is kept of what these hand on, in any number of steps, by the nodes that get any.
    outside = (number[of] >= 0) & (number[to] < 0) & (portion[to] > 0)
    stays = chain[portion[chain] > 0]
    taking, row = np.unique(np.append(to[outside], stays), return_inverse=True)
    handed = np.zeros((taking.size, chain.size))
    handed[row, number[np.append(of[outside], stays)]] = np.append(
        (portion[to] * steps)[outside], portion[stays]
    )
    values = splu(on_itself).solve(handed.T).T
    values[values <= SAME_NUMBER**2] = 0.0
    values /= values.sum(axis=0)
    of_keeping, of_chain = np.nonzero(values)
    rows = np.concatenate((alone, np.searchsorted(nodes, taking[of_keeping])))
    columns = np.concatenate((nodes[alone], chain[of_chain]))
    entries = np.concatenate((np.ones(alone.size), values[of_keeping, of_chain]))
    return _by_rows(entries, rows, columns, (nodes.size, portion.size))


def _by_rows(values: Array, rows: Ints, columns: Ints, shape: tuple[int, int]) -> sp.csr_array:
    """Return a sparse matrix from entries at distinct places; three times faster than the general
    constructor, which must look for duplicates.
    """
    order = np.argsort(rows, kind="stable")
    ends = np.append(0, np.bincount(rows, minlength=shape[0]).cumsum())
    return sp.csr_array((values[order], columns[order], ends), shape=shape)


def _mixed(
    shares: sp.csr_array, nodes: Ints, weights: tuple[Array, Array], portion: Array
) -> sp.csr_array:
    """Return the shares of the points, where those with a portion below one are mixed with the
    points that took over their remainder.
    """
    weak = np.flatnonzero(portion < 1.0)
    if not weak.size:
        return shares
    # Which points the function of each of them is in.
    to = shares.tocsc()[:, nodes[weak]].tocoo()
    others = to.row != weak[to.col]
    point = to.row[others]
    of = to.col[others]
    own = np.bincount(to.col[~others], to.data[~others], weak.size)
    remainder = np.maximum(1.0 - own, 0.0)
    given = (1.0 - portion[weak]) * weights[1][weak]
    given *= quotient(1.0, remainder, remainder > SAME_NUMBER)
    added = given[of] * to.data[others] * quotient(1.0, shares @ weights[0])[point]
    count = nodes.size
    added /= np.maximum(1.0, 2.0 * np.bincount(point, added, count))[point]
    kept = np.arange(count)
    rows = np.concatenate((kept, weak[of]))
    columns = np.concatenate((kept, point))
    entries = np.concatenate((1.0 - np.bincount(point, added, count), added))
    return _by_rows(entries, rows, columns, (count, count)) @ shares


def extended(side: PairSurface, nodes: Ints, values: Array) -> Array:
    """Return values at all nodes with test functions, shape (N, k), extended ring by ring from some
    nodes as means over neighbours; zero at nodes that no ring reaches.

    ``nodes``: ascending; ``values``: at these nodes, shape (n, k).
    """
    (to, of), _ = _together(side, np.arange(len(side.nodes)))
    extension: Array = np.zeros((len(side.x), values.shape[1]))
    known: Flags = np.zeros(len(side.x), dtype=bool)
    extension[nodes] = values
    known[nodes] = True
    while (into := known[of] & ~known[to]).any():
        number = np.bincount(to[into], minlength=known.size)
        np.add.at(extension, to[into], extension[of[into]] / number[to[into], None])
        known = known | (number > 0)
    return extension


def _together(side: PairSurface, facets: Ints) -> tuple[Pairs, Flags]:
    """Return the pairs of different nodes that have test functions on a common facet, in both
    orders, ascending, and the flags of nodes with a test function on any of the facets, shape (N,).
    """
    tests = side.points[facets]
    count = len(side.x)
    tested_nodes = np.zeros(count, dtype=bool)
    tested_nodes[tests] = True
    first, second = np.divmod(np.unique(tests[:, :, None] * count + tests[:, None]), count)
    others = first != second
    return (first[others], second[others]), tested_nodes


def _taken_over(pairs: Pairs, able: Flags) -> tuple[Ints, sp.csr_array]:
    """Return the nodes that carry a point, and the shares in which they take over the functions of
    the other nodes, ring by ring.
    """
    to, of = pairs
    nodes = np.flatnonzero(able)
    done = able
    shares = sp.csr_array(
        (np.ones(nodes.size), nodes, np.arange(nodes.size + 1)), shape=(nodes.size, able.size)
    )
    while (into := done[to] & ~done[of]).any():
        number = np.bincount(of[into], minlength=able.size)
        shares = shares + shares @ _by_rows(
            1.0 / number[of[into]], to[into], of[into], (able.size, able.size)
        )
        done = done | (number > 0)
    return nodes, shares
