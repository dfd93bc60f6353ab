"""A contact problem ready to be solved: its parts, the iterate that algorithms share, and what they leave behind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from petsc4py import PETSc

from signorini_fx.algorithms.ladder import climb
from signorini_fx.algorithms.ssn import SemismoothNewton
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.rigid import RigidMotions
from signorini_fx.contact.laws import (
    ActiveSets,
    FrictionLaw,
    Nodal,
    RegularisedData,
    slip_multiplier,
    slip_of,
)
from signorini_fx.contact.resting import Rest
from signorini_fx.contact.state import ContactState
from signorini_fx.linalg import ElasticSystem
from signorini_fx.linalg.rotated import rotate
from signorini_fx.problem.exact import ExactProblem
from signorini_fx.problem.regularised import ContactProblem, RegularisedProblem
from signorini_fx.records import History, Status
from signorini_fx.results.certificate import UNREGULARISED, Law
from signorini_fx.scene.model import SolverSettings


@dataclass
class Task:
    """A contact problem ready to be solved, and what the algorithms leave behind.

    Attributes:
        settings: the solver settings of the scene.
        system: the elastic system.
        boundary: the contact nodes.
        motions: rigid motions of the body.
        data: the regularised problem with the gamma of the scene.
        law: the friction law, None without friction.
        has_coulomb: whether its bound follows the pressure anywhere.
        first_sets: sets of the first linear solve; None: from the iterate.
        first_iteration: its number.
        start: (lambda, mu) to start from, where there are any.
        rest: where displacements are counted from; None: from where the body was at first.
        natural_gamma: E over the size of the body, the natural unit of gamma.
        history: records.
        linear_algebra: which kind of elastic system it is, and why.
        goal: the regularisation error that path-following may leave, in the energy norm, judged at an iterate.
        step: the load step, from 0.
        x: the iterate.
        problem: the problem that holds the answer.
        monolithic: whether Coulomb friction was solved monolithically.
        augmented: whether augmentation took over, which leaves nothing of the regularisation.
        regularisation_error: what path-following says is left, in the energy norm; None where it did not run.
    """

    settings: SolverSettings
    system: ElasticSystem
    boundary: ContactBoundary
    motions: RigidMotions
    data: RegularisedData
    law: FrictionLaw | None
    has_coulomb: bool
    first_sets: ActiveSets | None
    first_iteration: int
    natural_gamma: float
    history: History
    linear_algebra: str
    goal: Callable[[PETSc.Vec], float]
    start: tuple[Nodal, Nodal] | None = None
    rest: Rest | None = None
    step: int = 0
    x: PETSc.Vec = field(init=False)
    problem: ContactProblem = field(init=False)
    monolithic: bool = False
    augmented: bool = False
    regularisation_error: float | None = None

    def __post_init__(self) -> None:
        self.x = self.system.start.copy()
        self._regularised = self.problem = RegularisedProblem(self.system, self.boundary, self.motions)
        self._symmetric = self._newton(self._regularised)
        self._unsymmetric: SemismoothNewton | None = None
        self._exact: dict[bool, SemismoothNewton] = {}

    def _newton(
        self, problem: ContactProblem, x: PETSc.Vec | None = None, *, symmetric: bool = True
    ) -> SemismoothNewton:
        return SemismoothNewton(
            problem,
            self.x if x is None else x,
            self.settings.max_iterations,
            self.history,
            symmetric=symmetric,
            climb=climb if self.settings.fallbacks else None,
            limited=_limited(self.settings, "max_iterations"),
        )

    @property
    def newton(self) -> SemismoothNewton:
        """The inner method on the regularised problem."""
        return self._symmetric

    @property
    def unsymmetric_newton(self) -> SemismoothNewton:
        """The same with an unsymmetric tangent, on the same iterate."""
        if self._unsymmetric is None:
            self._unsymmetric = self._newton(self._regularised, symmetric=False)
        return self._unsymmetric

    @property
    def exact_newton(self) -> SemismoothNewton:
        """The inner method on the unregularised problem, with an iterate of its own."""
        if True not in self._exact:
            system = rotate(self.system, self.boundary)
            problem = ExactProblem(system, self.boundary, self.motions)
            self._exact[True] = self._newton(problem, system.start.copy())
        return self._exact[True]

    @property
    def exact_unsymmetric_newton(self) -> SemismoothNewton:
        """The same with an unsymmetric tangent, on the same iterate."""
        exact = self.exact_newton
        if False not in self._exact:
            self._exact[False] = self._newton(exact.problem, exact.x, symmetric=False)
        return self._exact[False]

    @property
    def answer(self) -> SemismoothNewton:
        """The inner method whose iterate is the answer."""
        return self._symmetric if self.problem is self._regularised else self.exact_newton

    def displacement(self) -> PETSc.Vec:
        """All displacement dofs of the answer, counted from where the body rests."""
        return self.problem.system.displacement(self.answer.x)

    def contact(self) -> ContactState:
        """The contact nodes of this rank as the answer has them, displacements from where the body was at first."""
        problem = self.problem
        sets, data = problem.sets, problem.data
        u_n, u_t = problem.traces(self.answer.x)
        rest_n, rest_t = (0.0, 0.0) if self.rest is None else (self.rest.u_n, self.rest.u_t)
        pressure, shear = self.answer.multipliers()
        return ContactState(
            boundary=self.boundary,
            gap=data.gap + rest_n,
            u_n=u_n + rest_n,
            u_t=u_t + rest_t,
            pressure=pressure,
            shear=shear,
            # Of the law itself: the iteration may have stopped with the bound of the pressure before.
            bound=np.zeros_like(pressure) if not data.has_friction or self.law is None else self.law.bound(pressure),
            in_contact=sets.contact,
            direction=sets.direction,
            has_friction=data.has_friction,
            bilateral=np.zeros(self.boundary.size, dtype=bool) if data.bilateral is None else data.bilateral,
            slip_length=slip_of(u_t, data),
            xi=slip_multiplier(sets, shear, u_t, data) if data.has_friction else slip_of(u_t, data),
        )

    @property
    def promised(self) -> Law:
        """The contact law that the answer promises to meet: without regularisation, or with the gamma in force."""
        if self.augmented or self.settings.algorithm in ("alm", "exact"):
            return UNREGULARISED
        return Law(self.problem.data.gamma_n, self.problem.data.gamma_t)

    def begin_from(self, sets: ActiveSets, start: tuple[Nodal, Nodal]) -> None:
        """Start from sets and (lambda, mu) that another mesh, or fewer contact nodes, have led to."""
        self.first_sets, self.first_iteration, self.start = sets, 1, start

    def gave_up(self, status: Status) -> bool:
        """Whether a method has failed that was not told when to end."""
        limit = {Status.MAX_ITERATIONS: "max_iterations", Status.OUTER_MAX_ITERATIONS: "max_outer_iterations"}
        return status is Status.CYCLING or (status in limit and not _limited(self.settings, limit[status]))

    def restart(self, step: int, scale: float = 1.0) -> None:
        """Take the loads and prescribed displacements of a load step, times ``scale``, on the iterate that there is."""
        for problem in {id(p): p for p in (self._regularised, self.problem)}.values():
            problem.system.set_step(step, scale)
        fixed = self.system.fixed
        self.x.getArray()[fixed] = self.system.start.getArray(readonly=True)[fixed]
        self.problem = self._regularised

    def next_step(self) -> None:
        """Go on to the next load step: friction acts on what is added to the slip, from the shear that there is."""
        _, u_t = self.problem.traces(self.answer.x)
        pressure, shear = self.answer.multipliers()
        self.step += 1
        self.restart(self.step)
        self.data = replace(self.data, slip_origin=u_t)
        if self.law is not None:
            self.data = replace(self.data, mu_hat=shear, bound=self.law.bound(pressure))
        self.first_sets, self.first_iteration, self.start = None, 1, (pressure, shear)


def _limited(settings: SolverSettings, name: str) -> bool:
    """Whether a limit is lower than usual: then it is an end that was asked for, and no failure."""
    return bool(getattr(settings, name) < SolverSettings.model_fields[name].default)
