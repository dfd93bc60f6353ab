"""Linear solvers of other packages, named in a scene and found as entry points; their results are
checked.

A solver is a class with ``set_up`` and ``solve``, see ``LinearSolver``, which is created without
arguments; an installed package names it in the group ``signorini_fx.linear_solvers``.  FGMRES uses
it as a preconditioner until the residual is small relative to the forces: an inexact solver costs
iterations, but no accuracy.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Protocol

from petsc4py import PETSc

from signorini_fx.algebra.linalg import Elasticity, ElasticSystem, petsc_options
from signorini_fx.algebra.linalg.petsc_calls import called_back
from signorini_fx.extensions import LINEAR_SOLVERS, load
from signorini_fx.tuned import KRYLOV_STEPS, LEFT_BY_SOLVES, NO_FORCE, ZERO_COMPONENT


class LinearSolver(Protocol):
    """Solves J x = b for the stiffness with the contact blocks; both methods are collective."""

    def set_up(self, matrix: PETSc.Mat) -> None:
        """Take a new matrix J: sparse, distributed over the ranks of the body, symmetric unless
        friction makes it unsymmetric.
        """

    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Write the solution, or an approximation of it, into x."""


@called_back
def _judge(ksp: PETSc.KSP, b: PETSc.Vec, x: PETSc.Vec) -> None:
    """Mark a solve as diverged if its residual is larger than FGMRES estimates.

    If a solver returns nothing new, FGMRES breaks down and trusts its own estimate.
    """
    allowed = NO_FORCE * b.norm() + 10 * ksp.getTolerances()[1]
    if ksp.getConvergedReason() > 0 and not (b - ksp.getOperators()[0] * x).norm() <= allowed:
        ksp.setConvergedReason(PETSc.KSP.ConvergedReason.DIVERGED_BREAKDOWN)


@dataclass
class UserSystem(ElasticSystem):
    """The system of all unknowns with a linear solver of another package.

    Attributes:
        solver: the class of the solver.
    """

    solver: type[LinearSolver] | None = None

    @classmethod
    def named(cls, name: str, elasticity: Elasticity) -> UserSystem:
        """Return the system as assembled, with the solver of this name."""
        system = cls.of(elasticity)
        system.solver = load(LINEAR_SOLVERS, name)
        return system

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """Set FGMRES with the solver as its preconditioner, and a tolerance relative to the
        forces.
        """
        ksp.setType(PETSc.KSP.Type.FGMRES)
        ksp.setTolerances(rtol=LEFT_BY_SOLVES, max_it=KRYLOV_STEPS)
        assert self.solver is not None
        solver = self.solver()
        pc = ksp.getPC()
        pc.setType(PETSc.PC.Type.PYTHON)

        @called_back
        def set_up(pc: PETSc.PC) -> None:
            solver.set_up(pc.getOperators()[1])

        @called_back
        def apply(pc: PETSc.PC, b: PETSc.Vec, x: PETSc.Vec) -> None:
            solver.solve(b, x)

        pc.setPythonContext(SimpleNamespace(setUp=set_up, apply=apply))
        ksp.setPostSolve(_judge)

    def keep_factor(
        self, ksp: PETSc.KSP, unchanged: bool, forces: float, *, exact: bool = False
    ) -> bool:
        """Return whether the factor is kept, which is so for an unchanged matrix; set the tolerance
        relative to the forces.
        """
        if not petsc_options.user_sets("ksp_"):
            ksp.setTolerances(rtol=ZERO_COMPONENT, atol=LEFT_BY_SOLVES * forces)
        return unchanged
