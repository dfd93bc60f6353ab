"""The load steps of a ``ContactProblem``, and its solution."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from dolfinx import fem

from signorini_fx.errors import FormError, SceneError
from signorini_fx.forms.solver import BodyOfForms, Clock, FormSolver, options_applied
from signorini_fx.machine.result_files import folder_path
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.load_path import LoadPath, counted_path
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.records import Status
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.solution import ConvergenceError, Solution
from signorini_fx.solving.increments import Increments, check_step
from signorini_fx.solving.load_path import run
from signorini_fx.solving.restart import StoredStates
from signorini_fx.solving.solve_on_mesh import contact_solution, findings_of_steps, last_solved
from signorini_fx.solving.step import Report, step
from signorini_fx.tuned import MOST_ADJOINT_UNKNOWNS

Ran = tuple[LoadPath, list[Report]]  # the load path of a run, and the reports of its steps


def solve_path(
    solver: FormSolver,
    path: LoadPath,
    clock: Clock,
    stored: StoredStates | None,
    on_step: Callable[[StepResult], None],
) -> Ran:
    """Solve the load steps of a path, and leave the solver at the last one; collective."""
    solver.go_through(path, clock, waits=path.several)
    reports = list[Report]()
    way = Increments(path, solver.settings)
    with options_applied(*solver.options):
        for new, report in run(solver, solver.begin, way, guess=solver.last, stored=stored):
            assert isinstance(report, Report)
            solver.show_step(new, report)
            reports.append(report)
            if report.status is Status.CONVERGED:
                on_step(report.result)
    return path, reports


def solve_step(solver: FormSolver, state: State, time: float) -> tuple[State, StepResult]:
    """Solve the step from a state to a time with the present values, show it, and return its end
    and result; collective.
    """
    check_step(state, time, solver.space)
    solver.go_through(LoadPath((time,)))
    with options_applied(*solver.options):
        new, report = step(solver, state, 0.0)
    assert isinstance(report, Report)
    solver.show_step(new, report)
    return new, report.result


def solution_of(solver: FormSolver, ran: Ran | None, title: str) -> Solution:
    """Return the last solution or iterate, with the present values of the forms; collective.

    Args:
        solver: the solver.
        ran: the path and reports of the last run, whose load steps the solution gets; None: there
            was only a single solve.
        title: the title of the solution.
    """
    report = solver.report
    if solver.outdated or report is None:
        raise RuntimeError("there is no solution so far: call solve()")
    # Without a run the user's own loop counts the load steps.
    path, reports = ran or (counted_path(report.start.step), [report])
    steps = [report.result for report in reports]
    # After a failed load step the forms have its values, while the results are those of a step
    # before.
    settled = steps[-1].status is Status.CONVERGED or len(steps) == 1
    model = replace(solver.elastic, title=title, path=path)
    mechanics = replace(solver.mechanics(model), settled=settled)
    ended = last_solved(reports)
    solution = contact_solution(
        mechanics, steps, solver.task, ended, solver.timings, findings_of_steps
    )
    # The adjoint solve needs the matrix, which is that of the last step.
    small = ran is None and solution.model.dofs <= MOST_ADJOINT_UNKNOWNS
    return replace(solution, state=solver.last, reached=report if small else None)


def converged(solution: Solution) -> Solution:
    """Return the solution, or raise a ``ConvergenceError`` if it has not converged."""
    if not solution.converged:
        raise ConvergenceError(solution)
    return solution


def begun_path(
    solver: BodyOfForms,
    path: LoadPath | Iterable[float],
    at: Clock | fem.Constant,
    folder: str | Path | None,
    *,
    restart: bool,
) -> tuple[LoadPath, Clock, StoredStates | None]:
    """Return the load path of a run, the function that sets a time, and the stored states, None
    without a folder; collective.
    """
    if not isinstance(path, LoadPath | Iterable):
        raise FormError.at("path", f"must be times, or a LoadPath, not {kind_of(path)}", "run")
    path = path if isinstance(path, LoadPath) else LoadPath(tuple(path))
    scalar = isinstance(at, fem.Constant) and at.value.ndim == 0
    clock = partial(setattr, at, "value") if scalar else at
    if isinstance(clock, fem.Constant) or not callable(clock):
        raise FormError.at(
            "at", f"must be a function of the time or a Constant with one value, not {kind_of(at)}"
        )
    if folder is None:
        if restart:
            raise FormError.at("restart", "needs the folder of the checkpoint")
        return path, clock, None
    if (place := folder_path(folder).resolve()) in solver.folders:
        reason = (
            f"{folder} has the load steps of another run of this problem: give each run a "
            "folder of its own"
        )
        raise FormError.at("folder", reason, "run")
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
        stored = StoredStates(comm, folder, described, history, restart=restart)
    except SceneError as error:
        raise FormError(error.problems, "run") from None
    solver.folders.append(place)
    return path, clock, stored
