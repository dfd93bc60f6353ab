"""Partial factorisation by MUMPS: eliminate all dofs but a few, and get the dense Schur complement on these.

petsc4py has no binding for it, so that PETSc's C functions are called through ctypes; they are looked up in petsc4py's
own library, hence in the same PETSc that petsc4py uses.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.linalg.petsc_c import call

Array = npt.NDArray[np.float64]
_FACTOR_CHOLESKY = 2  # MAT_FACTOR_CHOLESKY of petscmat.h
_SOLVE_INTERIOR_ONLY = 0  # ICNTL(26): the Schur variables are not touched
_MEMORY_RELAXATION = (14, 30)  # ICNTL(14), per cent
_SMALL = 20  # powers of two by which the entries of a load are smaller than those of the matrix


class SchurComplement:
    """A symmetric matrix with its interior eliminated, and with it that of loads; one rank only.

    A load is one row and column more that stay: the factorisation condenses it, and no back substitution is needed.

    Args:
        matrix: A, of which A_ii must be regular.
        retained: the dofs c that stay, in the order of the dense matrix.
        loads: right-hand sides b.
        definite: whether A_ii is positive definite.

    Attributes:
        dense: A_cc - A_ci A_ii^-1 A_ic, symmetric.
        loads: b_c - A_ci A_ii^-1 b_i of each load, shape (loads, c).

    Raises:
        PETSc.Error: PETSc has no MUMPS, or the factorisation broke down.
    """

    def __init__(
        self, matrix: PETSc.Mat, retained: npt.NDArray[np.int32], loads: Sequence[Array] = (), *, definite: bool
    ) -> None:
        self.matrix = matrix
        self.retained = retained
        # With a Schur complement MUMPS does not scale, and pivots below an absolute threshold would be lost.
        self._unit = _power(np.abs(matrix.getDiagonal().getArray(readonly=True)).max())
        # So small that they have no influence on the choice of pivots of an indefinite matrix.
        sizes = np.array([_power(np.abs(load).max(initial=0.0)) * 2.0**_SMALL for load in loads])
        whole = _with_loads(matrix, self._unit, [load / size for load, size in zip(loads, sizes, strict=True)])
        whole.setOption(PETSc.Mat.Option.SPD, definite)
        stays = np.concatenate((retained, np.arange(matrix.getSize()[0], whole.getSize()[0])))
        handle = ctypes.c_void_p()
        call("MatGetFactor", whole, b"mumps", _FACTOR_CHOLESKY, ctypes.byref(handle))
        self._factor = handle
        self._right, self._found = whole.createVecs()
        index_set = PETSc.IS().createGeneral(stays.astype(PETSc.IntType), comm=matrix.comm)
        call("MatFactorSetSchurIS", handle, index_set)
        call("MatMumpsSetIcntl", handle, *_MEMORY_RELAXATION)
        # MatFactorInfo is a struct of doubles; zeros are its defaults.
        info = (ctypes.c_double * 32)()
        call("MatCholeskyFactorSymbolic", handle, whole, None, ctypes.byref(info))
        call("MatCholeskyFactorNumeric", handle, whole, ctypes.byref(info))
        dense = ctypes.c_void_p()
        call("MatFactorCreateSchurComplement", handle, ctypes.byref(dense), None)
        entries = ctypes.POINTER(ctypes.c_double)()
        call("MatDenseGetArrayRead", dense, ctypes.byref(entries))
        values = np.ctypeslib.as_array(entries, shape=(stays.size, stays.size)).copy()
        call("MatDenseRestoreArrayRead", dense, ctypes.byref(entries))
        call("MatDestroy", ctypes.byref(dense))
        _symmetrise(values)
        count = retained.size
        self.dense = self._unit * values[:count, :count]
        self.loads = sizes[:, None] * values[count:, :count]
        call("MatMumpsSetIcntl", handle, 26, _SOLVE_INTERIOR_ONLY)

    def solve_interior(self, right: PETSc.Vec) -> PETSc.Vec:
        """A_ii^-1 right_i in the interior, zero at the kept dofs; no back substitution where right_i is zero."""
        result, values = right.duplicate(), right.getArray(readonly=True)
        if np.count_nonzero(values) > np.count_nonzero(values[self.retained]):
            self._right.getArray()[: values.size] = values
            call("MatSolve", self._factor, self._right, self._found)
            result.getArray()[:] = self._found.getArray(readonly=True)[: values.size] / self._unit
            result.getArray()[self.retained] = 0.0
        return result

    def condense(self, load: PETSc.Vec) -> Array:
        """Another load, shape (c,): one back substitution."""
        interior, residual = self.solve_interior(load), load.duplicate()
        self.matrix.mult(interior, residual)
        residual.aypx(-1.0, load)
        return np.array(residual.getArray(readonly=True)[self.retained])

    def __del__(self) -> None:
        if getattr(self, "_factor", None):
            call("MatDestroy", ctypes.byref(self._factor))


def _power(size: float) -> float:
    """A power of two of this size; 1 for zero."""
    return float(2.0 ** np.round(np.log2(size))) if size > 0 else 1.0


def _with_loads(matrix: PETSc.Mat, unit: float, loads: Sequence[Array]) -> PETSc.Mat:
    """The upper half of the matrix over a unit, of which MUMPS needs no copy, with a column more for each load."""
    rows, columns, values = matrix.getValuesCSR()
    size = rows.size - 1
    upper = columns >= np.repeat(np.arange(size, dtype=columns.dtype), np.diff(rows))
    rows = np.concatenate((rows[:1], np.cumsum(upper, dtype=rows.dtype)[rows[1:] - 1]))
    columns, values = columns[upper], values[upper]
    values /= unit
    if loads:
        row, load = np.nonzero(np.transpose(loads))
        columns = np.insert(columns, rows[row + 1], size + load)
        values = np.insert(values, rows[row + 1], np.transpose(loads)[row, load])
        rows[1:] += np.cumsum(np.bincount(row, minlength=size), dtype=rows.dtype)
        last = np.arange(1, len(loads) + 1, dtype=rows.dtype)  # the diagonal
        columns, values = np.append(columns, size - 1 + last), np.append(values, np.ones(last.size))
        rows = np.append(rows, rows[-1] + last)
    return PETSc.Mat().createSBAIJ((rows.size - 1,) * 2, 1, csr=(rows, columns, values), comm=matrix.comm)


def _symmetrise(values: Array, block: int = 256) -> None:
    """Complete a symmetric matrix of which MUMPS has filled one triangle, in place."""
    if not values[1:, 0].any():  # a foundation that forces move has zeros in its row
        values = values.T
    for k in range(0, values.shape[0], block):
        here = slice(k, k + block)
        lower = np.tril(values[here, here])
        values[here, here] = lower + np.tril(lower, -1).T
        values[here, k + block :] = values[k + block :, here].T
