"""Partial factorisation by MUMPS, for which petsc4py has no binding: all dofs but a few are
eliminated, which gives the dense Schur complement on these few.

Nested dissection eliminates last the nodes that separate two halves of a body.  With the halves of
a k-d tree of the nodes' positions it is found in a fraction of the time of minimum degree, and the
factorisation takes about as few operations as with METIS, in 3D half of those with minimum degree.

Sources: George, SIAM J. Numer. Anal. 10 (1973) 345-363; Heath & Raghavan, SIAM J. Matrix Anal.
Appl. 16 (1995) 235-253.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from signorini_fx.algebra.linalg.petsc_calls import call
from signorini_fx.arrays import Array, Indices, Ints
from signorini_fx.tuned import SAME_LENGTH

Numbers = npt.NDArray[np.intp]
_FACTOR_LU, _FACTOR_CHOLESKY = 1, 2  # MAT_FACTOR_LU and MAT_FACTOR_CHOLESKY of petscmat.h
_LU_SYMBOLIC = 25  # MATOP_LUFACTOR_SYMBOLIC
ERROR_IN_LIBRARY = 76  # PETSC_ERR_LIB
_ORDER_OF_USER = 1  # INFOG(7)
_NEGATIVE_PIVOTS = 12  # INFOG(12)
_SOLVE_INTERIOR_ONLY = 0  # ICNTL(26): the Schur variables are not touched
_MEMORY = (14, 100)  # ICNTL(14), per cent more than estimated
_SMALL = 20  # powers of two by which the entries of a load are smaller than those of the matrix
_LEAF = 32  # nodes that are not divided
_DEEPEST = 40  # halvings


class PartialFactor:
    """A symmetric matrix with its inner unknowns i eliminated and some unknowns c retained; one
    rank.

    Each load is one more row and column that is retained: the factorisation then condenses it,
    without a back substitution.

    Attributes:
        inner: the m inner unknowns.
        toward: A_ic, shape (m, c).
        negative: number of negative eigenvalues of A_ii, once it is factorised.

    Args:
        rows: of A, shape (n, n or more).
        places: for each column its position among the retained unknowns; -1: it is inner, or empty
            if it belongs to another rank.
        count: number of retained unknowns.
        loads: right-hand sides to condense.
        positions: of the first unknowns, which give the order of elimination; None: minimum degree.
        definite: whether A_ii is positive definite.
    """

    negative = 0

    def __init__(
        self,
        rows: sp.csr_array,
        places: Ints,
        count: int,
        loads: Sequence[Array] = (),
        positions: Array | None = None,
        *,
        definite: bool,
    ) -> None:
        self.inner = np.flatnonzero(places[: rows.shape[0]] < 0)
        self._count = count
        inside = self.inner.size
        # For an indefinite matrix, with a pressure, minimum degree takes fewer operations.
        self._in_order = positions is not None and definite and _order_is_taken()
        stay = places >= 0
        order = self.inner
        rows = sp.csr_array(rows[self.inner])
        if positions is not None and self._in_order:
            order = _dissected(rows, self.inner, positions)
        # First the inner unknowns in their order, then the retained ones, then the loads.
        numbers = np.full(places.size, -1, dtype=rows.indices.dtype)
        numbers[order] = np.arange(inside)
        numbers[stay] = inside + places[stay]
        self._order = numbers[self.inner]
        row = np.repeat(self._order, np.diff(rows.indptr))
        column = numbers[rows.indices]
        between = np.flatnonzero((column >= inside) & (rows.data != 0.0))
        row_between = np.searchsorted(rows.indptr, between, side="right") - 1
        entries = rows.data[between], (row_between, places[rows.indices[between]])
        self.toward = sp.csr_array(entries, shape=(inside, count))
        # With a Schur complement MUMPS does not scale the matrix, and would drop pivots below an
        # absolute threshold.
        self._unit = _power(np.abs(rows.data[column == row]).max(initial=0.0))
        # Loads are scaled so small that they do not influence the choice of pivots of an indefinite
        # matrix.
        self._sizes = np.array(
            [_power(np.abs(load[self.inner]).max(initial=0.0)) * 2.0**_SMALL for load in loads]
        )
        bordered = self._bordered(rows.data, row, column, loads)
        csr = (
            *(at.astype(PETSc.IntType, copy=False) for at in (bordered.indptr, bordered.indices)),
            bordered.data,
        )
        # MUMPS gets the part of these rows above the diagonal.
        self._matrix = PETSc.Mat().createAIJWithArrays(bordered.shape, csr, comm=PETSc.COMM_SELF)
        self._matrix.setOption(PETSc.Mat.Option.SPD, definite)

    def _bordered(
        self, values: Array, row: Ints, column: Ints, loads: Sequence[Array]
    ) -> sp.csr_array:
        """Return the upper triangle of the matrix that is factorised, the inner unknowns first.

            A_ii / unit   A_ic / unit   b_i / sizes
                          0             0
                                        0

        Args:
            values: the entries of the inner rows of A.
            row: the row of each entry in the new order.
            column: its column in the new order.
            loads: b, the right-hand sides to condense.
        """
        inside = self.inner.size
        # Zeros between inner unknowns are kept: the ordering is better with the same pattern for
        # all unknowns of a node.
        upper = (column >= row) & ((column < inside) | (values != 0.0))
        retained = np.arange(inside, inside + self._count + len(loads), dtype=row.dtype)
        of_loads = [load[self.inner] / size for load, size in zip(loads, self._sizes, strict=True)]
        size = inside + retained.size
        rows = (row[upper], np.tile(self._order, len(loads)), retained)
        columns = (column[upper], np.repeat(retained[self._count :], inside), retained)
        # Zeros on the diagonal of the retained unknowns: PETSc needs the entries.
        data = (values[upper] / self._unit, *of_loads, np.zeros(retained.size))
        places = (np.concatenate(rows), np.concatenate(columns))
        return sp.csr_array((np.concatenate(data), places), shape=(size, size))

    def eliminate(self) -> tuple[Array, Array]:
        """Factorise; call it once, when the caller needs the rows no more.

        Returns:
            -A_ci A_ii^-1 A_ic, symmetric, shape (c, c), and -A_ci A_ii^-1 b_i of each load, shape
            (loads, c).

        Raises:
            PETSc.Error: the factorisation broke down.
        """
        inside = self.inner.size
        count = self._count
        bordered = self._matrix
        del self._matrix
        if not inside:  # some versions of MUMPS fail with nothing to eliminate
            return np.zeros((count, count)), np.zeros((self._sizes.size, count))
        self._right, self._solution = bordered.createVecs()
        self._factor = handle = _factorise(bordered, inside, in_order=self._in_order)
        dense = ctypes.c_void_p()
        call("MatFactorGetSchurComplement", handle, ctypes.byref(dense), None)
        entries = ctypes.POINTER(ctypes.c_double)()
        call("MatDenseGetArrayRead", dense, ctypes.byref(entries))
        values = self._unit * np.ctypeslib.as_array(
            entries, shape=(bordered.getSize()[0] - inside,) * 2
        )
        call("MatDenseRestoreArrayRead", dense, ctypes.byref(entries))
        _symmetrise(values)
        call("MatMumpsSetIcntl", handle, 26, _SOLVE_INTERIOR_ONLY)
        self.negative = _infog(handle, _NEGATIVE_PIVOTS)
        return values[:count, :count], (self._sizes / self._unit)[:, None] * values[count:, :count]

    def solve(self, right: Array) -> Array:
        """Return A_ii^-1 times a right-hand side, shape (m,); a zero one needs no back
        substitution.
        """
        if not right.any():
            return np.zeros(right.size)
        self._right.set(0.0)
        self._right.getArray()[self._order] = right
        call("MatSolve", self._factor, self._right, self._solution)
        return self._solution.getArray(readonly=True)[self._order] / self._unit

    def __del__(self) -> None:
        if getattr(self, "_factor", None):
            call("MatDestroy", ctypes.byref(self._factor))


def _power(size: float) -> float:
    """Return the power of two nearest to a size; 1 for zero."""
    return float(2.0 ** np.round(np.log2(size))) if size > 0 else 1.0


@cache
def _order_is_taken() -> bool:
    """Return whether ``_factorise`` can prescribe the order of elimination, which some versions of
    PETSc ignore.
    """
    sample = PETSc.Mat().createSBAIJ(
        (3, 3), 1, csr=([0, 2, 3, 4], [0, 2, 1, 2], [1.0, 1.0, 1.0, 0.0]), comm=PETSc.COMM_SELF
    )
    try:
        factor = _factorise(sample, 2, in_order=True)
    except PETSc.Error:
        return False
    used = _infog(factor, 7)
    call("MatDestroy", ctypes.byref(factor))
    return used == _ORDER_OF_USER


def _infog(factor: ctypes.c_void_p, number: int) -> int:
    """Return an entry of INFOG, the information of MUMPS about a factorisation."""
    said = ctypes.c_int()
    call("MatMumpsGetInfog", factor, number, ctypes.byref(said))
    return said.value


def _factorise(matrix: PETSc.Mat, inside: int, *, in_order: bool) -> ctypes.c_void_p:
    """Factorise the first ``inside`` rows and columns of a symmetric matrix, in their order or by
    minimum degree.
    """
    broken = ctypes.c_int()
    info = (ctypes.c_double * 32)()  # MatFactorInfo is a struct of doubles; zeros are its defaults
    factor = ctypes.c_void_p()
    call("MatGetFactor", matrix, b"mumps", _FACTOR_CHOLESKY, ctypes.byref(factor))
    indices = np.arange(matrix.getSize()[0], dtype=PETSc.IntType)
    call(
        "MatFactorSetSchurIS", factor, PETSc.IS().createGeneral(indices[inside:], comm=matrix.comm)
    )
    call("MatMumpsSetIcntl", factor, *_MEMORY)
    if in_order:
        # PETSc passes an order to MUMPS only in the symbolic LU factorisation, so its function is
        # borrowed.
        lent = ctypes.c_void_p()
        symbolic = ctypes.c_void_p()
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
    if broken.value:
        call("MatDestroy", ctypes.byref(factor))
        raise PETSc.Error(ERROR_IN_LIBRARY)
    return factor


def _symmetrise(values: Array, block: int = 256) -> None:
    """Complete a symmetric matrix in place, of which MUMPS has filled the lower triangle, by
    columns.
    """
    values = values.T
    for k in range(0, values.shape[0], block):
        rows = slice(k, k + block)
        lower = np.tril(values[rows, rows])
        values[rows, rows] = lower + np.tril(lower, -1).T
        values[rows, k + block :] = values[k + block :, rows].T


# The last order, by a hash of pattern and positions: all tangents of a nonlinear body have the same
# pattern.  A wrong order would only cost time.
_last_dissected: dict[int, Numbers] = {}


def _dissected(rows: sp.csr_array, inner: Numbers, positions: Array) -> Numbers:
    """Return the inner unknowns in the order of nested dissection, those of a node one after
    another, shape (m,).

    Args:
        rows: the rows of the inner unknowns, with the columns of this rank first.
        inner: the inner unknowns, ascending.
        positions: of the first unknowns; the others are eliminated at the end.
    """
    body = hash((rows.indptr.tobytes(), inner.tobytes(), positions.tobytes()))
    if body in _last_dissected:
        return _last_dissected[body]
    behind = inner[inner >= len(positions)]
    inner = inner[inner < len(positions)]
    if not inner.size:
        return behind
    begins = np.ones(len(positions), dtype=bool)
    begins[1:] = np.logical_or.reduce([column[1:] != column[:-1] for column in positions.T])
    _, first, node = np.unique(np.cumsum(begins)[inner], return_index=True, return_inverse=True)
    number = np.full(rows.shape[1], -1)  # by the first inner unknown of each node
    number[inner[first]] = np.arange(first.size)
    node_rows = rows[first]
    columns = number[node_rows.indices]
    coupled = columns >= 0
    ends = np.concatenate(([0], np.cumsum(coupled)))[node_rows.indptr]
    columns = columns[coupled]
    graph = sp.csr_array(
        (np.broadcast_to(1.0, columns.size), columns, ends), shape=(first.size,) * 2
    )
    when = np.empty(first.size, dtype=np.intp)
    when[_nested_dissection(graph, positions.take(inner[first], axis=0))] = np.arange(first.size)
    _last_dissected.clear()
    _last_dissected[body] = np.concatenate((inner[np.argsort(when[node], kind="stable")], behind))
    return _last_dissected[body]


def _nested_dissection(graph: sp.csr_array, positions: Array) -> Numbers:
    """Return the nodes of a graph of symmetric pattern in the order of elimination, shape (n,)."""
    _, piece = connected_components(
        graph, directed=True, connection="weak"
    )  # the fastest option for a symmetric pattern
    path = _paths(positions, piece)
    apart = np.repeat(path, np.diff(graph.indptr)) ^ path[graph.indices]
    edges = np.flatnonzero(apart)
    # The halving that separates both nodes of an edge: the first bit in which their paths differ.
    level = (_DEEPEST - np.frexp(apart[edges].astype(np.float64))[1]).astype(np.int8)
    order = np.argsort(level, kind="stable")  # in linear time for such small integers
    halvings, counts = np.unique(level, return_counts=True)
    edges = edges[order]
    ends = np.cumsum(counts)[:-1]
    tails = np.searchsorted(graph.indptr, edges, side="right") - 1
    heads = graph.indices[edges]
    separates = np.full(path.size, _DEEPEST)  # halving that a node separates; _DEEPEST: none
    for halving, tail, head in zip(
        halvings.tolist(), np.split(tails, ends), np.split(heads, ends), strict=False
    ):
        unseparated = (
            (path[tail] < path[head])
            & (separates[tail] == _DEEPEST)
            & (separates[head] == _DEEPEST)
        )
        sides = [np.unique(side[unseparated]) for side in (tail, head)]
        halved = np.concatenate([path[side] >> (_DEEPEST - halving) for side in sides])
        number = np.unique(halved, return_inverse=True)[1]
        first, second = np.split(number, [sides[0].size])
        fewer = np.bincount(first, minlength=number.size) <= np.bincount(
            second, minlength=number.size
        )
        separates[sides[0][fewer[first]]] = halving
        separates[sides[1][~fewer[second]]] = halving
    behind = (1 << (_DEEPEST - separates)) - 1  # a separator comes after both halves
    inside = np.argsort((-separates).astype(np.int8), kind="stable")
    return inside[np.argsort((path | behind)[inside], kind="stable")]


def _paths(positions: Array, piece: Indices) -> Ints:
    """Return a number for each node, shape (n,): the number of its piece, followed by one bit for
    each halving of the piece, the side on which the node is.
    """
    # Round-off must not divide nodes in one plane, which would turn one separating layer into two.
    positions = np.rint(positions / (float(np.ptp(positions, axis=0).max()) * SAME_LENGTH or 1.0))
    paths = piece.astype(np.int64) << _DEEPEST
    for nodes in np.split(np.argsort(piece, kind="stable"), np.cumsum(np.bincount(piece))[:-1]):
        waiting = (
            [(cKDTree(positions.take(nodes, axis=0), leafsize=_LEAF).tree, 0, 0)]
            if nodes.size > _LEAF
            else []
        )
        while waiting:
            node, path, depth = waiting.pop()
            if node.split_dim < 0 or depth == _DEEPEST:
                paths[nodes[node.indices]] |= path << (_DEEPEST - depth)
            else:
                waiting += [
                    (node.lesser, 2 * path, depth + 1),
                    (node.greater, 2 * path + 1, depth + 1),
                ]
    return paths
