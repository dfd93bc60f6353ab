"""The load steps of a ``ContactProblem``, and what they end with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from dolfinx import fem

from signorini_fx.algorithms.strategy import solve_task
from signorini_fx.algorithms.task import Outcome, Start, Task
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.deformation import Deformation
from signorini_fx.body.elastic import ElasticBody
from signorini_fx.body.joint_pressure import JointPressure
from signorini_fx.body.rigid_bodies import RigidBodyMotion
from signorini_fx.contact.laws import Nodal
from signorini_fx.errors import FormError
from signorini_fx.linalg import ElasticSystem
from signorini_fx.records import History, Status, Timings
from signorini_fx.results.certificate import Certificate
from signorini_fx.results.promised_law import PreviousStep
from signorini_fx.results.solution import StepResult
from signorini_fx.results.step_frames import LastSolution, StepEnd
from signorini_fx.scales import Scales
from signorini_fx.scene.load_steps import LoadPath
from signorini_fx.scene.values import kind_of
from signorini_fx.solving.load_steps import step_result
from signorini_fx.solving.stepped_problem import BegunStep, LoadStep, UncertifiedStep


@dataclass(frozen=True)
class StepBeginning:
    """Where a step of a ``ContactProblem`` begins, whatever is tried from there.

    Attributes:
        last: the end of the last step; None: there is none.
        start: of the step, in the frames of ``boundary``; None: the body at rest.
        previous: ``last`` as the certificate sees it from there.
        solution: the last solution.
        settled: the shapes of foundations as they were at the end of the last step.
        boundary: the contact points.
    """

    last: StepEnd | None
    start: Start | None
    previous: PreviousStep | None
    solution: LastSolution | None
    settled: dict[int, Any]
    boundary: ContactBoundary


class LoopedForms(Protocol):
    """What load steps need of a ``ContactProblem``; its methods are collective."""

    u: fem.Function
    status: Status | None
    certificate: Certificate | None
    deformation: Deformation | None
    tools: tuple[RigidBodyMotion, ...]
    _elastic: ElasticBody
    _task: Task
    _scales: Scales
    _begun: Start
    _previous_step: PreviousStep | None

    @property
    def state(self) -> ContactState:
        """See ``ContactProblem``."""
        ...

    def advance(self) -> None:
        """See ``ContactProblem``."""
        ...

    def _begin(self) -> Start: ...
    def _take(self, outcome: Outcome) -> None: ...
    def _load(self) -> None: ...
    def _beginning(self) -> StepBeginning: ...
    def _go_back(self, beginning: StepBeginning) -> None: ...


class Clock:
    """Changes a problem to what it is at a time.

    Args:
        at: a function of the time, or a Constant whose value is the time.

    Raises:
        FormError: it is neither.
    """

    def __init__(self, at: Callable[[float], object] | fem.Constant) -> None:
        if not callable(at) and not (isinstance(at, fem.Constant) and at.value.ndim == 0):
            raise FormError([("at", f"must be a function of the time or a Constant with one value, not {kind_of(at)}")])
        self._at = at
        self._time: float | None = None

    def turn(self, time: float) -> None:
        """Go to a time, unless it is the present one."""
        if time == self._time:
            return
        if isinstance(self._at, fem.Constant):
            self._at.value = time
        else:
            self._at(time)
        self._time = time


@dataclass(frozen=True)
class FormSteps:
    """A ``ContactProblem`` at the load steps of a path, see ``SteppedProblem``.

    Attributes:
        problem: which is always that of the last attempt.
        path: the load steps.
        clock: changes the problem to what it is at a time.
        timings: of the run.
        beginning: where the next load step begins.
    """

    problem: LoopedForms
    path: LoadPath
    clock: Clock
    timings: Timings
    beginning: StepBeginning

    @property
    def body(self) -> ElasticBody:
        """As it was assembled last."""
        return self.problem._elastic

    @property
    def size(self) -> float:
        """Of the body, length."""
        return self.problem._scales.size

    @property
    def loads(self) -> str:
        """The argument with its forces."""
        return "L"

    def at(self, path_step: float, task: Task, start: Start, last: PreviousStep | None) -> BegunStep[FormSteps]:
        """The problem as it is at the time of a place, from the end of the last load step; collective."""
        self.problem._go_back(self.beginning)
        with self.timings.phase("assemble"):
            self.clock.turn(self.path.time_at(path_step))
            begun = self.problem._begin()
        return BegunStep(self, self.problem._task, begun, self.problem._previous_step)

    def load(self, system: ElasticSystem, path_step: float) -> Nodal:
        """Those of the time of the place; collective."""
        self.clock.turn(self.path.time_at(path_step))
        self.problem._load()
        return np.ones(1)

    def solved(self, begun: BegunStep[FormSteps], allowed: int) -> UncertifiedStep[FormSteps]:
        """See ``SteppedProblem``."""
        return UncertifiedStep(begun, solve_task(begun.task, begun.start, allowed))

    def certified(
        self, begun: BegunStep[FormSteps], outcome: Outcome, joint: JointPressure | None = None
    ) -> StepResult:
        """See ``SteppedProblem``; the result is what the problem shows."""
        problem, start = self.problem, begun.start
        with self.timings.phase("certify"):
            problem._begun = start
            problem._take(outcome)
            assert problem.status is not None
            assert problem.certificate is not None
            assert problem.deformation is not None
            y = problem.u.copy()
            y.name = problem.u.name
        state, certificate, deformation = problem.state, problem.certificate, problem.deformation
        result = step_result(self.path, start.step, start.place, problem.status, y, state, certificate, deformation)
        return replace(result, tools=problem.tools)

    def ended(self, step: LoadStep[FormSteps]) -> FormSteps:
        """The next load step begins as after ``advance``."""
        self.problem.advance()
        return replace(self, beginning=self.problem._beginning())

    def stored(self, path_step: float, result: StepResult) -> tuple[dict[str, Nodal], dict[str, Any]]:
        """Nothing: all is in what the forms and foundations are at the time of the place."""
        return {}, {}

    def recalled(
        self, task: Task, path_step: float, nodal: dict[str, Nodal], figures: dict[str, Any]
    ) -> tuple[FormSteps, JointPressure | None]:
        """See ``stored``."""
        return self, None


@dataclass(frozen=True, repr=False)
class SolvedPath:
    """How the load steps of a ``ContactProblem`` have ended.

    Attributes:
        path: the load steps that were asked for.
        steps: one result per load step, up to the last one that was tried.
        history: of the problem.
        timings: wall seconds by phase, on this rank.
        bracket: between which loads a ramp has ended; None: it has not, or there is none.
    """

    path: LoadPath
    steps: tuple[StepResult, ...]
    history: History
    timings: Timings
    bracket: str | None = None

    def __repr__(self) -> str:
        return f"<SolvedPath: {self.status.value}, {len(self.steps)} load steps>"

    @property
    def status(self) -> Status:
        """That of the last load step that was tried."""
        return self.steps[-1].status

    @property
    def converged(self) -> bool:
        """Whether there is a solution at the last of the times."""
        return self.status is Status.CONVERGED

    @property
    def last_step(self) -> StepResult:
        """The last load step with a solution, or the first one if it has none."""
        return ([step for step in self.steps if step.status is Status.CONVERGED] or [*self.steps])[-1]

    def outcome(self) -> str:
        """How the last load step ended, and what to do."""
        failed = self.steps[-1]
        reason = failed.status.advice if failed.reason is None else failed.reason.message
        remark = "" if self.bracket is None else f"; {self.bracket}"
        return f"{failed}: {failed.status.value}: {reason}{remark}"
