"""The loop over load steps of every kind of body; of a linear one the increments of a ramp, the
attempts at each load step, and what the checkpoint has of it.  Scenes and forms have each a
``SteppedBody`` of their own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import floor
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import numpy as np

from signorini_fx.algebra import step_limit
from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.mechanics.body.deformation import deformation_of
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.obstacles.corner_depths import deepest_corner
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import Finding, History, Status, StepRecord, Timings
from signorini_fx.results.certificate.law_of_method import (
    Law,
    PreviousStep,
    Tractions,
    overclosures_of,
)
from signorini_fx.results.mechanics import SolidBody, StepResult
from signorini_fx.results.step_frames import StepEnd
from signorini_fx.tuned import (
    EASY_STEP,
    ENCLOSED,
    FAILED_STEP,
    LARGEST_INCREMENT,
    SAME_LENGTH,
    SMALLEST_INCREMENT,
)

if TYPE_CHECKING:
    from signorini_fx.solving.checkpointed_steps import MeshCheckpoint

S = TypeVar("S")
Marks = tuple[int, int, int]  # numbers of linear solves, regularised problems and events so far


@dataclass(frozen=True)
class SteppedBody:
    """A body that load steps lead through, at the present one; all methods are collective."""

    model: SolidBody
    path: LoadPath
    timings: Timings

    def begun(self, path_step: float, task: Task, first: Start, end: StepEnd | None) -> BegunStep:
        """The load step that begins at a place, after the ``end`` of the last one, which had
        ``task``, or as first.
        """
        raise NotImplementedError

    def show(self, outcome: Outcome, result: StepResult) -> None:
        """Show a result to whoever looks at the load steps from outside."""

    def ended(self, end: StepEnd) -> SteppedBody:
        """The body at the end of a load step with a solution, from which the next one begins."""
        return self


@dataclass(frozen=True)
class BegunStep:
    """A load step that begins, with foundations where they are in it; ``last``: the end of the one
    before it.
    """

    body: SteppedBody
    task: Task
    start: Start
    last: PreviousStep | None

    def certified(self, outcome: Outcome) -> LoadStep:
        """The step with its result, without its linear solves, and the certificate's verdict;
        collective.
        """
        body = self.body
        task = self.task
        start = self.start
        model = body.model
        path = body.path
        with body.timings.phase("certify"):
            unknowns = outcome.displacement()
            displacement = model.from_rest(task.rest, unknowns)
            at = model.boundary
            contact = None if at is None else ContactState.of(task.contact(outcome, start), at)
            rigid = (
                model.rigid.moved(model.driven(unknowns, task.rest)) if model.rigid.bodies else ()
            )
            certificate = model.certified(
                displacement,
                None if contact is None else Tractions.of(contact),
                law=Law(*task.promised(outcome)),
                step=start.place,
                last=self.last,
                rigid=rigid,
            )
            deformation = deformation_of(model, displacement, model.tagged.size)
            status = outcome.status
            reason = None
            if status in (Status.CONVERGED, Status.ROUND_OFF):
                # First this, as a body that has moved far away is the usual reason of a residual
                # that stagnates.
                if deformation.largest > model.settings.largest_deformation:
                    status = Status.TOO_LARGE
                elif status is Status.CONVERGED and not certificate.holds:
                    status = Status.NOT_CERTIFIED
                elif status is Status.CONVERGED:
                    deep = deepest_corner(model.shapes(start.place), displacement, rigid)
                    if deep is not None:
                        status = Status.CORNER
                        reason = Finding("warning", deep.path, str(deep))
            result = StepResult(
                step=start.step + 1,
                place=start.place,
                time=path.time_at(start.place),
                name=path.name_at(start.place),
                status=status,
                displacement=displacement,
                contact=contact,
                certificate=certificate,
                deformation=deformation,
                strain_energy=certificate.strain_energy,
                linear_solves=0,
                tools=rigid,
                reason=reason,
            )
            body.show(outcome, result)
        return LoadStep(body, task, start, self.last, result, outcome)


@dataclass(frozen=True)
class LoadStep(BegunStep):
    """A load step with its result."""

    result: StepResult
    outcome: Outcome

    def __str__(self) -> str:
        return f"{self.result}: {self.result.status.value}"


def first_start(
    start: Start, boundary: ContactBoundary | None, state: ContactState | None
) -> Start:
    """Where the first load step of a task starts, from the contact state of a coarser mesh, if any;
    collective.
    """
    if state is None or boundary is None:
        return start
    from signorini_fx.solving.meshed_problem import carry_over

    return start.begin_from(*carry_over(state, boundary))


class Stepping(ABC, Generic[S]):
    """A way through the load steps of one kind of body, with its history and timings; all methods
    are collective.
    """

    history: History
    timings: Timings

    @property
    @abstractmethod
    def through(self) -> bool:
        """Whether there is no further load step."""

    @abstractmethod
    def solved(self) -> S | None:
        """The next load step; None: it has no solution, and is tried in another way unless this is
        through.
        """

    @abstractmethod
    def recalled(self, checkpoint: MeshCheckpoint) -> S | None:
        """The next load step as an earlier run has left it; None: it is not there, or is no
        solution.
        """

    @abstractmethod
    def store(self, checkpoint: MeshCheckpoint, step: S, marks: Marks) -> None:
        """Put a load step into a checkpoint, with the marks before it."""

    def go_on(self, step: S) -> None:
        """Begin the next load step where this one has ended."""

    def all(self, on_step: Callable[[S], object], checkpoint: MeshCheckpoint | None = None) -> None:
        """Solve one load step after the other, or take it from the checkpoint, until there is
        none.
        """
        marks = _marks(self.history)
        while not self.through:
            step = None if checkpoint is None else self.recalled(checkpoint)
            recalled = step is not None
            step = step or self.solved()
            if step is None:
                continue
            on_step(step)
            if not recalled and checkpoint is not None:
                with self.timings.phase("checkpoint"):
                    self.store(checkpoint, step, marks)
            if not self.through:
                self.go_on(step)
            marks = _marks(self.history)


# Places are rounded to these digits, so that ten tenths are one.
_DIGITS = 12


class PathIncrements:
    """Where a problem is on its path through load steps: at the place ``reached``, by an
    ``increment`` from the next, ``nominal`` if it is that of a ramp; places are those of
    ``statement.load_path``.
    """

    stored_names: ClassVar[tuple[str, ...]] = ("reached", "increment")

    def __init__(self, path: LoadPath) -> None:
        self.path = path
        self.nominal = 1.0 / (path.steps or 1)
        # A list of several factors begins with one step to the first of them, in which slip is
        # counted from rest.
        self.reached, self.increment = -1.0, self.nominal if path.from_nothing else 1.0

    @property
    def ended(self) -> bool:
        """Whether the last load step has been solved."""
        return self.reached >= len(self.path.times) - 1

    @property
    def next(self) -> float:
        """The place of the next load step; none goes beyond the next factor."""
        station = floor(self.reached + SAME_LENGTH) + 1.0
        end = round(self.reached + self.increment, _DIGITS)
        return station if end > station - SAME_LENGTH else end

    def halve(self) -> None:
        """The next load step has no solution."""
        self.increment = (self.next - self.reached) / 2

    def resume(self, position: Mapping[str, float]) -> None:
        """Go on from where an earlier run has come to, see ``stored``."""
        for name in self.stored_names:
            setattr(self, name, position[name])

    def stored(self) -> dict[str, float]:
        """What ``resume`` needs, as plain data."""
        return {name: getattr(self, name) for name in self.stored_names}


# Outcomes that another increment of the load does not change if nothing has been reached before.
# Afterwards the same linear solver has solved the same body, and fails because the tangents near a
# limit load are nearly singular.
_HOPELESS_AT_FIRST = (Status.NOT_HELD, Status.LINEAR_SOLVER, Status.NO_MEMORY)


class Increments(PathIncrements):
    """Where a linear problem is on its path.  In a ramp the increment of a load step without a
    solution is halved, until the load is enclosed; the linear solves of the last load step set how
    many an attempt without one may take.
    """

    # ``easy``: how many of the last load steps with a solution were easy; ``last``: linear solves
    # of the last one.
    stored_names = (*PathIncrements.stored_names, "easy", "last")

    def __init__(self, path: LoadPath, settings: SolverSettings) -> None:
        super().__init__(path)
        self._iterations = settings.max_iterations
        self._divided = path.steps is not None
        self.easy = self.last = 0

    @property
    def _divisible(self) -> bool:
        return self._divided and (self.path.from_nothing or self.reached >= 0)

    @property
    def _encloses(self) -> bool:
        """Whether the increment is not divided any more."""
        reached = self.reached
        begun = reached - floor(reached + SAME_LENGTH) if reached >= 0 else reached + 1.0
        return self.next - reached <= max(ENCLOSED * begun, SMALLEST_INCREMENT * self.nominal)

    @property
    def allowed(self) -> int:
        """Linear solves that the next load step may take."""
        if not self._divisible:
            return step_limit(self._iterations)
        # One at which nothing changes takes two, which is no measure for one that fails.
        before_smaller = FAILED_STEP * (
            max(self.last, EASY_STEP) if self.last else self._iterations
        )
        return FAILED_STEP * before_smaller if self._encloses else before_smaller

    def bracket(self, status: Status) -> str | None:
        """Between which loads a ramp has ended with this status; None where no ramp or no load is
        the reason.
        """
        if self._is_final(status):
            return None
        nothing = self.reached == (-1.0 if self.path.from_nothing else 0.0)
        held = "without any load" if nothing else f"at time {self.path.time_at(self.reached):.6g}"
        return f"there is a solution {held}, and none at time {self.path.time_at(self.next):.6g}"

    def _is_final(self, status: Status) -> bool:
        """Whether a load step that ended with ``status`` has no solution for any increment."""
        return (
            not self._divisible
            or status is Status.CORNER
            or (self.reached < 0 and status in _HOPELESS_AT_FIRST)
        )

    def advance(self, linear_solves: int) -> None:
        """The next load step has a solution, which took this many linear solves."""
        divisible = self._divisible
        enclosed = self._encloses
        self.reached = self.next
        self.last = linear_solves
        if not self._divided:
            return
        if not divisible:
            self.increment = self.nominal
            return
        self.easy = self.easy + 1 if linear_solves <= EASY_STEP else 0
        if (self.easy > 1 or enclosed) and self.increment < LARGEST_INCREMENT * self.nominal:
            self.increment = 2 * self.increment
            self.easy = 0

    def shorten(self, status: Status) -> bool:
        """Halve the increment, as the next load step ended with ``status``; whether a smaller one
        may be tried.
        """
        if self._is_final(status) or self._encloses:
            return False
        self.halve()
        self.easy = 0
        return True


@dataclass
class StepProgress(Stepping[LoadStep]):
    """How far the load steps have come."""

    body: SteppedBody  # at the end of the last one
    task: Task  # its contact problem
    first: Start  # of the first one; without contact of the next one, with nothing of the last one
    path: Increments
    end: StepEnd | None = None  # of the last one; None: there is none, or no contact
    results: list[StepResult] = field(default_factory=list)
    ended: tuple[Outcome, RegularisedData] | None = (
        None  # of the last one with a solution, or the first one
    )
    failed: bool = False  # the last one has no solution

    @property
    def history(self) -> History:  # type: ignore[override]
        """That of the contact problem."""
        return self.task.history

    @property
    def timings(self) -> Timings:  # type: ignore[override]
        """Those of the body."""
        return self.body.timings

    @property
    def through(self) -> bool:
        return self.path.ended or self.failed

    def _take(self, step: LoadStep) -> None:
        self.body = step.body
        self.task = step.task
        self.failed = step.result.status is not Status.CONVERGED
        self.results.append(step.result)
        if not self.failed or self.ended is None:
            self.ended = step.outcome, step.outcome.problem.data

    def go_on(self, step: LoadStep) -> None:
        result = step.result
        if result.contact is None:
            self.first = step.outcome.next_step(step.start)
            return
        solved = step.outcome, step.start, result.contact, result.displacement
        self.end = StepEnd.of(step.task, *solved, step.last, result.tools)
        self.body = self.body.ended(self.end)

    def _begun(self, place: float) -> BegunStep:
        """The next load step with its loads; points of soft contact have the stiffness of their law
        for gamma_n.
        """
        begun = self.body.begun(place, self.task, self.first, self.end)
        model = begun.body.model
        start = begun.start
        laws = overclosures_of(begun.body.model.statement)
        if model.boundary is not None and laws:
            share = np.ones(model.boundary.size)
            for number, law in laws.items():
                share[model.boundary.part == number] = law.stiffness / start.data.gamma_n
            start = replace(start, data=replace(start.data, share=share))
        factors = model.load(begun.task.system, place)
        return replace(
            begun,
            start=replace(start, place=place, factors=factors, several=self.body.path.several),
        )

    def solved(self) -> LoadStep | None:
        history = self.task.history
        path = self.path
        newton = self.task.newton
        beginning = newton.checkpoint()
        step = self._attempt()
        status = step.result.status
        if status is not Status.CONVERGED and not history.exhausted and path.shorten(status):
            history.add(f"{step}: half the increment")
            newton.restore(beginning)
            return None
        self._take(step)
        if self.failed:
            if bracket := path.bracket(status):
                history.add(f"the ramp ends: {bracket}")
            return None
        path.advance(step.result.linear_solves)
        return step

    def _attempt(self) -> LoadStep:
        """Solve the next load step, which may have no solution."""
        history = self.task.history
        steps = self.body.path
        place = self.path.next
        solves_before = history.linear_solves
        begun = self._begun(place)
        model = begun.body.model
        start = begun.start
        allowed = self.path.allowed
        if steps.several:
            history.add(StepRecord(start.step + 1, steps.name_at(place), steps.time_at(place)))
        reason: Finding | None = None
        with begun.body.timings.phase("iterate"):
            if model.statement.tightens(place):
                from signorini_fx.solving.bolt_preloads import solve_tightened

                model, start, outcome, reason = solve_tightened(model, begun.task, start, allowed)
                begun = replace(begun, body=replace(begun.body, model=model), start=start)
            else:
                outcome = solve_task(begun.task, start, allowed)
        if reason is None:
            from signorini_fx.solving.findings import explained

            when = f"load step {start.step + 1}: " if steps.several else ""
            reason = explained(begun.body.model, begun.task, outcome, when)
        step = begun.certified(outcome)
        solves = history.linear_solves - solves_before
        return replace(
            step,
            result=replace(step.result, linear_solves=solves, reason=reason or step.result.reason),
        )

    def store(self, checkpoint: MeshCheckpoint, step: LoadStep, marks: Marks) -> None:
        model = step.body.model
        figures: dict[str, Any] = {"path": self.path.stored()}
        if model.statement.preloads:
            from signorini_fx.solving.bolt_preloads import shortenings

            figures["shortenings"] = shortenings(model, step.start.place)
        checkpoint.store(
            model,
            step.body.timings,
            step.task,
            step.start,
            step.outcome,
            step.result,
            marks,
            figures,
        )

    def recalled(self, checkpoint: MeshCheckpoint) -> LoadStep | None:
        number = self.first.step if self.end is None else self.end.start.step
        figures = checkpoint.figures(number)
        history = self.task.history
        newton = self.task.newton
        if figures is None:
            return None
        beginning = newton.checkpoint()
        place = float(figures["place"])
        with self.body.timings.phase("restart"):
            begun = self._begun(place)
            model = begun.body.model
            if model.statement.preloads:
                from signorini_fx.solving.bolt_preloads import with_shortenings

                model = with_shortenings(model, place, figures["shortenings"])
                start = replace(begun.start, factors=model.factors(place))
                begun = replace(begun, body=replace(begun.body, model=model), start=start)
            outcome = checkpoint.recall(model, model.tagged.size, begun.task, begun.start)
        if outcome is None:
            return None
        step = begun.certified(outcome)
        if step.result.status is not Status.CONVERGED:
            history.add(f"restart: {step}: it is solved again")
            checkpoint.forget(number)
            newton.restore(beginning)
            return None
        checkpoint.recall_history(figures, history, self.body.timings)
        self.path.resume(figures["path"])
        step = replace(step, result=replace(step.result, linear_solves=self.path.last))
        self._take(step)
        return step


def _marks(history: History) -> Marks:
    return history.linear_solves, len(history.outer), len(history.events)
