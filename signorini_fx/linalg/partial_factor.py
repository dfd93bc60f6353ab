"""Partial factorisation by MUMPS, for which petsc4py has no binding: eliminate all dofs but a few, and get the dense
Schur complement on these.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc
from scipy.sparse.csgraph import breadth_first_order

from signorini_fx.linalg.petsc_c import call

Array = npt.NDArray[np.float64]
_FACTOR_CHOLESKY = 2  # MAT_FACTOR_CHOLESKY of petscmat.h
_SOLVE_INTERIOR_ONLY = 0  # ICNTL(26): the Schur variables are not touched
_MEMORY_RELAXATION = (14, 30)  # ICNTL(14), per cent
_SMALL = 20  # powers of two by which the entries of a load are smaller than those of the matrix


class PartialFactor:
    """The symmetric matrix of inner unknowns i, factorised, and what is left of it for those that stay, c; one rank.

    A load is one row and column more that stay: the factorisation condenses it, and no back substitution is needed.

    Args:
        rows: those of A of the m inner unknowns, shape (m, m + c), sorted; A_ii must be regular.
        loads: right-hand sides b_i, shape (m,).
        definite: whether A_ii is positive definite.

    Attributes:
        dense: -A_ci A_ii^-1 A_ic, symmetric, shape (c, c).
        loads: -A_ci A_ii^-1 b_i of each load, shape (loads, c).

    Raises:
        PETSc.Error: PETSc has no MUMPS, or the factorisation broke down.
    """

    def __init__(self, rows: sp.csr_array, loads: Sequence[Array] = (), *, definite: bool) -> None:
        count, size = rows.shape
        self.dense, self.loads = np.zeros((size - count,) * 2), np.zeros((len(loads), size - count))
        self._places = _nearest_first(rows)
        if not count:  # some MUMPS fail with nothing to eliminate
            return
        # With a Schur complement MUMPS does not scale, and pivots below an absolute threshold would be lost.
        self._unit = _power(np.abs(rows.diagonal()).max())
        # So small that they have no influence on the choice of pivots of an indefinite matrix.
        sizes = np.array([_power(np.abs(load).max()) * 2.0**_SMALL for load in loads])
        scaled = [load / load_size for load, load_size in zip(loads, sizes, strict=True)]
        whole = _upper_half(rows, self._places, self._unit, scaled)
        whole.setOption(PETSc.Mat.Option.SPD, definite)
        handle = ctypes.c_void_p()
        call("MatGetFactor", whole, b"mumps", _FACTOR_CHOLESKY, ctypes.byref(handle))
        self._factor = handle
        self._right, self._found = whole.createVecs()
        stays = np.arange(count, size + len(loads), dtype=PETSc.IntType)
        call("MatFactorSetSchurIS", handle, PETSc.IS().createGeneral(stays, comm=whole.comm))
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
        self.dense = self._unit * values[: size - count, : size - count]
        self.loads = sizes[:, None] * values[size - count :, : size - count]
        call("MatMumpsSetIcntl", handle, 26, _SOLVE_INTERIOR_ONLY)

    def solve(self, right: Array) -> Array:
        """A_ii^-1 times a right-hand side, shape (m,); no back substitution where it is zero."""
        if not right.any():
            return np.zeros(right.size)
        self._right.set(0.0)
        self._right.getArray()[self._places] = right
        call("MatSolve", self._factor, self._right, self._found)
        return np.asarray(self._found.getArray(readonly=True)[self._places] / self._unit)

    def __del__(self) -> None:
        if getattr(self, "_factor", None):
            call("MatDestroy", ctypes.byref(self._factor))


def _power(size: float) -> float:
    """A power of two of this size; 1 for zero."""
    return float(2.0 ** np.round(np.log2(size))) if size > 0 else 1.0


def _nearest_first(rows: sp.csr_array) -> npt.NDArray[np.intp]:
    """The places of the inner unknowns in the order of their distance in the graph from those that stay, shape (m,).

    Minimum degree, by which MUMPS orders with a Schur complement, takes the first of equal degrees, so that the
    operations depend on the numbering, by up to a factor of three; of all that were tried this one is among the best.
    """
    count, size = rows.shape
    staying = rows.indices >= count
    near = np.unique(np.searchsorted(rows.indptr, np.flatnonzero(staying), side="right") - 1)
    # A node more, from which the search begins; those that stay have no row and end it.
    ends = np.append(np.append(rows.indptr, np.full(size - count, rows.indptr[-1])), rows.indptr[-1] + near.size)
    entries = np.ones(ends[-1]), np.append(rows.indices, near), ends
    order = breadth_first_order(sp.csr_array(entries, shape=(size + 1,) * 2), size, return_predecessors=False)
    order = order[order < count]
    left = np.ones(count, dtype=bool)
    left[order] = False
    places = np.empty(count, dtype=np.intp)
    places[np.concatenate((order, np.flatnonzero(left)))] = np.arange(count)
    return places


def _upper_half(rows: sp.csr_array, places: npt.NDArray[np.intp], unit: float, loads: Sequence[Array]) -> PETSc.Mat:
    """The upper half of the matrix over a unit, of which MUMPS needs no copy, with a column more for each load.

    Args:
        rows: as for ``PartialFactor``.
        places: of the inner unknowns.
        unit: which the entries are divided by.
        loads: shape (m,).
    """
    count, size = rows.shape
    to = np.concatenate((places, np.arange(count, size))).astype(rows.indices.dtype)
    row, column = np.repeat(to[:count], np.diff(rows.indptr)), to[rows.indices]
    upper = column >= row
    where, number = np.nonzero(np.transpose(loads)) if loads else (np.empty(0, dtype=np.intp),) * 2
    last = np.arange(count, size + len(loads))
    entries = np.concatenate((rows.data[upper] / unit, np.transpose(loads)[where, number] if loads else [], 0.0 * last))
    row = np.concatenate((row[upper], places[where], last))
    column = np.concatenate((column[upper], size + number, last))
    found = sp.csr_array((entries, (row, column)), shape=(size + len(loads),) * 2)
    csr = (found.indptr.astype(PETSc.IntType), found.indices.astype(PETSc.IntType), found.data)
    return PETSc.Mat().createSBAIJ(found.shape, 1, csr=csr, comm=PETSc.COMM_SELF)


def _symmetrise(values: Array, block: int = 256) -> None:
    """Complete a symmetric matrix of which MUMPS has filled one triangle, in place."""
    first = next((k for k in range(len(values)) if values[k + 1 :, k].any() or values[k, k + 1 :].any()), 0)
    if not values[first + 1 :, first].any():
        values = values.T
    for k in range(0, values.shape[0], block):
        here = slice(k, k + block)
        lower = np.tril(values[here, here])
        values[here, here] = lower + np.tril(lower, -1).T
        values[here, k + block :] = values[k + block :, here].T
