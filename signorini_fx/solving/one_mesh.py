"""A scene on one mesh: sets up its contact problem, solves its load steps and certifies them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.accuracy.stress_recovery import StressRecovery
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.deformation import Deformation, deformation_of
from signorini_fx.body.discretisation import Discretisation, discretise
from signorini_fx.check.cost import estimated_cost
from signorini_fx.check.findings import result_findings, scene_findings
from signorini_fx.contact.data import first_sets, friction_law, regularised_data
from signorini_fx.contact.laws import FrictionLaw, RegularisedData
from signorini_fx.contact.resting_place import Rest, resting_place
from signorini_fx.contact.state import ContactState, functionals
from signorini_fx.linalg import ElasticSystem, options
from signorini_fx.linalg.choice import choose_system
from signorini_fx.linalg.krylov import KrylovSystem
from signorini_fx.linalg.mesh_levels import MeshLevel
from signorini_fx.linalg.rotated import check_rotation
from signorini_fx.mesh.tagged import load_mesh
from signorini_fx.records import Finding, History, Status, Timings
from signorini_fx.results.certificate import Certificate, certify
from signorini_fx.results.nodal_forces import NodalForces
from signorini_fx.results.promised_law import Before, Tractions
from signorini_fx.results.solution import Solution, StepResult
from signorini_fx.scene.model import Scene
from signorini_fx.solving import boundary_levels
from signorini_fx.solving.nested import carry_over
from signorini_fx.solving.strategy import run
from signorini_fx.solving.task import Outcome, Start, Task
from signorini_fx.tuned import PATH_ERROR_SHARE

# Called after a load step with its task, its outcome and its result.
After = Callable[[Discretisation, Outcome, StepResult], object]


def _nothing_more(discretisation: Discretisation, outcome: Outcome, step: StepResult) -> None:
    """Does nothing after a load step."""


def solve_mesh(
    scene: Scene,
    comm: MPI.Comm,
    history: History,
    state: ContactState | None,
    after: After = _nothing_more,
    coarser: MeshLevel | None = None,
) -> tuple[Solution, Task | None, Outcome | None]:
    """Solve on one mesh, starting from the contact state of a coarser one if there is one, with it as a level of
    multigrid.
    """
    timings = Timings()
    with timings.phase("mesh"):
        tagged = load_mesh(scene, comm)
    discretisation = discretise(scene, tagged, timings)
    history.move(dofs=discretisation.dofs)
    if history.watchers and history.progress.meshes == 1:
        history.move(end=time.perf_counter() + math.sqrt(math.prod(estimated_cost(discretisation).seconds)))
    if discretisation.boundary is None:
        return _solve_linear(discretisation, history, timings), None, None
    with timings.phase("condense"):
        task = contact_task(discretisation, discretisation.boundary, history, coarser)
    start = task.start
    if state is not None:
        start = start.begin_from(*carry_over(state, discretisation.boundary))
        if coarser is not None and scene.steps == 1:
            _begin_at_coarse(task, coarser, discretisation)
    elif boundary_levels.worthwhile(task):
        with timings.phase("iterate"):
            start = boundary_levels.start_from_few_nodes(task)
    solution, outcome = solve_contact(discretisation, task, start, timings, after)
    return solution, task, outcome


def _begin_at_coarse(task: Task, coarser: MeshLevel, discretisation: Discretisation) -> None:
    """Begin with the displacement of the coarser mesh, where solves are not exact and gain by it; collective."""
    system, free = task.system, ~discretisation.fixed
    if not isinstance(system, KrylovSystem) or discretisation.rotation is not None:
        return
    start = system.displacement_of_coarser(coarser)
    if start is not None:
        if task.rest is not None:
            moved = discretisation.motions.displacement(task.rest.motion).ravel()
            start.getArray()[:] -= moved[: start.getLocalSize()]
        task.iterate.x.getArray()[free] = start.getArray(readonly=True)[free]


def solve_contact(
    discretisation: Discretisation,
    task: Task,
    start: Start,
    timings: Timings,
    after: After = _nothing_more,
) -> tuple[Solution, Outcome]:
    """All load steps, until one has no solution, and how the last of them ended; ``after`` is called after each."""
    scene, history = discretisation.scene, task.history
    steps: list[StepResult] = []
    original = start.data if task.rest is None else replace(start.data, gap=start.data.gap + task.rest.u_n)
    last: Before | None = None
    for step in range(scene.steps):
        before = history.linear_solves
        history.move(step=step + 1, steps=scene.steps)
        with timings.phase("iterate"):
            outcome = run(task, start)
        with timings.phase("certify"):
            displacement = from_rest(discretisation, task.rest, outcome.displacement())
            contact = task.contact(outcome, start)
            certificate = certify(
                scene,
                discretisation.tagged,
                displacement,
                Tractions.of(contact),
                law=task.promised(outcome),
                step=step,
                before=last,
            )
            last = Before.of(displacement, Tractions.of(contact), task.promised(outcome), last)
            deformation = deformation_of(discretisation, displacement)
            status = _judged(outcome.status, certificate, deformation, scene)
            energy = certificate.strain_energy
        solves = history.linear_solves - before
        steps.append(StepResult(step, status, contact, certificate, deformation, energy, solves))
        if status is not Status.CONVERGED:
            break
        after(discretisation, outcome, steps[-1])
        if step + 1 < scene.steps:
            start = outcome.next_step(start)
    values = None
    if not task.has_coulomb:
        values = functionals(certificate.potential_energy, contact, replace(outcome.problem.data, gap=contact.gap))
    solution = Solution(
        scene=scene,
        status=status,
        algorithm=_algorithm_name(scene, monolithic=outcome.monolithic),
        discretisation=discretisation,
        displacement=displacement,
        contact=contact,
        functionals=values,
        certificate=certificate,
        steps=tuple(steps),
        history=history,
        parameters=_parameters(outcome, energy),
        linear_algebra=task.linear_algebra,
        findings=tuple(_findings(discretisation, steps, task.start.law, original)),
        timings=timings,
    )
    return solution, outcome


def _judged(status: Status, certificate: Certificate, deformation: Deformation, scene: Scene) -> Status:
    """The status of an iteration after its result has been checked.

    If the residual stagnates, the usual reason is a body that has moved far away: therefore this is checked first.
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
    """The findings of ``check`` about the scene, and those about its result; collective."""
    solved = steps[-1].status in (Status.CONVERGED, Status.TOO_LARGE, Status.NOT_CERTIFIED)
    found = scene_findings(discretisation, law, data, estimates=not solved)
    if not solved:
        return found
    contacts = [step.contact.in_contact.any() for step in steps if step.contact is not None]
    touching = parallel.any_rank(discretisation.comm, bool(np.any(contacts))) if contacts else None
    return [*found, *result_findings([step.deformation for step in steps], touching=touching)]


