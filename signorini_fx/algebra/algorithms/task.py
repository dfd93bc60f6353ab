"""The inputs of a contact problem, the initial state of a load step, and the outcome of a solve."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra import Settings
from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.contact.active_sets import ActiveSets, slip_multiplier
from signorini_fx.algebra.contact.complementarity import RegularisedData, slip_of
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.motions import FreeMotions, ReferenceMotion, reference_motion
from signorini_fx.algebra.contact.state import PointState
from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.algebra.regularised import RegularisedProblem
from signorini_fx.arrays import Array, Flags, length
from signorini_fx.records import History, Status


@dataclass(frozen=True)
class Start:
    """The initial state of a load step for its algorithm.

    Attributes:
        data: the regularised problem with the gamma to start with.
        law: the friction law; None without friction.
        elastic_slip: the part of the slip so far that is due to the regularisation, length, shape
            (n, d - 1).
        sets: active sets of the first linear solve; None: from the iterate.
        iteration: number of the first linear solve.
        multipliers: (lambda, mu) to start from, if there are any.
        step: number of load steps solved before.
        place: position of the load step on the load path; the algorithms do not use it.
        factors: of the load cases; None: the load stays as it is set.
        regularisation_error: that of path-following in an earlier load step, in the energy norm.
        several: whether the path has several load steps; then a body without load stays where it is
            until it is loaded.
    """

    data: RegularisedData
    law: PointFriction | None
    elastic_slip: Array
    sets: ActiveSets | None = None
    iteration: int = 1
    multipliers: tuple[Array, Array] | None = None
    step: int = 0
    place: float = 0.0
    factors: Array | None = None
    regularisation_error: float | None = None
    several: bool = False

    def begin_from(self, sets: ActiveSets, multipliers: tuple[Array, Array]) -> Start:
        """Return this start with the sets and (lambda, mu) of another mesh, of fewer contact nodes,
        or of another load.
        """
        return replace(self, sets=sets, iteration=1, multipliers=multipliers)


@dataclass(frozen=True)
class Outcome:
    """The outcome of a load step, or of one of the methods that were tried on it.

    Attributes:
        status: how the method has ended.
        newton: the inner method, whose iterate is the result.
        data: the problem with the final gamma.
        monolithic: whether the monolithic method for Coulomb friction was used.
        augmented: whether the result is by augmentation, so that there is neither a regularisation
            error nor elastic slip.
        regularisation_error: the estimate of path-following, in the energy norm; None if it did not
            run.
    """

    status: Status
    newton: SemismoothNewton
    data: RegularisedData
    monolithic: bool = False
    augmented: bool = False
    regularisation_error: float | None = None

    @property
    def problem(self) -> RegularisedProblem:
        """The regularised problem of the result."""
        return self.newton.problem

    def displacement(self) -> PETSc.Vec:
        """Return all displacement dofs of the result, relative to the reference motion of
        the body.
        """
        return self.problem.system.displacement(self.newton.x)


@dataclass(frozen=True)
class Task:
    """The inputs of a contact problem.

    Attributes:
        settings: algorithms and limits.
        system: the elastic system.
        motions: free rigid motions of the bodies.
        start: initial state of the first load step.
        has_coulomb: whether the friction bound depends on the pressure anywhere.
        natural_gamma: E over the size of the body, the natural unit of gamma, stress per length.
        history: the record of all solves.
        linear_algebra: description of the chosen linear solver and the reason; only shown.
        goal: returns the regularisation error allowed for path-following at an iterate, in the
            energy norm.
        rest: the reference motion from which displacements are counted; None: from the initial
            position.
        coordinate_error: uncertainty of gaps due to round-off of coordinates, length.
    """

    settings: Settings
    system: ElasticSystem
    motions: FreeMotions
    start: Start
    has_coulomb: bool
    natural_gamma: float
    history: History
    linear_algebra: str = ""
    goal: Callable[[PETSc.Vec], float] = lambda x: 0.0
    rest: ReferenceMotion | None = None
    coordinate_error: float = 0.0

    @classmethod
    def of(
        cls,
        system: ElasticSystem,
        motions: FreeMotions,
        gap: Array,
        law: PointFriction | None = None,
        *,
        settings: Settings,
        natural_gamma: float,
        bilateral: Flags | None = None,
        **options: Any,
    ) -> Task:
        """Return a problem that starts with contact and stick everywhere, at its reference motion;
        collective.

        Args:
            system: the elastic system.
            motions: free rigid motions of the bodies.
            gap: d, length, shape (n,).
            law: the friction law; None: without friction.
            settings: algorithms and limits.
            natural_gamma: see ``Task``.
            bilateral: points whose contact cannot open, shape (n,); None: there are none.
            options: further attributes of ``Task``.
        """
        points = motions.points
        sides = np.zeros(gap.size, dtype=bool) if bilateral is None else bilateral
        data = RegularisedData.unshifted(
            gap, points.dimension - 1, settings, natural_gamma, law, sides, points.immovable
        )
        resting = reference_motion(gap, sides, motions, system.resultant)
        sets = ActiveSets.all_in_contact(*data.mu_hat.shape)
        start = Start(
            data if resting is None else resting.data_from(data),
            law,
            0.0 * data.mu_hat,
            sets,
            iteration=0,
        )
        return cls(
            settings, system, motions, start, natural_gamma=natural_gamma, rest=resting, **options
        )

    @cached_property
    def newton(self) -> SemismoothNewton:
        """The inner method on the regularised problem, whose iterate the algorithms share."""
        problem = RegularisedProblem(self.system, self.motions)
        problem.data = self.start.data
        return SemismoothNewton(problem, self.system.start.copy(), self.settings, self.history)

    @cached_property
    def unsymmetric_newton(self) -> SemismoothNewton:
        """Newton's method with an unsymmetric tangent on the same iterate."""
        return SemismoothNewton(
            self.newton.problem, self.newton.x, self.settings, self.history, symmetric=False
        )

    @property
    def idle(self) -> list[int]:
        """Numbers of the assemblies of bodies that can move freely and have no resultant load."""
        return [
            number
            for number, columns in self.motions.assemblies
            if not self.system.resultant[columns].any()
        ]

    def counted_from(self, rest: ReferenceMotion) -> Task:
        """Return the task with displacements counted from another reference motion."""
        return self._with("rest", rest)

    def held_by(self, bonded: Flags) -> Task:
        """Return the task without free motions if the bonded points hold all bodies; collective."""
        motions = self.motions
        return self._with("motions", motions.none) if motions.held_by(bonded, bonded) else self

    def _with(self, name: str, value: Any) -> Task:
        """Return a copy with another value of one attribute, and the same iterate."""
        _ = self.newton, self.unsymmetric_newton  # which both have
        other = copy(self)
        object.__setattr__(other, name, value)
        return other

    def begin_step(self, start: Start) -> None:
        """Apply the loads and prescribed displacements of a load step to the current iterate."""
        self.newton.lost = False
        for newton in (self.newton, vars(self).get("unsymmetric_newton", self.newton)):
            newton.fails_in_step = False
        if start.factors is not None:
            self.system.set_load(start.factors)
        fixed = self.system.contact.fixed
        self.newton.x.getArray()[fixed] = self.system.start.getArray(readonly=True)[fixed]

    def contact(self, outcome: Outcome, start: Start) -> PointState:
        """Return the state of the contact points of this rank in a result.

        Displacements are from the initial position; slip is counted from ``start``.
        """
        law = start.law
        problem = outcome.problem
        sets = problem.sets
        data = problem.data
        u_n, u_t = problem.system.contact.traces(outcome.newton.x)
        rest_n, rest_t = (0.0, 0.0) if self.rest is None else (self.rest.u_n, self.rest.u_t)
        pressure, shear = outcome.newton.multipliers()
        slip = slip_of(u_t, start.data)
        bound = np.zeros_like(pressure)
        if data.bound is not None and law is not None:
            # The bound of the law itself, as the iteration may have stopped with that of the
            # previous pressure.
            bound, _, _ = law.evaluate(pressure, length(slip))
            bound = data.at((u_n, u_t)).acting(bound)
        xi = slip_of(u_t, data)
        if data.bound is not None:
            xi = slip_multiplier(sets, shear, u_t, data)
        held = damage = None
        if data.bond is not None:
            damage = data.bond.damaged((u_n, u_t))
            held = data.bond.tractions((u_n, u_t))
            pressure, shear = pressure + held[:, 0], shear + held[:, 1:]
        return PointState(
            points=self.system.contact.points,
            gap=data.gap + rest_n,
            u_n=u_n + rest_n,
            u_t=u_t + rest_t,
            pressure=pressure,
            shear=shear,
            bound=bound,
            in_contact=sets.contact,
            direction=sets.direction,
            has_friction=data.bound is not None,
            bilateral=data.bilateral,
            slip_length=slip,
            dt=law.dt if law is not None and law.follows_slip else 0.0,
            xi=xi,
            held=held,
            damage=damage,
        )

    def promised(self, outcome: Outcome) -> tuple[float, float, float]:
        """Return (gamma_1, gamma_2) of the contact law that a result satisfies, and the largest
        gamma with which its tractions were computed.

        Both gammas are infinite without regularisation; the last value is 0 without contact points.
        """
        if outcome.newton.linear:
            return np.inf, np.inf, 0.0
        gammas = outcome.problem.data.gamma_n, outcome.problem.data.gamma_t
        penalty = max(gammas)
        if outcome.augmented:
            gammas = np.inf, np.inf
        return *gammas, penalty
