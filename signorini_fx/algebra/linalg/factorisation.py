"""Sparse factorisations: the available packages, the memory they need, and direct linear
solvers.
"""

from __future__ import annotations

import ctypes
import math
from functools import cache

from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.linalg.petsc_calls import call
from signorini_fx.machine import parallel
from signorini_fx.tuned import FACTOR_ENTRIES, MEMORY_SHARE, MOST_CONDENSED_UNKNOWNS


@cache
def has_package(package: str, kind: str = "cholesky") -> bool:
    """Return whether this PETSc can factorise with a package (``kind``: cholesky or lu)."""
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
    """Return the fastest sparse direct solver that this PETSc has for the task.

    CHOLMOD factorises faster than MUMPS on one rank, but only symmetric positive definite matrices.
    """
    if not definite:
        return "mumps"
    kind = "cholesky" if symmetric else "lu"
    candidates = ["cholmod", "mumps"] if comm.size == 1 and symmetric else ["mumps", "superlu_dist"]
    return next((package for package in candidates if has_package(package, kind)), "petsc")


def factor_type(*, symmetric: bool) -> str:
    """Return PETSc's type of factorisation: Cholesky for a symmetric matrix, otherwise LU."""
    return str(PETSc.PC.Type.CHOLESKY if symmetric else PETSc.PC.Type.LU)


def can_factorise(comm: MPI.Comm) -> bool:
    """Return whether this PETSc has a sparse direct solver for this number of ranks; PETSc's own
    solver works on one rank only.
    """
    return comm.size == 1 or factorisation_package(comm, symmetric=True) != "petsc"


def factor_entries(unknowns: int, dimension: int) -> float:
    """Return the estimated number of entries of a sparse factor: n log n in 2D, n^(4/3) in 3D
    (nested dissection).
    """
    return (
        FACTOR_ENTRIES[dimension]
        * unknowns
        * (math.log2(unknowns) if dimension == 2 else unknowns ** (1 / 3))
    )


def factor_memory(unknowns: int, dimension: int) -> float:
    """Return the estimated memory of a sparse factor, bytes: 8 for an entry, and an index for every
    second one.
    """
    return 12.0 * factor_entries(unknowns, dimension)


def enough_memory(comm: MPI.Comm, needed: float) -> bool:
    """Return whether the machines of these ranks have ``needed`` bytes; collective."""
    return needed <= MEMORY_SHARE * parallel.machine_memory(comm)


def use_factorisation(ksp: PETSc.KSP, *, symmetric: bool, definite: bool = True) -> None:
    """Make a linear solver a direct one: Cholesky if the matrix is symmetric, otherwise LU."""
    ksp.setType(PETSc.KSP.Type.PREONLY)
    use_factor(ksp.getPC(), symmetric=symmetric, definite=definite)


def use_factor(pc: PETSc.PC, *, symmetric: bool, definite: bool = True) -> None:
    """Make a preconditioner a factorisation: Cholesky if the matrix is symmetric, otherwise LU."""
    pc.setType(factor_type(symmetric=symmetric))
    pc.setFactorSolverType(
        factorisation_package(pc.comm.tompi4py(), symmetric=symmetric, definite=definite)
    )


def use_direct(pc: PETSc.PC, unknowns: int, *, symmetric: bool) -> None:
    """Make a preconditioner a direct solver; collective.

    A large matrix is factorised by all ranks together.  For few unknowns this is no faster, and
    each solve would take more time for messages than for arithmetic: then each rank gathers the
    right-hand side and has the whole factor.

    Args:
        pc: the preconditioner.
        unknowns: of its matrix, on all ranks.
        symmetric: whether the matrix is symmetric.
    """
    comm = pc.comm.tompi4py()
    if comm.size == 1 or (unknowns > MOST_CONDENSED_UNKNOWNS and can_factorise(comm)):
        use_factor(pc, symmetric=symmetric)
        return
    pc.setType(PETSc.PC.Type.REDUNDANT)
    ksp = ctypes.c_void_p()
    inner = ctypes.c_void_p()
    call("PCRedundantGetKSP", pc, ctypes.byref(ksp))
    call("KSPGetPC", ksp, ctypes.byref(inner))
    call("PCSetType", inner, factor_type(symmetric=symmetric).encode())
    package = factorisation_package(MPI.COMM_SELF, symmetric=symmetric)
    call("PCFactorSetMatSolverType", inner, package.encode())


def with_inertia(matrix: PETSc.Mat) -> tuple[PETSc.PC, int]:
    """Return an LDL^T factorisation of a symmetric matrix by MUMPS, and the number of its negative
    eigenvalues; collective.
    """
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    preconditioner = PETSc.PC().create(matrix.comm)
    preconditioner.setOperators(matrix)
    preconditioner.setType("cholesky")
    preconditioner.setFactorSolverType("mumps")
    preconditioner.setFactorSetUpSolverType()
    # For the inertia MUMPS must keep the root on one rank (ICNTL 13) and detect null pivots (24).
    for option in (13, 24):
        preconditioner.getFactorMatrix().setMumpsIcntl(option, 1)
    preconditioner.setUp()
    return preconditioner, int(preconditioner.getFactorMatrix().getInertia()[0])
