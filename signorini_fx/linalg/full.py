"""The elastic system with all displacement dofs: sparse, any number of ranks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.loads import LoadCase, load_resultant
from signorini_fx.body.rigid import rigid_modes
from signorini_fx.contact.map import ContactMap
from signorini_fx.linalg import options
from signorini_fx.tuned import (
    INEXACT_TOLERANCE,
    KRYLOV_TOLERANCE,
    LAGGED_NODES,
    LAGGED_SHARE,
    LAGGED_STEPS,
    RANKS_WITH_MINIMUM_DEGREE,
)


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


def can_factorise(comm: MPI.Comm) -> bool:
    """Whether this PETSc has a sparse direct solver for so many ranks; its own is for one."""
    return comm.size == 1 or factorisation_package(comm, symmetric=True) != "petsc"


# MUMPS takes more memory (per cent) than it foresees where large contact blocks disturb the pivot order; CHOLMOD's own
# nested dissection has half the fill of its default orderings on large meshes.
_FACTOR_DEFAULTS = {"mat_mumps_icntl_14": "100", "mat_cholmod_default_nesdis": "true"}


@dataclass
class FullSystem:
    """See ``ElasticSystem``: x holds the displacement dofs themselves.

    Attributes:
        krylov: solve by a Krylov method with algebraic multigrid instead of a factorisation.
        inexact: whether the last solve was a loose one.
    """

    comm: MPI.Comm
    matrix: PETSc.Mat
    load: PETSc.Vec
    start: PETSc.Vec
    resultant: npt.NDArray[np.float64]
    fixed: npt.NDArray[np.bool_]
    contact: ContactMap
    cases: tuple[LoadCase, ...]
    krylov: bool = False
    inexact: bool = False

    @property
    def unsymmetric(self) -> bool:
        """Multigrid makes nothing of the large unsymmetric blocks of the monolithic tangent."""
        return not self.krylov

    @classmethod
    def of(cls, discretisation: Discretisation, *, krylov: bool = False) -> FullSystem:
        """The system as it was assembled, at the first load step."""
        d = discretisation
        load, start = d.stiffness.createVecRight(), d.stiffness.createVecRight()
        contact = ContactMap.of_points(d.boundary, None, d.fixed, d.stiffness)
        resultant = np.zeros(d.motions.free.shape[0])
        if d.rotation is not None:
            contact = contact.turned(d.rotation, d.fixed)
        matrix = contact.admitted(d.stiffness)
        system = cls(d.tagged.mesh.comm, matrix, load, start, resultant, d.fixed, contact, d.cases, krylov)
        if krylov:
            matrix.setBlockSize(d.tagged.dimension)
            matrix.setNearNullSpace(_rigid_modes(d))
        system.set_step(0)
        return system

    def set_step(self, step: int, scale: float = 1.0) -> None:
        """The loads and prescribed displacements times their factors."""
        self.load.set(0.0)
        self.start.set(0.0)
        self.resultant = scale * load_resultant(self.cases, step, self.resultant.size)
        for case in self.cases:
            self.load.axpy(scale * case.factors[step], case.load)
            self.start.axpy(scale * case.factors[step], case.start)

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """A direct factorisation, Cholesky where the matrix is symmetric; or CG or GMRES with algebraic multigrid."""
        pc = ksp.getPC()
        self._symmetric = symmetric
        if self.krylov:
            ksp.setType(PETSc.KSP.Type.CG if symmetric else PETSc.KSP.Type.FGMRES)
            ksp.setTolerances(rtol=KRYLOV_TOLERANCE, max_it=1000)
            pc.setType(PETSc.PC.Type.GAMG)
            return
        ksp.setType(PETSc.KSP.Type.PREONLY)
        pc.setType(PETSc.PC.Type.CHOLESKY if symmetric else PETSc.PC.Type.LU)
        pc.setFactorSolverType(factorisation_package(self.comm, symmetric=symmetric))

    @property
    def solver_defaults(self) -> dict[str, str]:
        """For MUMPS and CHOLMOD, which read their options when they factorise."""
        if self.krylov:
            return {}
        ordering = {"mat_mumps_icntl_7": "0"} if self.comm.size <= RANKS_WITH_MINIMUM_DEGREE else {}
        return {**_FACTOR_DEFAULTS, **ordering}

    def keep_factor(self, ksp: PETSc.KSP, moved: int | None, forces: float) -> bool:
        """For the same matrix, and as a preconditioner where only a few contact nodes have moved."""
        if options.user_sets("ksp_") or options.user_sets("pc_"):
            return moved == 0
        if self.krylov:
            self.inexact = moved is not None and moved > 0
            ksp.setTolerances(rtol=INEXACT_TOLERANCE if self.inexact else KRYLOV_TOLERANCE)
            return moved == 0
        retained = moved is not None and moved <= LAGGED_NODES
        if retained and moved != 0:
            ksp.setType(PETSc.KSP.Type.CG if self._symmetric else PETSc.KSP.Type.GMRES)
            # The residual itself, against the forces: the preconditioned norm does not tell whether Newton ends.
            if not self._symmetric:
                ksp.setPCSide(PETSc.PC.Side.RIGHT)
            ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
            ksp.setTolerances(rtol=1e-15, atol=LAGGED_SHARE * forces, max_it=LAGGED_STEPS)
        else:
            ksp.setType(PETSc.KSP.Type.PREONLY)
            ksp.setNormType(PETSc.KSP.NormType.NONE)
        return retained

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """X itself."""
        return x


def _rigid_modes(discretisation: Discretisation) -> PETSc.NullSpace:
    """Translations and rotations, orthonormal: what multigrid must not forget on its coarse levels.

    Multigrid coarsens locally, where the motions of a piece are those of the whole body.
    """
    d = discretisation
    owned = d.space.dofmap.index_map.size_local
    modes = rigid_modes(d.motions.x[:owned], d.motions.centre[0], d.motions.length[0])
    vectors = [d.stiffness.createVecRight() for _ in range(modes.shape[2])]
    for k, vector in enumerate(vectors):
        vector.getArray()[:] = modes[:, :, k].ravel()
        if d.rotation is not None:
            d.rotation.multTranspose(vector.copy(), vector)
        for other in vectors[:k]:
            vector.axpy(-vector.dot(other), other)
        vector.normalize()
    return PETSc.NullSpace().create(vectors=vectors, comm=d.tagged.mesh.comm)
