"""The elastic system with all displacement dofs, solved by a Krylov method with multigrid, on any
number of ranks.

Nothing of the size of the mesh is factorised, unless this fails.  See ``multigrid`` for the
preconditioner, which is set up once.

Linear solvers of other packages are found as entry points, and their results are checked.  A solver
is a class with ``set_up`` and ``solve``, see ``LinearSolver``, which is created without arguments;
an installed package names it in the group ``signorini_fx.linear_solvers``.  FGMRES uses it as a
preconditioner until the residual is small relative to the forces: an inexact solver costs
iterations, but no accuracy.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from types import SimpleNamespace
from typing import Protocol, Self

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.linalg import Elasticity, ElasticSystem, is_by_blocks, petsc_options
from signorini_fx.algebra.linalg.blocks import use_entries
from signorini_fx.algebra.linalg.factorisation import (
    can_factorise,
    enough_memory,
    factor_memory,
    use_factor,
    use_factorisation,
)
from signorini_fx.algebra.linalg.multigrid import ContactLevels, ContactPreconditioner, Hierarchy
from signorini_fx.algebra.linalg.petsc_calls import call, called_back, weakly
from signorini_fx.arrays import Ints
from signorini_fx.extensions import LINEAR_SOLVERS, load
from signorini_fx.machine import parallel
from signorini_fx.tuned import (
    ATTAINABLE_SHARE,
    INEXACT_TOLERANCE,
    KRYLOV_STEPS,
    LEFT_BY_SOLVES,
    NO_FORCE,
    ZERO_COMPONENT,
)


@dataclass
class KrylovSystem(ElasticSystem):
    """The elastic system solved by CG or FGMRES with multigrid."""

    _forces: float = 0.0
    _first_residual: float = (
        0.0  # first residual of the last solve of the same Newton iteration; 0: none
    )
    # By the handle of the KSP, kept in Python: objects that PETSc held would be freed late on
    # several ranks, or never.
    _preconditioners: dict[int, ContactPreconditioner] = field(default_factory=dict)

    @classmethod
    def of(cls, elasticity: Elasticity) -> Self:
        """Return the system as assembled, with the rigid motions set as near null space for
        multigrid.
        """
        system = super().of(elasticity)
        if not system.rigid:
            system._tell(system.matrix)
        return system

    @cached_property
    def rigid(self) -> bool:
        """Whether rigid bodies have unknowns, on the last rank; collective."""
        return parallel.any_rank(self.comm, self.elasticity.rigid > 0)

    def _tell(self, matrix: PETSc.Mat) -> None:
        """Set the block size and the rigid motions of a sparse matrix; a matrix by blocks needs
        neither.
        """
        if is_by_blocks(matrix):
            return
        matrix.setBlockSize(self.contact.points.dimension)
        if self.elasticity.level is not None:
            matrix.setNearNullSpace(self.elasticity.level.modes())

    @cached_property
    def hierarchy(self) -> Hierarchy:
        """The hierarchy of A, set up at its first use; collective.

        It is set up without room for the entries of contact: aggregates follow the pattern, and
        would mix unknowns that only contact joins.
        """
        e = self.elasticity
        if self.rigid:
            first, last = e.matrix.getOwnershipRange()
            of_nodes = PETSc.IS().createStride(last - first - e.rigid, first, 1, comm=self.comm)
            nodes = e.matrix.createSubMatrix(of_nodes, of_nodes)
            nodes.setOption(PETSc.Mat.Option.SPD, True)
            self._tell(nodes)
            fixed = self.contact.fixed
            diagonal = e.matrix.getDiagonal().getArray(readonly=True)
            of_bodies = slice(fixed.size - e.rigid, None)
            return Hierarchy.of(nodes, e.level).with_rigid_bodies(
                ~fixed[of_bodies], diagonal[of_bodies]
            )
        self._tell(e.matrix)
        return Hierarchy.of(e.matrix, e.level)

    @cached_property
    def levels(self) -> ContactLevels:
        """The levels of the hierarchy, truncated by contact; collective."""
        rigid = int(
            np.count_nonzero(~self.contact.fixed[self.contact.fixed.size - self.elasticity.rigid :])
        )
        return ContactLevels(self.hierarchy, self.matrix, self._touched, self.contact, rigid=rigid)

    @cached_property
    def _touched(self) -> Ints:
        """The unknowns of this rank on which contact can act, ascending, without prescribed
        ones.
        """
        touched = self.contact.touched
        touched[touched.size - self.elasticity.rigid :] = True
        return np.flatnonzero(touched & ~self.contact.fixed)

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """Set CG, or FGMRES for an unsymmetric matrix, with a tolerance relative to the forces; see
        ``multigrid``.
        """
        ksp.setType(PETSc.KSP.Type.CG if symmetric else PETSc.KSP.Type.FGMRES)
        if not petsc_options.user_sets("ksp_"):  # another method may not support this norm
            ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        ksp.setTolerances(rtol=LEFT_BY_SOLVES, max_it=KRYLOV_STEPS)
        pc = ksp.getPC()
        if is_by_blocks(self.matrix):
            use_entries(pc, lambda inner: inner.setType(PETSc.PC.Type.GAMG))
        else:
            pc.setType(PETSc.PC.Type.GAMG)
        contact = int(parallel.total(self.comm, self._touched.size))
        if contact == 0 or petsc_options.user_sets("pc_type") or not self.hierarchy.interpolations:
            return
        preconditioner = ContactPreconditioner(self.levels, self.contact.fixed, symmetric=symmetric)
        self._preconditioners[ksp.handle] = preconditioner
        pc.setType(PETSc.PC.Type.PYTHON)
        pc.setPythonContext(
            SimpleNamespace(setUp=weakly(preconditioner.setUp), apply=weakly(preconditioner.apply))
        )
        ksp.setInitialGuessNonzero(True)
        ksp.setPreSolve(weakly(self._begin))
        # A tolerance of the user is relative to the residual after the exact solve at the contact
        # unknowns.
        call("KSPConvergedDefaultSetUIRNorm", ksp)

    def factorise(self, ksp: PETSc.KSP, *, symmetric: bool) -> bool:
        """Set a factorisation and return True, if the user has chosen no solver and the factor fits
        into the memory.  An unsymmetric matrix needs twice as much.
        """
        if petsc_options.user_sets("ksp_", "pc_") or not can_factorise(self.comm):
            return False
        unknowns = self.matrix.getSize()[0]
        dimension = self.contact.points.dimension
        if not enough_memory(
            self.comm, (1 if symmetric else 2) * factor_memory(unknowns, dimension)
        ):
            return False
        if not is_by_blocks(self.matrix):
            use_factorisation(ksp, symmetric=symmetric)
            return True

        def as_factor(pc: PETSc.PC) -> None:
            pc.getOperators()[0].setOption(PETSc.Mat.Option.SPD, symmetric)
            use_factor(pc, symmetric=symmetric)

        ksp.setType(PETSc.KSP.Type.PREONLY)
        use_entries(ksp.getPC(), as_factor)
        return True

    @called_back
    def _begin(self, ksp: PETSc.KSP, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve for the contact unknowns, which removes the penalty from the residual, and set the
        tolerance.
        """
        ksp.setUp()  # PETSc calls this before
        self._preconditioners[ksp.handle].solve_contact(b, x)
        rtol, atol, _, _ = ksp.getTolerances()
        # Without an absolute tolerance the caller wants a share of this right-hand side, not of the
        # forces.
        if petsc_options.user_sets("ksp_") or (atol == 0.0 and rtol > ZERO_COMPONENT):
            return
        size = (b - ksp.getOperators()[0] * x).norm()
        # The residual that Newton's method will leave anyway if it gains as much as in the last
        # step, or the share of the forces if that is larger (Eisenstat & Walker, 1996; "Tolerances"
        # in docs/theory.md).
        scales = [scale for scale in (self._forces, self._first_residual) if scale > 0]
        allowance = size * min(
            INEXACT_TOLERANCE, max((size / scale for scale in scales), default=1.0)
        )
        if (
            not self.inexact or allowance <= ATTAINABLE_SHARE * self._forces
        ):  # the method may end soon
            allowance = 0.0
        ksp.setTolerances(rtol=ZERO_COMPONENT, atol=max(LEFT_BY_SOLVES * self._forces, allowance))
        self._first_residual = (
            size if allowance > 0 else 0.0
        )  # otherwise Newton's method may end, and another iteration start

    def keep_factor(
        self, ksp: PETSc.KSP, unchanged: bool, forces: float, *, exact: bool = False
    ) -> bool:
        """Return whether the factor is kept, which is so for an unchanged matrix; for a changed one
        a solve by multigrid need not be exact.
        """
        if ksp.getType() == PETSc.KSP.Type.PREONLY:
            self.inexact = False
        elif not petsc_options.user_sets("ksp_"):
            self._forces = forces
            self.inexact = not unchanged and not exact
        return unchanged


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
