"""A scene on one mesh after the other, see ``MeshedProblem``."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import partial
from math import log2
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.mechanics.body.contact_state import ContactState
from signorini_fx.mechanics.body.contact_table import contact_table
from signorini_fx.mechanics.body.mesh_levels import MeshLevel
from signorini_fx.mechanics.mesh.files.size_field import SizeField
from signorini_fx.mechanics.mesh.remeshing import moved_back, size_fields
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh, load_file
from signorini_fx.mechanics.statement.contact_sizes import contact_sizes
from signorini_fx.mechanics.statement.mesh_sources import MeshFile, MeshGenerator
from signorini_fx.mechanics.statement.rigid_shape import turning
from signorini_fx.mechanics.statement.settings import Accuracy, SolverSettings
from signorini_fx.records import History
from signorini_fx.results.accuracy.error_estimates import Errors, estimate_errors
from signorini_fx.results.accuracy.level_results import compliance_of
from signorini_fx.results.accuracy.mesh_level import LevelResult
from signorini_fx.results.accuracy.pressure_error import polygon_error
from signorini_fx.results.checkpoint import Checkpoint
from signorini_fx.scenes.hierarchy import scene_on, with_halved_bodies
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.plan import Plan, planned
from signorini_fx.scenes.scene import Scene
from signorini_fx.solving.finer_meshes import Meshes
from signorini_fx.solving.meshed_problem import SolvedMesh, measured
from signorini_fx.solving.one_mesh import solve_mesh
from signorini_fx.solving.restart import MeshCheckpoint
from signorini_fx.solving.stepped_body import LoadStep
from signorini_fx.tuned import COARSER_START


@dataclass(frozen=True)
class SceneMesh:
    """A scene on one of several meshes.

    Attributes:
        scene: with this mesh.
        comm: the ranks that share the work.
        history: of all meshes.
        stored: the checkpoint; None: there is none.
        plan: how the mesh is refined for a requested accuracy; None: it is not.
        coarsest: how many times larger than those of the plan's scene the cells of the first mesh are.
        shown: whether somebody may look at the result; else nothing is said about the scene on this mesh.
    """

    scene: Scene
    comm: MPI.Comm
    history: History
    stored: Checkpoint | None = None
    plan: Plan | None = None
    coarsest: float = 1.0
    shown: bool = True

    @property
    def settings(self) -> SolverSettings:
        """Of the scene."""
        return self.scene.solver

    @property
    def degree(self) -> int:
        """Of the displacement."""
        return int(self.scene.element.degree)

    @property
    def paired(self) -> bool:
        """Whether two bodies are in contact."""
        return self.scene.statement.sides[1] is not None

    @property
    def may_begin_finer(self) -> bool:
        """Whether the first mesh is coarser than the scene's own, from a generator."""
        return self.scene.statement.generated and self.coarsest > 1

    def with_settings(self, settings: SolverSettings) -> SceneMesh:
        """See ``MeshedProblem``."""
        return replace(self, scene=self.scene.model_copy(update={"solver": settings}))

    def beginning_finer(self) -> SceneMesh:
        """See ``MeshedProblem``."""
        return replace(self, coarsest=self.coarsest / 2).divided(1)

    def keeping(self, solved: SolvedMesh) -> SceneMesh:
        """Leave the contact points of pairs on the sides that were chosen on the first mesh: forces have their sign."""
        if solved.solution.statement.sides[1] is None:
            return self
        contacts = [
            model if model.against is None else model.model_copy(update={"points": "boundary"})
            for model in solved.solution.statement.contact
        ]
        return replace(self, scene=self.scene.model_copy(update={"contact": tuple(contacts)}))

    def divided(self, times: int) -> SceneMesh:
        """See ``MeshedProblem``."""
        assert self.plan is not None
        scene, halvings = self.plan.scene, round(log2(times))
        if isinstance(scene.mesh, MeshFile):
            names = (scene.statement.sections, scene.statement.touching)
            return self.on(load_file(scene.mesh, self.comm, halvings, self.plan.geometry, *names, contact_sizes(scene)))
        if scene.statement.generated:
            scene = scene_on(scene, self.coarsest / times)
        elif scene.body:
            scene = with_halved_bodies(scene, halvings, self.comm)
        contacts = tuple(
            contact.model_copy(update={"contact_size": finer.contact_size})
            for contact, finer in zip(self.scene.contact, scene.contact, strict=True)
        )
        update = {"mesh": scene.mesh, "body": scene.body, "contact": contacts}
        return replace(self, scene=self.scene.model_copy(update=update))

    def remade(self, last: TaggedMesh, lengths: npt.NDArray[np.float64], finer: float) -> tuple[SceneMesh, int]:
        """The same on cells that gmsh makes anew, and how many there are; collective.

        Args:
            last: the mesh before.
            lengths: of the cells that take the place of each of its owned cells, shape (cells,).
            finer: how many times finer, on average over the body, the mesh may become.

        Raises:
            MeshError: gmsh cannot make them.
        """
        assert self.plan is not None
        scene, dim = self.plan.scene, last.dimension
        if not scene.body:
            (field,) = size_fields(last, lengths, [np.arange(len(lengths), dtype=np.int32)], finer)
            tagged = self._with_lengths(scene.mesh, field, scene.statement.sections)
            return self.on(tagged), tagged.mesh.topology.index_map(dim).size_global
        bodies, count = [], 0
        fields = size_fields(last, lengths, [last.cells(body.name) for body in scene.body], finer)
        for body, of_body in zip(scene.body, fields, strict=True):
            pivot, shift = (np.array(vector or (0.0,) * dim) for vector in (body.pivot, body.shift))
            turned = np.eye(dim) if body.rotation is None else turning(body.rotation, dim)
            field = moved_back(of_body, turned, pivot, shift)
            tagged = self._with_lengths(body.mesh, field, scene.sections_of(body.name))
            count += tagged.mesh.topology.index_map(dim).size_global
            bodies.append(body.model_copy(update={"mesh": tagged}))
        return replace(self, scene=self.scene.model_copy(update={"body": tuple(bodies)})), count

    def _with_lengths(self, mesh: Any, field: SizeField, sections: Collection[str]) -> TaggedMesh:
        """The cells of a table ``mesh``, of these lengths."""
        if isinstance(mesh, MeshGenerator):
            return generate_mesh(mesh.generator, mesh.parameters, self.comm, field)
        curved = 2 if self.degree == 2 else None
        return load_file(mesh, self.comm, 0, curved, sections, self.scene.statement.touching, field)

    def on(self, tagged: TaggedMesh) -> SceneMesh:
        """See ``MeshedProblem``."""
        return replace(self, scene=self.scene.model_copy(update={"mesh": tagged}))

    def polygon_error(self, level: LevelResult, last: float | None) -> float:
        """See ``MeshedProblem``; with several bodies, some may be made anew on true arcs."""
        if self.plan is None or not self.plan.polygonal:
            return 0.0
        if last is not None and not self.scene.body:
            return last
        return polygon_error(level.table, max(material.plane_modulus for material in self.scene.material))

    def solved(self, number: int, state: ContactState | None, coarser: MeshLevel | None) -> SolvedMesh:
        """See ``MeshedProblem``."""

        def solve(step_errors: list[Errors]) -> SolvedMesh:
            def estimate(step: LoadStep) -> None:
                d, outcome, result = step.body.model, step.outcome, step.result
                if result.contact is None:
                    return
                table = contact_table(result.contact, *d.statement.sides)
                displacement, compliance = d.function(outcome.displacement()), compliance_of(outcome, self.comm)
                errors = estimate_errors(d, displacement, result.strain_energy, table, result.place, compliance)
                step_errors.append(errors)

            checkpoint = None if self.stored is None else MeshCheckpoint(self.stored, number)
            solution, task, outcome = solve_mesh(
                self.scene.statement,
                partial(load_mesh, self.scene, self.comm),
                self.history,
                state,
                estimate,
                coarser,
                checkpoint,
                with_findings=self.shown,
            )
            d = solution.model
            return SolvedMesh(solution, d.tagged, d, task, outcome, solution.statement.sides)

        return measured(number, self.history, self.comm, solve)


