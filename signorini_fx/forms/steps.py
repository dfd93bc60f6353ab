"""The load steps of a ``ContactProblem``."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.laws import Nodal
from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.errors import FormError, SceneError
from signorini_fx.forms import options
from signorini_fx.forms.solver import FormSolver, StepBeginning
from signorini_fx.forms.stated_values import constants_of
from signorini_fx.mechanics.body.elastic import ElasticBody
from signorini_fx.mechanics.body.joint_pressure import JointPressure
from signorini_fx.mechanics.statement.load_steps import LoadPath
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.records import Timings
from signorini_fx.results.accuracy.price_list import peak_memory
from signorini_fx.results.checkpoint import Checkpoint
from signorini_fx.results.solution import StepResult
from signorini_fx.results.step_frames import StepEnd
from signorini_fx.solving.load_path import Increments
from signorini_fx.solving.load_steps import StepProgress, all_load_steps, step_result
from signorini_fx.solving.restart import MeshCheckpoint, open_checkpoint
from signorini_fx.solving.stepped_problem import BegunStep, UncertifiedStep


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
        solver: which is always at the last attempt.
        path: the load steps.
        clock: changes the problem to what it is at a time.
        timings: of the run.
        beginning: where the next load step begins.
    """

    solver: FormSolver
    path: LoadPath
    clock: Clock
    timings: Timings
    beginning: StepBeginning

    @property
    def body(self) -> ElasticBody:
        """As it was assembled last."""
        return self.solver.elastic

    @property
    def size(self) -> float:
        """Of the body, length."""
        return self.solver.scales.size

    @property
    def loads(self) -> str:
        """The argument with its forces."""
        return "L"

    def at(self, path_step: float, task: Task, first: Start, end: StepEnd | None) -> BegunStep[FormSteps]:
        """The problem as it is at the time of a place, from the end of the last load step; collective."""
        self.solver.return_to(self.beginning)
        with self.timings.phase("assemble"):
            self.clock.turn(self.path.time_at(path_step))
            begun = self.solver.begin_step()
        return BegunStep(self, self.solver.task, begun, self.solver.previous_step)

    def load(self, system: ElasticSystem, path_step: float) -> Nodal:
        """Those of the time of the place; collective."""
        self.clock.turn(self.path.time_at(path_step))
        self.solver.load()
        return np.ones(1)

    def solved(self, begun: BegunStep[FormSteps], allowed: int) -> UncertifiedStep[FormSteps]:
        """See ``SteppedProblem``."""
        return UncertifiedStep(begun, solve_task(begun.task, begun.start, allowed))

    def certified(
        self, begun: BegunStep[FormSteps], outcome: Outcome, joint: JointPressure | None = None
    ) -> StepResult:
        """See ``SteppedProblem``; the result is what the problem shows."""
        solver, start = self.solver, begun.start
        with self.timings.phase("certify"):
            solver.begun = start
            solver.take(outcome)
            assert solver.status is not None
            assert solver.certificate is not None
            assert solver.deformation is not None
            y = solver.u.copy()
            y.name = solver.u.name
        state, certificate, deformation = solver.state, solver.certificate, solver.deformation
        result = step_result(self.path, start.step, start.place, solver.status, y, state, certificate, deformation)
        return replace(result, tools=solver.tools)

    def ended(self, end: StepEnd) -> FormSteps:
        """The next load step begins as after ``advance``."""
        self.solver.end_at(end)
        return replace(self, beginning=self.solver.beginning())

    def stored(self, path_step: float, result: StepResult) -> tuple[dict[str, Nodal], dict[str, Any]]:
        """Nothing: all is in what the forms and foundations are at the time of the place."""
        return {}, {}

    def recalled(
        self, task: Task, path_step: float, nodal: dict[str, Nodal], figures: dict[str, Any]
    ) -> tuple[FormSteps, JointPressure | None]:
        """See ``stored``."""
        return self, None


def solve_path(
    solver: FormSolver,
    path: LoadPath,
    clock: Clock,
    on_step: Callable[[StepResult], object],
    stored: MeshCheckpoint | None = None,
) -> StepProgress[FormSteps]:
    """Solve the load steps of a path, which the solver is left at the last of; collective.

    Args:
        solver: of the forms.
        path: the load steps.
        clock: changes the problem to what it is at a time.
        on_step: called with the result of each load step that has a solution.
        stored: the checkpoint; None: there is none.
    """
    begin, comm, solver.timings = time.perf_counter(), solver.space.mesh.comm, Timings()
    solver.solves_before = len(solver.history.iterations)
    increments = Increments(path, solver.settings, has_coulomb=solver.forms.has_coulomb)
    with options.applied(*solver.options):
        clock.turn(path.time_at(increments.next))
        with solver.timings.phase("assemble"):
            start = solver.begin_step()
        steps = FormSteps(solver, path, clock, solver.timings, solver.beginning())
        progress = all_load_steps(steps, solver.task, start, increments, lambda step: on_step(step.result), stored)
    solver.cost = time.perf_counter() - begin, peak_memory(comm)
    return progress


def checkpoint_of(solver: FormSolver, folder: str | Path, path: LoadPath, *, restart: bool) -> Checkpoint:
    """The checkpoint of a path in a folder; collective.

    Args:
        solver: with the Constants as they are at the first time.
        folder: see ``ContactProblem.run``.
        path: the load steps.
        restart: whether to go on from what is there.

    Raises:
        FormError: the folder is that of another problem.
    """
    forms = solver.forms
    mesh, dofmap = forms.mesh, forms.space.dofmap
    described = {
        "path": asdict(path),
        "settings": solver.settings.model_dump(mode="json"),
        "contact": [type(contact).__name__ for contact in forms.contact],
        "constants": constants_of(forms.compiled, forms.contact),
        "cells": mesh.topology.index_map(mesh.topology.dim).size_global,
        "unknowns": dofmap.index_map.size_global * dofmap.index_map_bs,
    }
    try:
        return open_checkpoint(
            mesh.comm, folder, described, solver.history, restart=restart, several_steps=path.several
        )
    except SceneError as error:
        raise FormError(error.problems, "run") from None
