"""The elastic system with all displacement dofs and a sparse factorisation, on any number of ranks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.linalg import options
from signorini_fx.linalg.assembled import AssembledSystem
from signorini_fx.tuned import (
    FACTOR_ENTRIES,
    LAGGED_NODES,
    LAGGED_SHARE,
    LAGGED_STEPS,
    MEMORY_SHARE,
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


def factorisation_package(comm: MPI.Comm, *, symmetric: bool, definite: bool = True) -> str:
    """The fastest sparse direct solver that this PETSc has for the task.

    CHOLMOD factorises faster than MUMPS on one rank, but only symmetric positive definite matrices.
    """
    if not definite:
        return "mumps"
    kind = "cholesky" if symmetric else "lu"
    candidates = ["cholmod", "mumps"] if comm.size == 1 and symmetric else ["mumps", "superlu_dist"]
    return next((package for package in candidates if has_package(package, kind)), "petsc")


def can_factorise(comm: MPI.Comm) -> bool:
    """Whether this PETSc has a sparse direct solver for this number of ranks; its own is for one."""
    return comm.size == 1 or factorisation_package(comm, symmetric=True) != "petsc"


def factor_entries(unknowns: int, dimension: int) -> float:
    """Entries of a sparse factor: n log n in two dimensions, n^(4/3) in three (nested dissection)."""
    least, slope, offset = FACTOR_ENTRIES[dimension]
    growing = slope * (math.log2(unknowns) - offset) if dimension == 2 else slope * unknowns**offset
    return unknowns * max(least, growing)


def factor_memory(unknowns: int, dimension: int) -> float:
    """Bytes of a sparse factor: a number of 8 bytes an entry, and an index for every second one."""
    return 12.0 * factor_entries(unknowns, dimension)


def enough_memory(comm: MPI.Comm, needed: float) -> bool:
    """Whether the machines of these ranks have so many bytes; collective."""
    return needed <= MEMORY_SHARE * parallel.machine_memory(comm)


# MUMPS takes more memory (per cent) than it predicts if large contact blocks disturb the pivot order; CHOLMOD's own
# nested dissection has half the fill of its default orderings on large meshes.
_FACTOR_DEFAULTS = {"mat_mumps_icntl_14": "100", "mat_cholmod_default_nesdis": "true"}


def factor_defaults(comm: MPI.Comm) -> dict[str, str]:
    """PETSc options of the factorisation packages."""
    ordering = {"mat_mumps_icntl_7": "0"} if comm.size <= RANKS_WITH_MINIMUM_DEGREE else {}
    return {**_FACTOR_DEFAULTS, **ordering}


def use_factorisation(ksp: PETSc.KSP, *, symmetric: bool, definite: bool = True) -> None:
    """Make a linear solver a direct one: Cholesky if the matrix is symmetric, else LU."""
    pc = ksp.getPC()
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc.setType(PETSc.PC.Type.CHOLESKY if symmetric else PETSc.PC.Type.LU)
    pc.setFactorSolverType(factorisation_package(ksp.comm.tompi4py(), symmetric=symmetric, definite=definite))


@dataclass
class FullSystem(AssembledSystem):
    """See ``ElasticSystem``: factorised by a package, on any number of ranks."""

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """A direct factorisation, Cholesky if the matrix is symmetric."""
        self._symmetric = symmetric
        use_factorisation(ksp, symmetric=symmetric, definite=self.definite)

    @property
    def solver_defaults(self) -> dict[str, str]:
        """For MUMPS and CHOLMOD, which read their options when they factorise."""
        return factor_defaults(self.comm)

    def keep_factor(self, ksp: PETSc.KSP, moved: int | None, forces: float, *, exact: bool = False) -> bool:
        """For the same matrix, and as a preconditioner if only a few contact nodes have changed their state."""
        if options.user_sets("ksp_") or options.user_sets("pc_"):
            return moved == 0
        lagging = self.definite and not exact  # of an indefinite matrix CG would break down
        retained = moved == 0 or (lagging and moved is not None and moved <= LAGGED_NODES)
        if retained and moved != 0:
            ksp.setType(PETSc.KSP.Type.CG if self._symmetric else PETSc.KSP.Type.GMRES)
            # The residual itself, relative to the forces: the preconditioned norm does not decide whether Newton ends.
            if not self._symmetric:
                ksp.setPCSide(PETSc.PC.Side.RIGHT)
            ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
            ksp.setTolerances(rtol=1e-15, atol=LAGGED_SHARE * forces, max_it=LAGGED_STEPS)
        else:
            ksp.setType(PETSc.KSP.Type.PREONLY)
            ksp.setNormType(PETSc.KSP.NormType.NONE)
        return retained
