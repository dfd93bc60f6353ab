"""The contact problem as SNES callbacks: residual and active-set Jacobian, regularised (3.3)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.rigid import RigidMotions
from signorini_fx.contact.holding_sets import fewest_constraints, hold
from signorini_fx.contact.laws import (
    ActiveSets,
    FrictionLaw,
    Nodal,
    RegularisedData,
    classify,
    law_residual,
    length,
    multipliers,
    release,
    tangent,
    trial_pressure,
)
from signorini_fx.contact.statics import Escape, no_balance
from signorini_fx.linalg import ElasticSystem
from signorini_fx.linalg.callbacks import called_back
from signorini_fx.problem.tangent import contact_tangent
from signorini_fx.records import Status


@dataclass(frozen=True)
class NextSets:
    """The active sets of the next linear solve, and where they come from.

    Attributes:
        sets: the sets of the next linear solve.
        trial: the sets that follow from the iterate; ``sets`` differ from them if they would not hold the body.
        repaired: whether ``sets`` differ from them.
        escapes: the status if the body moves away whatever the sets are; None: it does not.
    """

    sets: ActiveSets
    trial: ActiveSets
    repaired: bool = False
    escapes: Status | None = None


class ContactProblem(Protocol):
    """The interface of a problem for the semi-smooth Newton method.

    ``sets`` are those of the last linear solve; evaluating the residual finds the next ones (``next``) without changing
    ``sets``, so that SNES may evaluate it any number of times; assembling the Jacobian makes the next sets current.

    Attributes:
        system: the elastic system.
        boundary: the contact points.
        data: the data that outer algorithms change.
        affine: whether the residual is affine for fixed sets and directions, so that repeated sets mean a solution, and
            sets that come back mean a cycle.
        sets: active sets of the last linear solve.
        next: active sets of the last residual.
        force_scale: size of the forces on the unknowns that are not prescribed, in the last residual.
        moved: contact points whose blocks in the Jacobian differ from those of its last factorisation; None: there is
            none, or too many to tell.
    """

    system: ElasticSystem
    boundary: ContactBoundary
    data: RegularisedData
    sets: ActiveSets
    next: NextSets
    force_scale: float
    moved: int | None

    @property
    def affine(self) -> bool:
        """Whether the residual is affine for fixed sets, see above."""

    def set_data(self, data: RegularisedData, first_sets: ActiveSets | None = None) -> None:
        """Begin a new problem.

        Args:
            data: its data.
            first_sets: sets of the first linear solve; None: from the iterate and the sets of the previous problem.
        """

    def traces(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """(tau_N y, tau_T y) at the contact nodes."""

    def multipliers(self, x: PETSc.Vec, sets: ActiveSets) -> tuple[Nodal, Nodal]:
        """(lambda, mu) at the contact nodes for given sets."""

    def friction_bounds(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """The friction bounds of the current and the next sets."""

    def law_residual(self, x: PETSc.Vec) -> float:
        """Largest distance of mu from the projection (3.4), relative to the largest bound or shear that the body feels;
        collective.
        """

    def accept(self, x: PETSc.Vec, sets: ActiveSets, tolerance: float) -> bool:
        """Accept these sets as those of the solution if the residual is at most a share of the forces; collective."""

    def holds(self, sets: ActiveSets, data: RegularisedData) -> bool:
        """Whether these sets resist every rigid motion; collective."""

    def constraints(self, sets: ActiveSets, opening: Nodal, slipping: Nodal) -> tuple[Any, Any]:
        """Nodes that would hold the body if they were fixed, see ``holding_sets.fewest_ties``; collective."""

    def lost_to_round_off(self, x: PETSc.Vec, tolerance: float) -> bool:
        """Whether the round-off of the penalty is above a share of the forces in the last residual; collective."""

    def create_jacobian(self, *, symmetric: bool) -> PETSc.Mat:
        """A matrix with the pattern of the Jacobian."""

    def residual(self, snes: PETSc.SNES | None, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """The residual with the sets that follow from x."""

    def factorised(self, jacobian: PETSc.Mat) -> None:
        """Note that the current Jacobian is factorised."""

    def assemble_jacobian(self, snes: PETSc.SNES | None, x: PETSc.Vec, jacobian: PETSc.Mat, _: Any = None) -> None:
        """The Jacobian with the sets of the last residual, which become the current ones."""


ROUND_OFF = 1e-8
# Share of the stiffness times the displacement of which a residual of 1e-8 is still above round-off.
_ATTAINABLE = 1e-7


class ProblemState(ABC):
    """The state that all contact problems share; see ``ContactProblem``."""

    def __init__(self, system: ElasticSystem, boundary: ContactBoundary, motions: RigidMotions) -> None:
        self.system = system
        self.boundary = boundary
        self.data: RegularisedData
        self.sets = ActiveSets.all_in_contact(boundary.size, boundary.tangents.shape[2])
        self.next = NextSets(self.sets, self.sets)
        self.force_scale = 0.0
        self.moved: int | None = None
        self._motions = motions
        self._forced_first = False
        self._definite: set[int] = set()
        self._stiffness = parallel.global_max(
            system.comm, parallel.local_max(system.matrix.getDiagonal().getArray(readonly=True))
        )

    @property
    def affine(self) -> bool:
        """See ``ContactProblem``: in space the direction of slip changes."""
        return self.boundary.tangents.shape[2] == 1 or not self.data.has_friction

    def set_data(self, data: RegularisedData, first_sets: ActiveSets | None = None) -> None:
        """See ``ContactProblem``."""
        self.data = data
        moved = self.system.start.copy()
        moved.getArray()[self.system.fixed] = 0.0
        self._lifted = None if moved.norm() == 0.0 else self.system.load.duplicate()
        if self._lifted is not None:
            self.system.matrix.mult(moved, self._lifted)
        self._escaping: tuple[Escape | None] | None = None
        self._forced_first = first_sets is not None
        if data.bound is not None:  # sets of the previous problem may slip where this one has no limit
            self.sets = self.sets.sticking(np.isinf(data.bound))
        if first_sets is not None:
            first = release(first_sets, data)
            self.next = NextSets(first, first)

    @abstractmethod
    def multipliers(self, x: PETSc.Vec, sets: ActiveSets) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``."""

    @abstractmethod
    def friction_bounds(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``."""

    @abstractmethod
    def away(self, x: PETSc.Vec) -> Nodal:
        """Distance of mu from the projection (3.4) at each contact point, stress, shape (n,)."""

    def traces(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``."""
        return self.system.contact.traces(x)

    def law_residual(self, x: PETSc.Vec) -> float:
        """See ``ContactProblem``."""
        bound, _ = self.friction_bounds(x)
        pressure, shear = self.multipliers(x, self.sets)
        alone, felt = self.boundary.felt(shear), self.boundary.felt(shear, pressure)
        left = np.divide(felt, alone, out=np.ones_like(felt), where=alone > 0)
        # What follows the pressure of nodes that supports press into the foundation is no scale for others, nor is
        # what a pressure and a shear undo in each other.
        felt = np.maximum(left * self.boundary.felt(np.where(np.isfinite(bound), bound, 0.0)), felt)
        size = parallel.local_max(felt)
        away, size = (
            parallel.global_max(self.system.comm, value) for value in (parallel.local_max(self.away(x)), size)
        )
        return away / size if size > 0 else away

    def accept(self, x: PETSc.Vec, sets: ActiveSets, tolerance: float) -> bool:
        """See ``ContactProblem``: never, where sets are constraints."""
        return False

    def holds(self, sets: ActiveSets, data: RegularisedData) -> bool:
        """See ``ContactProblem``."""
        stick = ~sets.slip if data.has_friction else np.zeros_like(sets.contact)
        return self._motions.held_by(self.boundary, sets.contact, stick, sets.turned if data.has_friction else None)

    def constraints(self, sets: ActiveSets, opening: Nodal, slipping: Nodal) -> tuple[Any, Any]:
        """See ``ContactProblem``."""
        return fewest_constraints(sets, opening, slipping, self.boundary, self._motions)

    def lost_to_round_off(self, x: PETSc.Vec, tolerance: float) -> bool:
        """See ``ContactProblem``."""
        data = self.data
        if not np.isfinite(data.gamma_n):
            return False
        u_n, u_t = self.traces(x)
        stretch = data.gamma_n * np.maximum(np.abs(u_n), np.abs(data.gap))
        if data.has_friction:
            stretch = np.maximum(stretch, data.gamma_t * length(u_t))
        largest = parallel.global_max(self.system.comm, parallel.local_max(self.boundary.weight * stretch))
        return bool(largest * np.finfo(float).eps > tolerance * self.force_scale)

    def create_jacobian(self, *, symmetric: bool) -> PETSc.Mat:
        """See ``ContactProblem``: a copy of A."""
        jacobian = self.system.matrix.duplicate(copy=True)
        if symmetric:
            self._definite.add(jacobian.handle)
        return jacobian

    def _declare(self, jacobian: PETSc.Mat) -> None:
        """PETSc forgets it at every assembly, and LAPACK's Cholesky is three times as fast as its LDL^T."""
        if jacobian.handle in self._definite:
            jacobian.setOption(PETSc.Mat.Option.SPD, True)

    def _hold(self, trial: ActiveSets, pressure: Nodal, shear: Nodal) -> None:
        """Choose next sets that hold the body, or note that it moves away."""
        boundary, motions, resultant = self.boundary, self._motions, self.system.resultant
        # Not finite: the convergence test ends the iteration, and such numbers have no order to choose sets by.
        if parallel.any_rank(boundary.comm, not (np.isfinite(pressure).all() and np.isfinite(shear).all())):
            self.next = NextSets(trial, trial)
            return

        def escaping() -> Status | None:
            if self._escaping is None:  # until the data change
                data, none = self.data, np.zeros(boundary.size)
                law = FrictionLaw(*(none if part is None else part for part in (data.bound, data.coupling)))
                self._escaping = (no_balance(law, data.bilateral, boundary, motions, resultant, data.gap),)
            (found,) = self._escaping
            return None if found is None else found.status

        sets, escapes, repaired = hold(trial, self.sets, pressure, shear, self.data, boundary, motions, escaping)
        self.next = NextSets(sets, trial, repaired, escapes)

    def _measure(self, forces: PETSc.Vec, x: PETSc.Vec) -> None:
        """Use the size of the forces A x as the scale of the residual.

        In a prescribed row there is no force, but the value that is prescribed times an arbitrary factor.  Beside one
        there is its force on the free rows, however large; only what differs from a rigid motion does anything.
        """
        acting = []
        for vector in (forces, self.system.load):
            free = vector.copy()
            if self._lifted is not None:
                free.axpy(-1.0, self._lifted)
            free.getArray()[self.system.fixed] = 0.0
            acting.append(free.norm())
        self.force_scale = max(*acting, _ATTAINABLE * self._stiffness * x.norm())


class RegularisedProblem(ProblemState):
    """R(x) = A x - b + (lambda, tau_N .) + (mu, tau_T .) with lambda and mu of the current active sets (3.3a).

    For fixed sets R is affine, so that a full Newton step solves step 4 of Algorithm (SSN) exactly.
    See ``ContactProblem``.
    """

    def __init__(self, system: ElasticSystem, boundary: ContactBoundary, motions: RigidMotions) -> None:
        super().__init__(system, boundary, motions)
        self._tangent = contact_tangent(system.matrix, system.contact)

    def multipliers(self, x: PETSc.Vec, sets: ActiveSets) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``."""
        return multipliers(sets, *self.traces(x), self.data)

    def friction_bounds(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``."""
        u_n, _ = self.traces(x)
        pressure, _ = self.multipliers(x, self.sets)
        return self.data.friction_bound(pressure), self.data.friction_bound(trial_pressure(u_n, self.data))

    def away(self, x: PETSc.Vec) -> Nodal:
        """See ``ProblemState``."""
        return law_residual(self.sets, *self.traces(x), self.data)

    @called_back
    def residual(self, snes: PETSc.SNES | None, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """See ``ContactProblem``."""
        u_n, u_t = self.traces(x)
        trial = self.next.trial if self._forced_first else classify(self.sets, u_n, u_t, self.data)
        self._hold(trial, *multipliers(self.sets, u_n, u_t, self.data))
        self._imbalance(x, self.next.sets, f)

    def _imbalance(self, x: PETSc.Vec, sets: ActiveSets, f: PETSc.Vec) -> None:
        """R(x) for given sets."""
        self.system.matrix.mult(x, f)
        self._measure(f, x)
        f.axpy(-1.0, self.system.load)
        self.system.contact.add_forces(*self.multipliers(x, sets), f)

    def accept(self, x: PETSc.Vec, sets: ActiveSets, tolerance: float) -> bool:
        """See ``ContactProblem``."""
        force = x.duplicate()
        self._imbalance(x, sets, force)
        if not force.norm() <= tolerance * self.force_scale:
            return False
        self.sets = sets
        self.next = NextSets(sets, sets)
        return True

    def assemble_jacobian(self, snes: PETSc.SNES | None, x: PETSc.Vec, jacobian: PETSc.Mat, _: Any = None) -> None:
        """See ``ContactProblem``."""
        self.sets = self.next.sets
        self._forced_first = False
        # PETSc keeps its factor as long as the matrix is not changed.
        self.moved = self._tangent.insert(jacobian, tangent(self.sets, self.data))
        self._declare(jacobian)

    def factorised(self, jacobian: PETSc.Mat) -> None:
        """See ``ContactProblem``."""
        self._tangent.factorised[jacobian.handle] = self._tangent.inserted[jacobian.handle]
