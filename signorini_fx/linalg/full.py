"""The elastic system with all displacement dofs: sparse, any number of ranks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.discretisation import Discretisation, LoadCase


@cache
def has_package(package: str, kind: str = "cholesky") -> bool:
    """Whether this PETSc can factorise with a package (``kind``: cholesky or lu)."""
    probe = PETSc.Mat().createAIJ((1, 1), nnz=1, comm=MPI.COMM_SELF)
    probe.setValue(0, 0, 1.0)
    probe.assemble()
    pc = PETSc.PC().create(MPI.COMM_SELF)
    pc.setOperators(probe)
    pc.setType(kind)
    try:
        pc.setFactorSolverType(package)
        pc.setFactorSetUpSolverType()
    except PETSc.Error:
        return False
    return True


def factorisation_package(comm: MPI.Comm, *, symmetric: bool) -> str:
    """The fastest sparse direct solver that this PETSc has for the task.

    CHOLMOD factorises faster than MUMPS on one rank, but only symmetric positive definite matrices.
    """
    kind = "cholesky" if symmetric else "lu"
    candidates = ["cholmod", "mumps"] if comm.size == 1 and symmetric else ["mumps", "superlu_dist"]
    return next((package for package in candidates if has_package(package, kind)), "petsc")


@dataclass
class FullSystem:
    """See ``ElasticSystem``: x holds the displacement dofs themselves."""

    comm: MPI.Comm
    matrix: PETSc.Mat
    load: PETSc.Vec
    start: PETSc.Vec
    fixed: npt.NDArray[np.bool_]
    contact_dofs: npt.NDArray[np.int32]
    cases: tuple[LoadCase, ...]

    @classmethod
    def of(cls, discretisation: Discretisation) -> FullSystem:
        """The system as it was assembled, at the first load step."""
        d = discretisation
        nodes = d.boundary.nodes if d.boundary is not None else np.empty(0, dtype=np.int32)
        dofs = 2 * nodes[:, None] + np.arange(2, dtype=np.int32)
        load, start = d.stiffness.createVecRight(), d.stiffness.createVecRight()
        system = cls(d.tagged.mesh.comm, d.stiffness, load, start, d.fixed, dofs, d.cases)
        system.set_step(0)
        return system

    def set_step(self, step: int) -> None:
        """The loads and prescribed displacements times their factors."""
        self.load.set(0.0)
        self.start.set(0.0)
        for case in self.cases:
            self.load.axpy(case.factors[step], case.load)
            self.start.axpy(case.factors[step], case.start)

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """A direct factorisation: Cholesky where the matrix is symmetric."""
        ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY if symmetric else PETSc.PC.Type.LU)
        pc.setFactorSolverType(factorisation_package(self.comm, symmetric=symmetric))

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """X itself."""
        return x
