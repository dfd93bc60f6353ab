"""The independent check on which nodes of a sliding side carry points, and on how these take over the functions of
others.

The rule is that of the method, evaluated by other means.  A node keeps a portion of its function, by the share of its
area that sees the other side, and hands the rest to those that it shares a facet with, in proportion to their portions
and a little more, which do likewise: what each ends with solves one system of linear equations, node by node.  What a
node has kept of others' is mixed with what these have become, in proportion to what it lacks.  If a function has no
area left it keeps none of itself, and where no portion is left all nodes with enough area, or with any, take equal
shares of those beside them, ring by ring.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from signorini_fx.tuned import KEPT_WEIGHT, MOSTLY_HELD, PASSED_ON, SAME_NUMBER, WHOLE_WEIGHT

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


class TestedNodes(NamedTuple):
    """The nodes of a side with test functions.

    Attributes:
        facets: those that see the other side, nodes with functions, shape (f, t).
        all_facets: also the others, shape (g, t).
        area: undeformed, of the function of each node, shape (N,).
        seen: of it what sees the other side, shape (N,).
        unable: nodes that carry no point, shape (N,).
        movable: by which share the nodes that supports hold see what can move, of others one, shape (N,).
    """

    facets: Numbers
    all_facets: Numbers
    area: Array
    seen: Array
    unable: Flags
    movable: Array


class TakenFunctions(NamedTuple):
    """What points have of the functions of nodes.

    Attributes:
        nodes: that carry points, ascending, shape (n,).
        shares: of the function of each node in each point, scipy sparse, shape (n, N).
        portion: by how much each is its own, shape (n,).
        means: of points for nodes of facets that see the other side and carry none, by nodes.
    """

    nodes: Numbers
    shares: Any
    portion: Array
    means: dict[int, tuple[Numbers, Array]]

    def ways(self, side: TestedNodes, nodal: Array, own: Array, opposite: Array) -> Array:
        """Half-way between the normals of both sides, not of length one, at the nodes of the side, shape (N, d).

        Args:
            side: its nodes.
            nodal: normals there, shape (N, d).
            own: mean normals of the side at the points, shape (n, d).
            opposite: of the other side, likewise.
        """
        of_other, reached = np.zeros_like(nodal), np.zeros(len(nodal), dtype=bool)
        of_other[self.nodes], reached[self.nodes] = opposite, True
        for node, (points, parts) in self.means.items():
            of_other[node], reached[node] = parts @ opposite[points], True
        of_other = spread(side.all_facets, of_other, reached)
        ways = nodal - of_other
        portion = self.portion[:, None]
        ways[self.nodes] = portion * own + (1.0 - portion) * nodal[self.nodes] - opposite
        return ways


def taken_functions(side: TestedNodes) -> TakenFunctions:
    """Those of a side."""
    count = side.area.size
    tested = np.zeros(count, dtype=bool)
    tested[side.facets] = True
    neighbours = _neighbours(side.facets, count)
    portion = np.zeros(count)
    for node in np.flatnonzero(tested & ~side.unable & (side.area > 0.0)):
        part = min(max((side.seen[node] / side.area[node] - KEPT_WEIGHT) / (WHOLE_WEIGHT - KEPT_WEIGHT), 0.0), 1.0)
        share = side.movable[node]
        smooth = (3.0 * part**2 - 2.0 * part**3) * (3.0 * share**2 - 2.0 * share**3)
        portion[node] = smooth if smooth > SAME_NUMBER else 0.0
    while portion.any():
        shares_of_all = _shares_of_all(portion, tested, neighbours)
        nodes = np.flatnonzero(portion)
        shares = sp.csr_array(shares_of_all[nodes])
        columns = shares_of_all.tocsc()
        means = {
            int(node): (np.searchsorted(nodes, columns[:, [node]].indices), columns[:, [node]].data)
            for node in np.flatnonzero(tested & (portion == 0.0))
        }
        mixed = _mixed(shares, nodes, portion, side.seen, side.movable)
        empty = mixed @ side.seen <= 0.0
        if not empty.any():
            return TakenFunctions(nodes, mixed, portion[nodes], {k: v for k, v in means.items() if v[0].size})
        portion[nodes[empty]] = 0.0
    return _by_rings(side, tested, neighbours)


def carried_by_rings(side: TestedNodes) -> TakenFunctions:
    """Those of a side that does not slide: all nodes with enough area, or with any, take equal shares of those beside
    them, ring by ring.
    """
    tested = np.zeros(side.area.size, dtype=bool)
    tested[side.facets] = True
    return _by_rings(side, tested, _neighbours(side.facets, side.area.size))


def movable(held: tuple[Flags, Flags], met: Any, of_places: Array | None = None) -> Array:
    """By which share held nodes of the slave see free nodes of the master, there and around, and 1 at its others, shape
    (N,).

    Args:
        held: nodes of both sides.
        met: integrals of the functions of the slave times those of the master, scipy sparse, shape (N, M).
        of_places: shares by which the places of nodes of the slave are held, zero where there are none, shape (N,);
            None: they do not count.
    """
    entries = met.tocoo()
    total = np.bincount(entries.row, entries.data, minlength=met.shape[0])
    of_free = np.bincount(entries.row, entries.data * ~held[1][entries.col], minlength=met.shape[0])
    share = np.where(total > 0.0, of_free / np.where(total > 0.0, total, 1.0), 1.0)
    share = share if of_places is None else np.minimum(share, 1.0 - of_places)
    return np.where(held[0], np.clip(share, 0.0, 1.0), 1.0)


def times_rows(factors: Array, matrix: Any) -> Any:
    """Rows of a sparse matrix times factors, in the same pattern."""
    entries = np.repeat(factors, np.diff(matrix.indptr)) * matrix.data
    return sp.csr_array((entries, matrix.indices, matrix.indptr), shape=matrix.shape)


def times_columns(matrix: Any, factors: Array) -> Any:
    """Columns of a sparse matrix times factors, likewise."""
    return sp.csr_array((matrix.data * factors[matrix.indices], matrix.indices, matrix.indptr), shape=matrix.shape)


def _neighbours(facets: Numbers, count: int) -> Any:
    """One where two nodes, not the same, are on a facet, scipy sparse, shape (N, N)."""
    pairs = np.concatenate(
        [facets[:, [j, k]] for j in range(facets.shape[1]) for k in range(facets.shape[1]) if j != k]
    )
    pairs = np.unique(pairs, axis=0)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    return sp.csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))


def _shares_of_all(portion: Array, tested: Flags, neighbours: Any) -> Any:
    """What nodes end with of the functions of all, columns with the sum one, scipy sparse, shape (N, N)."""
    count = portion.size
    takes = np.where(tested, portion + PASSED_ON, 0.0)
    able = np.array(portion > 0.0)
    while True:  # which nodes are joined to one that keeps something
        wider = able | ((neighbours @ able.astype(np.float64)) > 0.0)
        if (wider == able).all():
            break
        able = wider
    total = neighbours @ takes
    hands = np.where(tested & able & (total > 0.0), 1.0 - portion, 0.0)
    factors = np.divide(hands, total, out=np.zeros(count), where=total > 0.0)
    handed = times_columns(times_rows(takes, neighbours), factors)
    columns = np.flatnonzero(hands > 0.0)
    diagonal = np.where(hands > 0.0, 0.0, portion)
    shares = sp.csr_array((diagonal, np.arange(count), np.arange(count + 1)), shape=(count, count))
    if columns.size:
        within = sp.csc_array(sp.eye_array(columns.size) - handed[columns][:, columns])
        targets = times_rows(portion, handed)[:, columns]  # what comes to rest in one step
        stays = np.flatnonzero((hands == 0.0) & (portion > 0.0))
        keepers = columns[portion[columns] > 0.0]
        rows = [targets[stays].toarray()]
        unit = np.zeros((keepers.size, columns.size))
        unit[np.arange(keepers.size), np.searchsorted(columns, keepers)] = portion[keepers]
        rows.append(unit)
        starts, resting = np.concatenate(rows), np.concatenate((stays, keepers))
        reaching = np.flatnonzero(starts.any(axis=1))
        if reaching.size:
            ends = spsolve(within.T.tocsc(), starts[reaching].T.copy()).reshape(columns.size, reaching.size)
            of_column, of_row = np.nonzero(ends > SAME_NUMBER**2)
            places = resting[reaching[of_row]], columns[of_column]
            shares = shares + sp.csr_array((ends[of_column, of_row], places), shape=(count, count))
    sums = np.asarray(shares.sum(axis=0)).ravel()
    inverse = np.divide(1.0, sums, out=np.zeros(count), where=sums > 0.0)
    shares = times_columns(shares, inverse)
    shares.eliminate_zeros()
    return shares


def _mixed(shares: Any, nodes: Numbers, portion: Array, seen: Array, movable: Array) -> Any:
    """The shares with those of points that are not all their own mixed with those that took over the rest of them."""
    rows = np.flatnonzero(portion[nodes] < 1.0)
    if not rows.size:
        return shares
    sizes, taken = shares @ seen, sp.lil_array((nodes.size, nodes.size))
    of_nodes = shares.tocsc()
    for row in rows:
        column = of_nodes[:, [nodes[row]]].toarray().ravel()
        rest = 1.0 - column[row]
        column[row] = 0.0
        if rest > SAME_NUMBER:
            takers = np.flatnonzero((column != 0.0) & (sizes > 0.0))
            lacking = (1.0 - portion[nodes[row]]) * movable[nodes[row]] * seen[nodes[row]]
            taken[row, takers] = lacking * column[takers] / rest / sizes[takers]
    matrix = sp.csr_array(taken)
    matrix = times_columns(matrix, 1.0 / np.maximum(1.0, 2.0 * np.asarray(matrix.sum(axis=0)).ravel()))
    remainder = 1.0 - np.asarray(matrix.sum(axis=0)).ravel()
    return sp.csr_array(matrix @ shares + times_rows(remainder, shares))


def _by_rings(side: TestedNodes, tested: Flags, neighbours: Any) -> TakenFunctions:
    """Equal shares, where no node keeps a portion."""
    count = side.area.size
    movable = side.movable >= 1.0 - MOSTLY_HELD - SAME_NUMBER  # a half may be more or less by round-off
    for least in (KEPT_WEIGHT + SAME_NUMBER, 0.0):
        able = tested & ~side.unable & movable & (side.seen > least * side.area)
        while able.any():
            nodes = np.flatnonzero(able)
            shares = sp.csr_array(sp.eye_array(count))[nodes]
            reached = able.copy()
            while (tested & ~reached).any():
                number = neighbours @ reached.astype(np.float64)
                ring = tested & ~reached & (number > 0.0)
                if not ring.any():
                    break
                mean = sp.diags_array(np.divide(1.0, number, out=np.zeros(count), where=ring))
                shares = sp.csr_array(shares + shares @ sp.diags_array(reached.astype(np.float64)) @ neighbours @ mean)
                reached |= ring
            empty = shares @ side.seen <= least * side.area[nodes]
            if not empty.any():
                columns = shares.tocsc()
                taken = np.flatnonzero(~able & (np.diff(columns.indptr) > 0))
                ends = [slice(columns.indptr[node], columns.indptr[node + 1]) for node in taken]
                means = {
                    int(node): (columns.indices[part].astype(np.int64), columns.data[part])
                    for node, part in zip(taken, ends, strict=True)
                }
                return TakenFunctions(nodes, shares, np.ones(nodes.size), means)
            able[nodes[empty]] = False
    return TakenFunctions(np.zeros(0, dtype=np.int64), sp.csr_array((0, count)), np.zeros(0), {})


def spread(facets: Numbers, values: Array, reached: Flags) -> Array:
    """Values at some nodes, and at others the means of those beside them, ring by ring, shape (N, d)."""
    neighbours, values, reached = _neighbours(facets, reached.size), values.copy(), reached.copy()
    while True:
        number = neighbours @ reached.astype(np.float64)
        ring = np.flatnonzero(~reached & (number > 0.0))
        if not ring.size:
            return values
        values[ring] = (neighbours @ np.where(reached[:, None], values, 0.0))[ring] / number[ring, None]
        reached[ring] = True
