"""Sets up the contact problem of a scene on one mesh, solves its load steps and certifies them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem

from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.algebra.linalg import Elasticity, ElasticSystem
from signorini_fx.algebra.linalg.choice import SystemSize, choose_system
from signorini_fx.arrays import Array
from signorini_fx.machine.petsc_objects import free_unused
from signorini_fx.mechanics.body.discretisation import moved_since, placed, placements, prepare
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, no_points
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.mechanics.step_effect import StepEffect, stated_effects
from signorini_fx.records import Finding, History, Status, Timings
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.results.mechanics import Mechanics, StatedMechanics, StepResult
from signorini_fx.results.solution import Solution
from signorini_fx.solving.findings import (
    errors_of_steps,
    facets_in_result,
    loose_at_rest,
    may_jump,
    pushed_nodes,
    refuse_beforehand,
    result_findings,
    scene_findings,
    shapes_in_results,
    slid_at_corners,
    untouched,
)
from signorini_fx.solving.frames import Posed
from signorini_fx.solving.increments import Increments, check_step
from signorini_fx.solving.load_path import all_steps, run
from signorini_fx.solving.step import (
    Report,
    contact_equilibrium,
    recalled_equilibrium,
    step,
)
from signorini_fx.tuned import MOST_ADJOINT_UNKNOWNS, PATH_ERROR_SHARE

if TYPE_CHECKING:
    from signorini_fx.solving.restart import StoredStates


def solve_mesh(
    statement: Statement,
    load: Callable[[], TaggedMesh],
    history: History,
    contact: ContactState | None,
    on_step: Callable[[Report], None] = lambda report: None,
    coarser: MeshLevel | None = None,
    stored: StoredStates | None = None,
    begin: State | None = None,
    effects: Sequence[StepEffect] = (),
) -> tuple[Solution, Task, Outcome]:
    """Solve a scene on one mesh.

    Args:
        statement: the scene.
        load: returns the mesh.
        history: the record of all solves.
        contact: contact state of a coarser mesh to start from; None: there is none.
        on_step: called with the report of each load step that has a solution.
        coarser: the coarser mesh as a level of multigrid; None: there is none.
        stored: stored load steps for restart; None: nothing is stored.
        begin: the state to start from; None: the initial state.
        effects: effects in time in addition to those of the scene.
    """
    problem = stated_problem(statement, load, history, coarser, effects)
    near = None
    if coarser is not None and not statement.path.several:
        near = _displacement_of_coarser(problem.task, problem.model)
    return solve_contact(problem, contact, on_step, stored, near, begin)


def stated_problem(
    statement: Statement,
    load: Callable[[], TaggedMesh],
    history: History,
    coarser: MeshLevel | None = None,
    effects: Sequence[StepEffect] = (),
) -> StatedProblem:
    """Return the problem of a scene on one mesh; collective.

    Args:
        statement: the scene.
        load: returns the mesh.
        history: the record of all solves.
        coarser: the coarser mesh as a level of multigrid; None: there is none.
        effects: effects in time in addition to those of the scene.
    """
    timings = Timings()
    with timings.phase("mesh"):
        tagged = load()
    free_unused(tagged.mesh)
    model = prepare(statement, tagged, timings)
    with timings.phase("compile"):
        assert model.forms
    with timings.phase("assemble"):
        assert model.cases is not None
    refuse_beforehand(model)
    for given, chosen in zip(statement.contact, model.contacts, strict=True):
        if chosen.boundary != given.boundary:
            history.add(
                f"the contact points are on {chosen.boundary!r}, not on {given.boundary!r}: see "
                "contact.points"
            )
    effects = *effects, *stated_effects(statement)
    if any(effect.overrides("body") for effect in effects):
        return StatedProblem(model, None, timings, history, effects)
    with timings.phase("condense"):
        task = contact_task(model, history, coarser)
    return StatedProblem(model, task, timings, history, effects)


def _displacement_of_coarser(task: Task, model: Model) -> Array | None:
    """Return the displacement of the coarser mesh as a start, shape (dofs,); collective.

    Returns None if it is not available, or if linear solves are direct, which gain nothing from it.
    """
    from signorini_fx.algebra.linalg.krylov import KrylovSystem

    level = task.system.elasticity.level
    if (
        not isinstance(task.system, KrylovSystem)
        or not isinstance(level, MeshLevel)
        or model.turned is not None
    ):
        return None
    if (start := level.start()) is None:
        return None
    x = task.system.start.copy()
    free = ~model.fixed
    if task.rest is not None:
        start.getArray()[:] -= model.motions.displacement(task.rest.motion).ravel()[
            : start.getLocalSize()
        ]
    x.getArray()[: free.size][free] = start.getArray(readonly=True)[free]
    return model.from_rest(task.rest, task.system.displacement(x)).x.array.copy()


def solve_contact(
    problem: StatedProblem,
    contact: ContactState | None,
    on_step: Callable[[Report], None] = lambda report: None,
    stored: StoredStates | None = None,
    near: Array | None = None,
    begin: State | None = None,
) -> tuple[Solution, Task, Outcome]:
    """Solve load steps until the end of the path, or until one has no solution.

    Args:
        problem: the problem on one mesh.
        contact: contact state of other points, for example of a coarser mesh, to start from; None:
            there is none.
        on_step: called with the report of each load step that has a solution.
        stored: stored load steps for restart; None: nothing is stored.
        near: displacement to start the iteration from, shape (dofs,); None: there is none.
        begin: the state after which the load steps are solved; None: the initial state.

    Returns:
        The solution, the last task, and the outcome of the last step with a solution;
        of the first step if there is none.
    """
    begin = problem.initial() if begin is None else begin
    model = problem.model
    guess = None
    if contact is not None and model.boundary is not None:
        from signorini_fx.solving.meshed_problem import carry_over

        guess = carry_over(contact, model.boundary, begin)
    if near is not None:
        guess = replace(guess or replace(begin, number=1), displacement=near)
    way = Increments(problem.path, model.settings)
    if begin.number:
        check_step(begin, problem.path.times[-1], problem.model.space)
        way.begin_at(problem.path.place_of(begin.time))
    reports = []
    state = None
    for new, report in run(problem, begin, way, guess=guess, stored=stored):
        assert isinstance(report, Report)
        reports.append(report)
        if report.status is Status.CONVERGED:
            state = new
            on_step(report)
    ended = last_solved(reports)
    solution = contact_solution(
        reports[-1].mechanics,
        [report.result for report in reports],
        problem.task,
        ended,
        problem.timings,
        _findings,
    )
    # A large solve is not kept, as it would occupy too much memory.
    reached = ended if model.dofs <= MOST_ADJOINT_UNKNOWNS else None
    return replace(solution, state=state, reached=reached), problem.task, ended.outcome


def last_solved(reports: Sequence[Report]) -> Report:
    """Return the report of the last load step with a solution; that of the first step if there is
    none.
    """
    solved = (report for report in reversed(reports) if report.result.status is Status.CONVERGED)
    return next(solved, reports[0])


def contact_solution(
    mechanics: Mechanics,
    steps: Sequence[StepResult],
    task: Task,
    ended: Report,
    timings: Timings,
    find: Callable[[Mechanics, Sequence[StepResult]], Iterable[Finding]],
) -> Solution:
    """Return the solution of all load steps; collective.

    Args:
        mechanics: evaluates forces and stresses of the body.
        steps: the results of the load steps.
        task: the contact problem.
        ended: the report of the last step with a solution, or of the first step.
        timings: times of parts of the solve.
        find: returns the findings about the steps; it is called when they are first needed, on
            several ranks at once.
    """
    outcome = ended.outcome
    data = ended.data
    shown = _shown(steps)
    found = cache(lambda: (*find(mechanics, steps), *may_jump(task.history)))
    model = mechanics.model
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
        algorithm=algorithm_name(model, outcome),
        mechanics=mechanics,
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
    """Return the last load step with a solution; the last one if there is none."""
    return next((step for step in reversed(steps) if step.status is Status.CONVERGED), steps[-1])


def _findings(mechanics: Mechanics, steps: Sequence[StepResult]) -> list[Finding]:
    """Return the findings of ``check`` about the scene, and those about its result; collective."""
    last = steps[-1]
    findings = [*scene_findings(mechanics.model, last.place)]
    if _solved(steps):
        findings += facets_in_result(mechanics.model, last.contact)
    return findings_of_steps(mechanics, steps, findings)


def findings_of_steps(
    mechanics: Mechanics, steps: Sequence[StepResult], further: Sequence[Finding] = ()
) -> list[Finding]:
    """Return the findings about the results of load steps, with ``further`` ones; collective.

    If the last step has no result, they give the reasons.
    """
    if not _solved(steps):
        return [*further, *(step.reason for step in steps if step.reason is not None)]
    model = mechanics.model
    lost = sorted({piece for step in steps for piece in step.certificate.unjudged})
    names = [model.motions.pieces.called(piece) for piece in lost]
    return [
        *pushed_nodes([step.contact for step in steps], model.tagged.size),
        *loose_at_rest(model, steps, model.forces_at),
        *shapes_in_results(mechanics.shapes(_shown(steps).place), _shown(steps).displacement),
        *slid_at_corners(_shown(steps).contact),
        *further,
        *_shown(steps).told,
        *result_findings([step.deformation for step in steps], names),
        *untouched(model.comm, steps),
        *errors_of_steps(model.comm, mechanics.statement, model.path, steps),
    ]


def _solved(steps: Sequence[StepResult]) -> bool:
    """Return whether the last load step has a result that findings can be about."""
    return steps[-1].status in (Status.CONVERGED, Status.TOO_LARGE, Status.NOT_CERTIFIED)


def contact_task(
    model: Model,
    history: History,
    coarser: MeshLevel | None = None,
    choose: Callable[[Elasticity, SystemSize, str], tuple[ElasticSystem, str]] = choose_system,
) -> Task:
    """Return the contact problem of a discretised scene, ready for ``strategy.solve_task`` or for a
    user-defined algorithm.
    """
    factors = model.factors(0)
    task = model.task(
        model.cases,
        factors,
        coarser=coarser,
        allowed=_allowed(model),
        choose=choose,
        history=history,
    )
    start = replace(task.start, factors=factors)
    if model.boundary is not None:
        sets, iteration = model.first_sets()
        start = replace(start, sets=sets, iteration=iteration)
    return replace(task, start=start)


def algorithm_name(model: Model, ended: Outcome) -> str:
    """Return the name of the algorithms that were used, in the paper's abbreviations."""
    if ended.newton.linear:
        return "linear"
    settings = model.settings
    regularised = settings.algorithm == "auto" or (
        settings.algorithm == "alm" and not ended.augmented
    )
    outer = "ssn" if regularised else settings.algorithm
    if not model.has_coulomb:
        return outer
    if ended.monolithic:
        return "coulomb-newton" if outer == "ssn" else f"{outer}, coulomb-newton"
    return {"ssn": "fp", "alm": "alm-fp"}.get(outer, f"{outer}, fp")


