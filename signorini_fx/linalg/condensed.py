"""The elastic system condensed onto the contact nodes: a small dense Schur complement, one rank.

The elastic operator never changes, and the nonlinearity is confined to the contact boundary.  So the interior is
eliminated once; all Newton steps of all outer iterations, load steps and values of gamma use the dense matrix, and the
interior is recovered at the end with the same factor.  The interior matrix is regular for a floating body too.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.body.contact_map import contact_map
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.loads import LoadCase, load_resultant
from signorini_fx.contact.map import ContactMap
from signorini_fx.linalg.schur import SchurComplement
from signorini_fx.scene.load_steps import factor_at


@dataclass
class CondensedSystem:
    """See ``ElasticSystem``: x holds the unknowns that B touches."""

    comm: MPI.Comm
    matrix: PETSc.Mat
    load: PETSc.Vec
    start: PETSc.Vec
    resultant: npt.NDArray[np.float64]
    fixed: npt.NDArray[np.bool_]
    contact: ContactMap
    cases: tuple[LoadCase, ...]
    schur: SchurComplement
    interior: tuple[PETSc.Vec, ...]
    condensed: npt.NDArray[np.float64]
    factors: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, discretisation: Discretisation) -> CondensedSystem:
        """Eliminate the interior and condense every load case.

        Raises:
            PETSc.Error: PETSc has no MUMPS, or the factorisation broke down.
        """
        d = discretisation
        assert d.boundary is not None
        contact = contact_map(d.boundary, d.fixed, d.stiffness, d.rotation, d.tagged.dimension)
        retained = np.unique(contact.operator.getValuesCSR()[1]).astype(np.int32)
        schur = SchurComplement(d.stiffness, retained)
        matrix = PETSc.Mat().createDense((retained.size, retained.size), array=schur.dense.T, comm=d.boundary.comm)
        matrix.assemble()
        interior = tuple(schur.solve_interior(case.load) for case in d.cases)
        condensed = np.array(
            [_condense(d.stiffness, case.load, x, retained) for case, x in zip(d.cases, interior, strict=True)]
        )
        fixed = d.fixed[retained]
        contact = contact.among(retained, fixed)
        load, start = matrix.createVecRight(), matrix.createVecRight()
        system = cls(
            d.boundary.comm,
            matrix,
            load,
            start,
            np.zeros(d.motions.free.shape[1]),
            fixed,
            contact,
            d.cases,
            schur,
            interior,
            condensed.reshape(len(d.cases), retained.size),
        )
        system.set_step(0)
        return system

    @property
    def solver_defaults(self) -> dict[str, str]:
        """None."""
        return {}

    @property
    def inexact(self) -> bool:
        """Never: dense."""
        return False

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool, turned: PETSc.Mat | None = None) -> None:
        """A dense factorisation by LAPACK."""
        ksp.setType(PETSc.KSP.Type.PREONLY)
        ksp.getPC().setType(PETSc.PC.Type.CHOLESKY if symmetric else PETSc.PC.Type.LU)

    def keep_factor(self, ksp: PETSc.KSP, moved: int | None, forces: float, *, exact: bool = False) -> bool:
        """Only for the same matrix: a dense factorisation is cheap."""
        return moved == 0

    def set_step(self, step: float, scale: float = 1.0) -> None:
        """The condensed loads and the prescribed displacements times their factors."""
        self.factors = scale * np.array([factor_at(case.factors, step) for case in self.cases])
        self.resultant = scale * load_resultant(self.cases, step, self.resultant.size)
        starts = np.array([case.start.getArray(readonly=True)[self.schur.retained] for case in self.cases])
        self.load.getArray()[:] = self.factors @ self.condensed
        self.start.getArray()[:] = self.factors @ starts.reshape(self.condensed.shape)

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
        for factor, particular in zip(self.factors, self.interior, strict=True):
            result.axpy(factor, particular)
        result.getArray()[retained] = x.getArray(readonly=True)
        return result

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """Those of the nodes that contact reaches."""
        x = self.load.duplicate()
        x.getArray()[:] = displacement.getArray(readonly=True)[self.schur.retained]
        return x


def _condense(
    matrix: PETSc.Mat, load: PETSc.Vec, interior: PETSc.Vec, retained: npt.NDArray[np.int32]
) -> npt.NDArray[np.float64]:
    """b_c - A_ci A_ii^-1 b_i."""
    residual = load.duplicate()
    matrix.mult(interior, residual)
    residual.aypx(-1.0, load)
    return np.array(residual.getArray(readonly=True)[retained])
