"""The Schur complement on several ranks: each eliminates what is its own, and all what separates them.

The unknowns of a rank that couple with those of a later one are the border.  Without it, and without the unknowns that
stay, no two ranks couple, so that each factorises alone the matrix of its others, which need no messages.  What is left
is dense, the border in it as long as a cut through the body; every rank has all of it and eliminates the border too.

Source: Przemieniecki, AIAA J. 1 (1963) 138-147.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc
from scipy.linalg import cho_solve, cholesky, solve_triangular

from signorini_fx import parallel
from signorini_fx.linalg.schur import SchurComplement

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


class Substructures:
    """What ``SchurComplement`` is on one rank, of a positive definite A_ii; collective, as all its methods are.

    Args:
        matrix: A.
        retained: local numbers of the dofs c of this rank that stay; those of all ranks stacked are in the order of the
            dense matrix.
        loads: right-hand sides b, the entries of this rank.

    Attributes:
        dense: A_cc - A_ci A_ii^-1 A_ic, the same on all ranks.
        loads: b_c - A_ci A_ii^-1 b_i of each load, shape (loads, c), the same on all ranks.

    Raises:
        PETSc.Error: PETSc has no MUMPS, or a factorisation broke down.
    """

    def __init__(self, matrix: PETSc.Mat, retained: Indices, loads: Sequence[Array] = ()) -> None:
        self.matrix, self.retained = matrix, retained
        self._comm: MPI.Comm = matrix.comm.tompi4py()
        first, last = matrix.getOwnershipRange()
        starts, columns, values = matrix.getValuesCSR()
        # The columns of this rank first, then those of others.
        others, own = np.unique(columns[(columns < first) | (columns >= last)]), last - first
        known = np.where((columns < first) | (columns >= last), own + np.searchsorted(others, columns), columns - first)
        rows = sp.csr_array((values, known, starts), shape=(own, own + others.size))
        rows.eliminate_zeros()
        stay = parallel.gather_rows(self._comm, first + retained)
        flags = np.zeros(own + others.size, dtype=bool)
        flags[own:] = (others >= last) & ~np.isin(others, stay)
        separating = np.searchsorted(rows.indptr, np.flatnonzero(flags[rows.indices]), side="right") - 1
        self._border = np.setdiff1d(separating, retained)
        joint = np.concatenate((parallel.gather_rows(self._comm, first + self._border), stay))
        self._size, order = joint.size, np.argsort(joint)
        # Of each column its number among the joint unknowns; -1: it is inner.
        numbers = np.full(own + others.size, -1)
        names = np.concatenate((first + np.concatenate((self._border, retained)), others))
        places = order[np.minimum(np.searchsorted(joint[order], names), joint.size - 1)]
        places[joint[places] != names] = -1
        numbers[np.concatenate((self._border, retained, np.arange(own, numbers.size)))] = places
        self._inner = np.flatnonzero(numbers[:own] < 0)
        inside, between = rows[self._inner], sp.coo_array(rows[np.flatnonzero(numbers[:own] >= 0)])
        # One joint unknown at least, as MUMPS must leave something.
        self._places = np.unique(np.append(numbers[inside.indices], [-1, 0]))[1:]
        self._local: SchurComplement | None = None  # some MUMPS fail with nothing to eliminate
        touched = self._places.size
        parts = np.zeros((touched, touched)), np.zeros((len(loads), touched))
        if self._inner.size:
            self._local = SchurComplement(
                self._coupled(inside, numbers),
                np.arange(self._inner.size, self._inner.size + touched, dtype=np.int32),
                [self._of_inner(load) for load in loads],
                definite=True,
            )
            parts = self._local.dense, self._local.loads
        at = np.flatnonzero(numbers[between.col] >= 0)
        of_row = numbers[:own][numbers[:own] >= 0][between.row[at]]
        row, column, entry = (
            parallel.gather_rows(self._comm, one) for one in (of_row, numbers[between.col[at]], between.data[at])
        )
        whole = sp.coo_array((entry, (row, column)), shape=(self._size,) * 2).toarray()
        for there, part in self._parts(parts[0]):
            whole[np.ix_(there, there)] += part.reshape(there.size, there.size)

        cut = self._size - stay.size
        try:
            self._factor = cholesky(whole[:cut, :cut], lower=True, check_finite=False)
        except np.linalg.LinAlgError:  # not finite, as the solution will not be either
            self._factor = np.full((cut, cut), np.nan)
        self._across = solve_triangular(self._factor, whole[:cut, cut:], lower=True, check_finite=False)
        self.dense: Array = whole[cut:, cut:] - self._across.T @ self._across
        condensed = [self._onto_retained(self._joined(load, part)) for load, part in zip(loads, parts[1], strict=True)]
        self.loads = np.reshape(condensed, (len(condensed), stay.size))

    def solve_interior(self, right: PETSc.Vec) -> PETSc.Vec:
        """A_ii^-1 right_i in the interior, zero at the kept dofs: two back substitutions."""
        result, values = right.duplicate(), np.array(right.getArray(readonly=True))
        values[self.retained] = 0.0
        local = PETSc.Vec().createWithArray(self._of_inner(values), comm=PETSc.COMM_SELF)
        cut = self._factor.shape[0]
        at_joint = np.zeros(self._size)
        at_joint[:cut] = cho_solve((self._factor, True), self._joined(values, self._condensed(local))[:cut])
        result.set(0.0)
        if self._local is not None:
            count, placed, moved = self._inner.size, local.duplicate(), local.duplicate()
            placed.set(0.0)
            placed.getArray()[count:] = at_joint[self._places]
            self._local.matrix.mult(placed, moved)
            moved.aypx(-1.0, local)
            moved.getArray()[count:] = 0.0
            result.getArray()[self._inner] = self._local.solve_interior(moved).getArray(readonly=True)[:count]
        before = parallel.rows_before(self._comm, self._border.size)
        result.getArray()[self._border] = at_joint[before : before + self._border.size]
        return result

    def condense(self, load: PETSc.Vec) -> Array:
        """Another load, shape (c,), the same on all ranks: one back substitution."""
        values = np.array(load.getArray(readonly=True))
        local = PETSc.Vec().createWithArray(self._of_inner(values), comm=PETSc.COMM_SELF)
        return self._onto_retained(self._joined(values, self._condensed(local)))

    def _coupled(self, rows: Any, numbers: Indices) -> PETSc.Mat:
        """The matrix of the inner unknowns and behind them of the joint ones that they couple with, among which it is
        zero.

        Args:
            rows: those of the inner unknowns, scipy sparse.
            numbers: of each of its columns among the joint unknowns, -1: it is inner.
        """
        count, size = self._inner.size, self._inner.size + self._places.size
        to = count + np.searchsorted(self._places, numbers)
        to[self._inner] = np.arange(count)
        upper = sp.csr_array((rows.data, to[rows.indices], rows.indptr), shape=(count, size))
        lower = sp.hstack((upper[:, count:].T, _zeros(size - count)), format="csr")
        both = sp.vstack((upper, lower), format="csr")
        both.sort_indices()
        csr = (both.indptr.astype(PETSc.IntType), both.indices.astype(PETSc.IntType), both.data)
        return PETSc.Mat().createAIJ((size, size), csr=csr, comm=PETSc.COMM_SELF)

    def _condensed(self, load: PETSc.Vec) -> Array:
        """What a load of the inner unknowns is to the joint ones that they couple with."""
        return np.zeros(self._places.size) if self._local is None else self._local.condense(load)

    def _of_inner(self, values: Array) -> Array:
        """Values of this rank at its inner unknowns, and zero at the joint ones that it touches."""
        return np.concatenate((values[self._inner], np.zeros(self._places.size)))

    def _joined(self, load: Array, part: Array) -> Array:
        """A load of all joint unknowns, from that of this rank and what it is to those that the rank touches."""
        found = np.concatenate([parallel.gather_rows(self._comm, load[one]) for one in (self._border, self.retained)])
        for there, values in self._parts(part):
            found[there] += values
        return found

    def _onto_retained(self, load: Array) -> Array:
        """A load of all joint unknowns without the border."""
        cut = self._factor.shape[0]
        eliminated = solve_triangular(self._factor, load[:cut], lower=True)
        return np.asarray(load[cut:] - self._across.T @ eliminated)

    def _parts(self, values: Array) -> list[tuple[Indices, Array]]:
        """The joint unknowns that each rank touches, and its values, flat."""
        every = [parallel.gather_rows(self._comm, one) for one in (self._places, np.ravel(values))]
        ends = [np.cumsum(self._comm.allgather(size))[:-1] for size in (self._places.size, values.size)]
        return list(zip(*(np.split(one, at) for one, at in zip(every, ends, strict=True)), strict=True))


def _zeros(size: int) -> sp.csr_array:
    """A square matrix with a diagonal, which is zero."""
    return sp.csr_array((np.zeros(size), np.arange(size), np.arange(size + 1)), shape=(size, size))
