"""A symmetric positive definite matrix of scipy, factorised once, on one rank."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.linalg import petsc_options
from signorini_fx.algebra.linalg.factorisation import FACTOR_DEFAULTS, use_factorisation


class Factor:
    """The factors of a matrix, by the fastest solver that this PETSc has."""

    def __init__(self, upper: sp.csr_matrix) -> None:
        """Factorise.

        Args:
            upper: the upper half of the matrix, its diagonal included, indices sorted.

        Raises:
            PETSc.Error: the factorisation broke down.
        """
        rows, columns = (array.astype(PETSc.IntType) for array in (upper.indptr, upper.indices))
        matrix = PETSc.Mat().createSBAIJ(upper.shape, 1, csr=(rows, columns, upper.data), comm=MPI.COMM_SELF)
        self._solver = PETSc.KSP().create(MPI.COMM_SELF)
        self._solver.setOperators(matrix)
        self._solver.setOptionsPrefix(petsc_options.PREFIX)
        use_factorisation(self._solver, symmetric=True)
        self._solver.setErrorIfNotConverged(True)
        self._right, self._solution = matrix.createVecs()
        with petsc_options.defaults(FACTOR_DEFAULTS):
            self._solver.setUp()

    def solve(self, right: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """The solution, shape (n,)."""
        self._right.setArray(right)
        self._solver.solve(self._right, self._solution)
        return np.array(self._solution.getArray(readonly=True), dtype=np.float64)
