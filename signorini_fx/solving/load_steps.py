"""One load step: its attempts, what the checkpoint has of it, and the verdict of the certificate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import floor

import numpy as np
from dolfinx import fem

from signorini_fx.algorithms.strategy import solve_task
from signorini_fx.algorithms.task import Outcome, Start, Task
from signorini_fx.attempts import HALF, METHOD, tried
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.deformation import Deformation, deformation_of
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.joint_pressure import JointPressure
from signorini_fx.contact.laws import Nodal
from signorini_fx.contact.statics import no_balance
from signorini_fx.records import Finding, Status, StepRecord, Timings
from signorini_fx.results.certificate import Certificate, certify
from signorini_fx.results.promised_law import Law, PreviousStep, Tractions
from signorini_fx.results.solution import StepResult
from signorini_fx.results.step_frames import carried, relative_to
from signorini_fx.results.tool_motion import ToolMotion, motions_of
from signorini_fx.scene.model import Scene
from signorini_fx.solving.load_path import Increments
from signorini_fx.solving.loose_bodies import explained
from signorini_fx.solving.restart import MeshCheckpoint

# Share of what has been added since the last factor by which a limit is passed to be proved: well above the round-off
# of statics.
_BEYOND = 1e-6


@dataclass(frozen=True)
class LoadStep:
    """A load step, where it started, how it ended, and what it was solved on.

    Attributes:
        result: of it.
        start: of it.
        outcome: of it.
        last: the end of the load step before it; None: there is none.
        discretisation: the scene with its foundations where they are in this step.
        task: its contact problem.
    """

    result: StepResult
    start: Start
    outcome: Outcome
    last: PreviousStep | None
    discretisation: Discretisation
    task: Task

    def __str__(self) -> str:
        return f"{self.result}: {self.result.status.value}"


def load_step(
    discretisation: Discretisation,
    task: Task,
    start: Start,
    last: PreviousStep | None,
    timings: Timings,
    path: Increments,
    renew: Callable[[Discretisation], Task],
) -> LoadStep:
    """Solve the next load step, in a ramp for smaller and smaller increments until one of them has a solution.

    Where foundations move with the time it has a contact problem of its own, from ``renew``.
    """
    scene, history, newton = discretisation.scene, task.history, task.iterate.newton
    begun = newton.checkpoint()
    ended: list[LoadStep] = []

    def attempt() -> LoadStep:
        solves_before = history.linear_solves
        path_step = path.next
        d, problem, begin, earlier = _placed(path_step, discretisation, task, start, last, renew)
        step_start = replace(
            begin,
            place=path_step,
            factors=_load_at(d, problem, begin, path_step, path),
            without_fall_backs=path.without_fall_backs,
            augmented=path.at.augmented,
        )
        if scene.several_steps:
            history.add(
                StepRecord(step_start.step + 1, scene.path.name_at(step_start.place), scene.time_at(step_start.place))
            )
        history.move(step=step_start.step + 1, steps=scene.steps)
        reason: Finding | None = None
        with timings.phase("iterate"):
            joint = None
            if scene.joint_loads:
                from signorini_fx.solving.joint_loads import solve_with_joint_loads

                def holds(outcome: Outcome, joint: JointPressure) -> bool:
                    stage = _certified(d, problem, step_start, outcome, earlier, timings, joint)
                    return stage.status is Status.CONVERGED

                entered = None if earlier is None else earlier.tractions.joint
                outcome, joint = solve_with_joint_loads(d, problem, step_start, entered, path.allowed, holds)
            elif scene.tightens_at(path_step):
                from signorini_fx.solving.preload import solve_tightened

                d, step_start, outcome, reason = solve_tightened(d, problem, step_start, path.allowed)
            else:
                outcome = solve_task(problem, step_start, path.allowed)
        if reason is None and history.linear_solves > solves_before:  # else it is proved of a body that ``check`` names
            outcome, reason = explained(d, problem, step_start, outcome)
        result = _certified(d, problem, step_start, outcome, earlier, timings, joint)
        result = replace(result, linear_solves=history.linear_solves - solves_before, reason=reason)
        ended.append(LoadStep(result, step_start, outcome, earlier, d, problem))
        return ended[-1]

    def increments() -> Iterator[tuple[object, Callable[[], LoadStep]]]:
        yield METHOD, attempt
        while _goes_on(path, ended[-1].result):
            yield HALF, attempt

    return tried(
        increments(),
        history=history,
        settled=lambda step: step.result.status is Status.CONVERGED,
        restore=lambda: newton.restore(begun),
    )[-1]


def _load_at(d: Discretisation, task: Task, start: Start, path_step: float, path: Increments) -> Nodal:
    """The factors of the load cases at a place; where statics proves within a ramp that its load is the largest one, a
    little beyond: which loads a ramp tries is arbitrary, and at the limit itself round-off would decide; collective.
    """
    factors = d.load(task.system, path_step)
    if not path.halves or task.motions.count == 0:
        return factors

    def proved(factors: Nodal) -> bool:
        task.system.set_load(factors)
        return no_balance(start.law, start.data.bilateral, task.motions, task.system.resultant) is not None

    beyond = d.load(task.system, path_step + _BEYOND * (path_step - floor(path_step)))
    if proved(factors) or not proved(beyond):
        return d.load(task.system, path_step)
    task.history.add(f"statics: the load at time {d.scene.time_at(path_step):.6g} is the largest that can be held")
    return beyond


def _placed(
    path_step: float,
    earlier: Discretisation,
    task: Task,
    start: Start,
    last: PreviousStep | None,
    renew: Callable[[Discretisation], Task],
) -> tuple[Discretisation, Task, Start, PreviousStep | None]:
    """The scene with its foundations and its friction at a place, its contact problem, where the load step starts, and
    the end of the last one; collective.
    """
    moved = earlier.placed(path_step)
    if moved is earlier:
        return earlier, task, start, last
    if moved.boundary is earlier.boundary:
        assert moved.law is not None
        bound = moved.law.given if start.multipliers is None else moved.law.bound(start.multipliers[0])
        return moved, task, replace(start, law=moved.law, data=replace(start.data, bound=bound)), last
    return moved, *on_moved_foundations(earlier, moved, renew(moved), start, last)


def on_moved_foundations(
    earlier: Discretisation, moved: Discretisation, task: Task, start: Start, last: PreviousStep | None
) -> tuple[Task, Start, PreviousStep]:
    """A load step on foundations that have moved: its contact problem, with the last displacement as its iterate, where
    it starts, and the end of the last one as it begins from it; supports hold the body, see ``check.refusals``;
    collective.
    """
    assert earlier.boundary is not None
    assert moved.boundary is not None
    if last is None:  # slip is counted from the body without loads, at time 0
        drift, tractions = moved.moved_since(moved.scene.placed(-1)), Tractions.none(moved.boundary)
        last, begun, tangential = (
            PreviousStep(fem.Function(moved.space), tractions),
            task.start,
            np.zeros_like(drift[:, 1:]),
        )
        if start.sets is not None and start.multipliers is not None:  # of a coarser mesh
            carried_start, _, _ = carried(start, None, drift[:, 0], earlier.boundary, moved.boundary)
            assert carried_start.multipliers is not None
            begun = begun.begin_from(start.sets, carried_start.multipliers)
    else:
        drift, x, free = moved.moved_since(earlier.scene), moved.unknowns(last.displacement), ~moved.fixed
        if task.iterate.x.getLocalSize() == free.size:  # else of contact nodes alone
            task.iterate.x.getArray()[free] = x.getArray(readonly=True)[free]
        normal, tangential = moved.contact.traces(x)
        begun, _, _ = carried(start, None, normal, earlier.boundary, moved.boundary)
        if moved.law is not None:  # its friction may depend on the time, too
            assert start.multipliers is not None
            bound = moved.law.bound(start.multipliers[0])
            begun = replace(begun, law=moved.law, data=replace(begun.data, bound=bound))
    origin = tangential + np.einsum("nij,ni->nj", moved.boundary.tangents, drift)
    data = replace(begun.data, gap=task.start.data.gap, slip_origin=origin)
    return task, replace(begun, data=data), relative_to(last, moved.boundary, drift)


def _goes_on(path: Increments, failed: StepResult) -> bool:
    """Whether a smaller increment is to be tried after a load step without a solution."""
    status, solves = failed.status, failed.linear_solves
    return not path.begins_again(status, solves) and path.shorten(status, solves)


def recalled_step(
    discretisation: Discretisation,
    task: Task,
    start: Start,
    last: PreviousStep | None,
    timings: Timings,
    level_checkpoint: MeshCheckpoint,
    path: Increments,
    renew: Callable[[Discretisation], Task],
) -> LoadStep | None:
    """The next load step as an earlier run has left it; None if it is not there, or is no solution."""
    path_step = level_checkpoint.place(start.step)
    if path_step is None:
        return None
    begun = task.iterate.newton.checkpoint()
    with timings.phase("restart"):
        d, problem, begin, earlier = _placed(path_step, discretisation, task, start, last, renew)
        d = level_checkpoint.tightened(d, start.step)
        recalled = level_checkpoint.recall(d, problem, begin)
    if recalled is None:
        return None
    result = _certified(d, problem, recalled.start, recalled.outcome, earlier, timings, recalled.joint)
    if result.status is not Status.CONVERGED:
        task.history.add(f"restart: {result}: {result.status.value}: it is solved again")
        level_checkpoint.forget(start.step)
        task.iterate.newton.restore(begun)
        return None
    recalled.accept(task.history, timings, path)
    result = replace(result, linear_solves=path.at.last)
    return LoadStep(result, recalled.start, recalled.outcome, earlier, d, problem)


def _certified(
    discretisation: Discretisation,
    task: Task,
    start: Start,
    outcome: Outcome,
    last: PreviousStep | None,
    timings: Timings,
    joint: JointPressure | None = None,
) -> StepResult:
    """The result of a load step, with the certificate's verdict; its linear solves are not counted yet.

    Args:
        discretisation: of its scene.
        task: its contact problem.
        start: of it.
        outcome: how it ended.
        last: the end of the load step before it; None: there is none.
        timings: of the mesh.
        joint: the pressure of loads within the contact; None: none enters.
    """
    scene = discretisation.scene
    with timings.phase("certify"):
        displacement = discretisation.from_rest(task.rest, outcome.displacement())
        contact = replace(discretisation.state(task, outcome, start), joint=joint)
        tools: tuple[ToolMotion, ...] = ()
        if discretisation.tools is not None:
            unknowns = discretisation.driven(outcome.displacement(), task.rest)
            tools = motions_of(discretisation.tools, scene, unknowns)
        certificate = certify(
            scene,
            discretisation.tagged,
            displacement,
            Tractions.of(contact),
            law=Law(*task.promised(outcome)),
            step=start.place,
            before=last,
            pairs=discretisation.pairs,
            tools=tools,
        )
        deformation = deformation_of(discretisation, displacement)
        status = judged(outcome.status, certificate, deformation, scene)
    result = step_result(scene, start.step, start.place, status, displacement, contact, certificate, deformation)
    return replace(result, tools=tools)


def step_result(
    scene: Scene,
    number: int,
    path_step: float,
    status: Status,
    displacement: fem.Function,
    contact: ContactState | None,
    certificate: Certificate,
    deformation: Deformation,
    linear_solves: int = 0,
) -> StepResult:
    """The result of a load step; ``number``: of those before it."""
    return StepResult(
        step=number + 1,
        place=path_step,
        time=scene.time_at(path_step),
        name=scene.path.name_at(path_step),
        status=status,
        displacement=displacement,
        contact=contact,
        certificate=certificate,
        deformation=deformation,
        strain_energy=certificate.strain_energy,
        linear_solves=linear_solves,
    )


def judged(status: Status, certificate: Certificate, deformation: Deformation, scene: Scene) -> Status:
    """The status of an iteration after its result has been checked.

    If the residual stagnates, the usual reason is a body that has moved far away: therefore this is checked first.
    """
    if status not in (Status.CONVERGED, Status.ROUND_OFF):
        return status
    if deformation.largest > scene.solver.largest_deformation:
        return Status.TOO_LARGE
    return Status.NOT_CERTIFIED if status is Status.CONVERGED and not certificate.holds else status
