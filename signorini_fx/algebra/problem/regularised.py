"""The regularised contact problem (3.3) as SNES callbacks: residual and active-set Jacobian.

(3.3b), the contact pressure, is in ``algebra.contact.complementarity``, (3.3c), the friction, in
``algebra.contact.active_sets``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.contact.active_sets import (
    ActiveSets,
    classify,
    law_residual,
    linearised,
    multipliers,
    tangent,
)
from signorini_fx.algebra.contact.complementarity import trial_pressure
from signorini_fx.algebra.contact.motions import FreeMotions
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.algebra.linalg.callbacks import called_back
from signorini_fx.algebra.problem.protocol import NextSets, Problem
from signorini_fx.algebra.problem.tangent import ContactTangent


@dataclass(frozen=True)
class SoftSprings:
    """Springs at all contact points.

    Attributes:
        stiffness: stress per length.
        position: relative displacement (tau_N y, tau_T y) at which they are without stress, length, shape (n, d).
    """

    stiffness: float
    position: Nodal


class RegularisedProblem(Problem):
    """R(x) = A x - b + (lambda, tau_N .) + (mu, tau_T .) with lambda and mu of the current active sets (3.3a).

    For fixed sets R is affine, so that a full Newton step solves step 4 of Algorithm (SSN) exactly.

    Attributes:
        springs: that act beside contact; None: there are none.
    """

    springs: SoftSprings | None = None

    def __init__(self, system: ElasticSystem, motions: FreeMotions) -> None:
        super().__init__(system, motions)
        self.tangent = ContactTangent(system.matrix, system.contact)

    def multipliers(self, x: PETSc.Vec, sets: ActiveSets) -> tuple[Nodal, Nodal]:
        """See ``Problem``."""
        return multipliers(sets, *self.system.contact.traces(x), self.data)

    def friction_bounds(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """See ``Problem``."""
        data = self.data
        if data.follows is None:  # given, whatever the iterate
            bound = np.zeros(self.points.size) if data.bound is None else data.bound
            return bound, bound
        u_n, u_t = self.system.contact.traces(x)
        pressure, _ = multipliers(self.sets, u_n, u_t, data)
        return data.friction_bound(pressure), data.friction_bound(trial_pressure(u_n, data))

    def away(self, x: PETSc.Vec) -> Nodal:
        """See ``Problem``."""
        return law_residual(self.sets, *self.system.contact.traces(x), self.data)

    @called_back
    def residual(self, snes: PETSc.SNES | None, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """See ``Problem``."""
        u_n, u_t = self.system.contact.traces(x)
        trial = self.next.trial if self._forced_first else classify(self.sets, u_n, u_t, self.data)
        if self.data.follows is not None:
            trial = linearised(trial, trial_pressure(u_n, self.data), self.data)
        self._hold(trial, lambda: multipliers(self.sets, u_n, u_t, self.data))
        self.imbalance(x, *multipliers(self.next.sets, u_n, u_t, self.data), f)

    def imbalance(self, x: PETSc.Vec, pressure: Nodal, shear: Nodal, f: PETSc.Vec) -> None:
        """R(x) for given (lambda, mu); collective."""
        if self.springs is not None:
            pulled = self.springs.stiffness * (np.column_stack(self.system.contact.traces(x)) - self.springs.position)
            pressure, shear = pressure + pulled[:, 0], shear + pulled[:, 1:]
        self.system.matrix.mult(x, f)
        self._measure(f, x)
        f.axpy(-1.0, self.system.load)
        self.system.contact.add_forces(pressure, shear, f)

    def accept(self, x: PETSc.Vec, sets: ActiveSets, tolerance: float) -> bool:
        """See ``Problem``."""
        force = x.duplicate()
        self.imbalance(x, *self.multipliers(x, sets), force)
        if not force.norm() <= tolerance * self.force_scale:
            return False
        self.sets = sets
        self.next = NextSets(sets, sets)
        return True

    def assemble_jacobian(self, snes: PETSc.SNES | None, x: PETSc.Vec, jacobian: PETSc.Mat, _: Any = None) -> None:
        """See ``Problem``."""
        self.sets = self.next.sets
        self._forced_first = False
        # PETSc keeps its factor as long as the matrix is not changed.
        self.insert(jacobian, tangent(self.sets, self.data))

    def new_jacobian(self) -> PETSc.Mat:
        """See ``Problem``."""
        return self.tangent.create()

    def insert(self, jacobian: PETSc.Mat, blocks: Nodal) -> None:
        """Make A + B^T D B of a Jacobian; D: shape (n, d, d), stress per length; collective."""
        if self.springs is not None:
            blocks = blocks + self.springs.stiffness * np.eye(blocks.shape[1])
        self.moved = self.tangent.insert(jacobian, blocks)
        self._declare(jacobian)

    def factorised(self, jacobian: PETSc.Mat) -> None:
        """See ``Problem``."""
        self.tangent.factorised[jacobian.handle] = self.tangent.inserted[jacobian.handle]
