"""Partial factorisation by MUMPS, for which petsc4py has no binding: eliminate all dofs but a few, and get the dense
Schur complement on these.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc
from scipy.sparse.csgraph import breadth_first_order

from signorini_fx.linalg.petsc_c import call

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
_FACTOR_CHOLESKY = 2  # MAT_FACTOR_CHOLESKY of petscmat.h
_SOLVE_INTERIOR_ONLY = 0  # ICNTL(26): the Schur variables are not touched
_MEMORY_RELAXATION = (14, 30)  # ICNTL(14), per cent
_SMALL = 20  # powers of two by which the entries of a load are smaller than those of the matrix


class PartialFactor:
    """The symmetric matrix of inner unknowns i, factorised, and what is left of it for those that stay, c; one rank.

    A load is one row and column more that stay: the factorisation condenses it, and no back substitution is needed.

    Args:
        rows: those of A of the unknowns of this rank, shape (n, n or more); A_ii must be regular.
        places: of each column its place among those that stay, -1: it is inner, or if it is none of this rank empty.
        count: number of those that stay.
        loads: right-hand sides b, shape (n,).
        definite: whether A_ii is positive definite.

    Attributes:
        inner: the m inner unknowns.
        toward: A_ic, shape (m, c).

    Raises:
        PETSc.Error: PETSc has no MUMPS.
    """

    def __init__(
        self, rows: sp.csr_array, places: Indices, count: int, loads: Sequence[Array] = (), *, definite: bool
    ) -> None:
        self.inner = np.flatnonzero(places[: rows.shape[0]] < 0)
        self._count, inside = count, self.inner.size
        stay = places >= 0
        to = np.full(places.size, -1, dtype=rows.indices.dtype)
        to[_nearest_first(rows, stay)] = np.arange(inside)
        to[stay] = inside + places[stay]
        self._order = to[self.inner]
        # With a Schur complement MUMPS does not scale, and pivots below an absolute threshold would be lost.
        self._unit = _power(np.abs(rows.diagonal()[self.inner]).max(initial=0.0))
        # So small that they have no influence on the choice of pivots of an indefinite matrix.
        self._sizes = np.array([_power(np.abs(load[self.inner]).max(initial=0.0)) * 2.0**_SMALL for load in loads])
        row, column = np.repeat(to[: rows.shape[0]], np.diff(rows.indptr)), to[rows.indices]
        # Zeros between inner ones stay: with the same pattern for all unknowns of a node the ordering is better.
        upper = (row < inside) & (column >= row) & ((column < inside) | (rows.data != 0.0))
        values, row, column = rows.data[upper], row[upper], column[upper]
        there = np.flatnonzero(column >= inside)
        toward = values[there], (row[there], column[there] - inside)
        self.toward: Any = sp.csr_array(toward, shape=(inside, count))[self._order]
        values /= self._unit
        scaled = [load[self.inner] / size for load, size in zip(loads, self._sizes, strict=True)]
        last = np.arange(inside, inside + count + len(loads), dtype=row.dtype)  # the diagonal, zero
        of_load, at = np.nonzero(scaled) if loads else (last[:0], last[:0])
        values = np.concatenate((values, np.asarray(scaled)[of_load, at] if loads else [], 0.0 * last))
        row = np.concatenate((row, self._order[at], last))
        column = np.concatenate((column, (inside + count + of_load).astype(row.dtype), last))
        found = sp.csr_array((values, (row, column)), shape=(inside + count + len(loads),) * 2)
        del values, row, column, upper
        csr = (found.indptr.astype(PETSc.IntType), found.indices.astype(PETSc.IntType, copy=False), found.data)
        self._whole = PETSc.Mat().createSBAIJ(found.shape, 1, csr=csr, comm=PETSc.COMM_SELF)
        self._whole.setOption(PETSc.Mat.Option.SPD, definite)

    def eliminate(self) -> tuple[Array, Array]:
        """Factorise, once, when the caller needs the rows no more.

        Returns:
            -A_ci A_ii^-1 A_ic, symmetric, shape (c, c), and -A_ci A_ii^-1 b_i of each load, shape (loads, c).

        Raises:
            PETSc.Error: the factorisation broke down.
        """
        inside, count, whole = self.inner.size, self._count, self._whole
        del self._whole
        if not inside:  # some MUMPS fail with nothing to eliminate
            return np.zeros((count, count)), np.zeros((self._sizes.size, count))
        handle = ctypes.c_void_p()
        call("MatGetFactor", whole, b"mumps", _FACTOR_CHOLESKY, ctypes.byref(handle))
        self._factor = handle
        self._right, self._found = whole.createVecs()
        stays = np.arange(inside, whole.getSize()[0], dtype=PETSc.IntType)
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
        call("MatMumpsSetIcntl", handle, 26, _SOLVE_INTERIOR_ONLY)
        return self._unit * values[:count, :count], self._sizes[:, None] * values[count:, :count]

    def solve(self, right: Array) -> Array:
        """A_ii^-1 times a right-hand side, shape (m,); no back substitution where it is zero."""
        if not right.any():
            return np.zeros(right.size)
        self._right.set(0.0)
        self._right.getArray()[self._order] = right
        call("MatSolve", self._factor, self._right, self._found)
        return np.asarray(self._found.getArray(readonly=True)[self._order] / self._unit)

    def __del__(self) -> None:
        if getattr(self, "_factor", None):
            call("MatDestroy", ctypes.byref(self._factor))


def _power(size: float) -> float:
    """A power of two of this size; 1 for zero."""
    return float(2.0 ** np.round(np.log2(size))) if size > 0 else 1.0


def _nearest_first(rows: sp.csr_array, stay: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """The inner unknowns in the order of their distance in the graph from those that stay, shape (m,).

    Minimum degree, by which MUMPS orders with a Schur complement, takes the first of equal degrees, so that the
    operations depend on the numbering, by up to a factor of three; of all that were tried this one is among the best.
    """
    own, size = rows.shape
    # A node more, from which the search begins; columns of other ranks have no row and end it.
    columns = np.concatenate((rows.indices, np.flatnonzero(stay).astype(rows.indices.dtype)))
    ends = np.concatenate((rows.indptr, np.full(size - own, rows.indptr[-1]), [columns.size]))
    graph = sp.csr_array((np.broadcast_to(1.0, columns.size), columns, ends), shape=(size + 1,) * 2)
    order = breadth_first_order(graph, size, return_predecessors=False)
    inner = np.append(~stay[:own], np.zeros(size + 1 - own, dtype=bool))
    order = order[inner[order]]
    inner[order] = False  # what the search has not reached is left
    return np.concatenate((order, np.flatnonzero(inner)))


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
