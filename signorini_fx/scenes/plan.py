"""How the mesh of a scene is refined for a requested accuracy: where, with which cells and which elements.

Cells and elements that were found to be cheaper may take the place of the scene's; in 3D cells stay.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import compat
from signorini_fx.mechanics.mesh.bodies import naming
from signorini_fx.mechanics.mesh.refinement import check_divisible
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, curvature, load_file
from signorini_fx.mechanics.statement.features import divisible
from signorini_fx.mechanics.statement.mesh_sources import MeshFile, MeshGenerator, contact_sizes
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.results.accuracy.next_accuracy import LOCAL, divides
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.scene import Scene
from signorini_fx.tuned import SAME_LENGTH


@dataclass(frozen=True)
class Plan:
    """How a scene is refined."""

    # with the elements that are to be used; its mesh comes from a generator, from a file all of whose cells are
    # divided, or consists of triangles or tetrahedra that are divided
    scene: Scene
    adaptive: bool  # whether cells become smaller where the error is large
    polygonal: bool = False  # whether straight facets stay although the shape may be curved
    geometry: int | None = None  # degree of the geometry of a file's mesh; None: as the file has it
    # whether gmsh makes the cells anew where the error is large; else triangles or tetrahedra are divided
    remade: bool = False


_SOLIDS = {"tetrahedron", "hexahedron"}
# What can be divided in place of cells that cannot.
_SIMPLEX = {"quadrilateral": ("quadrilaterals", "triangle"), "hexahedron": ("hexahedra", "tetrahedron")}


def planned(scene: Scene, goal: Accuracy, comm: MPI.Comm) -> Plan:
    """How to refine the mesh of a scene; cells on arcs are not divided: they would converge to that on a polygon."""
    requested = goal
    if goal.refinement == "adaptive" and (plan := _remade(scene, comm)) is not None:
        return plan
    if not divisible(scene.statement, goal.of):
        goal = goal.model_copy(update={"refinement": "uniform"})
    if scene.body:
        if goal.refinement == "auto" and goal.of == "energy" and (one := _as_one_mesh(scene, comm)) is not None:
            return planned(one, goal, comm)
        return _planned_bodies(scene, requested)
    if isinstance(scene.mesh, MeshGenerator):
        return _planned_generator(scene, goal)
    if isinstance(scene.mesh, MeshFile):
        return _planned_file(scene, scene.mesh, goal, comm)
    return _planned_cells(scene, load_mesh(scene, comm), goal, polygonal=True)


def _planned_cells(scene: Scene, tagged: TaggedMesh, goal: Accuracy, *, polygonal: bool) -> Plan:
    """Straight cells are divided, where the error is if they are triangles or tetrahedra."""
    check_divisible(tagged)  # before hours are spent on the first mesh
    scene = scene.model_copy(update={"mesh": tagged})
    # Elements of degree 2 are cheaper; in 3D the error of a force on them is not known.
    takes = goal.refinement == "auto" and goal.of in (LOCAL if tagged.dimension == 2 else ("energy",))
    local = _divides(goal, scene, tagged.mesh.topology.cell_name(), straight=True)
    return Plan(_of_degree_2(scene) if takes else scene, local, polygonal=polygonal)


def _remade(scene: Scene, comm: MPI.Comm) -> Plan | None:
    """The plan for cells that gmsh makes anew; None: of one straight body divided ones change less."""
    if not scene.statement.remade:
        return None
    meshes: list[tuple[str, Any]] = [(f" of body {body.name!r}", body.mesh) for body in scene.body]
    several = len(meshes) > 1 or scene.statement.sides[1] is not None
    for name, mesh in meshes or [("", scene.mesh)]:
        if isinstance(mesh, MeshGenerator) and not mesh.sized:
            if not several:
                return None
            message = f"the cells of {mesh.generator!r}{name} are all alike, and are made smaller together"
            raise SceneError([("accuracy.refinement", f"{message}: use 'uniform'")])
    if not several and isinstance(scene.mesh, MeshFile):
        tagged = load_mesh(scene.model_copy(update={"element": scene.element.model_copy(update={"degree": 2})}), comm)
        if not curvature(tagged) > SAME_LENGTH * tagged.size:
            return None
    return Plan(scene, adaptive=True, geometry=scene.element.degree, remade=True)


def _as_one_mesh(scene: Scene, comm: MPI.Comm) -> Scene | None:
    """Several bodies as one mesh of straight triangles that can be divided; None: some have arcs or other cells."""
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
    except MeshError:  # some have other cells
        return None
    straight = not curvature(tagged) > SAME_LENGTH * tagged.size
    return scene_with(scene, tagged) if straight and tagged.mesh.topology.cell_name() == "triangle" else None


def scene_with(scene: Scene, tagged: TaggedMesh) -> Scene:
    """The scene on other cells, of several bodies on those of all of them."""
    if not scene.body:
        return scene.model_copy(update={"mesh": tagged})
    contacts = tuple(contact.model_copy(update={"contact_size": None}) for contact in scene.contact)
    return scene.model_copy(update={"mesh": tagged, "body": (), "contact": contacts})


def _planned_bodies(scene: Scene, goal: Accuracy) -> Plan:
    """All cells of all bodies become smaller together; those of generators with arcs are as for one body."""
    for number, body in enumerate(scene.body):
        if isinstance(body.mesh, TaggedMesh):
            with naming(number, body):
                check_divisible(body.mesh)
    polygonal = not all(isinstance(mesh, MeshGenerator) or getattr(mesh, "drawn", False) for mesh in scene.meshes)
    return Plan(_curved(scene, goal), adaptive=False, polygonal=polygonal)


def _curved(scene: Scene, goal: Accuracy) -> Scene:
    """In 2D with elements and cells of degree 2, if generators with arcs make all meshes; else as it is."""
    if goal.refinement != "auto" or goal.of not in LOCAL:
        return scene
    flat = [mesh for mesh in scene.meshes if isinstance(mesh, MeshGenerator) and _SOLIDS.isdisjoint(mesh.cells[:1])]
    curved = [mesh.curved for mesh in flat if mesh.curved is not None]
    return _of_degree_2(scene).with_meshes(curved) if len(curved) == len(scene.meshes) else scene


def _divides(goal: Accuracy, scene: Scene, cell: str, *, straight: bool) -> bool:
    """Whether cells are divided where the error is: if that is asked for, or may be chosen and is possible."""
    able = goal.refinement == "auto" and divides(scene.statement, goal.of, cell, straight=straight)
    return goal.refinement == "adaptive" or able


def _of_degree_2(scene: Scene) -> Scene:
    return scene.model_copy(update={"element": scene.element.model_copy(update={"degree": 2})})


def _planned_generator(scene: Scene, goal: Accuracy) -> Plan:
    assert isinstance(scene.mesh, MeshGenerator)
    triangles, cell = scene.mesh.of_simplices, next(iter(scene.mesh.cells), None)
    if cell in _SIMPLEX and goal.refinement == "adaptive":
        several, simplex = _SIMPLEX[cell]
        message = f"{several} cannot be divided one by one and stay conforming: use cell = '{simplex}', or 'uniform'"
        raise SceneError([("accuracy.refinement", message)])
    if goal.refinement == "adaptive" and triangles is None:
        message = (
            f"the arcs of {scene.mesh.generator} would stay the polygon that they are on the first mesh: use 'uniform'"
        )
        raise SceneError([("accuracy.refinement", message)])
    if cell in _SOLIDS:
        local = _divides(goal, scene, cell, straight=triangles is not None)
        takes = local and goal.refinement == "auto" and goal.of == "energy"
        return Plan(_of_degree_2(scene) if takes else scene, local)
    if triangles is None:  # arcs, with cells of degree 2 on them, and all of them smaller
        return Plan(_curved(scene, goal), adaptive=False)
    if goal.refinement != "auto" or goal.of not in LOCAL:
        return Plan(scene, goal.refinement == "adaptive")
    return Plan(_of_degree_2(scene).with_meshes([triangles]), adaptive=True)


def _planned_file(scene: Scene, file: MeshFile, goal: Accuracy, comm: MPI.Comm) -> Plan:
    """Curved sides stay curved: all cells are divided then, because dolfinx bisects straight ones only."""
    drawn, sizes = file.drawn, contact_sizes(scene)
    tagged = load_file(file, comm, 0, 2 if drawn else None, sizes)
    curved = curvature(tagged) > SAME_LENGTH * tagged.size
    degree = compat.geometry_degree(tagged.mesh)
    better = tagged.dimension == 2 and goal.refinement == "auto" and (goal.of in LOCAL or curved)
    if _divides(goal, scene, tagged.mesh.topology.cell_name(), straight=not curved):
        if curved:
            message = (
                "cells with curved sides cannot be divided one by one: dolfinx bisects straight ones only, and these "
                "would stay the polygon that they are; use 'uniform'"
            )
            raise SceneError([("accuracy.refinement", message)])
        straight = load_file(file, comm, degree=1, sizes=sizes)
        return _planned_cells(scene, straight, goal, polygonal=not drawn and degree == 1)
    planned_scene = _of_degree_2(scene) if better else scene
    geometry = (2 if curved and planned_scene.element.degree == 2 else 1) if drawn or not curved else None
    return Plan(planned_scene, adaptive=False, polygonal=not drawn and degree == 1, geometry=geometry)
