"""Partial factorisation by MUMPS: eliminate all dofs but a few, and get the dense Schur complement on these.

petsc4py has no binding for it, so that PETSc's C functions are called through ctypes; they are looked up in petsc4py's
own library, hence in the same PETSc that petsc4py uses.
"""

from __future__ import annotations

import ctypes

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.linalg.petsc_c import call

_FACTOR_CHOLESKY = 2  # MAT_FACTOR_CHOLESKY of petscmat.h
_SOLVE_INTERIOR_ONLY = 0  # ICNTL(26): the Schur variables are not touched
_MEMORY_RELAXATION = (14, 30)  # ICNTL(14), per cent


class SchurComplement:
    """A symmetric matrix with its interior eliminated; one rank only.

    Args:
        matrix: A, of which A_ii must be regular; positive definite, if PETSc knows A as such.
        retained: the dofs c that stay, in the order of the dense matrix.

    Attributes:
        dense: A_cc - A_ci A_ii^-1 A_ic, symmetric.

    Raises:
        PETSc.Error: PETSc has no MUMPS, or the factorisation broke down.
    """

    def __init__(self, matrix: PETSc.Mat, retained: npt.NDArray[np.int32]) -> None:
        self.matrix = matrix
        self.retained = retained
        handle = ctypes.c_void_p()
        call("MatGetFactor", matrix, b"mumps", _FACTOR_CHOLESKY, ctypes.byref(handle))
        self._factor = handle
        index_set = PETSc.IS().createGeneral(retained.astype(PETSc.IntType), comm=matrix.comm)
        call("MatFactorSetSchurIS", handle, index_set)
        call("MatMumpsSetIcntl", handle, *_MEMORY_RELAXATION)
        # MatFactorInfo is a struct of doubles; zeros are its defaults.
        info = (ctypes.c_double * 32)()
        # With a Schur complement MUMPS does not scale, and pivots below an absolute threshold would be lost.
        self._unit = 2.0 ** np.round(np.log2(np.abs(matrix.getDiagonal().getArray(readonly=True)).max()))
        matrix.scale(1.0 / self._unit)
        call("MatCholeskyFactorSymbolic", handle, matrix, None, ctypes.byref(info))
        call("MatCholeskyFactorNumeric", handle, matrix, ctypes.byref(info))
        matrix.scale(self._unit)
        dense = ctypes.c_void_p()
        call("MatFactorCreateSchurComplement", handle, ctypes.byref(dense), None)
        entries = ctypes.POINTER(ctypes.c_double)()
        call("MatDenseGetArrayRead", dense, ctypes.byref(entries))
        values = np.ctypeslib.as_array(entries, shape=(retained.size, retained.size)).copy()
        call("MatDenseRestoreArrayRead", dense, ctypes.byref(entries))
        call("MatDestroy", ctypes.byref(dense))
        _symmetrise(values)
        self.dense = self._unit * values
        call("MatMumpsSetIcntl", handle, 26, _SOLVE_INTERIOR_ONLY)

    def solve_interior(self, right: PETSc.Vec) -> PETSc.Vec:
        """A_ii^-1 right_i in the interior, zero at the kept dofs; no back substitution where right_i is zero."""
        result, values = right.duplicate(), right.getArray(readonly=True)
        if np.count_nonzero(values) > np.count_nonzero(values[self.retained]):
            call("MatSolve", self._factor, right, result)
            result.scale(1.0 / self._unit)
            result.getArray()[self.retained] = 0.0
        return result

    def __del__(self) -> None:
        if getattr(self, "_factor", None):
            call("MatDestroy", ctypes.byref(self._factor))


def _symmetrise(values: npt.NDArray[np.float64], block: int = 256) -> None:
    """Complete a symmetric matrix of which MUMPS has filled one triangle, in place."""
    if not values[1:, 0].any():  # a foundation that forces move has zeros in its row
        values = values.T
    for k in range(0, values.shape[0], block):
        here = slice(k, k + block)
        lower = np.tril(values[here, here])
        values[here, here] = lower + np.tril(lower, -1).T
        values[here, k + block :] = values[k + block :, here].T
