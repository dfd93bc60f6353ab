"""The order in which condensing eliminates the interior."""

import numpy as np
import pytest
import scipy.sparse as sp
from petsc4py import PETSc

from signorini_fx.algebra.linalg import elimination_order as order
from signorini_fx.algebra.linalg import partial_factor


def grid(shape, degree=1):
    """Graph and positions of the nodes of a rectangle of quadrilaterals: those of a cell couple."""
    sides = [degree * cells + 1 for cells in shape]
    number = np.arange(np.prod(sides)).reshape(sides)
    cells = [
        number[degree * i : degree * i + degree + 1, degree * j : degree * j + degree + 1].ravel()
        for i in range(shape[0])
        for j in range(shape[1])
    ]
    row, column = (np.concatenate([f(cell, cell.size) for cell in cells]) for f in (np.repeat, np.tile))
    graph = sp.csr_array((np.ones(row.size), (row, column)), shape=(number.size,) * 2)
    return graph, np.stack(np.unravel_index(np.arange(number.size), sides), axis=-1) / degree


def operations(graph, numbers):
    """Of a factorisation in this order, by elimination of one node after another: sum of the squares of its columns."""
    coupled = graph[numbers][:, numbers].toarray() != 0
    total = 0
    for k in range(len(coupled)):
        later = k + 1 + np.flatnonzero(coupled[k, k + 1 :])
        coupled[np.ix_(later, later)] = True
        total += later.size**2
    return total


@pytest.mark.parametrize("degree", [1, 2])
def test_separators_of_rectangles(degree):
    """Two rectangles that do not couple: each is halved by a line near its middle, whatever the round-off."""
    graph, x = grid((8, 3), degree)
    noise = np.random.default_rng(0).uniform(-1e-15, 1e-15, (2 * len(x), 2))
    positions = np.concatenate((x, x + np.array([3.0, 7.0]))) + noise
    numbers = order._nested_dissection(sp.block_diag((graph, graph), format="csr"), positions)
    np.testing.assert_array_equal(np.sort(numbers), np.arange(2 * len(x)))
    for part in (numbers < len(x), numbers >= len(x)):
        last = numbers[part][-3 * degree - 1 :] % len(x)
        assert np.ptp(x[last, 0]) == 0.0
        assert abs(x[last[0], 0] - 4.0) <= 1.0


