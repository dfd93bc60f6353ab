"""Systems of equations with a symmetric positive definite matrix of scipy, on one rank."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.addons.bounds.arrays import Array
from signorini_fx.algebra.linalg import petsc_options
from signorini_fx.algebra.linalg.factorisation import FACTOR_DEFAULTS, use_factorisation


def solved(upper: sp.csr_matrix, right: Array) -> Array:
    """The solution by the fastest factorisation that this PETSc has, shape (n,).

    Args:
        upper: the upper half of the matrix, its diagonal included, indices sorted.
        right: the right-hand side, shape (n,).

    Raises:
        PETSc.Error: the factorisation broke down.
    """
    rows, columns = (array.astype(PETSc.IntType) for array in (upper.indptr, upper.indices))
    matrix = PETSc.Mat().createSBAIJ(upper.shape, 1, csr=(rows, columns, upper.data), comm=MPI.COMM_SELF)
    solver = PETSc.KSP().create(MPI.COMM_SELF)
    solver.setOperators(matrix)
    solver.setOptionsPrefix(petsc_options.PREFIX)
    use_factorisation(solver, symmetric=True)
    solver.setErrorIfNotConverged(True)
    vector, solution = matrix.createVecs()
    vector.setArray(right)
    with petsc_options.defaults(FACTOR_DEFAULTS):
        solver.solve(vector, solution)
    return np.array(solution.getArray(readonly=True), dtype=np.float64)
