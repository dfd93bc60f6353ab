"""What an interface answers, and what it answers if it has nothing to say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from dolfinx import fem

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.loads.initial_strains import Jump
from signorini_fx.mechanics.loads.load_vectors import AppliedLoad
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import Finding
from signorini_fx.results.mechanics import SolidBody


@dataclass(frozen=True)
class LoadStepStart:
    """A load step that an interface is to solve; ``inner``: the interfaces that solve it within this one."""

    model: SolidBody
    task: Task
    start: Start
    max_iterations: int | None = None
    inner: tuple[Any, ...] = ()

    def solved(self, model: SolidBody, start: Start) -> LoadStepEnd:
        """By the inner interfaces, or as one contact problem, from here; collective."""
        if self.inner:
            end: LoadStepEnd = self.inner[0].solve(replace(self, model=model, start=start, inner=self.inner[1:]))
            return end
        return LoadStepEnd(model, start, solve_task(self.task, start, self.max_iterations))


@dataclass(frozen=True)
class LoadStepEnd:
    """What an interface has made of it, with what was found; ``reason``: why there is no solution, if that is known."""

    model: SolidBody
    start: Start
    outcome: Outcome
    reason: Finding | None = None


@dataclass(frozen=True)
class Interface:
    """The interfaces of one kind in a scene, by their paths; all methods are collective."""

    statement: Statement
    entries: Mapping[str, Any]

    def jumps(self, tagged: TaggedMesh, space: fem.FunctionSpace) -> list[Jump]:
        """The jumps of the displacement that it prescribes inside the body."""
        return []

    def loads(self, tagged: TaggedMesh, space: fem.FunctionSpace, boundary: ContactBoundary) -> list[AppliedLoad]:
        """Its loads on the contact points, beside those jumps and what forms say; not asked for without points."""
        return []

    def solve(self, step: LoadStepStart) -> LoadStepEnd:
        """Solve a load step at a place where an entry answers ``Effect.depends_on_solution_at``."""
        raise NotImplementedError

    def stored(self, model: SolidBody, step: float) -> dict[str, Any]:
        """What a checkpoint needs of a load step, plain data."""
        return {}

    def recalled(self, model: SolidBody, step: float, figures: Mapping[str, Any]) -> SolidBody:
        """The model with what ``stored`` has returned."""
        return model


def solve_step(step: LoadStepStart) -> LoadStepEnd:
    """Solve a load step: by the interfaces that something is sought of, or as one contact problem; collective."""
    statement = step.model.statement
    if not statement.interfaces:
        return step.solved(step.model, step.start)
    sought = statement.depends_on_solution_at(step.start.place)
    seeking = tuple(entry for entry in statement.interfaces if sought.keys() & entry.entries.keys())
    return replace(step, inner=seeking).solved(step.model, step.start)
