"""Partial factorisation by MUMPS: eliminate all dofs but a few, and get the dense Schur complement on these.

petsc4py has no binding for it, so that PETSc's C functions are called through ctypes; they are found by way of
petsc4py's own library, hence in the very PETSc that petsc4py uses.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

_FACTOR_CHOLESKY = 2  # MAT_FACTOR_CHOLESKY of petscmat.h
_SOLVE_INTERIOR_ONLY = 0  # ICNTL(26): the Schur variables are left alone
_MEMORY_RELAXATION = (14, 30)  # ICNTL(14), per cent


class SchurComplement:
    """A symmetric positive definite matrix with its interior eliminated; one rank only.

    Args:
        matrix: A, of which A_ii must be positive definite; A itself need not be.
        kept: the dofs c that stay, in the order of the dense matrix.

    Attributes:
        dense: A_cc - A_ci A_ii^-1 A_ic, symmetric.

    Raises:
        PETSc.Error: PETSc has no MUMPS, or the factorisation broke down.
    """

    def __init__(self, matrix: PETSc.Mat, kept: npt.NDArray[np.int32]) -> None:
        self.matrix = matrix
        self.kept = kept
        self._petsc = ctypes.CDLL(PETSc.__file__)
        handle = ctypes.c_void_p()
        self._call("MatGetFactor", matrix, b"mumps", _FACTOR_CHOLESKY, ctypes.byref(handle))
        self._factor = handle
        index_set = PETSc.IS().createGeneral(kept.astype(PETSc.IntType), comm=matrix.comm)
        self._call("MatFactorSetSchurIS", handle, index_set)
        self._call("MatMumpsSetIcntl", handle, *_MEMORY_RELAXATION)
        # MatFactorInfo is a struct of doubles; zeros are its defaults.
        info = (ctypes.c_double * 32)()
        self._call("MatCholeskyFactorSymbolic", handle, matrix, None, ctypes.byref(info))
        self._call("MatCholeskyFactorNumeric", handle, matrix, ctypes.byref(info))
        dense = ctypes.c_void_p()
        self._call("MatFactorCreateSchurComplement", handle, ctypes.byref(dense), None)
        entries = ctypes.POINTER(ctypes.c_double)()
        self._call("MatDenseGetArrayRead", dense, ctypes.byref(entries))
        values = np.ctypeslib.as_array(entries, shape=(kept.size, kept.size)).copy()
        self._call("MatDenseRestoreArrayRead", dense, ctypes.byref(entries))
        self._call("MatDestroy", ctypes.byref(dense))
        # MUMPS fills one triangle only.
        lower = np.tril(values) if np.abs(np.tril(values, -1)).sum() > 0 else np.triu(values).T
        self.dense = lower + np.tril(lower, -1).T
        self._call("MatMumpsSetIcntl", handle, 26, _SOLVE_INTERIOR_ONLY)

    def _call(self, name: str, *arguments: Any) -> None:
        converted = [ctypes.c_void_p(a.handle) if isinstance(a, PETSc.Object) else a for a in arguments]
        code = getattr(self._petsc, name)(*converted)
        if code:
            raise PETSc.Error(code)

    def solve_interior(self, right: PETSc.Vec) -> PETSc.Vec:
        """A_ii^-1 right_i in the interior, zero at the kept dofs."""
        result = right.duplicate()
        self._call("MatSolve", self._factor, right, result)
        result.getArray()[self.kept] = 0.0
        return result

    def __del__(self) -> None:
        if getattr(self, "_factor", None):
            self._petsc.MatDestroy(ctypes.byref(self._factor))
