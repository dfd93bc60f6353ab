"""A problem without contact points: one linear solve in each load step, with one factorisation for all of them."""

from __future__ import annotations

from petsc4py import PETSc

from signorini_fx.algebra.algorithms.task import Task
from signorini_fx.algebra.linalg import callbacks, finite, petsc_options
from signorini_fx.algebra.linalg.failures import factor_lacks_memory
from signorini_fx.records import Status


def solve_linear(task: Task) -> Status:
    """Solve with the present load, from the prescribed displacements; collective.

    Raises:
        PETSc.Error: see ``SemismoothNewton.outcome_of``.
    """
    system, status = task.system, Status.NOT_HELD
    if not task.motions.count:
        missing, change, ksp = system.load.duplicate(), system.load.duplicate(), task.iterate.linear_solver
        system.matrix.mult(system.start, missing)
        missing.aypx(-1.0, system.load)
        try:
            with petsc_options.defaults(system.solver_defaults):
                callbacks.solve(ksp.solve, missing, change)
            status = Status.SINGULAR if ksp.getType() == PETSc.KSP.Type.PREONLY else Status.LINEAR_SOLVER
            if ksp.getConvergedReason() > 0:
                status = Status.CONVERGED
            elif factor_lacks_memory(ksp):
                status = Status.NO_MEMORY
        except (PETSc.Error, MemoryError) as error:
            change.set(0.0)
            status = task.iterate.newton.outcome_of(error)
        task.iterate.x.waxpy(1.0, system.start, change)
    return status if finite(system.matrix) and finite(system.load) else Status.NOT_FINITE
