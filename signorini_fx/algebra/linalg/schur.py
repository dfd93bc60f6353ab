"""The Schur complement on any number of ranks: each eliminates what is its own, and all what separates them.

The unknowns of a rank that couple with those of a later one are the border.  Without it, and without the unknowns that
stay, no two ranks couple, so that each factorises alone the matrix of its others, which need no messages.  What is left
is dense, the border as long as a cut through the body; every rank has all of it and eliminates each body's border.

Source: Przemieniecki, AIAA J. 1 (1963) 138-147.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc
from scipy.linalg import cholesky, solve_triangular
from scipy.sparse.csgraph import connected_components

from signorini_fx.algebra.linalg.partial_factor import ERROR_IN_LIBRARY, PartialFactor
from signorini_fx.machine import parallel

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


class SchurComplement:
    """A condensed onto some of its unknowns; collective, as all its methods are.

    Args:
        matrix: A, symmetric, of which A_ii must be regular, on several ranks positive definite.
        retained: local numbers of the dofs c of this rank that stay; those of all ranks stacked are in the order of the
            dense matrix.
        loads: right-hand sides b, the entries of this rank.
        positions: see ``PartialFactor``.
        definite: whether A_ii is positive definite.

    Attributes:
        dense: A_cc - A_ci A_ii^-1 A_ic, symmetric, the same on all ranks.
        loads: b_c - A_ci A_ii^-1 b_i of each load, shape (loads, c), the same on all ranks.
        between: of each load what it is to the border, eliminated, shape (loads, border), the same on all ranks.

    Raises:
        PETSc.Error: PETSc has no MUMPS, or a factorisation broke down.
    """

    def __init__(
        self,
        matrix: PETSc.Mat,
        retained: Indices,
        loads: Sequence[Array] = (),
        positions: Array | None = None,
        *,
        definite: bool = True,
    ) -> None:
        self.matrix, self.retained = matrix, retained
        self._comm: MPI.Comm = matrix.comm.tompi4py()
        (first, last), (rows, foreign) = matrix.getOwnershipRange(), _own_columns_first(matrix)
        owned, stay = last - first, parallel.gather_rows(self._comm, first + retained)
        self._border: Indices = np.zeros(0, dtype=np.int64)
        if foreign.size:
            separating = np.zeros(owned + foreign.size, dtype=bool)
            separating[owned:] = (foreign >= last) & ~np.isin(foreign, stay)
            entries = np.flatnonzero(separating[rows.indices] & (rows.data != 0.0))
            self._border = np.setdiff1d(np.searchsorted(rows.indptr, entries, side="right") - 1, retained)
        joint = np.concatenate((parallel.gather_rows(self._comm, first + self._border), stay))
        self._size, self._cut = joint.size, joint.size - stay.size
        # Of each column its number among the joint unknowns; -1: it is inner.
        numbers, local_joint = np.full(owned + foreign.size, -1), np.concatenate((self._border, retained))
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
        joint_entries = np.flatnonzero(numbers[between.col] >= 0)
        of_row = numbers[:owned][numbers[:owned] >= 0][between.row[joint_entries]]
        row, column, entry = (
            parallel.gather_rows(self._comm, part)
            for part in (of_row, numbers[between.col[joint_entries]], between.data[joint_entries])
        )
        beyond = sp.csr_array((entry, (row, column)), shape=(self._size, self._size))
        self._blocks, self.dense = self._eliminated(beyond, dense)
        condensed_loads = [self._onto_retained(load, condensed[number]) for number, load in enumerate(loads)]
        self.loads = np.reshape([load for load, _ in condensed_loads], (len(loads), stay.size))
        self.between = np.reshape([between for _, between in condensed_loads], (len(loads), self._cut))
        self._condensed = (loads[-1][self._factor.inner], condensed[-1]) if len(loads) else None

    @property
    def positive_inside(self) -> bool:
        """Whether A_ii is positive definite, whatever it was taken for; on several ranks what each eliminates alone."""
        return not parallel.any_rank(self._comm, self._factor.negative > 0)

    def condense(self, load: PETSc.Vec) -> tuple[Array, Array]:
        """Another load as one of ``loads``, and as one of ``between``: one back substitution, or none where the last
        load was the same but for unknowns that stay.
        """
        values = load.getArray(readonly=True)
        inner = values[self._factor.inner]
        if self._condensed is None or not np.array_equal(inner, self._condensed[0]):
            self._condensed = inner, -self._factor.toward.T @ self._factor.solve(inner)
        return self._onto_retained(values, self._condensed[1])

    def recover(self, load: PETSc.Vec, between: Array, values: Array) -> PETSc.Vec:
        """All unknowns, from those that stay: one back substitution.

        Args:
            load: b.
            between: of this load.
            values: x_c of this rank.
        """
        at_joint, result = np.zeros(self._size), load.duplicate()
        at_joint[self._cut :] = parallel.gather_rows(self._comm, values)
        for block in self._blocks:
            right = between[block.border] - block.across @ at_joint[self._cut + block.stay]
            at_joint[block.border] = solve_triangular(block.factor, right, lower=True, trans=1, check_finite=False)
        unknowns = result.getArray()
        right = load.getArray(readonly=True)[self._factor.inner] - self._factor.toward @ at_joint[self._places]
        unknowns[self._factor.inner] = self._factor.solve(right)
        offset = parallel.rows_before(self._comm, self._border.size)
        unknowns[self._border] = at_joint[offset : offset + self._border.size]
        unknowns[self.retained] = values
        return result

    def _uncoupled(self, beyond: sp.csr_array, dense: Array) -> list[Indices]:
        """The joint unknowns in parts that do not couple: those that have a border, and one of all others; ``beyond``:
        entries between those of all ranks, ``dense``: between those that this rank touches.
        """
        if not self._cut:
            return [np.arange(self._size)]
        first, coupled = np.arange(len(dense)), dense != 0.0
        waiting: npt.NDArray[np.bool_] = np.ones(len(dense), dtype=bool)
        while waiting.any():
            begin = int(np.argmax(waiting))
            members, grown = np.zeros_like(waiting), np.arange(len(dense)) == begin
            while (grown & ~members).any():
                members, grown = grown, coupled[grown].any(axis=0) | grown
            first[members], waiting = begin, waiting & ~members
        pairs = parallel.gather_rows(self._comm, np.column_stack((self._places, self._places[first])))
        edges = sp.coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=beyond.shape)
        _, label = connected_components(abs(beyond) + edges, directed=False)
        label[~np.isin(label, label[: self._cut])] = -1
        return [np.flatnonzero(label == number) for number in np.unique(label)]

    def _eliminated(self, beyond: sp.csr_array, dense: Array) -> tuple[list[_Block], Array]:
        """The parts of the joint unknowns, and their matrix without the border; arguments as for ``_uncoupled``."""
        blocks, schur = [], np.zeros((self._size - self._cut,) * 2)  # as long as it is empty it takes no memory
        for joint in self._uncoupled(beyond, dense):
            block_matrix = self._among(joint, beyond, dense)
            cut = np.searchsorted(joint, self._cut)
            border, stay = joint[:cut], joint[cut:] - self._cut
            try:
                factor = cholesky(block_matrix[:cut, :cut], lower=True, check_finite=False)
            except np.linalg.LinAlgError:  # not finite, as the solution will not be either
                factor = np.full((cut, cut), np.nan)
            across = solve_triangular(factor, block_matrix[:cut, cut:], lower=True, check_finite=False)
            matrix = block_matrix[cut:, cut:] - across.T @ across if cut else block_matrix
            blocks.append(_Block(border, stay, factor, across))
            if joint.size == self._size:
                return blocks, matrix
            schur[np.ix_(stay, stay)] = matrix
        return blocks, schur

    def _among(self, joint: Indices, beyond: sp.csr_array, dense: Array) -> Array:
        """The matrix of some joint unknowns; their numbers, ascending, and arguments as for ``_uncoupled``."""
        if self._comm.size == 1:
            entries = sp.coo_array(beyond)
            dense[entries.row, entries.col] += entries.data
            return dense
        block_matrix, mine = beyond[joint][:, joint].toarray(), np.flatnonzero(np.isin(self._places, joint))
        for members, part in self._parts(np.searchsorted(joint, self._places[mine]), dense[np.ix_(mine, mine)]):
            block_matrix[np.ix_(members, members)] += part.reshape(members.size, members.size)
        return np.asarray(block_matrix)

    def _onto_retained(self, load: Array, part: Array) -> tuple[Array, Array]:
        """A load of this rank at all that stay without the border, and at the border, eliminated; ``part``: of its
        inner unknowns.
        """
        joint_load = np.concatenate(
            [parallel.gather_rows(self._comm, load[unknowns]) for unknowns in (self._border, self.retained)]
        )
        for members, values in self._parts(self._places, part):
            joint_load[members] += values
        between, retained_load = np.empty(self._cut), joint_load[self._cut :]
        for block in self._blocks:
            right = joint_load[block.border]
            between[block.border] = solve_triangular(block.factor, right, lower=True, check_finite=False)
            retained_load[block.stay] -= block.across.T @ between[block.border]
        return retained_load, between

    def _parts(self, places: Indices, values: Array) -> Iterator[tuple[Indices, Array]]:
        """Numbers of joint unknowns of each rank, and its values there, flat."""
        gathered = [parallel.gather_rows(self._comm, rows) for rows in (places, np.ravel(values))]
        ends = [np.cumsum(self._comm.allgather(size))[:-1] for size in (places.size, values.size)]
        return zip(*(np.split(rows, at) for rows, at in zip(gathered, ends, strict=True)), strict=True)


@dataclass(frozen=True)
class _Block:
    """Joint unknowns that couple with no others: border and others, the Cholesky factor L of the border, and L^-1 times
    the coupling of both.
    """

    border: Indices
    stay: Indices
    factor: Array
    across: Array


def _own_columns_first(matrix: PETSc.Mat) -> tuple[sp.csr_array, Indices]:
    """The rows of this rank, their columns those of this rank first, then those of others, and the names of these."""
    first, last = matrix.getOwnershipRange()
    starts, columns, values = matrix.getValuesCSR()
    if matrix.comm.size == 1:
        return sp.csr_array((values, columns, starts), shape=(last, last)), np.zeros(0, dtype=np.int64)
    columns -= first
    outside = np.flatnonzero((columns < 0) | (columns >= last - first))
    foreign, at = np.unique(columns[outside], return_inverse=True)
    columns[outside] = last - first + at
    rows = sp.csr_array((values, columns, starts), shape=(last - first, last - first + foreign.size))
    return rows, foreign.astype(np.int64) + first


def _places_in(names: Indices, wanted: Indices) -> Indices:
    """Where each of some names is among others, -1: nowhere."""
    order = np.argsort(names)
    places = order[np.minimum(np.searchsorted(names[order], wanted), names.size - 1)]
    places[names[places] != wanted] = -1
    return places
