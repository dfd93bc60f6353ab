"""Two bodies condensed onto relative displacements, which contact reaches one by one as it does those of one body.

With S of ``ContactMap`` the rows of S B, divided by their columns k, are M, relative displacements for the unknowns k
of the nodes with points.  Among these M is the identity, so that those that are not prescribed can be replaced:

    x~ = (1 + N) x,   x = (1 - N) x~,   N: the rows k of M without its columns k,   N N = 0.

What contact reached of the other body is then eliminated with both bodies bonded: half of a dense matrix.  Prescribed
unknowns stay as they are, and what N takes of them becomes a load.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc
from scipy.linalg import cholesky, solve_triangular

from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.machine import parallel
from signorini_fx.tuned import LARGEST_CONDITION, LEFT_BY_SOLVES

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class RelativeUnknowns:
    """The change of m unknowns, and what is eliminated of them.

    Attributes:
        matrix: the dense matrix of those that stay.
        contact: B from those that stay.
        stay, gone: their numbers and those of the others, ascending.
        sums: N, shape (m, m).
        factor: lower Cholesky factor L of the rows and columns ``gone`` of (1 - N)^T A (1 - N), without prescribed
            columns of N.
        between: L^-1 times the columns ``stay`` of the rows ``gone``.
        dense, fixed: A, shape (m, m), and the prescribed ones of the m unknowns.
    """

    matrix: Array
    contact: ContactMap
    stay: npt.NDArray[np.intp]
    gone: npt.NDArray[np.intp]
    sums: Any
    factor: Array
    between: Array
    dense: Array
    fixed: npt.NDArray[np.bool_]

    @classmethod
    def of(cls, dense: Array, contact: ContactMap) -> RelativeUnknowns | None:
        """None: contact is with rigid foundations alone, or a relative displacement has no unknowns of its own;
        collective.

        Args:
            dense: A, prescribed rows and columns empty but for the diagonal, shape (m, m), the same on all ranks.
            contact: B, which reaches all m unknowns.
        """
        if contact.lift is None:
            return None
        comm = contact.points.comm
        operator, lift = (of_all_ranks(comm, part) for part in (contact.operator, contact.lift))
        lift.eliminate_zeros()
        points, fixed = np.diff(lift.indptr) > 0, parallel.gather_rows(comm, contact.fixed)
        # Across a plane of symmetry there is no relative displacement, see ``obstacles.mirrored_points``.
        movable = abs(operator).sum(axis=1) > LEFT_BY_SOLVES
        moving = abs(lift) @ movable > 0
        at_points, free = (sp.diags_array(flags.astype(np.float64)) for flags in (moving, ~fixed))
        mapping = sp.csr_array(lift @ operator)
        square = (at_points @ mapping @ at_points + sp.eye_array(points.size) - at_points).toarray()
        if at_points.sum() != movable.sum() or not np.linalg.cond(square, 1) < LARGEST_CONDITION:
            return None
        if abs(square - np.eye(points.size)).max() > LEFT_BY_SOLVES:  # points turn with their own nodes
            divided = np.linalg.solve(square, (at_points @ mapping).toarray())
            mapping = sp.csr_array(np.where(np.abs(divided) > LEFT_BY_SOLVES / 1000, divided, 0.0))
        couplings = mapping - mapping @ at_points
        sums = sp.csr_array(free @ couplings)
        # A prescribed component of a node with a point cannot be replaced: there contact reaches what it did.
        remaining = sp.csr_array(operator @ at_points @ (at_points + couplings - sums))
        remaining.eliminate_zeros()
        reached = points | (np.bincount(remaining.indices, minlength=points.size) > 0)
        stay, gone = np.flatnonzero(reached), np.flatnonzero(~reached)
        changed = _changed(dense, sp.csr_array(sums @ free)[points][:, ~points], points)
        held = True
        try:
            factor = cholesky(changed[np.ix_(gone, gone)], lower=True, overwrite_a=True, check_finite=False)
        except np.linalg.LinAlgError:  # to round-off not held, even if both bodies were bonded
            held = False
        if parallel.any_rank(comm, not held):
            return None
        between = solve_triangular(factor, changed[np.ix_(gone, stay)], lower=True, check_finite=False)
        matrix = changed[np.ix_(stay, stay)] - between.T @ between
        inside = _distributed(sp.csr_array(remaining[:, stay]), stay, contact, fixed)
        return cls(matrix, inside, stay, gone, sums, factor, between, dense, fixed)

    def load(self, load: Array, start: Array) -> tuple[Array, Array]:
        """A load at those that stay, and L^-1 times the one at the others; ``start``: with what is prescribed."""
        acting = load + self.dense @ (self.sums @ np.where(self.fixed, start, 0.0))
        acting = acting - np.where(self.fixed, 0.0, self.sums.T @ acting)
        inner = solve_triangular(self.factor, acting[self.gone], lower=True)
        return acting[self.stay] - self.between.T @ inner, inner

    def displacement(self, x: Array, inner: Array) -> Array:
        """The m unknowns from those that stay; ``inner``: of the load."""
        unknowns = np.empty(self.fixed.size)
        unknowns[self.stay] = x
        unknowns[self.gone] = solve_triangular(self.factor, inner - self.between @ x, lower=True, trans=1)
        return np.asarray(unknowns - self.sums @ unknowns)

    def unknowns(self, x: Array) -> Array:
        """Those that stay from the m unknowns."""
        return np.asarray((x + self.sums @ x)[self.stay])


def of_all_ranks(comm: MPI.Comm, matrix: PETSc.Mat) -> sp.csr_array:
    """A sparse matrix of the size of contact with the rows of all ranks, on every rank; collective."""
    starts, columns, values = matrix.getValuesCSR()
    counts, columns, values = (parallel.gather_rows(comm, part) for part in (np.diff(starts), columns, values))
    return sp.csr_array((values, columns, np.concatenate(([0], np.cumsum(counts)))), shape=matrix.getSize())


def _distributed(
    rows: sp.csr_array, stay: npt.NDArray[np.intp], contact: ContactMap, fixed: npt.NDArray[np.bool_]
) -> ContactMap:
    """B from the unknowns that stay, each on its own rank as the points are; ``rows``: of all ranks; collective."""
    first, last = contact.operator.getOwnershipRangeColumn()
    owned, (start, end) = stay[(first <= stay) & (stay < last)], contact.operator.getOwnershipRange()
    owned_rows = sp.csr_array(rows[start:end])
    csr = (owned_rows.indptr.astype(PETSc.IntType), owned_rows.indices.astype(PETSc.IntType), owned_rows.data)
    size = ((end - start, None), (owned.size, None))
    operator = PETSc.Mat().createAIJ(size, csr=csr, comm=contact.operator.comm)
    return ContactMap(operator, contact.points, fixed[owned], paired=contact.paired)


def _changed(dense: Array, sums: Any, points: npt.NDArray[np.bool_]) -> Array:
    """(1 - N)^T A (1 - N), which differs from A in the rows and columns without points; ``sums``: N between both."""
    changed, with_points, without_points = dense.copy(), np.flatnonzero(points), np.flatnonzero(~points)
    half = sums.T @ dense[with_points]
    changed[without_points] -= half
    changed[:, without_points] -= half.T
    changed[np.ix_(without_points, without_points)] += half[:, with_points] @ sums
    return changed