def _solve_linear(discretisation: Discretisation, history: History, timings: Timings) -> Solution:
    """A scene without contact: one factorisation, one solve per load step, no SNES."""
    steps: list[StepResult] = []
    with timings.phase("iterate"):
        system, linear_algebra = choose_system(discretisation, discretisation.scene.solver.linear_algebra)
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
                failed = Status.LINEAR_SOLVER if isinstance(system, KrylovSystem) else Status.SINGULAR
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
        linear_algebra=linear_algebra,
        findings=tuple(_findings(discretisation, steps)),
        timings=timings,
    )


def contact_task(
    discretisation: Discretisation, boundary: ContactBoundary, history: History, coarser: MeshLevel | None = None
) -> Task:
    """The contact problem of a discretised scene, ready for ``strategy.run`` or for a user-defined algorithm."""
    scene = discretisation.scene
    law = friction_law(scene, boundary)
    if scene.solver.algorithm == "exact":
        check_rotation(boundary)
    sets, first_iteration = first_sets(scene, boundary)
    system, reason = choose_system(discretisation, scene.solver.linear_algebra, coarser)
    data = regularised_data(scene, discretisation, boundary, law)
    rest = resting_place(data, boundary, discretisation.motions, system.resultant)
    return Task(
        settings=scene.solver,
        system=system,
        linear_algebra=reason,
        boundary=boundary,
        motions=discretisation.motions,
        start=Start(data if rest is None else rest.data_from(data), law, sets, first_iteration),
        rest=rest,
        has_coulomb=scene.has_coulomb,
        natural_gamma=scene.young / discretisation.tagged.size,
        history=history,
        goal=_goal(discretisation, system),
    )


def _parameters(outcome: Outcome, energy: float) -> dict[str, float]:
    """The parameters of the regularisation for the summary."""
    data = outcome.problem.data
    parameters = {"gamma_n": data.gamma_n, "gamma_t": data.gamma_t, "sigma": data.sigma}
    if outcome.regularisation_error is not None:
        size = np.sqrt(2 * energy)
        parameters["regularisation_error"] = outcome.regularisation_error / size if size > 0 else 0.0
    return parameters


def _algorithm_name(scene: Scene, *, monolithic: bool) -> str:
    """The algorithms that are used, in the paper's abbreviations."""
    settings = scene.solver
    outer = "ssn" if settings.algorithm == "auto" else settings.algorithm
    if not scene.has_coulomb:
        return outer
    if monolithic:
        return "coulomb-newton" if outer == "ssn" else f"{outer}, coulomb-newton"
    return {"ssn": "fp", "alm": "alm-fp"}.get(outer, f"{outer}, fp")


def _goal(discretisation: Discretisation, system: ElasticSystem) -> Callable[[PETSc.Vec], float]:
    """The regularisation error allowed for path-following at an iterate of the system, in the energy norm."""
    requested = discretisation.scene.solver.regularisation_error
    if discretisation.scene.solver.algorithm == "path-following" and requested == "auto":
        recovery = StressRecovery(discretisation)
        allowed = PATH_ERROR_SHARE[discretisation.scene.element.degree]
        return lambda x: allowed * recovery.error(discretisation.displacement(system.displacement(x)))

    forces = NodalForces(discretisation.scene, discretisation.tagged, discretisation.space)

    def share(x: PETSc.Vec) -> float:
        displacement = discretisation.function(system.displacement(x))
        return float(requested * np.sqrt(2 * forces.strain_energy(displacement)))

    return share


def from_rest(discretisation: Discretisation, rest: Rest | None, displacement: PETSc.Vec) -> fem.Function:
    """A displacement that is counted from the resting place, converted to one from the initial position."""
    function = discretisation.function(displacement)
    if rest is not None:
        function.x.array[:] += discretisation.motions.displacement(rest.motion).ravel()
    return function
