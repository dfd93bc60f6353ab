"""What an interface answers, and what it answers if it has nothing to say."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from dolfinx import fem

from signorini_fx.algorithms.strategy import solve_task
from signorini_fx.algorithms.task import Outcome, Start, Task
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.joint_pressure import JointPressure
from signorini_fx.body.jumps import Jump
from signorini_fx.body.loads import AppliedLoad
from signorini_fx.contact.laws import Nodal
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.records import Finding
from signorini_fx.scene.model import Scene


@dataclass(frozen=True)
class LoadStepStart:
    """A load step that an interface is to solve.

    Attributes:
        d: the discretised scene.
        task: its contact problem.
        start: where the load step starts.
        max_iterations: linear solves allowed for each contact problem; None: those of a load step.
        scale: factor of all loads, those of the interface included.
        earlier: the pressure of loads within the contact at the end of the last load step; None: there is none.
        holds: whether the certificate of a solution holds with such a pressure; collective.
    """

    d: Discretisation
    task: Task
    start: Start
    max_iterations: int | None = None
    scale: float = 1.0
    earlier: JointPressure | None = None
    holds: Callable[[Outcome, JointPressure], bool] = lambda outcome, joint: True


@dataclass(frozen=True)
class LoadStepEnd:
    """What an interface has made of it.

    Attributes:
        d: the discretised scene with what was found.
        start: where the load step starts with that.
        outcome: how it ended.
        joint: the pressure of loads within the contact; None: none enters.
        reason: why there is no solution; None: it is not known.
    """

    d: Discretisation
    start: Start
    outcome: Outcome
    joint: JointPressure | None = None
    reason: Finding | None = None


@dataclass(frozen=True)
class Interface:
    """The interfaces of one kind in a scene; all methods are collective.

    Attributes:
        scene: the scene.
        entries: those of this kind by their paths.
    """

    scene: Scene
    entries: Mapping[str, Any]

    def jumps(self, tagged: TaggedMesh, space: fem.FunctionSpace) -> list[Jump]:
        """The jumps of the displacement that it prescribes inside the body."""
        return []

    def loads(self, tagged: TaggedMesh, space: fem.FunctionSpace, boundary: ContactBoundary) -> list[AppliedLoad]:
        """Its loads on the contact points, beside those jumps and what forms say; not asked for without points."""
        return []

    def solve(self, step: LoadStepStart) -> LoadStepEnd:
        """Solve a load step at a place where an entry answers ``Effect.sought_at``."""
        raise NotImplementedError

    def stored(
        self, d: Discretisation, step: float, contact: ContactState | None
    ) -> tuple[dict[str, Nodal], dict[str, Any]]:
        """What a checkpoint needs of a load step: values at the contact points, and plain data."""
        return {}, {}

    def recalled(
        self, d: Discretisation, task: Task, step: float, nodal: Mapping[str, Nodal], figures: Mapping[str, Any]
    ) -> tuple[Discretisation, JointPressure | None]:
        """Take back what ``stored`` has returned: the scene with it, and the pressure within the contact."""
        return d, None


def solve_step(step: LoadStepStart) -> LoadStepEnd:
    """Solve a load step: by the interface that something is sought of, or as one contact problem; collective."""
    d = step.d
    sought = d.scene.sought_at(step.start.place)
    for interface in d.scene.interfaces if sought else ():
        if sought.keys() & interface.entries.keys():
            end: LoadStepEnd = interface.solve(step)
            return end
    return LoadStepEnd(d, step.start, solve_task(step.task, step.start, step.max_iterations))
