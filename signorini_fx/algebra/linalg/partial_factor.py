"""Partial factorisation by MUMPS, for which petsc4py has no binding: eliminate all dofs but a few, and get the dense
Schur complement on these.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any
from weakref import WeakSet

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc

from signorini_fx.algebra.linalg.elimination_order import dissected, nearest_first
from signorini_fx.algebra.linalg.petsc_c import call

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
_FACTOR_LU, _FACTOR_CHOLESKY = 1, 2  # MAT_FACTOR_LU and MAT_FACTOR_CHOLESKY of petscmat.h
_LU_SYMBOLIC = 25  # MATOP_LUFACTOR_SYMBOLIC
ERROR_IN_LIBRARY = 76  # PETSC_ERR_LIB
_ORDER_OF_USER = 1  # INFOG(7)
_NEGATIVE_PIVOTS = 12  # the number of INFOG that counts them in a symmetric matrix
_SOLVE_INTERIOR_ONLY = 0  # ICNTL(26): the Schur variables are not touched
_MEMORY = ((14, 30), (14, 300))  # ICNTL(14), per cent more than estimated, one after another until it is enough
_SMALL = 20  # powers of two by which the entries of a load are smaller than those of the matrix


@dataclass(frozen=True)
class _Bordering:
    """Where the entries of the rows of inner unknowns are in the matrix that is factorised: inner unknowns in the order
    of their elimination, then those that stay, then the loads, as upper triangle.  Entries between those that stay do
    not count, so that of bodies that slide it serves for any partners.

    Attributes:
        pattern: ends and columns of these rows.
        order: of the inner unknowns.
        places: see ``PartialFactor``.
        loads: their number.
        numbers: of each column its number there.
        between: entries between inner unknowns and those that stay.
        nonzero: which of these are not zero, or may be.
        diagonal: entries on the diagonal of inner unknowns.
        upper: entries that are taken.
        source: of each entry there its number among ``upper``, the loads in order of elimination, and the diagonal of
            what stays.
        ends, columns: of its rows.
        toward_shape: of ``PartialFactor.toward``.
        alive: the definite factors that were made with it.
    """

    pattern: tuple[npt.NDArray[np.integer[Any]], npt.NDArray[np.integer[Any]]]
    order: Indices
    places: Indices
    loads: int
    numbers: Indices
    between: Indices
    nonzero: npt.NDArray[np.bool_]
    diagonal: Indices
    upper: Indices
    source: Indices
    ends: npt.NDArray[np.integer[Any]]
    columns: npt.NDArray[np.integer[Any]]
    toward_shape: tuple[int, int]
    alive: WeakSet[PartialFactor] = field(default_factory=WeakSet, repr=False, compare=False)

    @classmethod
    def of(cls, rows: sp.csr_array, order: Indices, places: Indices, count: int, loads: int) -> _Bordering:
        """That of the rows of the inner unknowns, ascending, for the other arguments see ``PartialFactor``; ``order``:
        of the inner unknowns.
        """
        inside = order.size
        numbers = np.full(places.size, -1, dtype=rows.indices.dtype)
        numbers[order], numbers[places >= 0] = np.arange(inside), inside + places[places >= 0]
        row, column = np.repeat(numbers[np.sort(order)], np.diff(rows.indptr)), numbers[rows.indices]
        between = np.flatnonzero(column >= inside)
        # Zeros between inner ones stay: with the same pattern for all unknowns of a node the ordering is better.
        nonzero = rows.data[between] != 0.0
        taken = column >= row
        taken[between] = nonzero
        upper, diagonal = np.flatnonzero(taken), np.flatnonzero(column == row)
        row, column = row[upper], column[upper]
        del taken
        size = inside + count + loads
        staying = np.arange(inside, size, dtype=row.dtype)
        row = np.concatenate((row, np.tile(np.arange(inside, dtype=row.dtype), loads), staying))
        column = np.concatenate((column, np.repeat(staying[count:], inside), staying))
        bordered = sp.csr_array((np.arange(row.size), (row, column)), shape=(size, size))
        ends, columns = (at.astype(PETSc.IntType, copy=False) for at in (bordered.indptr, bordered.indices))
        toward_shape, source = (inside, count), bordered.data
        fields = order, places, loads, numbers, between, nonzero, diagonal, upper, source, ends, columns, toward_shape
        return cls((rows.indptr, rows.indices), *fields)

    def fits(self, rows: sp.csr_array, order: Indices, places: Indices, count: int, loads: int) -> bool:
        """Whether it serves for the rows of another matrix too."""
        same = self.order is order and (self.toward_shape[1], self.loads) == (count, loads)
        return (
            same
            and np.array_equal(self.pattern[0], rows.indptr)
            and np.array_equal(self.pattern[1], rows.indices)
            and np.array_equal(self.places, places)
            and not (rows.data[self.between] != 0.0)[~self.nonzero].any()
        )

    def toward(self, rows: sp.csr_array) -> sp.csr_array:
        """A_ic of a matrix, from the rows of its inner unknowns."""
        entries = self.between[self.nonzero]
        row = np.searchsorted(rows.indptr, entries, side="right") - 1
        column = self.places[rows.indices[entries]]
        return sp.csr_array((rows.data[entries], (row, column)), shape=self.toward_shape)


# That of the last order, once two matrices have had it, or others are known to follow: the tangents of a nonlinear body
# have one pattern.
_last: dict[str, _Bordering] = {}
_last_order: dict[str, Indices] = {}


def _bordering(
    rows: sp.csr_array, order: Indices, places: Indices, count: int, loads: int, *, followed: bool
) -> _Bordering:
    """That of the rows of inner unknowns, see ``_Bordering``; ``followed``: see ``PartialFactor``."""
    if (last := _last.get("bordering")) is not None and last.fits(rows, order, places, count, loads):
        return last
    same_order = followed or _last_order.get("order") is order
    _last.clear()
    _last_order["order"], bordering = order, _Bordering.of(rows, order, places, count, loads)
    if same_order:
        _last["bordering"] = replace(bordering, places=places.copy())
    return bordering


class PartialFactor:
    """The symmetric matrix of inner unknowns i, factorised, and what is left of it for those that stay, c; one rank.

    A load is one row and column more that stay: the factorisation condenses it, and no back substitution is needed.
    What MUMPS finds out from the pattern alone serves for the tangents of a nonlinear body, which have one pattern: a
    factor leaves that behind to one that is still in use, and the next one takes it from there.

    Args:
        rows: those of A of the unknowns of this rank, shape (n, n or more); A_ii must be regular.
        places: of each column its place among those that stay, -1: it is inner, or if it is none of this rank empty.
        count: number of those that stay.
        loads: right-hand sides b, shape (n,).
        positions: of the first of these unknowns, shape (at most n, d), from which the order of their elimination is
            taken; None: minimum degree.
        definite: whether A_ii is positive definite.
        followed: whether matrices of the same pattern are likely to follow.

    Attributes:
        inner: the m inner unknowns.
        toward: A_ic, shape (m, c).

    Raises:
        PETSc.Error: PETSc has no MUMPS.
    """

    def __init__(
        self,
        rows: sp.csr_array,
        places: Indices,
        count: int,
        loads: Sequence[Array] = (),
        positions: Array | None = None,
        *,
        definite: bool,
        followed: bool = False,
    ) -> None:
        self.inner = np.flatnonzero(places[: rows.shape[0]] < 0)
        self._count, inside = count, self.inner.size
        # Of an indefinite matrix, with a pressure, minimum degree takes fewer operations.
        self._in_order = positions is not None and definite and _order_is_taken()
        usable_positions = positions if self._in_order else None
        stay = places >= 0
        order = nearest_first(rows, stay) if usable_positions is None else dissected(rows, self.inner, usable_positions)
        rows = sp.csr_array(rows[self.inner])
        bordering = _bordering(rows, order, places, count, len(loads), followed=followed)
        self._order, self.toward = bordering.numbers[self.inner], bordering.toward(rows)
        self._alive = bordering.alive if definite else WeakSet[PartialFactor]()  # nothing of others is taken over
        self._left_behind = list[ctypes.c_void_p]()
        # With a Schur complement MUMPS does not scale, and pivots below an absolute threshold would be lost.
        self._unit = _power(np.abs(rows.data[bordering.diagonal]).max(initial=0.0))
        # So small that they have no influence on the choice of pivots of an indefinite matrix.
        self._sizes = np.array([_power(np.abs(load[self.inner]).max(initial=0.0)) * 2.0**_SMALL for load in loads])
        entries = [rows.data[bordering.upper] / self._unit]
        for load, size in zip(loads, self._sizes, strict=True):
            entries.append(np.empty(inside))
            entries[-1][self._order] = load[self.inner] / size
        entries.append(np.zeros(count + len(loads)))  # the diagonal of what stays
        data = np.concatenate(entries)[bordering.source]
        del entries
        csr = (bordering.ends, bordering.columns, data)
        # Of the rows of such a matrix MUMPS gets what is above the diagonal.
        self._matrix = PETSc.Mat().createAIJWithArrays((bordering.ends.size - 1,) * 2, csr, comm=PETSc.COMM_SELF)
        self._matrix.setOption(PETSc.Mat.Option.SPD, definite)

    def eliminate(self) -> tuple[Array, Array]:
        """Factorise, once, when the caller needs the rows no more.

        Returns:
            -A_ci A_ii^-1 A_ic, symmetric, shape (c, c), and -A_ci A_ii^-1 b_i of each load, shape (loads, c).

        Raises:
            PETSc.Error: the factorisation broke down.
        """
        inside, count, bordered = self.inner.size, self._count, self._matrix
        del self._matrix
        if not inside:  # some MUMPS fail with nothing to eliminate
            return np.zeros((count, count)), np.zeros((self._sizes.size, count))
        self._right, self._solution = bordered.createVecs()
        analyses = next(filter(None, (factor._left_behind for factor in self._alive)), [])
        analysed = analyses.pop() if analyses else None
        self._factor = handle = _factorise(bordered, inside, _MEMORY, analysed, in_order=self._in_order)
        self._alive.add(self)
        dense = ctypes.c_void_p()
        call("MatFactorGetSchurComplement", handle, ctypes.byref(dense), None)
        entries = ctypes.POINTER(ctypes.c_double)()
        call("MatDenseGetArrayRead", dense, ctypes.byref(entries))
        values = self._unit * np.ctypeslib.as_array(entries, shape=(bordered.getSize()[0] - inside,) * 2)
        call("MatDenseRestoreArrayRead", dense, ctypes.byref(entries))
        _symmetrise(values)
        call("MatMumpsSetIcntl", handle, 26, _SOLVE_INTERIOR_ONLY)
        return values[:count, :count], (self._sizes / self._unit)[:, None] * values[count:, :count]

    @property
    def negative(self) -> int:
        """How many eigenvalues of A_ii are negative, once it is factorised."""
        count = ctypes.c_int()
        if self.inner.size:
            call("MatMumpsGetInfog", self._factor, _NEGATIVE_PIVOTS, ctypes.byref(count))
        return count.value

    def solve(self, right: Array) -> Array:
        """A_ii^-1 times a right-hand side, shape (m,); no back substitution where it is zero."""
        if not right.any():
            return np.zeros(right.size)
        self._right.set(0.0)
        self._right.getArray()[self._order] = right
        call("MatSolve", self._factor, self._right, self._solution)
        return np.asarray(self._solution.getArray(readonly=True)[self._order] / self._unit)

    def __del__(self) -> None:
        if not getattr(self, "_factor", None):
            return
        useful, in_use = [self._factor, *self._left_behind], [factor for factor in self._alive if factor is not self]
        if in_use and not any(factor._left_behind for factor in in_use):  # as it is large, only one
            in_use[0]._left_behind.append(useful.pop())
        for handle in useful:
            call("MatDestroy", ctypes.byref(handle))


def _power(size: float) -> float:
    """A power of two of this size; 1 for zero."""
    return float(2.0 ** np.round(np.log2(size))) if size > 0 else 1.0


@cache
def _order_is_taken() -> bool:
    """Whether ``_factorise`` can prescribe the order: not with all versions of PETSc."""
    sample = PETSc.Mat().createSBAIJ(
        (3, 3), 1, csr=([0, 2, 3, 4], [0, 2, 1, 2], [1.0, 1.0, 1.0, 0.0]), comm=PETSc.COMM_SELF
    )
    used = ctypes.c_int()
    try:
        factor = _factorise(sample, 2, _MEMORY, in_order=True)
    except PETSc.Error:
        return False
    call("MatMumpsGetInfog", factor, 7, ctypes.byref(used))
    call("MatDestroy", ctypes.byref(factor))
    return used.value == _ORDER_OF_USER


def _factorise(
    matrix: PETSc.Mat,
    inside: int,
    memory: Sequence[tuple[int, int]],
    analysed: ctypes.c_void_p | None = None,
    *,
    in_order: bool,
) -> ctypes.c_void_p:
    """Factorise the first rows and columns of a symmetric matrix; those of the others become the Schur complement.

    Args:
        matrix: the matrix.
        inside: number of those rows.
        memory: what is tried one after another, as numbers and values of ICNTL.
        analysed: the factor of another matrix with the same pattern, which is overwritten; None: there is none.
        in_order: whether to eliminate them one after another, where PETSc lets MUMPS know; else by minimum degree.

    Raises:
        PETSc.Error: PETSc has no MUMPS, or the factorisation broke down.
    """
    broken = ctypes.c_int()
    info = (ctypes.c_double * 32)()  # MatFactorInfo is a struct of doubles; zeros are its defaults
    if analysed is not None:
        numeric = "MatLUFactorNumeric" if in_order else "MatCholeskyFactorNumeric"
        call(numeric, analysed, matrix, ctypes.byref(info))
        call("MatFactorGetError", analysed, ctypes.byref(broken))
        if not broken.value:
            return analysed
        call("MatDestroy", ctypes.byref(analysed))
    factor = ctypes.c_void_p()
    call("MatGetFactor", matrix, b"mumps", _FACTOR_CHOLESKY, ctypes.byref(factor))
    indices = np.arange(matrix.getSize()[0], dtype=PETSc.IntType)
    call("MatFactorSetSchurIS", factor, PETSc.IS().createGeneral(indices[inside:], comm=matrix.comm))
    call("MatMumpsSetIcntl", factor, *memory[0])
    if in_order:
        # PETSc passes an order on in the symbolic LU factorisation alone, which is borrowed.
        lent, symbolic = ctypes.c_void_p(), ctypes.c_void_p()
        small = PETSc.Mat().createConstantDiagonal((1, 1), 1.0, comm=PETSc.COMM_SELF).convert("aij")
        call("MatGetFactor", small, b"mumps", _FACTOR_LU, ctypes.byref(lent))
        call("MatGetOperation", lent, _LU_SYMBOLIC, ctypes.byref(symbolic))
        call("MatDestroy", ctypes.byref(lent))
        call("MatSetOperation", factor, _LU_SYMBOLIC, symbolic)
        order = PETSc.IS().createGeneral(indices, comm=matrix.comm)
        call("MatLUFactorSymbolic", factor, matrix, order, order, ctypes.byref(info))
        call("MatLUFactorNumeric", factor, matrix, ctypes.byref(info))
    else:
        call("MatCholeskyFactorSymbolic", factor, matrix, None, ctypes.byref(info))
        call("MatCholeskyFactorNumeric", factor, matrix, ctypes.byref(info))
    call("MatFactorGetError", factor, ctypes.byref(broken))
    if not broken.value:
        return factor
    call("MatDestroy", ctypes.byref(factor))
    if not memory[1:]:
        raise PETSc.Error(ERROR_IN_LIBRARY)
    return _factorise(matrix, inside, memory[1:], in_order=in_order)


def _symmetrise(values: Array, block: int = 256) -> None:
    """Complete a symmetric matrix of which MUMPS has filled one triangle, in place."""
    first = next((k for k in range(len(values)) if values[k + 1 :, k].any() or values[k, k + 1 :].any()), 0)
    if not values[first + 1 :, first].any():
        values = values.T
    for k in range(0, values.shape[0], block):
        rows = slice(k, k + block)
        lower = np.tril(values[rows, rows])
        values[rows, rows] = lower + np.tril(lower, -1).T
        values[rows, k + block :] = values[k + block :, rows].T