def meshes_of(scene: Scene, goal: Accuracy, comm: MPI.Comm, history: History) -> Meshes:
    """The meshes of a scene on the way to an accuracy.

    Raises:
        SceneError: see ``planned``.
        MeshError: the mesh cannot be refined.
    """
    plan = planned(scene, goal, comm)
    generated, any_jump = plan.scene.statement.generated, plan.scene.statement.generated and not plan.adaptive
    made = any_jump or isinstance(plan.scene.mesh, MeshFile) or bool(plan.scene.body and not generated)
    problem = SceneMesh(plan.scene, comm, history, None, plan, _coarsest_factor(plan.scene)).divided(1)
    if plan.replaced:
        how = "triangles divided where the error is" if plan.adaptive else "all cells smaller"
        history.add(
            f"elements: degree {problem.degree}, {how}; accuracy.refinement = 'uniform' or 'adaptive' keeps those of "
            "the scene"
        )
    remake = SceneMesh.remade if plan.remade else None
    return Meshes(problem, goal, comm, adaptive=plan.adaptive, made=made, any_jump=any_jump, remake=remake)


def _coarsest_factor(scene: Scene) -> float:
    """How many times larger the first cells are; the coarse nodes must be nodes of the scene's own mesh.

    A mesh needs a node where a load jumps, and the scene's own mesh has one.
    """
    factor = float(COARSER_START[scene.element.degree]) if scene.statement.generated else 1.0
    while factor > 1 and scene_on(scene_on(scene, factor), 1 / factor) != scene_on(scene, 1.0):
        factor /= 2
    return factor
