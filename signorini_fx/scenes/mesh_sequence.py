"""A scene on one mesh after the other: how its model is made on each, and how meshes are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from math import log2
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.mechanics.mesh.refinement import size_fields
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh, load_file
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.statement.mesh_sources import MeshFile, MeshGenerator, contact_sizes
from signorini_fx.mechanics.statement.settings import Accuracy, SolverSettings
from signorini_fx.records import History
from signorini_fx.results.accuracy.error_estimates import Errors, combined, estimate_errors
from signorini_fx.results.certificate.law_of_method import overclosures_of
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.mesh import load_mesh, scene_on, with_cells_alike, with_halved_bodies
from signorini_fx.scenes.plan import Plan, planned, scene_with
from signorini_fx.scenes.scene import Scene
from signorini_fx.solving.checkpointed_steps import MeshCheckpoint
from signorini_fx.solving.load_steps import LoadStep
from signorini_fx.solving.meshed_problem import MeshedProblem, SolvedMesh
from signorini_fx.solving.solve_on_mesh import solve_mesh
from signorini_fx.solving.to_accuracy import Meshes
from signorini_fx.tuned import COARSER_START


@dataclass(frozen=True, kw_only=True)
class MeshedScene(MeshedProblem):
    """A scene on one of several meshes; ``plan``: how it is refined for an accuracy."""

    scene: Scene
    plan: Plan | None = None

    @property
    def augmentable(self) -> bool:
        return self.scene.statement.sides[1] is None and not overclosures_of(self.scene.statement)

    @property
    def settings(self) -> SolverSettings:
        return self.scene.solver

    def with_settings(self, settings: SolverSettings) -> Self:
        return replace(self, scene=self.scene.model_copy(update={"solver": settings}))

    def solve(
        self, state: ContactState | None, coarser: MeshLevel | None, checkpoint: MeshCheckpoint | None
    ) -> tuple[SolvedMesh, list[Errors]]:
        scene, step_errors = self.scene, list[Errors]()
        if scene.statement.nonlinear:
            from signorini_fx.scenes.nonlinear import problem_of

            solution = problem_of(scene, self.comm, self.history).solved(checkpoint)
            return SolvedMesh(solution, solution.model.tagged, None), _errors_of_nonlinear(solution)

        def estimate(step: LoadStep) -> None:
            model, outcome, result = step.body.model, step.outcome, step.result
            if result.contact is None or result.strain_energy is None:
                return
            table = contact_table(result.contact, *model.statement.sides)
            displacement = model.function(outcome.displacement())
            step_errors.append(estimate_errors(model, displacement, result.strain_energy, table, result.place))

        load = partial(load_mesh, scene, self.comm)
        solution, task, outcome = solve_mesh(scene.statement, load, self.history, state, estimate, coarser, checkpoint)
        return SolvedMesh(solution, solution.model.tagged, task, outcome), step_errors

    def keeping(self, solved: SolvedMesh) -> Self:
        """The contact points of pairs stay on the sides that were chosen on the first mesh: forces have their sign."""
        if solved.solution.statement.sides[1] is None:
            return self
        contacts = [
            model if model.against is None else model.model_copy(update={"points": "boundary"})
            for model in solved.solution.statement.contact
        ]
        return replace(self, scene=self.scene.model_copy(update={"contact": tuple(contacts)}))

    def on(self, tagged: TaggedMesh) -> Self:
        return replace(self, scene=scene_with(self.scene, tagged))

    def divided(self, times: int) -> Self:
        assert self.plan is not None
        last, scene, halvings = self.scene, self.plan.scene, round(log2(times))
        if isinstance(scene.mesh, MeshFile):
            return self.on(load_file(scene.mesh, self.comm, halvings, self.plan.geometry, contact_sizes(scene)))
        if scene.statement.generated:
            scene = scene_on(scene, self.coarsest / times)
        elif scene.body:
            scene = with_halved_bodies(scene, halvings, self.comm)
        contacts = tuple(
            contact.model_copy(update={"contact_size": finer.contact_size})
            for contact, finer in zip(last.contact, scene.contact, strict=True)
        )
        update = {"mesh": scene.mesh, "body": scene.body, "contact": contacts}
        return replace(self, scene=last.model_copy(update=update))

    def remade(self, last: TaggedMesh, lengths: npt.NDArray[np.float64], finer: float) -> tuple[Self, int]:
        assert self.plan is not None
        dim, first, made = last.dimension, with_cells_alike(self.plan.scene), list[TaggedMesh]()
        parts = [last.cells(body.name) for body in first.body] or [np.arange(len(lengths), dtype=np.int32)]
        for number, field in enumerate(size_fields(last, lengths, parts, finer)):
            table: Any = first.mesh
            if first.body:
                body, table = first.body[number], first.body[number].mesh
                field = replace(field, points=body.moved_back(field.points))
            if isinstance(table, MeshGenerator):
                made.append(generate_mesh(table.generator, table.parameters, self.comm, field))
            else:
                made.append(load_file(table, self.comm, 0, 2 if self.scene.element.degree == 2 else None, field))
        count = sum(tagged.mesh.topology.index_map(dim).size_global for tagged in made)
        if not first.body:
            return self.on(made[0]), count
        bodies = tuple(body.model_copy(update={"mesh": tagged}) for body, tagged in zip(first.body, made, strict=True))
        return replace(self, scene=self.scene.model_copy(update={"body": bodies})), count


def _errors_of_nonlinear(solution: Solution) -> list[Errors]:
    """Those after the last load step, of contact none where cells lock: estimates were up to 30 times too small."""
    from signorini_fx.mechanics.body.nonlinear_law import volume_degree

    if not solution.converged or isinstance(shares := solution.error_shares, str):
        return []
    errors, statement = combined(solution.model, solution.table, shares, 0.5), solution.statement
    nearly = any(material.locks for material in statement.material)
    locking = nearly and volume_degree(statement, solution.model.tagged) is None
    return [replace(errors, pressure=None) if locking else errors]


def meshes_of(scene: Scene, goal: Accuracy, comm: MPI.Comm, history: History) -> Meshes:
    """The meshes of a scene on the way to an accuracy."""
    plan = planned(scene, goal, comm)
    generated, any_jump = plan.scene.statement.generated, plan.scene.statement.generated and not plan.adaptive
    made = any_jump or isinstance(plan.scene.mesh, MeshFile) or bool(plan.scene.body and not generated)
    problem = MeshedScene(
        comm=comm,
        history=history,
        scene=plan.scene,
        plan=plan,
        coarsest=_coarsest_factor(plan.scene),
        polygonal=plan.polygonal,
        remakes=plan.remade,
        in_parts=bool(plan.scene.body),
    ).divided(1)
    cells_differ = isinstance(plan.scene.mesh, MeshGenerator) and plan.scene.mesh != scene.mesh
    if cells_differ or (plan.scene.element, plan.scene.body) != (scene.element, scene.body):
        how = "triangles divided where the error is" if plan.adaptive else "all cells smaller"
        kept = "accuracy.refinement = 'uniform' or 'adaptive' keeps those of the scene"
        history.add(f"elements: degree {plan.scene.element.degree}, {how}; {kept}")
    return Meshes(problem, goal, adaptive=plan.adaptive, made=made, any_jump=any_jump)


def _coarsest_factor(scene: Scene) -> float:
    """How many times larger the first cells are; coarse nodes are nodes of the scene's mesh, as where a load jumps."""
    if not scene.statement.generated:
        return 1.0
    return min(mesh.coarsest(float(COARSER_START[scene.element.degree])) for mesh in scene.meshes)
