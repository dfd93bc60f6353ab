"""The loop over load steps, for scenes and forms, with ramps and restart from an earlier run.

Time steps within a load step are as long as effects allow, or as short as a required accuracy in
time needs: then two steps are compared with one step over the same time from the same state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import ceil, inf
from typing import TypeGuard

import numpy as np
import ufl
from dolfinx import fem

from signorini_fx.arrays import Array, quotient
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import compile_form
from signorini_fx.mechanics.state import State
from signorini_fx.records import Status, StepRecord
from signorini_fx.solving.frames import Posed
from signorini_fx.solving.increments import HalvedIncrements, Increments
from signorini_fx.solving.restart import StoredStates, marks_of
from signorini_fx.solving.step import Ending, Failure, Problem, Report, StoredProblem, step
from signorini_fx.tuned import ENCLOSED, SAME_LENGTH, SAME_NUMBER


def run(
    problem: StoredProblem,
    state: State,
    way: Increments | HalvedIncrements,
    *,
    guess: State | None = None,
    stored: StoredStates | None = None,
) -> Iterator[tuple[State, Ending]]:
    """Solve one load step after the other, or take it from an earlier run, until the end of the
    path; collective.

    Args:
        problem: the problem to solve.
        state: the state from which the first step starts.
        way: the position on the path and the size of increments; it is advanced.
        guess: for the first step, see ``step``.
        stored: the stored load steps of an unfinished run, to which each new one is added; None:
            nothing is stored.

    Yields:
        The end of each load step with its report; the last one may have no solution.
        A step is stored when the next one is requested.
    """
    history = problem.history
    between = list[tuple[float, Mapping[str, float]]]()

    def passed(new: State, report: Report, *, kept: bool) -> Iterator[tuple[State, Report]]:
        """Collect the figures of a time step with a solution; yield it if it is the end of a load
        step (``kept``).
        """
        figures = report.result.figures
        if (error := time_error(new)) is not None:
            figures = {**figures, "time_error": error}
        if figures:
            between.append((new.time, figures))
        if kept:
            result = replace(report.result, figures=figures, between=tuple(between))
            report = replace(report, result=result)
            between.clear()
            yield new, report

    if stored is not None:
        for new, earlier, kept in stored.recalled(problem, state, way):
            state = new
            yield from passed(new, earlier, kept=kept)
    marks = marks_of(history)
    end = told = -inf

    def solve(begin: State, at: float, time: float) -> tuple[State, Ending]:
        """Solve the step from a state to the place ``at``, which ends at ``time``."""
        nonlocal told
        if problem.path.several and time == end != told:
            told = end
            history.add(StepRecord(begin.number + 1, problem.path.name_at(at), time))
        return step(problem, begin, at, time, guess=guess, budget=way.allowed)

    while not way.ended:
        place = way.next
        end = problem.path.time_at(place)
        for new, report, at, time in time_steps(problem, state, way.reached, place, solve):
            status = report.status
            if isinstance(report, Failure) or status is not Status.CONVERGED:
                if not history.exhausted and way.shorten(status, at):
                    history.add(f"{report}: half the increment")
                    continue
                if bracket := way.bracket(status):
                    history.add(f"the ramp ends: {bracket}")
                yield new, report
                return
            state = new
            problem.accept(new, report)
            way.advance(at, report.result.linear_solves, report.iterations)
            yield from passed(new, report, kept=time == end)
            if stored is not None:
                with problem.timings.phase("checkpoint"):
                    stored.write(problem, new, report, way, marks, kept=time == end)
            guess = None
            marks = marks_of(history)


_FIELD = "time error"  # field of a state with the values of ``Pairs``

# Solves the step from a state to a place, which ends at a time.
Solve = Callable[[State, float, float], tuple[State, Ending]]
Solved = tuple[State, Report, float, float]
Ended = tuple[State, Ending, float, float]  # the end of a step, its report, its place and time


@dataclass(frozen=True)
class Pairs:
    """Error estimates from the pairs of time steps so far.

    Attributes:
        duration: of the next pair, time.
        errors: sums of the errors of displacement and tractions, in L2, shape (2,).
        sizes: largest norms of displacement and tractions so far, in L2, shape (2,).
    """

    duration: float
    errors: Array
    sizes: Array

    @classmethod
    def of(cls, state: State) -> Pairs:
        """Return the estimates that are stored in a state; zero errors if there are none."""
        if (kept := state.fields.get(_FIELD)) is None:
            return cls(inf, np.zeros(2), np.zeros(2))
        values = kept.values.ravel()
        return cls(float(values[0]), values[1:3], values[3:])

    def after(self, whole: Ended, last: Solved, order: float, *, moves: bool) -> Pairs:
        """Return the estimates with those of another pair; collective.

        Args:
            whole: the end of the one long step.
            last: the end of the second short step.
            order: order of the error in time.
            moves: whether bodies move: then tractions are left out, as they jump at impacts.
        """
        posed = last[1].posed
        errors = _sizes(posed, last[0], whole[0]) / (2**order - 1)
        if moves:
            errors[1] = 0.0
        sizes = np.maximum(self.sizes, _sizes(posed, last[0]))
        return replace(self, errors=self.errors + errors, sizes=sizes)

    def kept_in(self, state: State) -> State:
        """Return the state with these estimates stored in it."""
        values = [self.duration, *self.errors, *self.sizes]
        return state.with_field(_FIELD, "global", values)

    def shares(self, errors: Array) -> float:
        """Return the larger of the errors of displacement and tractions, each relative to its
        largest norm.
        """
        return float(quotient(errors, self.sizes).max())


def time_error(state: State) -> float | None:
    """Return the error of all time steps up to a state, in L2, relative to the largest displacement
    and the largest tractions so far; None if it is not estimated.
    """
    pairs = Pairs.of(state)
    return pairs.shares(pairs.errors) if _FIELD in state.fields else None


def time_steps(
    problem: Problem, state: State, reached: float, place: float, solve: Solve
) -> Iterator[Ended]:
    """Solve the next time step towards ``place``, or the two steps of a pair whose error is
    allowed; collective.

    Args:
        problem: the problem to solve.
        state: the state from which the step starts.
        reached: its position on the load path.
        place: the position at the end of the load step.
        solve: solves a step, see ``Solve``.

    Yields:
        The end of each step; the last one may have no solution.
    """
    path = problem.path
    effects = problem.effects
    end = path.time_at(place)
    longest = min((effect.next_time(state, end) for effect in effects), default=end)

    def to(begin: State, time: float) -> Ended:
        """Return the end of the step from a state to a time."""
        at = place
        if time < end:
            at = reached + (place - reached) * (time - state.time) / (end - state.time)
        return *solve(begin, at, time), at, time

    moves = any(effect.moves_bodies for effect in effects)
    if path.time_accuracy is None or end <= state.time or (moves and not state.number):
        yield to(state, longest)
        return
    rate = path.time_accuracy * (place - reached) / len(path.times) / (end - state.time)
    order = max((effect.order for effect in effects), default=1)
    pairs = Pairs.of(state)
    if not moves and abs(reached - round(reached)) < SAME_LENGTH:
        pairs = replace(pairs, duration=inf)  # a load step first tries its whole duration
    duration = min(pairs.duration, longest - state.time)
    whole: Ended | None = None
    while True:
        count = ceil((end - state.time) / duration * (1 - SAME_NUMBER))
        duration = (end - state.time) / count
        time = end if count == 1 else state.time + duration
        last = whole or to(state, time)
        whole, first = last, None
        if _solved(whole):
            last = to(state, 0.5 * (state.time + time))
            if _solved(last):
                first = last
                problem.accept(first[0], first[1])  # the second one continues from it
                last = to(first[0], time)
        if not moves and not _solved(last):
            yield last
            return
        report = last[1]
        shortest = [0.0]  # if a failure leaves no body
        if isinstance(report, Report):
            shortest = [2 * effect.shortest(report.posed.body) for effect in effects]
        least = max([ENCLOSED * (end - state.time), *shortest])
        if first is not None and _solved(last):
            after = pairs.after(whole, last, order, moves=moves)
            error = after.shares(after.errors - pairs.errors)
            allowed = rate * duration
            if error <= allowed or duration / 2 < least:
                easy = error <= allowed / 2**order
                after = replace(after, duration=2 * duration if easy else duration)
                yield first
                yield after.kept_in(last[0]), *last[1:]
                return
        elif duration / 2 < least:
            yield last
            return
        whole = first
        duration = duration / 2


def all_steps(
    problem: Problem, state: State, reached: float, place: float, solve: Solve
) -> tuple[State, Ending]:
    """Solve all time steps up to ``place``, and return the end, or that of the first step without a
    solution; collective.
    """
    while True:
        for new, report, at, _ in time_steps(problem, state, reached, place, solve):
            if isinstance(report, Failure) or report.status is not Status.CONVERGED:
                return new, report
            problem.accept(new, report)
            end = new, report, at
        state, report, reached = end
        if reached == place:
            return state, report


def _solved(ended: Ended) -> TypeGuard[Solved]:
    return ended[1].status is Status.CONVERGED


def _sizes(posed: Posed, state: State, other: State | None = None) -> Array:
    """Return the L2 norms of displacement and tractions of a state, or of its difference from
    ``other``, shape (2,); collective.
    """
    body = posed.body
    if "square" not in body.of_mesh:
        function = fem.Function(body.space)
        body.of_mesh["square"] = function, compile_form(ufl.inner(function, function) * ufl.dx)
    function, square = body.of_mesh["square"]
    function.x.array[:] = state.displacement - (0.0 if other is None else other.displacement)
    squares = np.array([fem.assemble_scalar(square), 0.0])
    if (values := state.contact) is not None:
        tractions = np.column_stack((values.pressure, values.shear))
        if other is not None and other.contact is not None:
            tractions -= np.column_stack((other.contact.pressure, other.contact.shear))
        squares[1] = posed.boundary.weight @ (tractions**2).sum(axis=1)
    return np.sqrt(parallel.global_sum(body.comm, squares))
