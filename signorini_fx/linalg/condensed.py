"""The elastic system condensed onto the contact nodes: a small dense Schur complement, one rank.

The elastic operator never changes, and the nonlinearity is confined to the contact boundary.  So the interior is
eliminated once; all Newton steps of all outer iterations, load steps and values of gamma use the dense matrix, and the
interior is recovered at the end with the same factor.  The interior matrix is regular for a floating body too.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.contact.map import ContactMap
from signorini_fx.contact.points import ContactPoints
from signorini_fx.linalg.elasticity import Elasticity, LoadCase
from signorini_fx.linalg.schur import SchurComplement


@dataclass
class DenseSystem:
    """See ``ElasticSystem``: a dense matrix with one load, which stays as it is; one rank."""

    comm: MPI.Comm
    matrix: PETSc.Mat
    load: PETSc.Vec
    start: PETSc.Vec
    resultant: npt.NDArray[np.float64]
    fixed: npt.NDArray[np.bool_]
    contact: ContactMap

    @property
    def solver_defaults(self) -> dict[str, str]:
        """None."""
        return {}

    @property
    def inexact(self) -> bool:
        """Never: dense."""
        return False

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """A dense factorisation by LAPACK."""
        ksp.setType(PETSc.KSP.Type.PREONLY)
        ksp.getPC().setType(PETSc.PC.Type.CHOLESKY if symmetric else PETSc.PC.Type.LU)

    def factorise(self, ksp: PETSc.KSP, *, symmetric: bool) -> bool:
        """None: it is the default."""
        return False

    def keep_factor(self, ksp: PETSc.KSP, moved: int | None, forces: float, *, exact: bool = False) -> bool:
        """Only for the same matrix: a dense factorisation is cheap."""
        return moved == 0

    def set_load(self, factors: npt.NDArray[np.float64]) -> None:
        """Nothing: its load stays as it is."""

    def set_case(self, number: int, case: LoadCase) -> None:
        """Nothing, likewise."""

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """X itself."""
        return x

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """A copy."""
        return displacement.copy()

    def projected(self, change: Any, rows: npt.NDArray[np.int64], points: ContactPoints) -> DenseSystem:
        """The Galerkin system for x = start + P x~, at some of the contact points: P^T A P and P^T (b - A start).

        Its relative displacements count from those of ``start``.

        Args:
            change: P, scipy sparse, shape (unknowns, fewer), zero in the rows that are prescribed.
            rows: numbers of the contact points that it has, shape (n,).
            points: these points.
        """
        half = change.T @ self.matrix.getDenseArray(
            readonly=True
        )  # A is symmetric: both products are sparse times dense
        dense = np.asfortranarray(change.T @ half.T)
        matrix = PETSc.Mat().createDense(dense.shape, array=dense, comm=self.comm)
        matrix.assemble()
        load, start = matrix.createVecRight(), matrix.createVecRight()
        missing = self.load.duplicate()
        self.matrix.mult(self.start, missing)
        missing.aypx(-1.0, self.load)
        load.getArray()[:] = change.T @ missing.getArray(readonly=True)
        starts, columns, values = self.contact.operator.getValuesCSR()
        every = sp.csr_array((values, columns, starts), shape=self.contact.operator.getSize())
        some = sp.csr_array(every[(points.dimension * rows[:, None] + np.arange(points.dimension)).ravel()] @ change)
        csr = (some.indptr.astype(PETSc.IntType), some.indices.astype(PETSc.IntType), some.data)
        operator, free = (
            PETSc.Mat().createAIJ(some.shape, csr=csr, comm=self.comm),
            np.zeros(dense.shape[0], dtype=bool),
        )
        contact = ContactMap(operator, points, free)
        return DenseSystem(self.comm, matrix, load, start, self.resultant, free, contact)


@dataclass
class CondensedSystem(DenseSystem):
    """See ``ElasticSystem``: x holds the unknowns that B touches."""

    elasticity: Elasticity
    cases: list[_CondensedCase]
    schur: SchurComplement
    factors: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, elasticity: Elasticity) -> CondensedSystem:
        """Eliminate the interior and condense every load case.

        Raises:
            PETSc.Error: PETSc has no MUMPS, or the factorisation broke down.
        """
        e = elasticity
        retained = np.unique(e.contact.operator.getValuesCSR()[1]).astype(np.int32)
        schur = SchurComplement(e.matrix, retained)
        matrix = PETSc.Mat().createDense((retained.size, retained.size), array=schur.dense.T, comm=e.comm)
        matrix.assemble()
        fixed = e.fixed[retained]
        contact = e.contact.among(retained, fixed)
        load, start = matrix.createVecRight(), matrix.createVecRight()
        cases = [_CondensedCase.of(case, schur) for case in e.cases]
        system = cls(e.comm, matrix, load, start, np.zeros(e.free), fixed, contact, e, cases, schur)
        system.set_load(np.ones(len(cases)))
        return system

    def set_load(self, factors: npt.NDArray[np.float64]) -> None:
        """The condensed loads and the prescribed displacements times their factors."""
        self.factors = factors
        self.resultant = self.elasticity.resultant([case.case for case in self.cases], factors)
        shape = (len(self.cases), self.fixed.size)
        self.load.getArray()[:] = factors @ np.reshape([case.load for case in self.cases], shape)
        self.start.getArray()[:] = factors @ np.reshape([case.start for case in self.cases], shape)

    def set_case(self, number: int, case: LoadCase) -> None:
        """Condense another right-hand side: one back substitution."""
        self.cases[number] = _CondensedCase.of(case, self.schur)

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """The interior recovered: x_i = A_ii^-1 (b_i - A_ic x_c)."""
        retained = self.schur.retained
        lifted, right = self.schur.matrix.createVecs()
        lifted.set(0.0)
        lifted.getArray()[retained] = x.getArray(readonly=True)
        self.schur.matrix.mult(lifted, right)
        right.getArray()[retained] = 0.0
        result = self.schur.solve_interior(right)
        result.scale(-1.0)
        for factor, case in zip(self.factors, self.cases, strict=True):
            result.axpy(factor, case.interior)
        result.getArray()[retained] = x.getArray(readonly=True)
        return result

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """Those of the nodes that contact reaches."""
        x = self.load.duplicate()
        x.getArray()[:] = displacement.getArray(readonly=True)[self.schur.retained]
        return x


@dataclass(frozen=True)
class _CondensedCase:
    """A load case, its interior x_i = A_ii^-1 b_i, and b_c - A_ci x_i and the prescribed values at the rest."""

    case: LoadCase
    interior: PETSc.Vec
    load: npt.NDArray[np.float64]
    start: npt.NDArray[np.float64]

    @classmethod
    def of(cls, case: LoadCase, schur: SchurComplement) -> _CondensedCase:
        """One back substitution."""
        interior, residual = schur.solve_interior(case.load), case.load.duplicate()
        schur.matrix.mult(interior, residual)
        residual.aypx(-1.0, case.load)
        load, start = (np.array(vector.getArray(readonly=True)[schur.retained]) for vector in (residual, case.start))
        return cls(case, interior, load, start)