def _allowed(model: Model) -> Callable[[fem.Function], float] | None:
    """Return a function for the regularisation error that path-following may leave, as a share of
    the estimated discretisation error; None if the settings do not ask for it.
    """
    settings = model.settings
    if model.boundary is None or (settings.algorithm, settings.regularisation_error) != (
        "path-following",
        "auto",
    ):
        return None
    recovery = StressRecovery.of(model)
    share = PATH_ERROR_SHARE[model.statement.element.degree]
    return lambda y: share * recovery.error(y)


@dataclass
class StatedProblem:
    """The problem of a scene on one mesh, at the position of its last step.

    The position of foundations changes from step to step; only what is assembled is kept.
    """

    model: Model
    _task: Task | None  # its contact problem, once it is needed
    timings: Timings
    history: History  # of all solves
    effects: Sequence[StepEffect] = ()
    # For each of at most two durations of a step: the body without and with effects in time.
    _timed: dict[float, tuple[Model, Model]] = field(default_factory=dict)
    _of_task: Model | None = None  # the body of the task, where it is another one
    _mechanics: StatedMechanics | None = None  # of the last body

    @property
    def task(self) -> Task:
        """The contact problem of the last step; collective."""
        if self._task is None:
            with self.timings.phase("condense"):
                self._task = contact_task(self.model, self.history)
        return self._task

    @property
    def path(self) -> LoadPath:
        """The load path of the statement."""
        return self.model.path

    @property
    def waits(self) -> bool:
        """Whether the path has several load steps, see ``Start.several``."""
        return self.path.several

    def mechanics(self, model: Model) -> Mechanics:
        """Return the evaluation of the statement on the body of a step; it is kept as long as the
        body is the same.
        """
        if self._mechanics is None or self._mechanics.model is not model:
            self._mechanics = StatedMechanics(model, model.statement)
        return self._mechanics

    def points(self) -> tuple[ContactBoundary, fem.FunctionSpace]:
        """Return the contact points, which may be none, and the space of displacements; see
        ``State.save``.
        """
        return self.model.boundary or no_points(self.model.space), self.model.space

    def initial(self) -> State:
        """Return the state before the first load step, without loads; collective."""
        model = self.model
        begun = placements(model.statement.contacts_at(-1))
        unknowns = np.zeros(model.rigid.fixed.size)
        displacement = np.zeros_like(fem.Function(model.space).x.array)
        state = State(0, self.path.time_at(-1), displacement, unknowns, begun)
        for effect in self.effects:
            state = effect.initial(model, state)
        return state

    def pose_at(self, state: State, place: float, dt: float) -> Posed:
        """Return the problem of the step from a state to a place on the path; ``dt`` is its
        duration. Collective.
        """
        model = self.model
        if model.statement.preloads:
            from signorini_fx.solving.bolt_preloads import with_found

            model = with_found(model, place, state.found)
        stepped = placed(model, place)
        self.model = stepped
        stepped = self._with_effects(stepped, state, dt)
        before = self._of_task or model
        if (
            self._task is None
            or stepped.boundary is not before.boundary
            or stepped.of_body is not before.of_body
        ):
            system = None if self._task is None else self._task.system
            if (
                system is not None
                and stepped.is_assembled
                and stepped.stiffness is system.elasticity.matrix
            ):
                stepped = replace(stepped, eliminated=system.eliminated)
            with self.timings.phase("condense"):
                self._task = contact_task(stepped, self.history)
        self._of_task = stepped
        first = self.task.start
        if stepped.law is not None:
            first = replace(
                first, law=stepped.law, data=replace(first.data, bound=stepped.law.given)
            )
        drift = moved_since(stepped, state.placed)
        spin = _spin(stepped)
        return Posed(stepped, self.task, first, placements(stepped.contacts), drift, spin)

    def _with_effects(self, body: Model, state: State, dt: float) -> Model:
        """Return the body of a step with effects in time; what is assembled is kept for two
        durations.
        """
        stepped = body
        for effect in self.effects:
            stepped = effect.body(stepped, state, dt)
        if stepped is body:
            return body
        of_body = dict[str, Any]()
        of_contact = dict[str, Any]()
        boundary = stepped.boundary
        if dt in self._timed:
            earlier, timed = self._timed[dt]
            if earlier.of_body is body.of_body:
                of_body = timed.of_body
            if earlier.of_contact is body.of_contact:
                of_contact = timed.of_contact
                boundary = timed.boundary
        while len(self._timed) > 1:
            self._timed.pop(next(iter(self._timed)))
        stepped = replace(stepped, of_body=of_body, of_contact=of_contact, boundary=boundary)
        stepped = replace(stepped, eliminated=None)
        self._timed[dt] = body, stepped
        return stepped

    equilibrium = contact_equilibrium
    recall = recalled_equilibrium

    def accept(self, new: State, report: Report) -> None:
        """Keep the shortenings that tightening forces have led to, for the following steps."""
        if self.model.statement.preloads:
            self.model = self.model.with_statement(report.mechanics.statement)

    def step(self, state: State, time: float) -> tuple[State, StepResult]:
        """Solve the load step from a state to a time; collective.

        Args:
            state: the end of the load step before, or ``initial()``; it is not changed.
            time: time at the end of the load step, after that of the state.

        Returns:
            The state at its end and the result, whose ``status`` tells whether it is a solution.

        Raises:
            SceneError: there is no load step at this time, or it is not after that of the state;
                the state is of another mesh.
        """
        check_step(state, time, self.model.space)
        place = self.path.place_of(time)
        reached = self.path.place_of(state.time) if state.number else place - 1.0
        new, report = all_steps(self, state, reached, place, partial(step, self))
        assert isinstance(report, Report)
        return new, report.result


def _spin(model: Model) -> Array | None:
    """Return the matrices that remove the shear of a pair across planes of symmetry, which supports
    impose now, shape (n, d, d); None without pairs.
    """
    now = model.boundary
    if now is None or not model.pairs:
        return None
    spin = np.tile(np.eye(now.x.shape[1]), (now.size, 1, 1))
    for number, pair in model.pairs.items():
        spin[now.part == number] -= pair.across
    return spin
