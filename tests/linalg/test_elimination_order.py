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
