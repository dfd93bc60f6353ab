"""The Schur complement on any number of ranks: each rank eliminates its own unknowns, and all ranks
eliminate those that separate them.

The unknowns of a rank that couple with those of a later one are the border.  Without the border and
without the retained unknowns, no two ranks couple, so that each factorises the matrix of its other
unknowns alone, without messages.  The remaining matrix is dense, and the border is as long as a cut
through the body; every rank has the whole matrix and eliminates the border.

Source: Przemieniecki, AIAA J. 1 (1963) 138-147.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc
from scipy.linalg import cholesky, solve_triangular

from signorini_fx.algebra.linalg.partial_factor import ERROR_IN_LIBRARY, PartialFactor
from signorini_fx.arrays import Array, Ints
from signorini_fx.machine import parallel


class SchurComplement:
    """A condensed onto some of its unknowns; collective, as all its methods are.

    Attributes:
        matrix: A.
        retained: local numbers of the retained dofs of this rank.
        dense: A_cc - A_ci A_ii^-1 A_ic, symmetric, the same on all ranks.
        loads: b_c - A_ci A_ii^-1 b_i of each load, shape (loads, c), the same on all ranks.
        between: the part of each load at the border, after elimination, shape (loads, border), the
            same on all ranks.
        regular: whether A_ii is positive definite.

    Args:
        matrix: A, symmetric; A_ii must be regular, on several ranks positive definite.
        retained: local numbers of the retained dofs c of this rank; those of all ranks stacked are
            in the order of the dense matrix.
        loads: right-hand sides b, the entries of this rank.
        positions: see ``PartialFactor``.
        definite: whether A is positive semi-definite.

    Raises:
        PETSc.Error: PETSc has no MUMPS, or a factorisation broke down.
    """

    def __init__(
        self,
        matrix: PETSc.Mat,
        retained: Ints,
        loads: Sequence[Array] = (),
        positions: Array | None = None,
        *,
        definite: bool = True,
    ) -> None:
        self.matrix = matrix
        self.retained = retained
        self._comm: MPI.Comm = matrix.comm.tompi4py()
        first, last = matrix.getOwnershipRange()
        rows, foreign = _own_columns_first(matrix)
        owned = last - first
        stay = parallel.gather_rows(self._comm, first + retained)
        self._border: Ints = np.zeros(0, dtype=np.int64)
        if foreign.size:
            separating = np.zeros(owned + foreign.size, dtype=bool)
            separating[owned:] = (foreign >= last) & ~np.isin(foreign, stay)
            entries = np.flatnonzero(separating[rows.indices] & (rows.data != 0.0))
            self._border = np.setdiff1d(
                np.searchsorted(rows.indptr, entries, side="right") - 1, retained
            )
        joint = np.concatenate((parallel.gather_rows(self._comm, first + self._border), stay))
        self._size = joint.size
        self._cut = joint.size - stay.size
        # For each column its number among the joint unknowns (border and retained); -1: it is
        # inner.
        numbers = np.full(owned + foreign.size, -1)
        local_joint = np.concatenate((self._border, retained))
        named = np.concatenate((local_joint, np.arange(owned, numbers.size)))
        numbers[named] = _places_in(joint, np.concatenate((first + local_joint, foreign)))
        touched = np.full(self._size, self._comm.size == 1)
        if self._comm.size > 1:
            inner = np.repeat(numbers[:owned] < 0, np.diff(rows.indptr)) & (rows.data != 0.0)
            touched[numbers[rows.indices[inner & (numbers >= 0)[rows.indices]]]] = True
        touched[0] = True  # at least one joint unknown, as MUMPS needs a Schur complement
        self._places = np.flatnonzero(touched)
        places = np.where(numbers >= 0, np.searchsorted(self._places, numbers), -1)
        between = sp.coo_array(rows[np.flatnonzero(numbers[:owned] >= 0)])
        stay_here = self._places.size
        self._factor = PartialFactor(rows, places, stay_here, loads, positions, definite=definite)
        del rows
        broken = False
        try:
            dense, condensed = self._factor.eliminate()
        except PETSc.Error:
            broken = True
        if parallel.any_rank(self._comm, broken):
            raise PETSc.Error(ERROR_IN_LIBRARY)
        self.regular = not parallel.any_rank(self._comm, self._factor.negative > 0)
        joint_entries = np.flatnonzero(numbers[between.col] >= 0)
        of_row = numbers[:owned][numbers[:owned] >= 0][between.row[joint_entries]]
        row, column, entry = (
            parallel.gather_rows(self._comm, part)
            for part in (of_row, numbers[between.col[joint_entries]], between.data[joint_entries])
        )
        beyond = sp.csr_array((entry, (row, column)), shape=(self._size, self._size))
        self.dense = self._eliminate_border(self._joined(beyond, dense))
        condensed_loads = [
            self._onto_retained(load, condensed[number]) for number, load in enumerate(loads)
        ]
        self.loads = np.reshape([load for load, _ in condensed_loads], (len(loads), stay.size))
        self.between = np.reshape(
            [between for _, between in condensed_loads], (len(loads), self._cut)
        )
        self._condensed = (loads[-1][self._factor.inner], condensed[-1]) if len(loads) else None

    def condense(self, load: PETSc.Vec) -> tuple[Array, Array]:
        """Return another load as one of ``loads``, and as one of ``between``.

        This takes one back substitution, or none if the last load differed only at retained
        unknowns.
        """
        values = load.getArray(readonly=True)
        inner = values[self._factor.inner]
        if self._condensed is None or not np.array_equal(inner, self._condensed[0]):
            self._condensed = inner, -self._factor.toward.T @ self._factor.solve(inner)
        return self._onto_retained(values, self._condensed[1])

    def recover(self, load: PETSc.Vec, between: Array, values: Array) -> PETSc.Vec:
        """Return all unknowns from the retained ones by one back substitution.

        Args:
            load: the load.
            between: the part of this load at the border.
            values: the retained unknowns of this rank.
        """
        at_joint = np.zeros(self._size)
        result = load.duplicate()
        at_joint[self._cut :] = parallel.gather_rows(self._comm, values)
        right = between - self._across @ at_joint[self._cut :]
        at_joint[: self._cut] = solve_triangular(
            self._border_factor, right, lower=True, trans=1, check_finite=False
        )
        unknowns = result.getArray()
        right = (
            load.getArray(readonly=True)[self._factor.inner]
            - self._factor.toward @ at_joint[self._places]
        )
        unknowns[self._factor.inner] = self._factor.solve(right)
        offset = parallel.rows_before(self._comm, self._border.size)
        unknowns[self._border] = at_joint[offset : offset + self._border.size]
        unknowns[self.retained] = values
        return result

    def _joined(self, beyond: sp.csr_array, dense: Array) -> Array:
        """Return the matrix of the joint unknowns, which are the border and the retained ones.

        Args:
            beyond: entries of A between joint unknowns, of all ranks.
            dense: Schur complement of this rank on the joint unknowns that it touches.
        """
        if self._comm.size == 1:
            entries = sp.coo_array(beyond)
            dense[entries.row, entries.col] += entries.data
            return dense
        matrix = beyond.toarray()
        for members, part in self._parts(self._places, dense):
            matrix[np.ix_(members, members)] += part.reshape(members.size, members.size)
        return matrix

    def _eliminate_border(self, matrix: Array) -> Array:
        """Eliminate the border from the matrix of the joint unknowns, and keep its factor and
        coupling.
        """
        cut = self._cut
        try:
            self._border_factor = cholesky(matrix[:cut, :cut], lower=True, check_finite=False)
        except np.linalg.LinAlgError:  # not definite, on all ranks
            raise PETSc.Error(ERROR_IN_LIBRARY) from None
        self._across = solve_triangular(
            self._border_factor, matrix[:cut, cut:], lower=True, check_finite=False
        )
        return matrix[cut:, cut:] - self._across.T @ self._across if cut else matrix

    def _onto_retained(self, load: Array, part: Array) -> tuple[Array, Array]:
        """Return a load at the retained unknowns after elimination of the border, and at the
        border.

        Args:
            load: the entries of this rank.
            part: the contribution of its inner unknowns.
        """
        joint_load = np.concatenate(
            [
                parallel.gather_rows(self._comm, load[unknowns])
                for unknowns in (self._border, self.retained)
            ]
        )
        for members, values in self._parts(self._places, part):
            joint_load[members] += values
        between = solve_triangular(
            self._border_factor, joint_load[: self._cut], lower=True, check_finite=False
        )
        return joint_load[self._cut :] - self._across.T @ between, between

    def _parts(self, places: Ints, values: Array) -> Iterator[tuple[Ints, Array]]:
        """Return, for each rank, numbers of joint unknowns and its values there, flat."""
        gathered = [parallel.gather_rows(self._comm, rows) for rows in (places, np.ravel(values))]
        ends = [np.cumsum(self._comm.allgather(size))[:-1] for size in (places.size, values.size)]
        return zip(
            *(np.split(rows, at) for rows, at in zip(gathered, ends, strict=True)), strict=True
        )


def _own_columns_first(matrix: PETSc.Mat) -> tuple[sp.csr_array, Ints]:
    """Return the rows of this rank with its own columns first, then those of other ranks, and the
    global numbers of the latter.
    """
    first, last = matrix.getOwnershipRange()
    starts, columns, values = matrix.getValuesCSR()
    if matrix.comm.size == 1:
        return sp.csr_array((values, columns, starts), shape=(last, last)), np.zeros(
            0, dtype=np.int64
        )
    columns -= first
    outside = np.flatnonzero((columns < 0) | (columns >= last - first))
    foreign, at = np.unique(columns[outside], return_inverse=True)
    columns[outside] = last - first + at
    rows = sp.csr_array(
        (values, columns, starts), shape=(last - first, last - first + foreign.size)
    )
    return rows, foreign.astype(np.int64) + first


def _places_in(names: Ints, wanted: Ints) -> Ints:
    """Return the position of each wanted name among ``names``; -1 if it is not there."""
    order = np.argsort(names)
    places = order[np.minimum(np.searchsorted(names[order], wanted), names.size - 1)]
    places[names[places] != wanted] = -1
    return places
