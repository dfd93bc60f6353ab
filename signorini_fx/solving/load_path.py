"""The loop over load steps, for scenes and forms, with ramps and restart from an earlier run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import inf

from signorini_fx.mechanics.state import State
from signorini_fx.records import Status, StepRecord
from signorini_fx.solving.increments import HalvedIncrements, Increments
from signorini_fx.solving.restart import StoredStates, marks_of
from signorini_fx.solving.step import Ending, Failure, Report, StoredProblem, step
from signorini_fx.solving.time_steps import time_error, time_steps


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
        while between and between[-1][0] >= new.time:  # of steps that were too long
            between.pop()
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
