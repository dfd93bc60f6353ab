"""The elastic system condensed onto the contact nodes: a small dense Schur complement.

The elastic operator never changes, and the nonlinearity is confined to the contact boundary.  So the interior is
eliminated once; all Newton steps of all outer iterations, load steps and values of gamma use the dense matrix, and the
interior is recovered at the end with the same factor.  The interior matrix is regular for a floating body too.

Contact points that are far from touching need not be reached: their unknowns are eliminated, too.  Such points stay
where they are while the problem is solved; ``find_far_points`` computes where the solution moves them, and whoever has
called them far has to find out whether they touch there.

Several ranks eliminate what is their own, see ``schur``.  Each has the rows of the dense matrix whose unknowns
it owns, as contact points are where their unknowns are; what is dense is so small that every rank does all of it.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.algebra.linalg.elasticity import Elasticity, LoadCase
from signorini_fx.algebra.linalg.factorisation import factor_type
from signorini_fx.algebra.linalg.schur import SchurComplement
from signorini_fx.machine import parallel


@dataclass
class CondensedSystem(ElasticSystem):
    """x holds the unknowns that B touches."""

    elasticity: Elasticity
    cases: list[_CondensedCase]
    schur: SchurComplement
    factors: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    recovered: tuple[npt.NDArray[np.float64], PETSc.Vec] | None = None  # x of this rank, and its displacement

    @classmethod
    def of(cls, elasticity: Elasticity) -> CondensedSystem:
        """Eliminate the interior and condense every load case.

        Raises:
            PETSc.Error: PETSc has no MUMPS, or the factorisation broke down.
        """
        e = elasticity
        first, last = e.matrix.getOwnershipRange()
        reaching = e.contact if e.far is None else e.contact.near(e.far.points, e.far.at)
        touched = np.unique(parallel.gather_rows(e.comm, np.unique(reaching.operator.getValuesCSR()[1])))
        retained = touched[(first <= touched) & (touched < last)] - first
        schur = e.eliminated
        if schur is None or parallel.any_rank(e.comm, not np.array_equal(schur.retained, retained)):
            loads = [case.load.getArray(readonly=True) for case in e.cases]
            schur = SchurComplement(e.matrix, retained, loads, e.positions, definite=e.definite)
            condensed = list(zip(schur.loads, schur.between, strict=True))
        else:
            condensed = [schur.condense(case.load) for case in e.cases]
        contact = reaching.among(retained)
        before = parallel.rows_before(e.comm, retained.size)
        columns = np.ascontiguousarray(schur.dense[:, before : before + retained.size])
        sizes = (retained.size, None)
        matrix = PETSc.Mat().createDense((sizes, sizes), array=columns.T, comm=e.comm)
        matrix.assemble()
        load, start = matrix.createVecRight(), matrix.createVecRight()
        resultant = np.zeros(e.free)
        system = cls(matrix, load, start, resultant, contact, e, [], schur)
        system.cases = [system._condensed(case, *load) for case, load in zip(e.cases, condensed, strict=True)]
        system.set_load(np.ones(len(e.cases)))
        return system

    @property
    def definite(self) -> bool:
        """It is, also where the matrix of all unknowns is not."""
        return True

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """A dense factorisation by LAPACK, on every rank."""
        ksp.setType(PETSc.KSP.Type.PREONLY)
        alone = self.comm.size == 1
        ksp.getPC().setType(factor_type(symmetric=symmetric) if alone else PETSc.PC.Type.REDUNDANT)

    def _condensed(
        self, case: LoadCase, load: npt.NDArray[np.float64], between: npt.NDArray[np.float64]
    ) -> _CondensedCase:
        """A load case and its condensed load of all ranks."""
        start = np.array(case.start.getArray(readonly=True)[self.schur.retained])
        return _CondensedCase(case, load[slice(*self.matrix.getOwnershipRange())], start, between)

    def find_far_points(self, x: PETSc.Vec) -> None:
        """Compute where the points are that no unknown reaches: one back substitution."""
        far, elsewhere = self.elasticity.far, self.contact.elsewhere
        if far is not None and elsewhere is not None:
            displacement = self.displacement(x)
            relative = np.column_stack(self.elasticity.contact.traces(displacement))
            elsewhere[far.points] = relative[far.points]
            self.recovered = np.array(x.getArray(readonly=True)), displacement

    def set_load(self, factors: npt.NDArray[np.float64]) -> None:
        """The condensed loads and the prescribed displacements times their factors."""
        self.factors, self.recovered = factors, None
        self.resultant = self.elasticity.resultant([case.case for case in self.cases], factors)
        shape = (len(self.cases), self.contact.fixed.size)
        self.load.getArray()[:] = factors @ np.reshape([case.load for case in self.cases], shape)
        self.start.getArray()[:] = factors @ np.reshape([case.start for case in self.cases], shape)

    def set_case(self, number: int, case: LoadCase) -> None:
        """Condense another right-hand side: one back substitution."""
        self.cases[number], self.recovered = self._condensed(case, *self.schur.condense(case.load)), None

    def with_load(self, load: PETSc.Vec) -> CondensedSystem:
        """The same with this load alone, condensed: one back substitution."""
        system, case = copy(self), replace(self.cases[0].case, load=load, start=load.duplicate())
        system.cases = [self._condensed(case, *self.schur.condense(load))]
        system.factors, system.load, system.recovered = np.ones(1), self.load.duplicate(), None
        system.load.getArray()[:] = system.cases[0].load
        return system

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """The interior recovered: x_i = A_ii^-1 (b_i - A_ic x_c)."""
        values = np.asarray(x.getArray(readonly=True))
        if self.recovered is not None and np.array_equal(values, self.recovered[0]):
            return self.recovered[1].copy()
        load = self.schur.matrix.createVecRight()
        load.set(0.0)
        for factor, case in zip(self.factors, self.cases, strict=True):
            load.axpy(factor, case.case.load)
        return self.schur.recover(load, self.factors @ [case.between for case in self.cases], values)

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """Those of the nodes that contact reaches."""
        x = self.load.duplicate()
        x.getArray()[:] = displacement.getArray(readonly=True)[self.schur.retained]
        return x


@dataclass(frozen=True)
class _CondensedCase:
    """A load case, and b_c - A_ci A_ii^-1 b_i and the prescribed values of the unknowns of this rank that stay;
    ``between``: of ``SchurComplement``.
    """

    case: LoadCase
    load: npt.NDArray[np.float64]
    start: npt.NDArray[np.float64]
    between: npt.NDArray[np.float64]
