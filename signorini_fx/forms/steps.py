"""The load steps of a ``ContactProblem``, and its solution."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from dolfinx import fem

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.errors import FormError, SceneError
from signorini_fx.forms.solver import FormSolver, options_applied
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.records import Status, Timings
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.solution import ConvergenceError, Solution
from signorini_fx.results.step_frames import StepEnd
from signorini_fx.solving.checkpointed_steps import MeshCheckpoint
from signorini_fx.solving.load_steps import BegunStep, Increments, SteppedBody, StepProgress
from signorini_fx.solving.solve_on_mesh import contact_solution, findings_of_steps

Clock = Callable[[float], object]  # changes a problem to what it is at a time


@dataclass(frozen=True)
class FormSteps(SteppedBody):
    """The body of a ``ContactProblem``, whose solver is always at the last attempt."""

    solver: FormSolver
    clock: Clock

    def begun(self, path_step: float, task: Task, first: Start, end: StepEnd | None) -> BegunStep:
        """From the end of the last load step, which the solver has kept."""
        solver = self.solver
        with self.timings.phase("assemble"):
            self.clock(self.path.time_at(path_step))
            start = solver.begin_step()
        if end is None:  # without contact nothing of the last step but its number counts
            start = replace(start, step=first.step)
        solver.begun = start
        return BegunStep(
            replace(self, model=solver.model(self.path)), solver.task, start, solver.previous_step
        )

    def show(self, outcome: Outcome, result: StepResult) -> None:
        self.solver.show(outcome, result)

    def ended(self, end: StepEnd) -> FormSteps:
        """The next load step begins as after ``advance``."""
        self.solver.end_at(end)
        return self


def solve_path(
    solver: FormSolver,
    path: LoadPath,
    clock: Clock,
    stored: MeshCheckpoint | None,
    on_step: Callable[[StepResult], object],
) -> StepProgress:
    """Solve the load steps of a path, which the solver is left at the last of; collective."""
    solver.timings = Timings()
    increments = Increments(path, solver.settings)
    with options_applied(*solver.options):
        clock(path.time_at(increments.next))
        with solver.timings.phase("assemble"):
            solver.begun = start = solver.begin_step()
        body = FormSteps(solver.model(path), path, solver.timings, solver, clock)
        progress = StepProgress(body, solver.task, start, increments)
        progress.all(lambda step: on_step(step.result), stored)
    return progress


def solution_of(solver: FormSolver, progress: StepProgress | None, title: str) -> Solution:
    """The last solution, or iterate, with the values that the forms have now; of a run its load
    steps; collective.
    """
    if solver.outcome is None or solver.result is None:
        raise RuntimeError("there is no solution so far: call solve()")
    path = None
    steps = [solver.result]
    ended = (solver.outcome, solver.outcome.problem.data)
    if progress is not None:
        assert progress.ended is not None
        path = progress.path.path
        steps = progress.results
        ended = progress.ended
    # Of a load step that has failed the forms are not those of the results, which are of one before
    # it.
    settled = steps[-1].status is Status.CONVERGED or len(steps) == 1
    body = replace(solver.model(path, title), settled=settled)
    found = partial(findings_of_steps, body, steps, [])
    return contact_solution(body, steps, solver.task, ended, solver.timings, found)


def converged(solution: Solution) -> Solution:
    """The same, if it is a solution, else a ``ConvergenceError``."""
    if not solution.converged:
        raise ConvergenceError(solution)
    return solution


def begun_path(
    solver: FormSolver,
    path: LoadPath | Iterable[float],
    at: Clock | fem.Constant,
    folder: str | Path | None,
    *,
    restart: bool,
) -> tuple[LoadPath, Clock, MeshCheckpoint | None]:
    """The load steps of a run, what goes through their times, and their checkpoint, if there is
    one; collective.
    """
    path = path if isinstance(path, LoadPath) else LoadPath(tuple(path))
    scalar = isinstance(at, fem.Constant) and at.value.ndim == 0
    clock: Any = partial(setattr, at, "value") if scalar else at
    if isinstance(clock, fem.Constant) or not callable(clock):
        raise FormError(
            [
                (
                    "at",
                    "must be a function of the time or a Constant with one value, not "
                    f"{kind_of(at)}",
                )
            ]
        )
    if folder is None:
        if restart:
            raise FormError([("restart", "needs the folder of the checkpoint")])
        return path, clock, None
    if (place := Path(folder).resolve()) in solver.folders:
        reason = (
            f"{folder} has the load steps of another run of this problem: give each run a "
            "folder of its own"
        )
        raise FormError([("folder", reason)], "run")
    forms = solver.forms
    dofmap = solver.space.dofmap
    topology = forms.mesh.topology
    described = {
        "path": asdict(path),
        "settings": solver.settings.model_dump(mode="json"),
        "contact": [type(contact).__name__ for contact in forms.contact],
        "cells": topology.index_map(topology.dim).size_global,
        "unknowns": dofmap.index_map.size_global * dofmap.index_map_bs,
    }
    comm = forms.mesh.comm
    history = solver.history
    try:
        stored = MeshCheckpoint(comm, folder, described, history, restart=restart)
    except SceneError as error:
        raise FormError(error.problems, "run") from None
    solver.folders.append(place)
    return path, clock, stored
