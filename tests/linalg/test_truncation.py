"""Truncated levels of multigrid: against dense products, and shared by solvers with different tangents."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.linalg import factorisation

WORLD = MPI.COMM_WORLD


@pytest.mark.parametrize("most", [0, 10_000])
@pytest.mark.parametrize("symmetric", [True, False])
def test_direct_solvers_of_all_ranks_and_of_each(most, symmetric, monkeypatch):
    """Of the matrix of a chain of springs, with a flow along it if it is not symmetric; factorised twice."""
    monkeypatch.setattr(factorisation, "MOST_REPLICATED_UNKNOWNS", most)
    n = 40 * WORLD.size
    matrix = PETSc.Mat().createAIJ(((None, n), (None, n)), nnz=(3, 2), comm=WORLD)
    for row in range(*matrix.getOwnershipRange()):
        for column, value in ((row - 1, -1.0), (row, 2.5), (row + 1, -1.0 if symmetric else -0.5)):
            if 0 <= column < n:
                matrix.setValue(row, column, value)
    matrix.assemble()
    pc = PETSc.PC().create(WORLD)
    factorisation.use_direct(pc, n, symmetric=symmetric)
    x, b = matrix.createVecs()
    first, last = b.getOwnershipRange()
    for factor in (1.0, 3.0):
        b.getArray()[:] = np.sin(1.0 + np.arange(first, last))
        pc.setOperators(factor * matrix)
        pc.setUp()
        pc.apply(b, x)
        assert (factor * (matrix * x) - b).norm() < 1e-12 * b.norm()
    assert (pc.getType() == PETSc.PC.Type.REDUNDANT) == (WORLD.size > 1 and most > 0)
