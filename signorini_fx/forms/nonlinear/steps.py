"""The load steps of a nonlinear body: each from the state before it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf

from signorini_fx.algebra.algorithms.task import Outcome
from signorini_fx.arrays import Array
from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import MatrixError
from signorini_fx.forms.nonlinear.newton import EquilibriumSolver
from signorini_fx.forms.nonlinear.results import ResidualMechanics, SolvedBody
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.step_effect import StepEffect
from signorini_fx.records import History, Status, StepRecord, Timings
from signorini_fx.results.mechanics import StepResult
from signorini_fx.solving.frames import Posed, solution_of
from signorini_fx.solving.increments import FINAL, HalvedIncrements
from signorini_fx.solving.load_path import run
from signorini_fx.solving.restart import Figures, StoredStates
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
        return self.solver.linear.history

    @property
    def timings(self) -> Timings:
        """Return the times of this path."""
        return self.solver.timings

    @property
    def effects(self) -> Sequence[StepEffect]:
        """What else happens from load step to load step."""
        return self.solver.linear.effects

    def accept(self, ended: Ended) -> None:
        """What a material remembers is in the state."""

    def record(self, state: State, place: float, time: float) -> StepRecord:
        """The step from a state to a place, in words."""
        return StepRecord(state.number + 1, self.path.name_at(place), time)


@dataclass(frozen=True)
class Ended:
    """How a load step of a nonlinear body has ended; no step goes on from it.

    Attributes:
        solver: is at it, as long as no other step is solved.
        record: the step in words.
        status: None: by an error.
        why: there is no solution, in words; "": there is one.
        error: by which it has ended.
        result: what is shown of it; None: nothing can be.
        mechanics: what the residual says of it.
        linear_solves: of the step.
        iterations: of Newton's method.
    """

    solver: EquilibriumSolver
    record: StepRecord
    status: Status | None
    why: str = ""
    error: FormError | None = None
    result: StepResult | None = None
    mechanics: ResidualMechanics | None = None
    linear_solves: int = 0
    iterations: int = 0

    @property
    def posed(self) -> Posed:
        """What the last iteration was solved with."""
        return self.solver.linear.posed

    @property
    def outcome(self) -> Outcome:
        """How its contact problem has ended."""
        outcome = self.solver.linear.outcome
        assert outcome is not None
        return outcome

    def __str__(self) -> str:
        return f"{self.record}: {self.why}"


def step(
    problem: NonlinearSteps,
    state: State,
    place: float,
    *,
    time: float | None = None,
    guess: State | None = None,
    budget: float | None = None,
) -> tuple[State, Ended]:
    """Solve the step from a state to a place on the path; a failure changes nothing that the user
    sees; collective.

    Args:
        problem: what is solved.
        state: the end of the step before.
        place: see ``statement.load_path``.
        time: of its end; None: that of the place.
        guess: is none of a nonlinear body.
        budget: linear solves that it may take; None: those of the settings.

    Returns:
        The state at its end, or that before it, and how it has ended.
    """
    solver = problem.solver
    way = problem.way
    kept = solver.linear.begin, solver.u.x.array.copy()
    time = problem.path.time_at(place) if time is None else time
    record = problem.record(state, place, time)
    solves = problem.history.linear_solves
    final = way is None or not way.may_halve
    error: FormError | None = None
    shown: SolvedBody | None = None
    try:
        _begin(problem, state, place, time)
        with problem.history.at_most(inf if budget is None else budget):
            why = solver.attempt(final=final)
        if not why:
            solver.take()
            new, figures = solver.ended(time)
            return new, _shown(problem, record, place, solver.linear_solves, figures)
        status = Status.LIMIT if solver.without else solver.status
        assert status is not None
        if (final or status in FINAL) and (way is None or solver.solved is None):
            shown = solver.before(status, problem.history.linear_solves - solves)
    except FormError as raised:
        status, why, error = None, str(raised), raised
    except Exception:
        _go_back(problem, kept)
        raise
    _go_back(problem, kept)
    if shown is None:
        return state, Ended(solver, record, status, why, error)
    shown = replace(shown, step=_named(shown.step, place, record))
    if solver.solved is None:
        solver.solved = shown
    return state, Ended(solver, record, status, why, error, shown.step, shown.mechanics)


def _begin(problem: NonlinearSteps, state: State, place: float, time: float) -> None:
    """Put the body where a step to a place, which ends at a time, begins; collective."""
    solver = problem.solver
    linear = solver.linear
    solver.start(state)
    linear.several = problem.path.several
    linear.foundations.dt = time - state.time
    problem.go_to(place)
    if any(entry.friction is not None and entry.friction.follows_slip for entry in linear.contact):
        refuse_no_duration(linear.foundations.dt)


def _go_back(problem: NonlinearSteps, kept: tuple[State, Array]) -> None:
    """Show the last solution, as a step has none; a step of a user's own begins again where the
    last one has begun; collective.
    """
    begin, values = kept
    solver = problem.solver
    if problem.way is None:
        solver.resume(begin)
        solver.show_last(values)
    else:
        problem.go_to(problem.way.reached)


def _named(result: StepResult, place: float, record: StepRecord) -> StepResult:
    return replace(result, place=place, time=record.time, name=record.name)


def _shown(
    problem: NonlinearSteps,
    record: StepRecord,
    place: float,
    solves: int,
    figures: Mapping[str, float],
) -> Ended:
    """The last solution as the end of a step."""
    solver = problem.solver
    solved = solver.solved
    assert solved is not None
    result = replace(_named(solved.step, place, record), linear_solves=solves, figures=figures)
    solver.solved = replace(solved, step=result)
    counts = solves, solver.iterations
    status = Status.CONVERGED
    return Ended(solver, record, status, "", None, result, solved.mechanics, *counts)


def recalled(
    problem: NonlinearSteps, state: State, figures: Figures, read: Callable[..., State | None]
) -> tuple[State, Ended] | None:
    """The end of a load step that follows a state, as an earlier run has stored it, with what is
    shown of it, evaluated again; None: it cannot be read; collective.
    """
    solver = problem.solver
    linear = solver.linear
    solver.refuse_elsewhere()
    place, time = (float(figures[name]) for name in ("place", "time"))
    record = problem.record(state, place, time)
    with problem.timings.phase("restart"):
        _begin(problem, state, place, time)
        if (end := read(linear.space)) is None:
            return None
        status = Status.NOT_CERTIFIED
        with suppress(FormError, MatrixError, PairingError):
            if solver.residual.at(end.displacement.copy()) is not None:
                linear.begin_at_solution(end)
                if (whole := read(linear.space, linear.boundary)) is None:
                    return None
                end = whole
                linear.take(solution_of(linear.posed, linear.begun, end, **figures["method"]))
                linear.take_tractions(end)
                status = solver.certify()
    if status is not Status.CONVERGED:
        solver.show_last(state.displacement)
        return state, Ended(solver, record, status, status.value)
    solver.status = status
    solver.iterations = 0
    solver.take()
    solver.reached = end
    told = solver.figures(end)
    return end, _shown(problem, record, place, figures["linear_solves"], told)


def solve_path(
    problem: NonlinearSteps,
    state: State,
    on_step: Callable[[Ended], object],
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
    solver.begin_path(several=problem.path.several)
    last = "there is no solution before it"
    for new, ended in run(problem, state, way, stored=stored, by=(step, recalled)):
        if ended.status is Status.CONVERGED:
            last = ""
            on_step(ended)
        solver.start(new)
    if ended.status is Status.CONVERGED:
        return "", ""
    path = problem.path
    end, reached = (f"time {path.time_at(place):g}" for place in (way.next, way.reached))
    if not last:
        last = f"there is a solution at {reached}{problem.held(way.reached, way.next)}"
    if (error := ended.error) is not None:
        reasons = [(key, f"{reason} (at {end}; {last})") for key, reason in error.problems]
        raise FormError(reasons, error.source) from error.__cause__
    status = solver.status = ended.status
    assert status is not None
    failure = f"{solver.failure}: at {end}; {last}"
    if status is Status.LIMIT:
        failure = f"{status.value}: {last}; a step to {end} ends with: {solver.failure}"
    return failure, solver.advice(status)
