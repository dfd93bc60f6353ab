"""What the loop over load steps asks of a problem, and the load steps that it makes of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, Protocol, Self, TypeVar

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.laws import Nodal
from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.mechanics.body.elastic import ElasticBody
from signorini_fx.mechanics.body.joint_pressure import JointPressure
from signorini_fx.mechanics.statement.load_steps import LoadPath
from signorini_fx.records import Finding, Timings
from signorini_fx.results.promised_law import PreviousStep
from signorini_fx.results.solution import StepResult
from signorini_fx.results.step_frames import StepEnd

P = TypeVar("P", bound="SteppedProblem")


class SteppedProblem(Protocol):
    """A problem that load steps lead through; places as in ``statement.load_steps``; all methods are collective."""

    @property
    def timings(self) -> Timings:
        """Of its mesh."""
        ...

    @property
    def path(self) -> LoadPath:
        """Its load steps."""
        ...

    @property
    def body(self) -> ElasticBody:
        """Its elastic body, with contact points."""
        ...

    @property
    def size(self) -> float:
        """Of the body, length."""
        ...

    @property
    def loads(self) -> str:
        """The name of its forces, for messages."""
        ...

    def at(self, path_step: float, task: Task, first: Start, end: StepEnd | None, /) -> BegunStep[Self]:
        """The load step that begins at a place, with foundations and friction as they are there.

        Args:
            path_step: the place.
            task: the contact problem of the last load step.
            first: where the first load step starts.
            end: that of the last load step; None: there is none.
        """
        ...

    def load(self, system: ElasticSystem, path_step: float, /) -> Nodal:
        """Give a system its loads at a place, and return their factors for ``system.set_load``."""
        ...

    def solved(self, begun: BegunStep[Self], allowed: int, /) -> UncertifiedStep[Self]:
        """Solve a load step with so many linear solves for each contact problem."""
        ...

    def certified(self, begun: BegunStep[Self], outcome: Outcome, joint: JointPressure | None = None, /) -> StepResult:
        """The result of a load step, with the certificate's verdict; its linear solves are not counted yet.

        Args:
            begun: the load step.
            outcome: how it ended.
            joint: the pressure of loads within the contact; None: none enters.
        """
        ...

    def ended(self, end: StepEnd, /) -> Self:
        """The problem at the end of a load step with a solution, from which the next one begins."""
        ...

    def stored(self, path_step: float, result: StepResult, /) -> tuple[dict[str, Nodal], dict[str, Any]]:
        """What else a checkpoint needs of a load step: values at the contact points, and plain data."""
        ...

    def recalled(
        self, task: Task, path_step: float, nodal: dict[str, Nodal], figures: dict[str, Any], /
    ) -> tuple[Self, JointPressure | None]:
        """Take back what ``stored`` has returned."""
        ...


@dataclass(frozen=True)
class BegunStep(Generic[P]):
    """A load step that begins.

    Attributes:
        problem: with its foundations where they are in this step.
        task: its contact problem.
        start: of it.
        last: the end of the load step before it; None: there is none.
    """

    problem: P
    task: Task
    start: Start
    last: PreviousStep | None


@dataclass(frozen=True)
class UncertifiedStep(Generic[P]):
    """A load step that is not certified yet.

    Attributes:
        begun: the load step, with what the solve has found of its loads.
        outcome: how it ended.
        joint: the pressure of loads within the contact; None: none enters.
        reason: why there is no solution; None: it is not known.
    """

    begun: BegunStep[P]
    outcome: Outcome
    joint: JointPressure | None = None
    reason: Finding | None = None


@dataclass(frozen=True)
class LoadStep(BegunStep[P]):
    """A load step with its result.

    Attributes:
        result: of it.
        outcome: how it ended.
    """

    result: StepResult
    outcome: Outcome

    @classmethod
    def of(cls, begun: BegunStep[P], outcome: Outcome, result: StepResult) -> LoadStep[P]:
        """The load step that has begun, with its result."""
        return cls(begun.problem, begun.task, begun.start, begun.last, result, outcome)

    def __str__(self) -> str:
        return f"{self.result}: {self.result.status.value}"
