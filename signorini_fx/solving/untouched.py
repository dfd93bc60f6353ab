"""Dense tangents of contact, with what contact does not touch eliminated once for many of them.

With a dense A, and D zero at points that are apart, J = A + B^T D B differs from A at some unknowns k alone:

    J = (A_oo, A_ok; A_ko, J_kk),   A_oo = L L^T,   S = J_kk - A_ko A_oo^-1 A_ok.

While the unknowns k stay the same, or become a little fewer, only S is factorised again.  Eliminating the others costs
less than factorising J, so that nothing is lost where they change each time.  A_oo is regular if J is: what it maps to
zero, A does too, as A is positive semi-definite, and so does J.

Every rank has A and eliminates alike, and of the tangent only the rows and columns k travel.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc
from scipy.linalg import lapack, solve_triangular

from signorini_fx import parallel
from signorini_fx.linalg import ElasticSystem, options
from signorini_fx.linalg.callbacks import called_back
from signorini_fx.linalg.choice import SystemSize, choose_system
from signorini_fx.linalg.condensed import CondensedSystem
from signorini_fx.linalg.elasticity import Elasticity
from signorini_fx.tuned import FEWER_TOUCHED, FEWEST_UNTOUCHED

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Eliminated:
    """A matrix without some of its unknowns.

    Attributes:
        stays, gone: k and o, ascending.
        factor: L, lower.
        between: L^-1 A_ok.
        product: A_ko A_oo^-1 A_ok.
    """

    stays: Indices
    gone: Indices
    factor: Array
    between: Array
    product: Array


class UntouchedUnknowns:
    """Those of a dense matrix A, for all tangents made of it; all methods are collective.

    Args:
        matrix: A, symmetric and positive semi-definite; it stays as it is.
        entries: all of A, the same on all ranks.

    Attributes:
        comm: the ranks.
        here: which unknowns are on this rank.
    """

    def __init__(self, matrix: PETSc.Mat, entries: Array) -> None:
        self._matrix, self._entries = matrix, entries
        self.comm: MPI.Comm = matrix.comm.tompi4py()
        self.owned_range = slice(*matrix.getOwnershipRange())
        self._last: Eliminated | None = None

    def eliminated(self, tangent: Array) -> Eliminated | None:
        """A without unknowns at which a tangent does not differ from it; None: without none, or it is singular then.

        Args:
            tangent: the rows of this rank.
        """
        differs, last = tangent != self._matrix.getDenseArray(readonly=True), self._last
        touched = parallel.global_sum(self.comm, differs.any(axis=0).astype(np.int64)) > 0
        touched |= parallel.gather_rows(self.comm, differs.any(axis=1))
        if last is None or touched[last.gone].any() or np.count_nonzero(touched) < FEWER_TOUCHED * last.stays.size:
            self._last = _without(self._entries, np.flatnonzero(touched), np.flatnonzero(~touched))
        return self._last

    def among(self, tangent: Array, unknowns: Indices) -> Array:
        """The rows and columns of some unknowns, ascending, of a tangent whose rows of this rank are given."""
        rows = (
            unknowns[(self.owned_range.start <= unknowns) & (unknowns < self.owned_range.stop)] - self.owned_range.start
        )
        return parallel.gather_rows(self.comm, tangent[np.ix_(rows, unknowns)])


def _without(matrix: Array, stays: Indices, gone: Indices) -> Eliminated | None:
    if not (stays.size and gone.size):
        return None
    factor, failed = lapack.dpotrf(matrix[np.ix_(gone, gone)], lower=1)
    if failed:
        return None
    between = solve_triangular(factor, matrix[np.ix_(gone, stays)], lower=True, check_finite=False)
    return Eliminated(stays, gone, factor, between, between.T @ between)


class TangentFactor:
    """The factor of a tangent, as a context of PETSc's ``python`` preconditioner.

    Args:
        untouched: of A.
        symmetric: whether the tangents are symmetric, hence positive definite.
    """

    def __init__(self, untouched: UntouchedUnknowns, *, symmetric: bool) -> None:
        self._untouched = untouched
        self._symmetric = symmetric
        self._without: Eliminated | None = None
        self._factor: list[Any] = []

    @called_back
    def setUp(self, pc: PETSc.PC) -> None:
        """Factorise what is left of the tangent; a zero pivot is a failure of the preconditioner."""
        tangent = pc.getOperators()[1].getDenseArray(readonly=True)
        self._without = without = self._untouched.eliminated(tangent)
        schur = self._untouched.among(tangent, np.arange(tangent.shape[1]) if without is None else without.stays)
        if without is not None:
            schur -= without.product
        *self._factor, failed = lapack.dpotrf(schur, lower=1) if self._symmetric else lapack.dgetrf(schur)
        reasons = PETSc.PC.FailedReason
        pc.setFailedReason(reasons.FACTOR_NUMERIC_ZEROPIVOT if failed else reasons.NOERROR)

    @called_back
    def apply(self, pc: PETSc.PC, right: PETSc.Vec, x: PETSc.Vec) -> None:
        """X = J^-1 right."""
        self._solve(right, x, transposed=False)

    @called_back
    def applyTranspose(self, pc: PETSc.PC, right: PETSc.Vec, x: PETSc.Vec) -> None:
        """X = J^-T right."""
        self._solve(right, x, transposed=True)

    def _solve(self, right: PETSc.Vec, x: PETSc.Vec, *, transposed: bool) -> None:
        gathered = parallel.gather_rows(self._untouched.comm, right.getArray(readonly=True))
        x.getArray()[:] = self._solved(gathered, transposed=transposed)[self._untouched.owned_range]

    def _solved(self, right: Array, *, transposed: bool) -> Array:
        e = self._without
        if e is None:
            return self._inverse(right, transposed)
        inner = solve_triangular(e.factor, right[e.gone], lower=True, check_finite=False)
        solution = np.empty(right.size)
        solution[e.stays] = self._inverse(right[e.stays] - inner @ e.between, transposed)
        inner -= e.between @ solution[e.stays]
        solution[e.gone] = solve_triangular(e.factor, inner, lower=True, trans=1, check_finite=False)
        return solution

    def _inverse(self, right: Array, transposed: bool) -> Array:
        """S^-1 or S^-T."""
        if self._symmetric:
            return np.asarray(lapack.dpotrs(*self._factor, right, lower=1)[0])
        return np.asarray(lapack.dgetrs(*self._factor, right, trans=int(transposed))[0])


@dataclass
class TouchedSystem(CondensedSystem):
    """A condensed system whose tangents are factorised by ``TangentFactor``."""

    @cached_property
    def _untouched(self) -> UntouchedUnknowns:
        return UntouchedUnknowns(self.matrix, self.entries)

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """See ``ElasticSystem``."""
        ksp.setType(PETSc.KSP.Type.PREONLY)
        ksp.getPC().setType(PETSc.PC.Type.PYTHON)
        ksp.getPC().setPythonContext(TangentFactor(self._untouched, symmetric=symmetric))


def choose_touched(elasticity: Elasticity, size: SystemSize, requested: str) -> tuple[ElasticSystem, str]:
    """As ``choose_system``, but a ``TouchedSystem`` where it is condensed and large enough."""
    system, reason = choose_system(elasticity, size, requested)
    if not isinstance(system, CondensedSystem) or len(system.entries) < FEWEST_UNTOUCHED or options.user_sets("pc_"):
        return system, reason
    return TouchedSystem(**{field.name: getattr(system, field.name) for field in fields(CondensedSystem)}), reason
