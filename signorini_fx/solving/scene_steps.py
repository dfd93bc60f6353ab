"""The load steps of a scene: foundations that move with the time, loads of several kinds, and their certificate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.laws import Nodal
from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.mechanics.body.deformation import deformation_of
from signorini_fx.mechanics.body.discretisation import moved_since, placed
from signorini_fx.mechanics.body.joint_pressure import JointPressure
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.load_steps import LoadPath
from signorini_fx.records import Status, Timings
from signorini_fx.results.certificate import certify
from signorini_fx.results.nodal_forces import NodalForces
from signorini_fx.results.promised_law import Law, PreviousStep, Tractions
from signorini_fx.results.solution import StepResult
from signorini_fx.results.step_frames import StepEnd, carried, from_rest
from signorini_fx.solving.interfaces.protocol import LoadStepStart, solve_step
from signorini_fx.solving.load_steps import judged, step_result
from signorini_fx.solving.stepped_problem import BegunStep, UncertifiedStep


@dataclass(frozen=True)
class SceneSteps:
    """A scene on its mesh at the load steps of its path, see ``SteppedProblem``.

    Attributes:
        body: the model, with foundations, friction and shortenings of the present load step.
        timings: of the mesh.
        renew: makes the contact problem of a scene whose foundations have moved.
        evaluation: what evaluates the certificates.
    """

    body: Model
    timings: Timings
    renew: Callable[[Model], Task]
    evaluation: NodalForces

    @classmethod
    def of(cls, body: Model, timings: Timings, renew: Callable[[Model], Task]) -> Self:
        """Those of a scene at its first load step."""
        return cls(body, timings, renew, NodalForces(body.statement, body.tagged, body.space))

    @property
    def path(self) -> LoadPath:
        """Of the scene."""
        return self.body.statement.path

    @property
    def size(self) -> float:
        """Of the mesh, length."""
        return self.body.tagged.size

    @property
    def loads(self) -> str:
        """Its forces, for messages."""
        return self.body.statement.forces_at

    def at(self, path_step: float, task: Task, first: Start, end: StepEnd | None) -> BegunStep[SceneSteps]:
        """With foundations and friction of a place; collective."""
        earlier, start, last = self.body, first, None
        if end is not None:
            start, last = end.start, end.before
        moved = placed(earlier, path_step)
        if moved is earlier:
            return BegunStep(self, task, start, last)
        steps = replace(self, body=moved)
        if moved.boundary is earlier.boundary:
            assert moved.law is not None
            bound = moved.law.given if start.multipliers is None else moved.law.bound(start.multipliers[0])
            return BegunStep(steps, task, replace(start, law=moved.law, data=replace(start.data, bound=bound)), last)
        task = self.renew(moved)
        return BegunStep(steps, task, *on_moved_foundations(earlier, moved, task, start, end))

    def load(self, system: ElasticSystem, path_step: float) -> Nodal:
        """See ``Model.load``."""
        return self.body.load(system, path_step)

    def solved(self, begun: BegunStep[SceneSteps], allowed: int) -> UncertifiedStep[SceneSteps]:
        """See ``SteppedProblem``."""

        def holds(body: Model, outcome: Outcome, joint: JointPressure) -> bool:
            return replace(self, body=body).certified(begun, outcome, joint).status is Status.CONVERGED

        earlier = None if begun.last is None else begun.last.tractions.joint
        end = solve_step(LoadStepStart(self.body, begun.task, begun.start, allowed, earlier=earlier, holds=holds))
        begun = replace(begun, problem=replace(self, body=end.d), start=end.start)
        return UncertifiedStep(begun, end.outcome, end.joint, end.reason)

    def certified(
        self, begun: BegunStep[SceneSteps], outcome: Outcome, joint: JointPressure | None = None
    ) -> StepResult:
        """See ``SteppedProblem``."""
        model, statement, task, start = self.body, self.body.statement, begun.task, begun.start
        with self.timings.phase("certify"):
            unknowns = outcome.displacement()
            displacement = model.from_rest(task.rest, unknowns)
            contact = replace(model.state(task, outcome, start), joint=joint)
            rigid = model.rigid.moved(model.driven(unknowns, task.rest))
            certificate = certify(
                statement,
                model.tagged,
                displacement,
                Tractions.of(contact),
                law=Law(*task.promised(outcome)),
                step=start.place,
                before=begun.last,
                pairs=model.pairs,
                rigid=rigid,
                like=self.evaluation,
            )
            deformation = deformation_of(model, displacement, self.size)
            status = judged(outcome.status, certificate, deformation, statement.solver)
        result = step_result(
            self.path, start.step, start.place, status, displacement, contact, certificate, deformation
        )
        return replace(result, tools=rigid)

    def ended(self, end: StepEnd) -> SceneSteps:
        """The next load step begins as this one has ended."""
        return self

    def stored(self, path_step: float, result: StepResult) -> tuple[dict[str, Nodal], dict[str, Any]]:
        """See ``SteppedProblem``."""
        nodal, figures = dict[str, Nodal](), dict[str, Any]()
        for interface in self.body.statement.interfaces:
            further = interface.stored(self.body, path_step, result.contact)
            nodal, figures = nodal | further[0], figures | further[1]
        return nodal, figures

    def recalled(
        self, task: Task, path_step: float, nodal: dict[str, Nodal], figures: dict[str, Any]
    ) -> tuple[SceneSteps, JointPressure | None]:
        """Take back what ``stored`` has returned."""
        d, joint = self.body, None
        for interface in d.statement.interfaces:
            d, pressure = interface.recalled(d, task, path_step, nodal, figures)
            joint = joint or pressure
        return replace(self, body=d), joint


def on_moved_foundations(
    earlier: Model, moved: Model, task: Task, start: Start, end: StepEnd | None
) -> tuple[Start, PreviousStep]:
    """A load step on foundations that have moved: where it starts, and the end of the last one as it begins from it;
    supports hold the body, see ``check.refusals``; collective.

    Args:
        earlier: the body at the end of the last load step.
        moved: the body with its foundations where they are now.
        task: its contact problem, which begins with the displacement of the last load step.
        start: where the first load step starts on the foundations of ``earlier``.
        end: that of the last load step; None: there is none.
    """
    assert earlier.boundary is not None
    assert moved.boundary is not None
    if end is None:
        drift, begun = moved_since(moved, moved.statement.placed(-1)), task.start
        if start.sets is not None and start.multipliers is not None:  # of a coarser mesh
            carried_start, _, _ = carried(start, None, drift[:, 0], earlier.boundary, moved.boundary)
            assert carried_start.multipliers is not None
            begun = begun.begin_from(start.sets, carried_start.multipliers)
        return from_rest(moved.space, moved.boundary, begun, drift)
    x, free = moved.unknowns(end.before.displacement), ~moved.fixed
    if task.iterate.x.getLocalSize() == free.size:  # else of contact nodes alone
        task.iterate.x.getArray()[free] = x.getArray(readonly=True)[free]
    return end.begins_on(moved.boundary, task.start.data, moved.law, moved_since(moved, earlier.statement))
