"""A scene on a sequence of meshes: the choice of the refinement for a requested accuracy, and the
meshes.

Cells and elements that were found to be cheaper may replace those of the scene; in 3D cells stay.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import log2
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from mpi4py import MPI

from signorini_fx.arrays import Array
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.forms.contact_problem import ProblemOfForms
from signorini_fx.machine import compat
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.mechanics.mesh.bodies import naming
from signorini_fx.mechanics.mesh.refinement import check_divisible, size_fields
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, curvature, generate_mesh, load_file
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.statement.features import divisible
from signorini_fx.mechanics.statement.mesh_sources import MeshFile, MeshGenerator, contact_sizes
from signorini_fx.mechanics.statement.settings import Accuracy, Element, SolverSettings
from signorini_fx.records import History
from signorini_fx.results.accuracy.error_estimates import Errors, estimate_errors
from signorini_fx.results.accuracy.next_accuracy import LOCAL, divides
from signorini_fx.results.certificate.contact_nodes import overclosures_of
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.mesh import load_mesh, scene_on, with_cells_alike, with_halved_bodies
from signorini_fx.scenes.scene import Scene
from signorini_fx.solving.meshed_problem import MeshedProblem, SolvedMesh
from signorini_fx.solving.restart import StoredStates
from signorini_fx.solving.solve_on_mesh import solve_mesh
from signorini_fx.solving.step import Report
from signorini_fx.solving.to_accuracy import Meshes
from signorini_fx.tuned import COARSER_START, SAME_LENGTH

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class Plan:
    """How the mesh of a scene is refined."""

    # the scene with the elements to use; its mesh is a generator, a file all of whose cells are
    # divided, or a mesh of triangles or tetrahedra that are divided
    scene: Scene
    adaptive: bool  # whether cells become smaller where the error is large
    polygonal: bool = False  # whether straight facets stay although the shape may be curved
    geometry: int | None = None  # geometric degree of a file's mesh; None: that of the file
    # whether gmsh remakes the mesh with smaller cells where the error is large; otherwise triangles
    # or tetrahedra are divided
    remade: bool = False


_SOLIDS = {"tetrahedron", "hexahedron"}
# Cells that can be divided, in place of those that cannot.
_SIMPLEX = {
    "quadrilateral": ("quadrilaterals", "triangle"),
    "hexahedron": ("hexahedra", "tetrahedron"),
}


def planned(scene: Scene, goal: Accuracy, comm: MPI.Comm) -> Plan:
    """Return how to refine the mesh of a scene; collective.

    Cells on arcs are not divided: they would converge to the solution on a polygon.
    """
    requested = goal
    if goal.refinement != "uniform" and (plan := _remade(scene, goal, comm)) is not None:
        return plan
    if not divisible(scene.statement, goal.of):
        goal = goal.model_copy(update={"refinement": "uniform"})
    if scene.body:
        if (
            goal.refinement == "auto"
            and goal.of == "energy"
            and (one := _as_one_mesh(scene, comm)) is not None
        ):
            return planned(one, goal, comm)
        return _planned_bodies(scene, requested)
    if isinstance(scene.mesh, MeshGenerator):
        return _planned_generator(scene, goal)
    if isinstance(scene.mesh, MeshFile):
        return _planned_file(scene, scene.mesh, goal, comm)
    return _planned_cells(scene, load_mesh(scene, comm), goal, polygonal=True)


def _planned_cells(scene: Scene, tagged: TaggedMesh, goal: Accuracy, *, polygonal: bool) -> Plan:
    """Return the plan for straight cells: triangles and tetrahedra may be divided where the error
    is large.
    """
    check_divisible(tagged)  # before a long solve on the first mesh
    scene = scene.model_copy(update={"mesh": tagged})
    # Elements of degree 2 are cheaper; in 3D the error of a force on them is not known.
    if goal.refinement == "auto" and tagged.mesh.topology.cell_name() == "triangle":
        scene = _of_triangles(scene)
    elif goal.refinement == "auto" and (tagged.dimension == 2 or goal.of == "energy"):
        scene = _of_degree_2(scene)
    local = _divides(goal, scene, tagged.mesh.topology.cell_name(), straight=True)
    return Plan(scene, local, polygonal=polygonal)


def _remade(scene: Scene, goal: Accuracy, comm: MPI.Comm) -> Plan | None:
    """Return the plan for a mesh that gmsh remakes, or None if it cannot, or if it is one straight
    body, whose cells are better divided; collective.

    Where the choice is left open, generators of plane bodies with arcs and one curved drawing make
    their cells anew, which then are curved.  A force, whose error falls twice as fast, takes fewer
    unknowns by meshes that are all finer, and is known better from them.
    """
    if not scene.statement.remade or (goal.refinement == "auto" and goal.of == "force"):
        return None
    meshes: list[tuple[str, Any]] = [(f" of body {body.name!r}", body.mesh) for body in scene.body]
    several = len(meshes) > 1 or scene.statement.sides[1] is not None
    if goal.refinement == "auto":
        curved = _curved(scene, goal)
        made = all(isinstance(mesh, MeshGenerator) and mesh.sized for mesh in curved.meshes)
        if curved is not scene and made:
            return Plan(curved, adaptive=True, geometry=2, remade=True)
        drawn = isinstance(scene.mesh, MeshFile) and not several and goal.of in LOCAL
        if not drawn or not divisible(scene.statement, goal.of):
            return None
        scene = _of_degree_2(scene)
    for name, mesh in meshes or [("", scene.mesh)]:
        if isinstance(mesh, MeshGenerator) and not mesh.sized:
            if not several:
                return None
            message = f"{mesh.generator!r}{name} can only be refined uniformly: use 'uniform'"
            raise SceneError.at("accuracy.refinement", message)
    if not several and isinstance(scene.mesh, MeshFile):
        tagged = load_mesh(_of_degree_2(scene), comm)
        straight = not curvature(tagged) > SAME_LENGTH * tagged.size
        if straight or (goal.refinement == "auto" and tagged.dimension == 3):
            return None
    return Plan(scene, adaptive=True, geometry=scene.element.degree, remade=True)


def _as_one_mesh(scene: Scene, comm: MPI.Comm) -> Scene | None:
    """Return the scene with several bodies as one mesh of straight triangles, which can be divided;
    None if some have arcs or other cells; collective.
    """
    meshes = scene.meshes
    for number, mesh in enumerate(meshes):
        if isinstance(mesh, MeshGenerator):
            if (triangles := mesh.of_simplices) is None:
                return None
            meshes[number] = triangles
        elif isinstance(mesh, MeshFile) and mesh.drawn:
            return None
    try:
        tagged = load_mesh(scene.with_meshes(meshes), comm)
    except MeshError:  # some bodies have other cells
        return None
    straight = not curvature(tagged) > SAME_LENGTH * tagged.size
    return (
        scene_with(scene, tagged)
        if straight and tagged.mesh.topology.cell_name() == "triangle"
        else None
    )


def scene_with(scene: Scene, tagged: TaggedMesh) -> Scene:
    """Return the scene with this mesh, which has the cells of all bodies."""
    if not scene.body:
        return scene.model_copy(update={"mesh": tagged})
    contacts = tuple(contact.model_copy(update={"contact_size": None}) for contact in scene.contact)
    return scene.model_copy(update={"mesh": tagged, "body": (), "contact": contacts})


def _planned_bodies(scene: Scene, goal: Accuracy) -> Plan:
    """Return the plan for several bodies: all cells are refined together; meshes of generators with
    arcs may be curved as for one body.
    """
    for number, body in enumerate(scene.body):
        if isinstance(body.mesh, TaggedMesh):
            with naming(number, body):
                check_divisible(body.mesh)
    polygonal = not all(
        isinstance(mesh, MeshGenerator) or getattr(mesh, "drawn", False) for mesh in scene.meshes
    )
    return Plan(_curved(scene, goal), adaptive=False, polygonal=polygonal)


def _curved(scene: Scene, goal: Accuracy) -> Scene:
    """Return the 2D scene with elements of degree 2, and such cells on arcs, if generators make all
    meshes, some with arcs; otherwise the scene itself.
    """
    flat = [
        mesh
        for mesh in scene.meshes
        if isinstance(mesh, MeshGenerator) and _SOLIDS.isdisjoint(mesh.cells[:1])
    ]
    curved = [mesh.curved for mesh in flat]
    if goal.refinement != "auto" or len(flat) < len(scene.meshes) or not any(curved):
        return scene
    meshes = [arcs or mesh for arcs, mesh in zip(curved, flat, strict=True)]
    return _of_degree_2(scene).with_meshes(meshes)


def _divides(goal: Accuracy, scene: Scene, cell: str, *, straight: bool) -> bool:
    """Return whether cells are divided where the error is large: if the scene requires it, or if it
    is possible and the choice is left open.
    """
    able = goal.refinement == "auto" and divides(scene.statement, goal.of, cell, straight=straight)
    return goal.refinement == "adaptive" or able


def _of_degree_2(scene: Scene) -> Scene:
    return scene.model_copy(update={"element": scene.element.model_copy(update={"degree": 2})})


def _of_triangles(scene: Scene) -> Scene:
    """Return the 2D scene with elements of degree 2 for triangles.

    Their pressure is an unknown where ``auto`` would reduce it to a constant in each triangle,
    whose error falls no faster than with degree 1, and where nothing refuses that.
    """
    if scene.element.volumetric == "auto" and any(material.locks for material in scene.material):
        with suppress(SceneError):
            return scene.remade(element=Element(degree=2, volumetric="mixed"))
    return _of_degree_2(scene)


def _planned_generator(scene: Scene, goal: Accuracy) -> Plan:
    assert isinstance(scene.mesh, MeshGenerator)
    triangles = scene.mesh.of_simplices
    cell = next(iter(scene.mesh.cells), None)
    if cell in _SIMPLEX and goal.refinement == "adaptive":
        several, simplex = _SIMPLEX[cell]
        message = (
            f"{several} cannot be divided one by one and stay conforming: use cell = "
            f"'{simplex}', or 'uniform'"
        )
        raise SceneError.at("accuracy.refinement", message)
    if goal.refinement == "adaptive" and triangles is None:
        message = (
            f"the arcs of {scene.mesh.generator} would stay the polygon that they are on "
            "the first mesh: use 'uniform'"
        )
        raise SceneError.at("accuracy.refinement", message)
    if cell in _SOLIDS:
        local = _divides(goal, scene, cell, straight=triangles is not None)
        takes = local and goal.refinement == "auto" and goal.of == "energy"
        return Plan(_of_degree_2(scene) if takes else scene, local)
    if triangles is None:  # with arcs: cells of degree 2, all refined
        return Plan(_curved(scene, goal), adaptive=False)
    if goal.refinement != "auto":
        return Plan(scene, goal.refinement == "adaptive")
    return Plan(_of_triangles(scene).with_meshes([triangles]), adaptive=True)


def _planned_file(scene: Scene, file: MeshFile, goal: Accuracy, comm: MPI.Comm) -> Plan:
    """Return the plan for the mesh of a file; collective.

    Curved sides must stay curved, so all of their cells are divided: dolfinx bisects straight cells
    only.
    """
    drawn = file.drawn
    sizes = contact_sizes(scene)
    tagged = load_file(file, comm, 0, 2 if drawn else None, sizes)
    curved = curvature(tagged) > SAME_LENGTH * tagged.size
    degree = compat.geometry_degree(tagged.mesh)
    better = tagged.dimension == 2 and goal.refinement == "auto"
    if _divides(goal, scene, tagged.mesh.topology.cell_name(), straight=not curved):
        if curved:
            message = (
                "cells with curved sides cannot be divided one by one: dolfinx bisects straight "
                "ones only, and these "
                "would stay the polygon that they are; use 'uniform'"
            )
            raise SceneError.at("accuracy.refinement", message)
        straight = load_file(file, comm, degree=1, sizes=sizes)
        return _planned_cells(scene, straight, goal, polygonal=not drawn and degree == 1)
    planned_scene = _of_degree_2(scene) if better else scene
    geometry = (
        (2 if curved and planned_scene.element.degree == 2 else 1) if drawn or not curved else None
    )
    return Plan(
        planned_scene, adaptive=False, polygonal=not drawn and degree == 1, geometry=geometry
    )


# --- on each mesh ---------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class MeshedScene(MeshedProblem):
    """A scene on one mesh of a sequence.

    Attributes:
        scene: the scene on this mesh.
        plan: how it is refined for an accuracy; None: it is not.
    """

    scene: Scene
    plan: Plan | None = None

    @property
    def augmentable(self) -> bool:
        return self.scene.statement.sides[1] is None and not overclosures_of(self.scene.contact)

    @property
    def settings(self) -> SolverSettings:
        return self.scene.solver

    def with_settings(self, settings: SolverSettings) -> Self:
        return replace(self, scene=self.scene.model_copy(update={"solver": settings}))

    def solve(
        self, state: ContactState | None, coarser: MeshLevel | None, checkpoint: StoredStates | None
    ) -> SolvedMesh:
        scene = self.scene
        step_errors = list[Errors]()
        if scene.statement.nonlinear:
            from signorini_fx.scenes.nonlinear import build_problem

            problem = build_problem(scene, self.comm, self.history)
            solution = problem.solved(checkpoint)
            step_errors = _errors_of_nonlinear(problem, solution)
            return SolvedMesh(solution, solution.model.tagged, None, step_errors=step_errors)

        def estimate(report: Report) -> None:
            model = report.mechanics.model
            outcome = report.outcome
            result = report.result
            if result.contact is None or result.strain_energy is None:
                return
            table = contact_table(result.contact, *model.statement.sides)
            displacement = model.function(outcome.displacement())
            step_errors.append(
                estimate_errors(
                    report.mechanics, displacement, result.strain_energy, table, result.place
                )
            )

        load = partial(load_mesh, scene, self.comm)
        statement = scene.statement
        if self.plan is not None and self.plan.remade:  # the next accuracy remakes it, too
            generated = self.plan.scene.statement.generated
            statement = replace(statement, generated=generated, remade=True)
        solution, task, outcome = solve_mesh(
            statement, load, self.history, state, estimate, coarser, checkpoint
        )
        return SolvedMesh(solution, solution.model.tagged, task, outcome, step_errors=step_errors)

    def keeping(self, solved: SolvedMesh) -> Self:
        """Return the scene with the contact points of pairs on the sides that the first mesh has
        chosen, so that forces keep their sign.
        """
        if solved.solution.statement.sides[1] is None:
            return self
        contacts = [
            model if model.against is None else model.model_copy(update={"points": "boundary"})
            for model in solved.solution.model.contacts
        ]
        return replace(self, scene=self.scene.model_copy(update={"contact": tuple(contacts)}))

    def on(self, tagged: TaggedMesh) -> Self:
        return replace(self, scene=scene_with(self.scene, tagged))

    def divided(self, times: int) -> Self:
        assert self.plan is not None
        last = self.scene
        scene = self.plan.scene
        halvings = round(log2(times))
        if isinstance(scene.mesh, MeshFile):
            return self.on(
                load_file(scene.mesh, self.comm, halvings, self.plan.geometry, contact_sizes(scene))
            )
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

    def remade(self, last: TaggedMesh, lengths: Array, finer: float) -> tuple[Self, int]:
        assert self.plan is not None
        dim = last.dimension
        first = with_cells_alike(self.plan.scene, last.mesh.comm)
        made = list[TaggedMesh]()
        parts = [last.cells(body.name) for body in first.body] or [
            np.arange(len(lengths), dtype=np.int32)
        ]
        for number, field in enumerate(size_fields(last, lengths, parts, finer)):
            table: Any = first.mesh
            if first.body:
                body = first.body[number]
                table = first.body[number].mesh
                field = replace(field, points=body.moved_back(field.points))
            if isinstance(table, MeshGenerator):
                made.append(generate_mesh(table.generator, table.parameters, self.comm, field))
            else:
                made.append(
                    load_file(
                        table, self.comm, 0, 2 if self.scene.element.degree == 2 else None, field
                    )
                )
        count = sum(tagged.mesh.topology.index_map(dim).size_global for tagged in made)
        if not first.body:
            return self.on(made[0]), count
        bodies = tuple(
            body.model_copy(update={"mesh": tagged})
            for body, tagged in zip(first.body, made, strict=True)
        )
        return replace(self, scene=self.scene.model_copy(update={"body": bodies})), count


def _errors_of_nonlinear(problem: ProblemOfForms, solution: Solution) -> list[Errors]:
    """Return the error estimates after the last load step.

    Without those of contact if cells lock: there they were up to 30 times too small.
    """
    from signorini_fx.mechanics.body.nonlinear_law import volume_degree

    if not solution.converged or isinstance(solution.error_shares, str):
        return []
    errors = problem.errors_of(solution)
    statement = solution.statement
    nearly = any(material.locks for material in statement.material)
    locking = nearly and volume_degree(statement, solution.model.tagged) is None
    return [replace(errors, pressure=None) if locking else errors]


def meshes_of(scene: Scene, goal: Accuracy, comm: MPI.Comm, history: History) -> Meshes:
    """Return the sequence of meshes of a scene for an accuracy; collective."""
    plan = planned(scene, goal, comm)
    generated = plan.scene.statement.generated
    any_jump = plan.scene.statement.generated and not plan.adaptive
    made = (
        any_jump or isinstance(plan.scene.mesh, MeshFile) or bool(plan.scene.body and not generated)
    )
    # How many times larger the first cells are: coarse nodes coincide with nodes of the scene's
    # mesh, for example where a load jumps.
    first = float(COARSER_START[plan.scene.element.degree])
    problem = MeshedScene(
        comm=comm,
        history=history,
        scene=plan.scene,
        plan=plan,
        coarsest=min(mesh.coarsest(first) for mesh in plan.scene.meshes) if generated else 1.0,
        polygonal=plan.polygonal,
        remakes=plan.remade,
        in_parts=bool(plan.scene.body),
    ).divided(1)
    cells_differ = isinstance(plan.scene.mesh, MeshGenerator) and plan.scene.mesh != scene.mesh
    if cells_differ or (plan.scene.element, plan.scene.body) != (scene.element, scene.body):
        how = "all cells smaller"
        if plan.adaptive:
            how = f"{'cells made anew' if plan.remade else 'triangles divided'} where the error is"
        kept = "accuracy.refinement = 'uniform' or 'adaptive' keeps those of the scene"
        history.add(f"elements: degree {plan.scene.element.degree}, {how}; {kept}")
    return Meshes(problem, goal, adaptive=plan.adaptive, made=made, any_jump=any_jump)
