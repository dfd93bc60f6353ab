"""A scene on one mesh after the other: how its model is made on each, and how meshes are."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import partial
from math import log2
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.mechanics.mesh.files.size_field import SizeField
from signorini_fx.mechanics.mesh.remeshing import moved_back, size_fields
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh, load_file
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.statement.mesh_sources import MeshFile, MeshGenerator, contact_sizes
from signorini_fx.mechanics.statement.rigid_shape import turning
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import History
from signorini_fx.results.accuracy.error_estimates import Errors, combined, estimate_errors
from signorini_fx.results.certificate.law_of_method import overclosures_of
from signorini_fx.results.restart_files import Checkpoint
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.mesh import load_mesh, scene_on, with_cells_alike, with_halved_bodies
from signorini_fx.scenes.plan import Plan, planned, scene_with
from signorini_fx.scenes.scene import Scene
from signorini_fx.solving.checkpointed_steps import MeshCheckpoint
from signorini_fx.solving.finer_meshes import Meshes
from signorini_fx.solving.meshed_problem import MeshedProblem, SolvedMesh
from signorini_fx.solving.nested import solve_nested
from signorini_fx.solving.solve_on_mesh import solve_mesh
from signorini_fx.solving.stepped_body import LoadStep
from signorini_fx.solving.to_accuracy import Budget, solve_to_accuracy
from signorini_fx.tuned import COARSER_START


def solve_scenes(
    scenes: Sequence[Scene],
    comm: MPI.Comm,
    history: History,
    on_level: Callable[[Solution], object] = lambda solution: None,
    stored: Checkpoint | None = None,
) -> Solution:
    """A scene on its coarser meshes, and then on its own, see ``solving.nested.solve_nested``."""
    meshes = [meshed_scene(scene, comm, history, stored) for scene in scenes]
    return solve_nested(meshes, len(meshes), comm, history, on_level)


def solve_scene_to_accuracy(
    scene: Scene, goal: Accuracy, comm: MPI.Comm, history: History, on_level: Callable[[Solution], object]
) -> Solution:
    """A scene on finer and finer meshes until it has the requested accuracy; collective."""
    budget = Budget.begins(goal, comm, history)
    return solve_to_accuracy(meshes_of(scene, goal, comm, history), budget, history, on_level)


def meshed_scene(
    scene: Scene, comm: MPI.Comm, history: History, stored: Checkpoint | None = None
) -> MeshedProblem[Scene]:
    """A scene on one of several meshes."""
    return MeshedProblem(
        source=scene,
        comm=comm,
        history=history,
        degree=int(scene.element.degree),
        paired=scene.statement.sides[1] is not None,
        soft=bool(overclosures_of(scene.statement)),
        stated=lambda source: source.solver,
        solve=_solved_nonlinear if scene.statement.nonlinear else _solved,
        on_cells=scene_with,
        keep=_with_points_kept,
        stored=stored,
    )


def _solved(
    problem: MeshedProblem[Scene],
    state: ContactState | None,
    coarser: MeshLevel | None,
    checkpoint: MeshCheckpoint | None,
    step_errors: list[Errors],
) -> SolvedMesh:
    scene, comm = problem.source.model_copy(update={"solver": problem.settings}), problem.comm

    def estimate(step: LoadStep) -> None:
        model, outcome, result = step.body.model, step.outcome, step.result
        if result.contact is None or result.strain_energy is None:
            return
        table = contact_table(result.contact, *model.statement.sides)
        displacement = model.function(outcome.displacement())
        step_errors.append(estimate_errors(model, displacement, result.strain_energy, table, result.place))

    load = partial(load_mesh, scene, comm)
    solution, task, outcome = solve_mesh(scene.statement, load, problem.history, state, estimate, coarser, checkpoint)
    return SolvedMesh(solution, solution.model.tagged, task, outcome)


def _solved_nonlinear(
    problem: MeshedProblem[Scene],
    state: ContactState | None,
    coarser: MeshLevel | None,
    checkpoint: MeshCheckpoint | None,
    step_errors: list[Errors],
) -> SolvedMesh:
    """Solved anew, along the whole load path; the errors are those after the last load step, without those of contact
    where cells lock: estimates of them were up to 30 times too small.
    """
    from signorini_fx.mechanics.body.nonlinear_law import volume_degree
    from signorini_fx.scenes.nonlinear import solve_nonlinear

    scene, comm = problem.source.model_copy(update={"solver": problem.settings}), problem.comm
    solution = solve_nonlinear(scene, comm, problem.history, checkpoint)
    if solution.converged and not isinstance(shares := solution.error_shares, str):
        errors = combined(solution.model, solution.table, shares, 0.5)
        nearly = any(material.locks for material in scene.statement.material)
        locking = nearly and volume_degree(scene.statement, solution.model.tagged) is None
        step_errors.append(replace(errors, pressure=None) if locking else errors)
    return SolvedMesh(solution, solution.model.tagged, None)


def _with_points_kept(scene: Scene, solved: SolvedMesh) -> Scene:
    """Leave the contact points of pairs on the sides that were chosen on the first mesh: forces have their sign."""
    if solved.solution.statement.sides[1] is None:
        return scene
    contacts = [
        model if model.against is None else model.model_copy(update={"points": "boundary"})
        for model in solved.solution.statement.contact
    ]
    return scene.model_copy(update={"contact": tuple(contacts)})


def _divided(plan: Plan, comm: MPI.Comm, last: Scene, coarsest: float, times: int) -> Scene:
    scene, halvings = plan.scene, round(log2(times))
    if isinstance(scene.mesh, MeshFile):
        sections, sizes = scene.statement.sections, contact_sizes(scene)
        return scene_with(last, load_file(scene.mesh, comm, halvings, plan.geometry, sections, sizes))
    if scene.statement.generated:
        scene = scene_on(scene, coarsest / times)
    elif scene.body:
        scene = with_halved_bodies(scene, halvings, comm)
    contacts = tuple(
        contact.model_copy(update={"contact_size": finer.contact_size})
        for contact, finer in zip(last.contact, scene.contact, strict=True)
    )
    return last.model_copy(update={"mesh": scene.mesh, "body": scene.body, "contact": contacts})


def _remade(
    plan: Plan, comm: MPI.Comm, scene: Scene, last: TaggedMesh, lengths: npt.NDArray[np.float64], finer: float
) -> tuple[Scene, int]:
    """The scene on cells that gmsh makes anew, and how many there are; collective."""
    dim, first = last.dimension, with_cells_alike(plan.scene)

    def with_lengths(mesh: Any, field: SizeField, sections: Collection[str]) -> TaggedMesh:
        """The cells of a table ``mesh``, of these lengths."""
        if isinstance(mesh, MeshGenerator):
            return generate_mesh(mesh.generator, mesh.parameters, comm, field)
        curved = 2 if scene.element.degree == 2 else None
        return load_file(mesh, comm, 0, curved, sections, field)

    if not first.body:
        (field,) = size_fields(last, lengths, [np.arange(len(lengths), dtype=np.int32)], finer)
        tagged = with_lengths(first.mesh, field, first.statement.sections)
        return scene_with(scene, tagged), tagged.mesh.topology.index_map(dim).size_global
    bodies, count = [], 0
    fields = size_fields(last, lengths, [last.cells(body.name) for body in first.body], finer)
    for body, of_body in zip(first.body, fields, strict=True):
        pivot, shift = (np.array(vector or (0.0,) * dim) for vector in (body.pivot, body.shift))
        turned = np.eye(dim) if body.rotation is None else turning(body.rotation, dim)
        field = moved_back(of_body, turned, pivot, shift)
        tagged = with_lengths(body.mesh, field, first.sections_of(body.name))
        count += tagged.mesh.topology.index_map(dim).size_global
        bodies.append(body.model_copy(update={"mesh": tagged}))
    return scene.model_copy(update={"body": tuple(bodies)}), count


def meshes_of(scene: Scene, goal: Accuracy, comm: MPI.Comm, history: History) -> Meshes:
    """The meshes of a scene on the way to an accuracy."""
    plan = planned(scene, goal, comm)
    generated, any_jump = plan.scene.statement.generated, plan.scene.statement.generated and not plan.adaptive
    made = any_jump or isinstance(plan.scene.mesh, MeshFile) or bool(plan.scene.body and not generated)
    problem = replace(
        meshed_scene(plan.scene, comm, history),
        divide=partial(_divided, plan, comm),
        remake=partial(_remade, plan, comm) if plan.remade else None,
        coarsest=_coarsest_factor(plan.scene),
        polygonal=plan.polygonal,
        in_parts=bool(plan.scene.body),
    ).divided(1)
    if plan.replaced:
        how = "triangles divided where the error is" if plan.adaptive else "all cells smaller"
        history.add(
            f"elements: degree {problem.degree}, {how}; accuracy.refinement = 'uniform' or 'adaptive' keeps those of "
            "the scene"
        )
    return Meshes(problem, goal, comm, adaptive=plan.adaptive, made=made, any_jump=any_jump)


def _coarsest_factor(scene: Scene) -> float:
    """How many times larger the first cells are; the coarse nodes must be nodes of the scene's own mesh.

    A mesh needs a node where a load jumps, and the scene's own mesh has one.
    """
    factor = float(COARSER_START[scene.element.degree]) if scene.statement.generated else 1.0
    while factor > 1 and scene_on(scene_on(scene, factor), 1 / factor) != scene_on(scene, 1.0):
        factor /= 2
    return factor
