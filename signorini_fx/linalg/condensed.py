"""The elastic system condensed onto the contact nodes: a small dense Schur complement, one rank.

The elastic operator never changes, and the nonlinearity is confined to the contact boundary.  So the interior is
eliminated once; all Newton steps of all outer iterations, load steps and values of gamma use the dense matrix, and the
interior is recovered at the end with the same factor.  The interior matrix is regular for a floating body too.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.contact.map import ContactMap
from signorini_fx.contact.motions import RigidLoad
from signorini_fx.linalg.elasticity import Elasticity, LoadCase
from signorini_fx.linalg.relative import RelativeUnknowns
from signorini_fx.linalg.schur import SchurComplement


@dataclass
class DenseSystem:
    """See ``ElasticSystem``: a dense matrix with one load, which stays as it is; one rank."""

    definite = True  # also where the matrix of all unknowns is not
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

    def with_load(self, load: PETSc.Vec) -> DenseSystem:
        """The same with this load."""
        return replace(self, load=load.copy())

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """X itself."""
        return x

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """A copy."""
        return displacement.copy()


@dataclass
class CondensedSystem(DenseSystem):
    """See ``ElasticSystem``: x holds the unknowns that B touches, of two bodies relative displacements where it can."""

    elasticity: Elasticity
    cases: list[_CondensedCase]
    schur: SchurComplement
    relative: RelativeUnknowns | None
    factors: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, elasticity: Elasticity) -> CondensedSystem:
        """Eliminate the interior and condense every load case.

        Raises:
            PETSc.Error: PETSc has no MUMPS, or the factorisation broke down.
        """
        e = elasticity
        retained = np.unique(e.contact.operator.getValuesCSR()[1]).astype(np.int32)
        loads = [case.load.getArray(readonly=True) for case in e.cases]
        schur = SchurComplement(e.matrix, retained, loads, definite=e.definite)
        contact = e.contact.among(retained, e.fixed[retained])
        dense, relative = schur.dense, RelativeUnknowns.of(schur.dense, contact)
        if relative is not None:
            dense, contact = relative.matrix, relative.contact
        matrix = PETSc.Mat().createDense(dense.shape, array=dense.T, comm=e.comm)
        matrix.assemble()
        load, start = matrix.createVecRight(), matrix.createVecRight()
        cases = [_CondensedCase.of(*case, schur, relative) for case in zip(e.cases, schur.loads, strict=True)]
        fixed, none = contact.fixed, np.zeros(e.free)
        system = cls(e.comm, matrix, load, start, none, fixed, contact, e, cases, schur, relative)
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
        self.cases[number] = _CondensedCase.of(case, self.schur.condense(case.load), self.schur, self.relative)

    def with_load(self, load: PETSc.Vec) -> CondensedSystem:
        """The same with this load alone, condensed: one back substitution."""
        other, case = copy(self), LoadCase(load, load.duplicate(), RigidLoad.of(load, []))
        other.cases = [_CondensedCase.of(case, self.schur.condense(load), self.schur, self.relative)]
        other.factors, other.load = np.ones(1), PETSc.Vec().createWithArray(other.cases[0].load.copy(), comm=self.comm)
        return other

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """The interior recovered: x_i = A_ii^-1 (b_i - A_ic x_c)."""
        retained, values = self.schur.retained, np.asarray(x.getArray(readonly=True))
        if self.relative is not None:
            values = self.relative.displacement(values, self.factors @ [case.inner for case in self.cases])
        lifted, right = self.schur.matrix.createVecs()
        lifted.set(0.0)
        lifted.getArray()[retained] = values
        self.schur.matrix.mult(lifted, right)
        right.scale(-1.0)
        for factor, case in zip(self.factors, self.cases, strict=True):
            right.axpy(factor, case.case.load)
        right.getArray()[retained] = 0.0
        result = self.schur.solve_interior(right)
        result.getArray()[retained] = values
        return result

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """Those of the nodes that contact reaches."""
        x, values = self.load.duplicate(), displacement.getArray(readonly=True)[self.schur.retained]
        x.getArray()[:] = values if self.relative is None else self.relative.unknowns(values)
        return x


@dataclass(frozen=True)
class _CondensedCase:
    """A load case, and b_c - A_ci A_ii^-1 b_i and the prescribed values of the unknowns that stay; ``inner``: of
    ``RelativeUnknowns.load``.
    """

    case: LoadCase
    load: npt.NDArray[np.float64]
    start: npt.NDArray[np.float64]
    inner: npt.NDArray[np.float64]

    @classmethod
    def of(
        cls, case: LoadCase, load: npt.NDArray[np.float64], schur: SchurComplement, relative: RelativeUnknowns | None
    ) -> _CondensedCase:
        """From the condensed load."""
        start = np.array(case.start.getArray(readonly=True)[schur.retained])
        if relative is None:
            return cls(case, load, start, np.empty(0))
        load, inner = relative.load(load, start)
        return cls(case, load, relative.unknowns(start), inner)
