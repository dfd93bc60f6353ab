"""What the systems with all displacement dofs share: the stiffness as it was assembled, and its loads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.body.contact_map import contact_map
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.loads import LoadCase, load_resultant
from signorini_fx.contact.map import ContactMap
from signorini_fx.scene.load_steps import factor_at


@dataclass
class AssembledSystem:
    """See ``ElasticSystem``: x holds the displacement dofs themselves, on any number of ranks."""

    comm: MPI.Comm
    matrix: PETSc.Mat
    load: PETSc.Vec
    start: PETSc.Vec
    resultant: npt.NDArray[np.float64]
    fixed: npt.NDArray[np.bool_]
    contact: ContactMap
    cases: tuple[LoadCase, ...]

    @classmethod
    def of(cls, discretisation: Discretisation) -> Self:
        """The system as it was assembled, at the first load step."""
        d = discretisation
        load, start = d.stiffness.createVecRight(), d.stiffness.createVecRight()
        contact = contact_map(d.boundary, d.fixed, d.stiffness, d.rotation, d.tagged.dimension)
        resultant = np.zeros(d.motions.free.shape[1])
        system = cls(
            d.tagged.mesh.comm, contact.admitted(d.stiffness), load, start, resultant, d.fixed, contact, d.cases
        )
        system.set_step(0)
        return system

    def set_step(self, step: float, scale: float = 1.0) -> None:
        """The loads and prescribed displacements times their factors."""
        self.load.set(0.0)
        self.start.set(0.0)
        self.resultant = scale * load_resultant(self.cases, step, self.resultant.size)
        for case in self.cases:
            factor = scale * factor_at(case.factors, step)
            self.load.axpy(factor, case.load)
            self.start.axpy(factor, case.start)

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """X itself."""
        return x

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """A copy."""
        return displacement.copy()
