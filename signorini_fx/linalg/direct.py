"""Direct solvers inside a preconditioner: of all ranks together, or, for few unknowns, of each rank alone.

Few unknowns are factorised no faster by several ranks, and each solve would take more time for messages than for
arithmetic: then each rank gathers the right-hand side, and has the whole factor.
"""

from __future__ import annotations

import ctypes

from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.linalg.full import can_factorise, factorisation_package
from signorini_fx.linalg.petsc_c import call
from signorini_fx.tuned import MOST_REPLICATED_UNKNOWNS


def use_direct(pc: PETSc.PC, unknowns: int, *, symmetric: bool) -> None:
    """Make a preconditioner a direct solver; collective.

    Args:
        pc: of all ranks that share the matrix.
        unknowns: of all ranks.
        symmetric: whether the matrix is symmetric and positive definite.
    """
    comm = pc.comm.tompi4py()
    alone = comm.size > 1 and (unknowns <= MOST_REPLICATED_UNKNOWNS or not can_factorise(comm))
    kind = PETSc.PC.Type.CHOLESKY if symmetric else PETSc.PC.Type.LU
    package = factorisation_package(MPI.COMM_SELF if alone else comm, symmetric=symmetric)
    if not alone:
        pc.setType(kind)
        pc.setFactorSolverType(package)
        return
    pc.setType(PETSc.PC.Type.REDUNDANT)
    ksp, inner = ctypes.c_void_p(), ctypes.c_void_p()
    call("PCRedundantGetKSP", pc, ctypes.byref(ksp))
    call("KSPGetPC", ksp, ctypes.byref(inner))
    call("PCSetType", inner, kind.encode())
    call("PCFactorSetMatSolverType", inner, package.encode())
