"""A scene on one mesh: sets up its contact problem, solves its load steps and certifies them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np
from dolfinx import fem

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.linalg import Elasticity, ElasticSystem
from signorini_fx.algebra.linalg.choice import SystemSize, choose_system
from signorini_fx.machine.petsc_objects import free_unused
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.body.discretisation import moved_since, placed, prepare
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import Finding, History, Status, Timings
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.results.certificate.law_of_method import PreviousStep
from signorini_fx.results.mechanics import SolidBody, StatedBody, StepResult
from signorini_fx.results.solution import Solution
from signorini_fx.results.step_frames import StepEnd, from_rest
from signorini_fx.solving.findings import (
    facets_in_result,
    loose_at_rest,
    pushed_nodes,
    refuse_beforehand,
    result_findings,
    scene_findings,
    shapes_in_results,
    untouched,
)
from signorini_fx.solving.load_steps import (
    BegunStep,
    Increments,
    LoadStep,
    SteppedBody,
    StepProgress,
    first_start,
)
from signorini_fx.tuned import PATH_ERROR_SHARE

if TYPE_CHECKING:
    from signorini_fx.solving.checkpointed_steps import MeshCheckpoint


def solve_mesh(
    statement: Statement,
    load: Callable[[], TaggedMesh],
    history: History,
    state: ContactState | None,
    on_step: Callable[[LoadStep], object] = lambda step: None,
    coarser: MeshLevel | None = None,
    kept: MeshCheckpoint | None = None,
) -> tuple[Solution, Task, Outcome]:
    """Solve on the mesh that ``load`` gives, from the ``state`` of a ``coarser`` one, a level of
    multigrid, if any.
    """
    timings = Timings()
    with timings.phase("mesh"):
        tagged = load()
    free_unused(tagged.mesh)
    model = StatedBody.of(prepare(statement, tagged, timings))
    with timings.phase("compile"):
        assert model.forms
    with timings.phase("assemble"):
        assert model.cases is not None
    refuse_beforehand(model)
    for stated, contact in zip(statement.contact, model.statement.contact, strict=True):
        if contact.boundary != stated.boundary:
            history.add(
                f"the contact points are on {contact.boundary!r}, not on {stated.boundary!r}: see "
                "contact.points"
            )
    with timings.phase("condense"):
        task = contact_task(model, history, coarser)
    if coarser is not None and not statement.several_steps:
        _begin_at_coarser(task, model)
    return solve_contact(model, task, state, timings, on_step, kept)


def _begin_at_coarser(task: Task, model: Model) -> None:
    """Begin with the displacement of the coarser mesh, where solves are not exact and gain by it;
    collective.
    """
    from signorini_fx.algebra.linalg.krylov import KrylovSystem

    level = task.system.elasticity.level
    if (
        not isinstance(task.system, KrylovSystem)
        or not isinstance(level, MeshLevel)
        or model.turned is not None
    ):
        return
    if (start := level.start()) is None:
        return
    if task.rest is not None:
        start.getArray()[:] -= model.motions.displacement(task.rest.motion).ravel()[
            : start.getLocalSize()
        ]
    free = ~model.fixed
    task.newton.x.getArray()[: free.size][free] = start.getArray(readonly=True)[free]


def solve_contact(
    model: SolidBody,
    task: Task,
    state: ContactState | None,
    timings: Timings,
    on_step: Callable[[LoadStep], object] = lambda step: None,
    level_checkpoint: MeshCheckpoint | None = None,
) -> tuple[Solution, Task, Outcome]:
    """All load steps from a ``state``, until one has no solution, the last task, and the last
    solved outcome.
    """
    statement = model.statement
    body = StatedSteps(model, statement.path, timings, state)
    start = first_start(task.start, model.boundary, state)
    progress = StepProgress(body, task, start, Increments(statement.path, statement.solver))
    progress.all(on_step, level_checkpoint)
    model = progress.body.model
    task = progress.task
    assert progress.ended is not None
    found = partial(_findings, model, progress.results)
    solution = contact_solution(model, progress.results, task, progress.ended, timings, found)
    return solution, task, progress.ended[0]


def contact_solution(
    model: SolidBody,
    steps: Sequence[StepResult],
    task: Task,
    ended: tuple[Outcome, RegularisedData],
    timings: Timings,
    find: Callable[[], Iterable[Finding]],
) -> Solution:
    """What load steps have come to; ``ended``: how the last one with a solution ended, or the first
    one, and its data;
    ``find``: gives the findings, which are looked for when the first one asks, on several ranks at
    once; collective.
    """
    (outcome, data), shown, found = ended, _shown(steps), cache(lambda: tuple(find()))
    if model.comm.size > 1:  # they may be asked for by one rank alone
        found()
    parameters = dict[str, float]()
    energy = shown.strain_energy
    if shown.contact is not None:
        parameters = {"gamma_n": data.gamma_n, "gamma_t": data.gamma_t, "sigma": data.sigma}
        if outcome.regularisation_error is not None and energy is not None:
            error = outcome.regularisation_error / np.sqrt(2 * energy) if energy > 0 else 0.0
            parameters["regularisation_error"] = error
    return Solution(
        status=steps[-1].status,
        algorithm=algorithm_name(model.statement, outcome),
        model=model,
        displacement=shown.displacement,
        contact=shown.contact,
        certificate=shown.certificate,
        steps=tuple(steps),
        history=task.history,
        parameters=parameters,
        found=found,
        timings=timings,
        linear_algebra=task.linear_algebra,
    )


def _shown(steps: Sequence[StepResult]) -> StepResult:
    """The last load step with a solution, or the last one."""
    return next((step for step in reversed(steps) if step.status is Status.CONVERGED), steps[-1])


def _findings(model: SolidBody, steps: Sequence[StepResult]) -> list[Finding]:
    """The findings of ``check`` about the scene, and those about its result; collective."""
    last = steps[-1]
    findings = [*scene_findings(model)]
    if _solved(steps):
        findings += facets_in_result(model, last.contact)
    return findings_of_steps(model, steps, findings)


def findings_of_steps(
    model: SolidBody, steps: Sequence[StepResult], further: Sequence[Finding]
) -> list[Finding]:
    """What is odd about results of load steps, beside what is known; where the last one has none,
    why; collective.
    """
    if not _solved(steps):
        return [*further, *(step.reason for step in steps if step.reason is not None)]
    lost = sorted({piece for step in steps for piece in step.certificate.unjudged})
    names = [model.motions.pieces.called(piece) for piece in lost]
    return [
        *pushed_nodes([step.contact for step in steps], model.tagged.size),
        *loose_at_rest(model, steps, model.statement.forces_at),
        *shapes_in_results(model.shapes(_shown(steps).place), _shown(steps).displacement),
        *further,
        *result_findings([step.deformation for step in steps], names),
        *untouched(model.comm, steps),
    ]


def _solved(steps: Sequence[StepResult]) -> bool:
    """Whether the last load step has a result that something can be said about."""
    return steps[-1].status in (Status.CONVERGED, Status.TOO_LARGE, Status.NOT_CERTIFIED)


def contact_task(
    model: Model,
    history: History,
    coarser: MeshLevel | None = None,
    choose: Callable[[Elasticity, SystemSize, str], tuple[ElasticSystem, str]] = choose_system,
) -> Task:
    """The contact problem of a discretised scene, ready for ``strategy.solve_task`` or for a
    user-defined algorithm.
    """
    factors = model.factors(0)
    task = model.task(
        model.cases,
        factors,
        model.data,
        model.law,
        coarser=coarser,
        allowed=_allowed(model),
        choose=choose,
        natural_gamma=model.scales.gamma,
        coordinate_error=model.scales.coordinate_error,
        has_coulomb=model.statement.has_coulomb,
        history=history,
    )
    start = replace(task.start, factors=factors)
    if model.boundary is not None:
        sets, iteration = model.first_sets()
        start = replace(start, sets=sets, iteration=iteration)
    return replace(task, start=start)


def algorithm_name(statement: Statement, ended: Outcome) -> str:
    """The algorithms that are used, in the paper's abbreviations."""
    if ended.newton.linear:
        return "linear"
    settings = statement.solver
    regularised = settings.algorithm == "auto" or (
        settings.algorithm == "alm" and not ended.augmented
    )
    outer = "ssn" if regularised else settings.algorithm
    if not statement.has_coulomb:
        return outer
    if ended.monolithic:
        return "coulomb-newton" if outer == "ssn" else f"{outer}, coulomb-newton"
    return {"ssn": "fp", "alm": "alm-fp"}.get(outer, f"{outer}, fp")


