"""The Schur complement on any number of ranks: each eliminates what is its own, and all what
separates them.

The unknowns of a rank that couple with those of a later one are the border.  Without it, and
without the unknowns that stay, no two ranks couple, so that each factorises alone the matrix of its
others, which need no messages.  What is left is dense, the border as long as a cut through the
body; every rank has all of it and eliminates the border.

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

    ``matrix``: A, symmetric, of which A_ii must be regular, on several ranks positive definite;
    ``retained``: local numbers of the dofs c of this rank that stay; those of all ranks stacked are
    in the order of the dense matrix;
    ``loads``: right-hand sides b, the entries of this rank; ``positions``: see ``PartialFactor``.

    Attributes:
        dense: A_cc - A_ci A_ii^-1 A_ic, symmetric, the same on all ranks.
        loads: b_c - A_ci A_ii^-1 b_i of each load, shape (loads, c), the same on all ranks.
        between: of each load what it is to the border, eliminated, shape (loads, border), the same
            on all ranks.
        regular: whether A_ii is positive definite.

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
        # Of each column its number among the joint unknowns; -1: it is inner.
        numbers = np.full(owned + foreign.size, -1)
        local_joint = np.concatenate((self._border, retained))
        named = np.concatenate((local_joint, np.arange(owned, numbers.size)))
        numbers[named] = _places_in(joint, np.concatenate((first + local_joint, foreign)))
        touched = np.full(self._size, self._comm.size == 1)
        if self._comm.size > 1:
            inner = np.repeat(numbers[:owned] < 0, np.diff(rows.indptr)) & (rows.data != 0.0)
            touched[numbers[rows.indices[inner & (numbers >= 0)[rows.indices]]]] = True
        touched[0] = True  # one joint unknown at least, as MUMPS must leave something
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
        """Another load as one of ``loads``, and as one of ``between``: one back substitution, or
        none where the last load was the same but for unknowns that stay.
        """
        values = load.getArray(readonly=True)
        inner = values[self._factor.inner]
        if self._condensed is None or not np.array_equal(inner, self._condensed[0]):
            self._condensed = inner, -self._factor.toward.T @ self._factor.solve(inner)
        return self._onto_retained(values, self._condensed[1])

    def recover(self, load: PETSc.Vec, between: Array, values: Array) -> PETSc.Vec:
        """Return all unknowns, from those of this rank that stay: one back substitution.

        ``between``: of this load.
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
        """Return the matrix of the joint unknowns.

        ``beyond``: entries of all ranks, ``dense``: of those it touches.
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
        """Return the matrix of the joint unknowns without the border, whose factor and coupling
        stay.
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
        """Return a load at all that stay without the border, and at the border.

        ``part``: of its inner unknowns.
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
        """Return numbers of joint unknowns of each rank, and its values there, flat."""
        gathered = [parallel.gather_rows(self._comm, rows) for rows in (places, np.ravel(values))]
        ends = [np.cumsum(self._comm.allgather(size))[:-1] for size in (places.size, values.size)]
        return zip(
            *(np.split(rows, at) for rows, at in zip(gathered, ends, strict=True)), strict=True
        )


def _own_columns_first(matrix: PETSc.Mat) -> tuple[sp.csr_array, Ints]:
    """Return the rows of this rank, their columns those of this rank first, then those of others,
    and the names of these.
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
    """Return the position of each of some names among others, -1: it has none."""
    order = np.argsort(names)
    places = order[np.minimum(np.searchsorted(names[order], wanted), names.size - 1)]
    places[names[places] != wanted] = -1
    return places
