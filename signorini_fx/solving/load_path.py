"""The loop over load steps: the same for scenes and forms, by ramps, and from an earlier run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from signorini_fx.mechanics.state import State
from signorini_fx.records import Status, StepRecord
from signorini_fx.solving.increments import Increments
from signorini_fx.solving.restart import StoredStates, marks_of
from signorini_fx.solving.step import Problem, Report, next_end, step

OnStep = Callable[[State, Report], object]


def run(
    problem: Problem,
    state: State,
    way: Increments,
    on_step: OnStep = lambda state, report: None,
    *,
    guess: State | None = None,
    stored: StoredStates | None = None,
) -> list[tuple[State, Report]]:
    """Solve one load step after the other, or take it from what is stored, until there is none;
    collective.

    Args:
        problem: what is solved.
        state: from which the first step begins.
        way: where it is on the path, which goes on from there.
        on_step: called with the end of each load step that has a solution, and its report.
        guess: see ``step``, of the first step.
        stored: the load steps of a run that has not ended, which each new one is added to; None:
            nothing is stored.

    Returns:
        The ends of all load steps with their reports, the last one with or without a solution.
    """
    history = problem.history
    ends = list[tuple[State, Report]]()
    between = list[tuple[float, Mapping[str, float]]]()

    def passed(new: State, report: Report, *, kept: bool) -> None:
        """A step has a solution, of which all that is shown is kept, or its figures alone."""
        if report.result.figures:
            between.append((new.time, report.result.figures))
        if kept:
            report = replace(report, result=replace(report.result, between=tuple(between)))
            between.clear()
            ends.append((new, report))
            on_step(new, report)

    if stored is not None:
        for new, report, kept in stored.recalled(problem, state, way):
            state = new
            passed(new, report, kept=kept)
    marks = marks_of(history)
    while not way.ended:
        place = way.next
        end = problem.path.time_at(place)
        place, time = next_end(problem, state, way.reached, place)
        if problem.path.several and time == end:
            name = problem.path.name_at(place)
            history.add(StepRecord(state.number + 1, name, time))
        new, report = step(problem, state, place, time=time, guess=guess, budget=way.allowed)
        status = report.result.status
        if status is not Status.CONVERGED:
            if not history.exhausted and way.shorten(status):
                history.add(f"{report.result}: {status.value}: half the increment")
                continue
            if bracket := way.bracket(status):
                history.add(f"the ramp ends: {bracket}")
            return [*ends, (new, report)]
        state = new
        problem.accept(report)
        way.advance(report.result.linear_solves, place)
        passed(new, report, kept=time == end)
        if stored is not None:
            with problem.timings.phase("checkpoint"):
                stored.write(problem, new, report, way, marks, kept=time == end)
        guess = None
        marks = marks_of(history)
    return ends