@pytest.mark.parametrize("degree", [1, 2])
def test_fewer_operations(degree):
    """Half of those row by row at most, counted by elimination."""
    graph, x = grid((40 // degree,) * 2, degree)
    found = operations(graph, order._nested_dissection(graph, x))
    assert found < 0.5 * operations(graph, np.arange(len(x)))


@pytest.mark.parametrize("count", [1, 2, 40, 300])
@pytest.mark.parametrize("d", [1, 2, 3])
def test_any_graph(count, d):
    """Random ones, with nodes that couple with none, and many at one place: every node once."""
    generator = np.random.default_rng(count)
    half = sp.random_array((count, count), density=min(1.0, 1.5 / max(count, 1)), rng=generator)
    positions = generator.integers(0, 3, (count, d)).astype(float)
    numbers = order._nested_dissection(sp.csr_array(half + half.T), positions)
    np.testing.assert_array_equal(np.sort(numbers), np.arange(count))


@pytest.mark.parametrize("known", [0, 1, 7, 24, 30])
def test_unknowns(known):
    """Those of a node one after another, those without a position at the end, and none that stays."""
    generator = np.random.default_rng(known)
    coupled = generator.random((30, 34)) < 0.2
    coupled[:, :30] |= coupled[:, :30].T | np.eye(30, dtype=bool)
    rows = sp.csr_array(np.repeat(np.repeat(coupled[::3], 3, axis=0)[:, :30:3], 3, axis=1).astype(float))
    rows.resize(30, 34)
    inner = np.setdiff1d(np.arange(30), [0, 1, 2, 4, 29])
    found = order.dissected(rows, inner, np.repeat(generator.random((10, 2)), 3, axis=0)[:known])
    np.testing.assert_array_equal(np.sort(found), inner)
    placed = found[found < known]
    np.testing.assert_array_equal(found[placed.size :], inner[inner >= known])
    node = placed // 3
    assert np.count_nonzero(np.diff(node)) == max(np.unique(node).size - 1, 0)


def test_the_last_order():
    """It is taken for the same pattern alone, also where arrays have been changed in place, and stays as it is."""
    graph, x = grid((8, 9))
    inner, elsewhere = np.arange(len(x)), np.random.default_rng(0).permutation(x)
    found = order.dissected(graph, inner, x)
    assert order.dissected(graph.copy(), inner.copy(), x.copy()) is found
    with pytest.raises(ValueError, match="read-only"):
        found[0] = 0
    x[:] = elsewhere
    again = order.dissected(graph, inner, x)
    assert (again != found).any()
    np.testing.assert_array_equal(again, order._dissected(graph, inner, elsewhere))
    assert order.dissected(graph, inner[1:], x).size == len(x) - 1


def test_the_last_order_where_what_stays_is_joined():
    """Entries between unknowns that stay have no part in it, those of inner ones have."""
    graph, x = grid((8, 9))
    inner = np.arange(5, len(x))
    found = order.dissected(graph, inner, x)
    joined = sp.lil_array(graph)
    joined[0, 4] = joined[4, 0] = 1.0
    assert order.dissected(sp.csr_array(joined), inner, x) is found
    joined[0, 20] = joined[20, 0] = 1.0
    assert order.dissected(sp.csr_array(joined), inner, x) is not found


def test_this_petsc_passes_the_order_on():
    """PETSc 3.25 does not where there is a Schur complement; then the order is that of minimum degree."""
    assert partial_factor._order_is_taken() or PETSc.Sys.getVersion() >= (3, 23)


@pytest.mark.parametrize("placed", [False, True])
def test_a_factorisation_without_memory_is_repeated(monkeypatch, placed):
    """MUMPS reports it, and PETSc only makes a note of it: a solution with this factor would not be finite."""
    graph, x = grid((60, 60))
    rows, places = sp.csr_array(graph + 10.0 * sp.eye_array(len(x))), np.full(len(x), -1)
    places[x[:, 1] == 0] = np.arange(61)

    def condensed():
        return partial_factor.PartialFactor(rows, places, 61, (), x if placed else None, definite=True).eliminate()[0]

    expected, little = condensed(), (23, 1)  # at most one megabyte
    monkeypatch.setattr(partial_factor, "_MEMORY", (little, (14, 300)))
    np.testing.assert_allclose(condensed(), expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    monkeypatch.setattr(partial_factor, "_MEMORY", (little, little))
    with pytest.raises(PETSc.Error):
        condensed()


def test_the_places_of_entries_are_those_of_the_pattern():
    """Matrices of one pattern, such as tangents of a nonlinear body, are condensed as those of others: with values and
    loads of their own, and also where an entry between what is eliminated and what stays is zero in some of them.
    """
    graph, x = grid((9, 6))
    rng, places = np.random.default_rng(0), np.full(len(x), -1)
    stay = np.flatnonzero(x[:, 1] == 0)
    places[stay] = np.arange(stay.size)
    inner = np.flatnonzero(places < 0)
    beside = int(np.intersect1d(sp.csr_array(graph)[stay].indices, inner)[0])
    kept = []
    for number, loads in enumerate((1, 1, 1, 1, 2, 2, 1)):
        rows = sp.csr_array(graph + sp.eye_array(len(x)))
        rows.data[:] = -rng.uniform(0.1, 1.0, rows.nnz)
        rows = sp.csr_array(rows + rows.T)
        if number in (0, 1, 3, 5):  # in the pattern, but zero
            row, column = np.repeat(np.arange(len(x)), np.diff(rows.indptr)), rows.indices
            rows.data[(np.isin(row, stay) & (column == beside)) | (np.isin(column, stay) & (row == beside))] = 0.0
        rows.setdiag(20.0 + rng.uniform(size=len(x)))
        rows.sort_indices()
        right = [rng.normal(size=len(x)) * (rng.uniform(size=len(x)) > 0.5) for _ in range(loads)]
        factor = partial_factor.PartialFactor(rows, places, stay.size, right, x, definite=True)
        dense, condensed = factor.eliminate()
        full = rows.toarray()
        inverse = np.linalg.inv(full[np.ix_(inner, inner)])
        across = full[np.ix_(stay, inner)] @ inverse
        np.testing.assert_allclose(dense, -across @ full[np.ix_(inner, stay)], atol=1e-12)
        np.testing.assert_allclose(condensed, [-across @ load[inner] for load in right], atol=1e-12)
        np.testing.assert_allclose(factor.toward.toarray(), full[np.ix_(inner, stay)], atol=0)
        np.testing.assert_allclose(factor.solve(right[0][inner]), inverse @ right[0][inner], atol=1e-12)
        kept.append(partial_factor._last.get("bordering"))
    if partial_factor._order_is_taken():
        assert kept[0] is None  # of a pattern that comes once nothing is kept
        assert kept[1] is not None
        assert kept[2] is not kept[1]  # which has no place for an entry that was zero
        assert kept[3] is kept[2]  # which has


def test_what_is_known_of_a_pattern_serves_for_the_next_matrix(monkeypatch):
    """A factor that ends leaves its analysis to one that is still in use, whose successor overwrites it: the values are
    its own, those of the factor in use stay, and nothing is left once all have ended.
    """
    graph, x = grid((9, 6))
    rng, places = np.random.default_rng(1), np.full(len(x), -1)
    stay = np.flatnonzero(x[:, 1] == 0)
    places[stay] = np.arange(stay.size)
    inner, calls, call = np.flatnonzero(places < 0), [], partial_factor.call

    def counted(name, *arguments):
        calls.append(name)
        call(name, *arguments)

    monkeypatch.setattr(partial_factor, "call", counted)
    taken = partial_factor._order_is_taken()
    partial_factor._last.clear()
    calls.clear()
    factor, before = None, None
    for _ in range(6):
        rows = sp.csr_array(graph + sp.eye_array(len(x)))
        rows.data[:] = -rng.uniform(0.1, 1.0, rows.nnz)
        rows = sp.csr_array(rows + rows.T)
        rows.setdiag(20.0 + rng.uniform(size=len(x)))
        rows.sort_indices()
        right, full = rng.normal(size=len(x)), rows.toarray()
        further = partial_factor.PartialFactor(rows, places, stay.size, [right], x, definite=True, followed=True)
        dense, _ = further.eliminate()
        inverse = np.linalg.inv(full[np.ix_(inner, inner)])
        expected = -full[np.ix_(stay, inner)] @ inverse @ full[np.ix_(inner, stay)]
        np.testing.assert_allclose(dense, expected, atol=1e-12)
        np.testing.assert_allclose(further.solve(right[inner]), inverse @ right[inner], atol=1e-12)
        if factor is not None:
            np.testing.assert_allclose(factor.solve(right[inner]), before @ right[inner], atol=1e-12)
        factor, before = further, inverse
    analyses = calls.count("MatLUFactorSymbolic") + calls.count("MatCholeskyFactorSymbolic")
    assert analyses == (2 if taken else 6)
    del factor, further
    assert calls.count("MatGetFactor") == calls.count("MatDestroy")
