"""The load steps of a nonlinear body: each from the state before it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf
from typing import Any

from signorini_fx.arrays import Array
from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import MatrixError
from signorini_fx.forms.nonlinear.newton import EquilibriumSolver
from signorini_fx.forms.nonlinear.results import SolvedBody
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.step_effect import StepEffect
from signorini_fx.records import History, Status, StepRecord, Timings
from signorini_fx.solving.frames import solution_of
from signorini_fx.solving.increments import FINAL, HalvedIncrements
from signorini_fx.solving.load_path import run
from signorini_fx.solving.restart import StoredStates
from signorini_fx.solving.step import refuse_no_duration


@dataclass(frozen=True)
class NonlinearSteps:
    """A nonlinear body on a path.

    Attributes:
        solver: finds its equilibria.
        path: the load steps.
        go_to: changes the body to what it is at a place.
        way: where it is on the path; None: one step of a user's own is solved.
        held: says in words what the place that was reached bears of the loads at one without a
            solution.
    """

    solver: EquilibriumSolver
    path: LoadPath
    go_to: Callable[[float], object]
    way: HalvedIncrements | None = None
    held: Callable[[float, float], str] = lambda reached, failed: ""

    @property
    def history(self) -> History:
        """Return the history of all solves."""
        return self.solver.body.history

    @property
    def timings(self) -> Timings:
        """Return the times of this path."""
        return self.solver.timings

    @property
    def effects(self) -> Sequence[StepEffect]:
        """Return what else happens from load step to load step."""
        return self.solver.body.effects

    def accept(self, new: State, report: Any) -> None:
        """The next step begins from this end of the last one."""
        self.solver.solved = report
        self.solver.reached = new

    def equilibrium(
        self,
        state: State,
        place: float,
        time: float,
        guess: State | None = None,
        budget: int | None = None,
    ) -> tuple[State, SolvedBody | Failure]:
        """Return the end of a step before effects in time, or that before it, and how it has ended;
        a failure changes nothing that the user sees; collective.

        Args:
            state: the end of the step before.
            place: see ``statement.load_path``.
            time: of its end.
            guess: is none of a nonlinear body.
            budget: linear solves that it may take; None: those of the settings.
        """
        solver = self.solver
        way = self.way
        kept = solver.body.begin, solver.body.at.x.array.copy()
        solves = self.history.linear_solves
        final = way is None or not way.may_halve
        error: FormError | None = None
        shown: SolvedBody | None = None
        try:
            self._begin(state, place, time)
            solver.extrapolate(state, time)
            with self.history.at_most(inf if budget is None else budget):
                why = solver.attempt(final=final)
            if not why:
                solved = self._named(solver.take(), place, time)
                return solver.committed(time), solved
            status = Status.LIMIT if solver.verdict.without else solver.status
            assert status is not None
            if (final or status in FINAL) and (way is None or solver.solved is None):
                shown = solver.before(status, self.history.linear_solves - solves)
        except FormError as raised:
            status, why, error = None, str(raised), raised
        except Exception:
            self._go_back(*kept)
            raise
        self._go_back(*kept)
        if shown is None:
            record = StepRecord(state.number + 1, self.path.name_at(place), time)
            return state, Failure(record, status, why, error)
        shown = self._named(shown, place, time)
        if solver.solved is None:
            solver.solved = shown
        return state, shown

    def _begin(self, state: State, place: float, time: float) -> None:
        """Put the body where a step to a place, which ends at a time, begins; collective."""
        body = self.solver.body
        self.solver.start(state)
        body.several = self.path.several
        body.foundations.dt = time - state.time
        self.go_to(place)
        body.evaluated.begin(state, body.foundations.dt)
        rigid = body.foundations.rigid_bodies
        body.drives = rigid.drives()
        for effect in self.effects:
            body.foundations.drive(effect.driven(rigid, state, body.foundations.dt))
        laws = [entry.friction for entry in body.contact]
        if any(law is not None and law.follows_slip for law in laws):
            refuse_no_duration(body.foundations.dt)

    def _go_back(self, begin: State, values: Array) -> None:
        """Show the last solution, as a step has none; a step of a user's own begins again where the
        last one has begun; collective.
        """
        if self.way is None:
            self.solver.body.begin = begin
            self.solver.recall(begin)
            self.solver.body.settle()
            self.solver.show_last(values)
        else:
            self.go_to(self.way.reached)

    def _named(self, solved: SolvedBody, place: float, time: float) -> SolvedBody:
        """Return a body at the end of the step to a place, which ends at a time."""
        name = self.path.name_at(place)
        return replace(solved, result=replace(solved.result, place=place, time=time, name=name))

    def recall(
        self,
        state: State,
        place: float,
        time: float,
        read: Callable[..., State | None],
        method: Mapping[str, Any],
    ) -> tuple[State, SolvedBody | Failure] | None:
        """See ``recalled_equilibrium``."""
        solver = self.solver
        body = solver.body
        solver.refuse_elsewhere()
        self._begin(state, place, time)
        if (end := read(body.space)) is None:
            return None
        status = Status.NOT_CERTIFIED
        with suppress(FormError, MatrixError, PairingError):
            if body.evaluated.at(end.displacement.copy()) is not None:
                body.foundations.carry_to(end.rigid)
                linear = body.as_it_is()
                if (whole := read(body.space, linear.boundary)) is None:
                    return None
                end = whole
                body.take(linear, solution_of(linear.posed, linear.start, end, **method))
                assert end.contact is not None
                body.take_tractions(end.contact)
                status = solver.certify()
        if status is not Status.CONVERGED:
            solver.show_last(state.displacement)
            record = StepRecord(state.number + 1, self.path.name_at(place), time)
            return state, Failure(record, status, status.value)
        solver.status = status
        return end, self._named(solver.take(), place, time)


@dataclass(frozen=True)
class Failure:
    """How a load step of a nonlinear body has ended that has nothing to show.

    Attributes:
        record: the step in words.
        status: None: by an error.
        why: there is no solution, in words.
        error: by which it has ended.
    """

    record: StepRecord
    status: Status | None
    why: str
    error: FormError | None = None
    result = None

    def __str__(self) -> str:
        return f"{self.record}: {self.why}"


def solve_path(
    problem: NonlinearSteps,
    state: State,
    on_step: Callable[[SolvedBody], object],
    stored: StoredStates | None = None,
) -> tuple[str, str]:
    """Solve the load steps of a path after a state; the solver is left where the next one would
    begin; collective.

    Returns:
        Why the path has ended before its last step, and what to do about it, in words; "": it has
        not.

    Raises:
        FormError: with which the smallest step has ended.
    """
    solver = problem.solver
    way = problem.way
    assert way is not None
    solver.begin_path()
    first = way.reached
    for new, ended in run(problem, state, way, stored=stored):
        if ended.status is Status.CONVERGED:
            on_step(ended)
        solver.start(new)
    if ended.status is Status.CONVERGED:
        return "", ""
    path = problem.path
    end, reached = (f"time {path.time_at(place):g}" for place in (way.next, way.reached))
    last = "there is no solution before it"
    if way.reached > first:
        last = f"there is a solution at {reached}{problem.held(way.reached, way.next)}"
    if (error := getattr(ended, "error", None)) is not None:
        reasons = [(key, f"{reason} (at {end}; {last})") for key, reason in error.problems]
        raise FormError(reasons, error.source) from error.__cause__
    status = solver.status = ended.status
    assert status is not None
    failure = f"{solver.failure}: at {end}; {last}"
    if status is Status.LIMIT:
        failure = f"{status.value}: {last}; a step to {end} ends with: {solver.failure}"
    return failure, solver.advice(status)
