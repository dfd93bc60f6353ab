"""The one entry point: a scene in, a solution out; the same outcome on every rank."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.accuracy.error_estimates import Errors, estimate_errors, worst_of
from signorini_fx.accuracy.estimators import StressRecovery
from signorini_fx.accuracy.price_list import LevelResult, peak_memory, price_list
from signorini_fx.algorithms.path_following import path_model
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.deformation import Deformation, deformation_of
from signorini_fx.body.discretisation import Discretisation, discretise
from signorini_fx.check.findings import result_findings, scene_findings
from signorini_fx.contact.data import first_sets, friction_law, regularised_data
from signorini_fx.contact.laws import FrictionLaw, RegularisedData
from signorini_fx.contact.resting import Rest, resting_place
from signorini_fx.contact.state import ContactState, functionals
from signorini_fx.contact.table import contact_table
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.linalg import ElasticSystem, options
from signorini_fx.linalg.choice import choose_system
from signorini_fx.linalg.full import FullSystem, can_factorise
from signorini_fx.linalg.rotated import check_rotation
from signorini_fx.mesh.hierarchy import coarser_scenes
from signorini_fx.mesh.tagged import load_mesh
from signorini_fx.records import Finding, History, IterationRecord, Status, Timings
from signorini_fx.results.certificate import Before, Certificate, Tractions, certify
from signorini_fx.results.nodal_forces import NodalForces
from signorini_fx.results.solution import ConvergenceError, Solution, StepResult
from signorini_fx.scene.model import MeshGenerator, Scene
from signorini_fx.solving import boundary_levels
from signorini_fx.solving.nested import carry_over
from signorini_fx.solving.strategy import PROBLEMS, run
from signorini_fx.solving.task import Task
from signorini_fx.solving.to_accuracy import Solved, solve_to_accuracy


def solve(
    scene: Scene,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    check: bool = True,
    observers: Sequence[Callable[[Any], None]] = (),
    keep: Callable[[Solution], object] = lambda solution: None,
) -> Solution:
    """Solve a scene.

    Args:
        scene: from ``read_scene`` or built in Python.
        comm: the ranks that share the work; the call is collective.
        check: raise if no solution was reached; otherwise look at ``Solution.status``.
        observers: called with each ``IterationRecord`` and ``OuterRecord`` as it happens.
        keep: called with the solution on each mesh but the last, when the next one is about to be solved; collective.

    Raises:
        SceneError: the scene does not fit its mesh.
        MeshError: the mesh cannot be had.
        OptionsError: PETSc does not take an option that the user has set.
        MachineError: a form cannot be compiled.
        ConvergenceError: no solution was reached; it carries the last iterate.
    """
    options.refuse_mistyped(comm)
    history = History(observers=list(observers))
    coarse = coarser_scenes(scene, scene.solver.levels)
    if scene.accuracy is not None:

        def solve_on(scene: Scene, state: ContactState | None, level: int) -> Solved:
            return solve_level(scene, comm, history, state, level)

        solution = solve_to_accuracy(scene, scene.accuracy, comm, solve_on, keep, history.add)
    elif not coarse:
        solution, task = _solve_mesh(scene, comm, history, None)
        if task is not None and scene.solver.fallbacks and task.gave_up(solution.status):
            solution = _from_coarser(scene, comm, history, solution)
    else:
        solution = _solve_nested([*coarse, scene], comm, history, keep)
    if check and not solution.converged:
        raise ConvergenceError(solution)
    return solution


def _solve_nested(
    scenes: Sequence[Scene],
    comm: MPI.Comm,
    history: History,
    keep: Callable[[Solution], object] = lambda solution: None,
) -> Solution:
    """Solve on one mesh after the other, each from the contact state of the one before."""
    base_memory = peak_memory(comm)
    state: ContactState | None = None
    levels: list[LevelResult] = []
    for number, scene in enumerate(scenes):
        solved = solve_level(scene, comm, history, state, number)
        solution, state = solved.solution, None
        if solution.converged:
            state = solution.contact
            if number + 1 < len(scenes):
                keep(solution)
        if solved.level is not None:
            if levels and levels[-1].dofs >= solved.level.dofs:  # a generator may not get it any coarser
                levels.pop()
            levels.append(solved.level)
    if len(levels) < 2 or not solution.converged:
        return replace(solution, levels=tuple(levels))
    return replace(solution, levels=tuple(levels), price_list=tuple(price_list(levels, base_memory)))


def solve_level(scene: Scene, comm: MPI.Comm, history: History, state: ContactState | None, number: int) -> Solved:
    """Solve on one of several meshes, and say what it is worth; collective."""
    history.add(f"level {number}")
    before = history.linear_solves
    found: list[Errors] = []

    def estimate(d: Discretisation, task: Task, step: StepResult) -> None:
        if d.tagged.dimension == 3:  # the estimates of the contact pressure follow a boundary curve
            return
        assert step.contact is not None
        table = contact_table(step.contact, [effect.boundary for effect in scene.contact])
        data = task.problem.data
        compliance = 0.0 if data.lambda_hat.any() else 1 / data.gamma_n
        found.append(estimate_errors(d, task.displacement(), step.strain_energy, table, step.step, compliance))

    solution, task = _solve_mesh(scene, comm, history, state, estimate)
    if not solution.converged or task is None or not found:
        return Solved(solution, task, None, None)
    errors = worst_of(found)
    return Solved(solution, task, _level_result(number, solution, task, history.iterations[before:], errors), errors)


# Coarser meshes that are tried where nothing else has helped.
_HELPING_MESHES = 2


def _from_coarser(scene: Scene, comm: MPI.Comm, history: History, failed: Solution) -> Solution:
    """The last resort: nested iteration, if the generator makes coarser meshes that have what the scene names."""
    if not isinstance(scene.mesh, MeshGenerator):
        return failed
    try:
        coarse = coarser_scenes(scene, 1 + _HELPING_MESHES)
        history.add(f"{failed.status.value}: nested iteration on {_HELPING_MESHES} coarser meshes")
        history.allow(PROBLEMS * scene.solver.max_iterations)
        history.kept = True
        solution = _solve_nested([*coarse, scene], comm, history)
    except (SceneError, MeshError) as error:
        history.add(f"no coarser meshes: {str(error).splitlines()[0]}")
        return failed
    return solution if solution.converged else failed


def _level_result(
    level: int,
    solution: Solution,
    task: Task,
    own: list[IterationRecord],
    errors: Errors,
) -> LevelResult:
    """What a mesh is worth and what it took; two back substitutions, collective.

    Args:
        level: number of the mesh.
        solution: the solution on it.
        task: its contact problem.
        own: the linear solves on this mesh.
        errors: what is estimated on it.
    """
    seconds = parallel.global_max(solution.comm, sum(solution.timings.seconds.values()))
    contact, table = solution.contact, solution.table
    assert contact is not None
    size = np.sqrt(2 * solution.steps[-1].strain_energy)
    regularisation = pressure_regularisation = 0.0
    data = task.problem.data
    if np.isfinite(data.gamma_n) and not data.lambda_hat.any() and size > 0:
        model = path_model(task.unsymmetric_newton if data.coupling is not None else task.newton, data)
        pressure = contact.boundary.norm(contact.pressure)
        regularisation = model.distance / size
        pressure_regularisation = model.pressure_distance / pressure if pressure > 0 else 0.0
    change = solution.history.outer[-1].change
    return LevelResult(
        level=level,
        h=float(table.columns["weight"].mean()),
        dofs=solution.discretisation.dofs,
        linear_solves=len(own),
        factorisations=sum(record.factorised for record in own),
        seconds=seconds,
        memory=peak_memory(solution.comm),
        status=solution.status.value,
        energy=errors.energy,
        pressure=errors.pressure,
        inside=errors.inside,
        data=errors.data,
        regularisation=regularisation,
        pressure_regularisation=pressure_regularisation,
        iteration=max(own[-1].residual if own else 0.0, change or 0.0),
        table=table,
        force=np.concatenate([np.concatenate(step.contact.forces) for step in solution.steps if step.contact]),
    )


def _solve_mesh(
    scene: Scene,
    comm: MPI.Comm,
    history: History,
    state: ContactState | None,
    after: Callable[[Discretisation, Task, StepResult], object] = lambda discretisation, task, step: None,
) -> tuple[Solution, Task | None]:
    """Solve on one mesh, from the contact state of a coarser one if there is any."""
    timings = Timings()
    with timings.phase("mesh"):
        tagged = load_mesh(scene, comm)
    discretisation = discretise(scene, tagged, timings)
    if discretisation.boundary is None:
        return _solve_linear(discretisation, history, timings), None
    with timings.phase("condense"):
        task = contact_task(discretisation, discretisation.boundary, history)
    if state is not None:
        task.begin_from(*carry_over(state, discretisation.boundary))
    elif boundary_levels.worthwhile(task):
        with timings.phase("iterate"):
            boundary_levels.start_from_few_nodes(task)
    return solve_contact(discretisation, task, timings, after), task


def solve_contact(
    discretisation: Discretisation,
    task: Task,
    timings: Timings,
    after: Callable[[Discretisation, Task, StepResult], object] = lambda discretisation, task, step: None,
) -> Solution:
    """All load steps, until one has no solution; ``after`` is called while the task still holds what a step left."""
    scene, history = discretisation.scene, task.history
    steps: list[StepResult] = []
    original = task.data if task.rest is None else replace(task.data, gap=task.data.gap + task.rest.u_n)
    last: Before | None = None
    for step in range(scene.steps):
        before = history.linear_solves
        with timings.phase("iterate"):
            if step > 0:
                task.next_step()
            status = run(task)
        with timings.phase("certify"):
            displacement = total_displacement(discretisation, task)
            contact = task.contact()
            certificate = certify(
                scene,
                discretisation.tagged,
                displacement,
                Tractions.of(contact),
                law=task.promised,
                step=step,
                before=last,
            )
            last = Before(displacement, Tractions.of(contact))
            deformation = deformation_of(discretisation, displacement)
            status = _judged(status, certificate, deformation, scene)
            energy = certificate.strain_energy
        solves = history.linear_solves - before
        steps.append(StepResult(step, status, contact, certificate, deformation, energy, solves))
        if status is not Status.CONVERGED:
            break
        after(discretisation, task, steps[-1])
    values = None
    if not task.has_coulomb:
        values = functionals(certificate.potential_energy, contact, replace(task.problem.data, gap=contact.gap))
    return Solution(
        scene=scene,
        status=status,
        algorithm=_algorithm_name(scene, monolithic=task.monolithic),
        discretisation=discretisation,
        displacement=displacement,
        contact=contact,
        functionals=values,
        certificate=certificate,
        steps=tuple(steps),
        history=history,
        parameters=_parameters(task, energy),
        linear_algebra=task.linear_algebra,
        findings=tuple(_findings(discretisation, steps, task.law, original)),
        timings=timings,
    )


def _judged(status: Status, certificate: Certificate, deformation: Deformation, scene: Scene) -> Status:
    """What becomes of the outcome of an iteration when its result is looked at.

    A residual that stagnates is as a rule that of a body that is far away: then this comes first.
    """
    if status not in (Status.CONVERGED, Status.ROUND_OFF):
        return status
    if deformation.largest > scene.solver.largest_deformation:
        return Status.TOO_LARGE
    return Status.NOT_CERTIFIED if status is Status.CONVERGED and not certificate.holds else status


def _findings(
    discretisation: Discretisation,
    steps: Sequence[StepResult],
    law: FrictionLaw | None = None,
    data: RegularisedData | None = None,
) -> list[Finding]:
    """What ``check`` says of the scene, and what its result says; collective."""
    solved = steps[-1].status in (Status.CONVERGED, Status.TOO_LARGE, Status.NOT_CERTIFIED)
    found = scene_findings(discretisation, law, data, estimates=not solved)
    if not solved:
        return found
    contacts = [step.contact.in_contact.any() for step in steps if step.contact is not None]
    touching = parallel.any_rank(discretisation.comm, bool(np.any(contacts))) if contacts else None
    return [*found, *result_findings([step.deformation for step in steps], touching=touching)]


def _solve_linear(discretisation: Discretisation, history: History, timings: Timings) -> Solution:
    """A scene without contact: one factorisation, one solve a load step, no SNES."""
    steps: list[StepResult] = []
    with timings.phase("iterate"):
        krylov = discretisation.scene.solver.linear_algebra == "krylov" or not can_factorise(
            discretisation.tagged.mesh.comm
        )
        system = FullSystem.of(discretisation, krylov=krylov)
        ksp = PETSc.KSP().create(system.comm)
        ksp.setOptionsPrefix(options.PREFIX)
        ksp.setOperators(system.matrix)
        system.configure(ksp, symmetric=True)
        ksp.setFromOptions()
        x = system.start.copy()
    for step in range(discretisation.scene.steps):
        with timings.phase("iterate"):
            system.set_step(step)
            status = Status.NOT_HELD
            if discretisation.motions.free.shape[1] == 0:
                with options.defaults(system.solver_defaults):
                    ksp.solve(system.load, x)
                failed = Status.LINEAR_SOLVER if krylov else Status.SINGULAR
                status = Status.CONVERGED if ksp.getConvergedReason() > 0 else failed
        with timings.phase("certify"):
            displacement = discretisation.function(x)
            certificate = certify(discretisation.scene, discretisation.tagged, displacement, None, step=step)
            deformation = deformation_of(discretisation, displacement)
            status = _judged(status, certificate, deformation, discretisation.scene)
            energy = certificate.strain_energy
        solves = int(status is not Status.NOT_HELD)
        steps.append(StepResult(step, status, None, certificate, deformation, energy, solves))
        if status is not Status.CONVERGED:
            break
    return Solution(
        scene=discretisation.scene,
        status=status,
        algorithm="linear",
        discretisation=discretisation,
        displacement=displacement,
        contact=None,
        functionals=None,
        certificate=certificate,
        steps=tuple(steps),
        history=history,
        findings=tuple(_findings(discretisation, steps)),
        timings=timings,
    )


def contact_task(discretisation: Discretisation, boundary: ContactBoundary, history: History) -> Task:
    """The contact problem of a discretised scene, ready for ``strategy.run`` or for an algorithm of one's own."""
    scene = discretisation.scene
    law = friction_law(scene, boundary)
    if scene.solver.algorithm == "exact":
        check_rotation(boundary)
    sets, first_iteration = first_sets(scene, boundary)
    system, reason = choose_system(discretisation, scene.solver.linear_algebra)
    data = regularised_data(scene, discretisation, boundary, law)
    rest = resting_place(data, boundary, discretisation.motions, system.resultant)
    return Task(
        settings=scene.solver,
        system=system,
        linear_algebra=reason,
        boundary=boundary,
        motions=discretisation.motions,
        data=data if rest is None else rest.data_from(data),
        rest=rest,
        law=law,
        has_coulomb=scene.has_coulomb,
        first_sets=sets,
        first_iteration=first_iteration,
        natural_gamma=scene.young / discretisation.tagged.size,
        history=history,
        goal=_goal(discretisation, system),
    )


