"""Factors for which the memory does not suffice."""

import numpy as np
import pytest
import scipy.sparse as sp
from petsc4py import PETSc

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
    row, column = (
        np.concatenate([f(cell, cell.size) for cell in cells]) for f in (np.repeat, np.tile)
    )
    graph = sp.csr_array((np.ones(row.size), (row, column)), shape=(number.size,) * 2)
    return graph, np.stack(np.unravel_index(np.arange(number.size), sides), axis=-1) / degree


@pytest.mark.parametrize("placed", [False, True])
def test_a_factorisation_without_memory(monkeypatch, placed):
    """MUMPS reports it, and PETSc only makes a note of it: a solution with this factor would not be
    finite.
    """
    graph, x = grid((60, 60))
    rows, places = sp.csr_array(graph + 10.0 * sp.eye_array(len(x))), np.full(len(x), -1)
    places[x[:, 1] == 0] = np.arange(61)
    factor = partial_factor.PartialFactor(
        rows, places, 61, (), x if placed else None, definite=True
    )
    monkeypatch.setattr(partial_factor, "_MEMORY", (23, 1))  # at most one megabyte
    with pytest.raises(PETSc.Error):
        factor.eliminate()