def _allowed(model: Model) -> Callable[[fem.Function], float] | None:
    """The regularisation error allowed for path-following where it follows the estimated
    discretisation error.
    """
    settings = model.statement.solver
    if model.boundary is None or (settings.algorithm, settings.regularisation_error) != (
        "path-following",
        "auto",
    ):
        return None
    recovery = model.recovery if isinstance(model, SolidBody) else StressRecovery.of(model)
    share = PATH_ERROR_SHARE[model.statement.element.degree]
    return lambda y: share * recovery.error(y)


@dataclass(frozen=True)
class StatedSteps(SteppedBody):
    """A body that a statement says all of; ``state``: from which the first load step begins."""

    state: ContactState | None

    def begun(self, path_step: float, task: Task, first: Start, end: StepEnd | None) -> BegunStep:
        earlier = self.model
        start = first
        last = None
        if end is not None:
            start = end.start
            last = end.before
        moved = placed(earlier, path_step)
        if moved is earlier:
            return BegunStep(self, task, start, last)
        stepped = replace(self, model=moved)
        if moved.boundary is earlier.boundary:
            assert moved.law is not None
            bound = (
                moved.law.given
                if start.multipliers is None
                else moved.law.bound(start.multipliers[0])
            )
            return BegunStep(
                stepped,
                task,
                replace(start, law=moved.law, data=replace(start.data, bound=bound)),
                last,
            )
        with self.timings.phase("condense"):
            task = contact_task(moved, task.history)
        if end is not None:
            return BegunStep(stepped, task, *on_moved_foundations(earlier, moved, task, end))
        assert moved.boundary is not None
        start = first_start(task.start, moved.boundary, self.state)
        drift = moved_since(moved, moved.statement.placed(-1))
        return BegunStep(stepped, task, *from_rest(moved.space, moved.boundary, start, drift))


