"""What nested iteration and a requested accuracy ask of a problem: to be solved on one mesh after another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol, Self

from mpi4py import MPI

from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.machine import signals
from signorini_fx.mechanics.body.contact_state import ContactState
from signorini_fx.mechanics.body.elastic import ElasticBody
from signorini_fx.mechanics.body.mesh_levels import MeshLevel
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import History
from signorini_fx.results.accuracy.error_estimates import Errors, worst_of
from signorini_fx.results.accuracy.level_results import level_result
from signorini_fx.results.accuracy.mesh_level import LevelResult
from signorini_fx.results.accuracy.price_list import peak_memory
from signorini_fx.results.solution import Solution


@dataclass(frozen=True)
class SolvedMesh:
    """A problem on one mesh.

    Attributes:
        solution: how it ended.
        tagged: the mesh.
        body: on it.
        task: the contact problem; None without one.
        outcome: how it ended; None where it has no solution.
        sides: which boundaries have the contact points, and which are opposite.
        level: errors and cost of the mesh; None where it has no solution, or no estimate.
        errors: the estimates on the mesh; None likewise.
    """

    solution: Solution
    tagged: TaggedMesh
    body: ElasticBody
    task: Task | None
    outcome: Outcome | None = None
    sides: Any = None
    level: LevelResult | None = None
    errors: Errors | None = None

    @property
    def state(self) -> ContactState | None:
        """The contact points after the first load step, with which the next mesh begins as well."""
        return self.solution.steps[0].contact


class MeshedProblem(Protocol):
    """A problem that can be solved on other meshes; what is changed is another one."""

    @property
    def settings(self) -> SolverSettings:
        """How it is solved."""
        ...

    @property
    def degree(self) -> int:
        """Of the displacement."""
        ...

    @property
    def paired(self) -> bool:
        """Whether two bodies are in contact somewhere."""
        ...

    def with_settings(self, settings: SolverSettings, /) -> Self:
        """The same, solved in another way."""
        ...

    @property
    def may_begin_finer(self) -> bool:
        """Whether its first mesh may be a finer one."""
        ...

    def beginning_finer(self) -> Self:
        """The same with a first mesh whose cells are half as large."""
        ...

    def keeping(self, solved: SolvedMesh, /) -> Self:
        """The same with what was chosen on the first mesh."""
        ...

    def divided(self, times: int, /) -> Self:
        """The same on a mesh that is made anew, with cells so many times as small as those of the first one."""
        ...

    def on(self, tagged: TaggedMesh, /) -> Self:
        """The same on a mesh whose cells are those of the last one, divided."""
        ...

    def polygon_error(self, level: LevelResult, last: float | None, /) -> float:
        """The effect of straight facets on a curved contact boundary, see ``pressure_error.polygon_error``.

        Args:
            level: the results on this mesh.
            last: that of the mesh before; None: there is none.
        """
        ...

    def solved(self, number: int, state: ContactState | None, coarser: MeshLevel | None, /) -> SolvedMesh:
        """Solve it, and estimate its errors; collective.

        Args:
            number: of the mesh.
            state: the contact state of a coarser mesh, to begin with; None: there is none.
            coarser: the coarser meshes as levels of multigrid; None: there are none.
        """
        ...


def measured(number: int, history: History, comm: MPI.Comm, solve: Callable[[list[Errors]], SolvedMesh]) -> SolvedMesh:
    """Solve on one of several meshes, with its errors and its cost; collective.

    Args:
        number: of the mesh.
        history: of all meshes.
        comm: the ranks that share the work.
        solve: solves, and appends the estimated errors of each load step with a solution, if there are any.
    """
    signals.agree(comm)
    history.add(f"level {number}")
    solves_before = history.linear_solves
    step_errors: list[Errors] = []
    solved = solve(step_errors)
    solution, task, outcome = solved.solution, solved.task, solved.outcome
    if not solution.converged or task is None or outcome is None:
        return replace(solved, outcome=None)
    if not step_errors:
        return solved
    errors = worst_of(step_errors)
    level = level_result(
        number,
        solved.body,
        task,
        outcome,
        step_errors[-1].size,
        errors,
        solution.table,
        own=history.iterations[solves_before:],
        cost=(sum(solution.timings.total.values()), peak_memory(comm)),
        # Of the load steps that all meshes have in common.
        contacts=[step.contact for step in solution.steps if step.contact and step.place.is_integer()],
    )
    return replace(solved, level=level, errors=errors)