def _parameters(task: Task, energy: float) -> dict[str, float]:
    """What the summary says of the regularisation."""
    data = task.problem.data
    parameters = {"gamma_n": data.gamma_n, "gamma_t": data.gamma_t, "sigma": data.sigma}
    if task.regularisation_error is not None:
        size = np.sqrt(2 * energy)
        parameters["regularisation_error"] = task.regularisation_error / size if size > 0 else 0.0
    return parameters


def _algorithm_name(scene: Scene, *, monolithic: bool) -> str:
    """The algorithms in force, in the paper's abbreviations."""
    settings = scene.solver
    outer = "ssn" if settings.algorithm == "auto" else settings.algorithm
    if not scene.has_coulomb:
        return outer
    if monolithic:
        return "coulomb-newton" if outer == "ssn" else f"{outer}, coulomb-newton"
    return {"ssn": "fp", "alm": "alm-fp"}.get(outer, f"{outer}, fp")


# Of the discretisation error path-following may leave: with degree 2 the model of the path was seen to be wrong by two.
_PATH_SHARE = {1: 1.0, 2: 1 / 3}


def _goal(discretisation: Discretisation, system: ElasticSystem) -> Callable[[PETSc.Vec], float]:
    """What path-following may leave at an iterate of the system, in the energy norm."""
    wanted = discretisation.scene.solver.regularisation_error
    if discretisation.scene.solver.algorithm == "path-following" and wanted == "auto":
        recovery = StressRecovery(discretisation)
        allowed = _PATH_SHARE[discretisation.scene.element.degree]
        return lambda x: allowed * recovery.error(system.displacement(x))

    forces = NodalForces(discretisation.scene, discretisation.tagged, discretisation.space)

    def share(x: PETSc.Vec) -> float:
        displacement = discretisation.function(system.displacement(x))
        return float(wanted * np.sqrt(2 * forces.strain_energy(displacement)))

    return share


def total_displacement(discretisation: Discretisation, task: Task) -> fem.Function:
    """The displacement of the answer of a task, from where the body was at first."""
    return from_rest(discretisation, task.rest, task.displacement())


def from_rest(discretisation: Discretisation, rest: Rest | None, displacement: PETSc.Vec) -> fem.Function:
    """A displacement that is counted from a resting place, as one from where the body was at first."""
    function = discretisation.function(displacement)
    if rest is not None:
        function.x.array[:] += discretisation.motions.displacement(rest.motion).ravel()
    return function