def on_moved_foundations(
    earlier: Model, moved: Model, task: Task, end: StepEnd
) -> tuple[Start, PreviousStep]:
    """Where a load step starts on moved foundations, and the end of the last one as it sees it;
    collective.
    """
    assert earlier.boundary is not None
    assert moved.boundary is not None
    end.taken_up(task, moved, moved.rigid)
    now = moved.boundary
    before = earlier.boundary
    spin = None
    # across planes of symmetry, which supports make that hold from now on, there is no shear any
    # more
    if moved.pairs:
        spin = np.tile(np.eye(now.x.shape[1]), (now.size, 1, 1))
        for number, pair in moved.pairs.items():
            spin[now.part == number] -= pair.across
    # Contact alone may hold the body, which rests elsewhere now.
    drift = moved_since(moved, earlier.statement)
    begun, last = end.begins_on(now, task.start.data, moved.law, drift, task.rest, spin)
    if not (before.paired and now.paired):
        return begun, last
    # With these planes the relative displacement at the points is another one for the same
    # displacement.
    y = last.displacement.x.array.reshape(-1, now.x.shape[1])[
        : moved.space.dofmap.index_map.size_local
    ]
    seen, sees = (
        (averages.operator @ from_owners(y, averages.nodes, now.comm).ravel()).reshape(now.x.shape)
        for averages in (before.averages, now.averages)
    )
    origin = begun.data.slip_origin + np.einsum("nij,ni->nj", now.tangents, sees - seen)
    return replace(begun, data=replace(begun.data, slip_origin=origin)), last
