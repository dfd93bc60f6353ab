"""A scene on other meshes, with other elements and settings than it states, as studies of accuracy solve it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

from mpi4py import MPI

from signorini_fx.mechanics.mesh.tagged import TaggedMesh, simplex_parameters
from signorini_fx.mechanics.statement.mesh_sources import MeshGenerator
from signorini_fx.mechanics.statement.settings import Accuracy, SolverSettings
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.hierarchy import scene_on
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve

# How many times as large as stated its cells are, or a mesh; an element, P1, Q1, P2 or Q2; how it is solved, with the
# number of nested meshes; and the requested accuracy, None: there is none.
Variation: TypeAlias = "Callable[[float | TaggedMesh, str, SolverSettings, Accuracy | None], Callable[[], Solution]]"


@dataclass(frozen=True)
class VariedProblem:
    """What studies ask of a scene; all functions are collective.

    Attributes:
        statement: what is stated of it.
        mesh: makes a mesh with cells so many times as large as stated, for an element.
        on: gives what solves a variation of it, to the last iterate or with an error if there is no solution.
        divisible: whether triangles have straight sides on the boundary, so that they may be divided.
    """

    statement: Statement
    mesh: Callable[[float, str], TaggedMesh]
    on: Variation
    divisible: bool


def cell_of(element: str) -> str:
    """The cells of an element in 2D."""
    return {"P": "triangle", "Q": "quadrilateral"}[element[0]]


def varied_scene(
    scene: Scene, cells: float | TaggedMesh, element: str, settings: SolverSettings, accuracy: Accuracy | None
) -> Scene:
    """The scene as ``Variation`` has it; ``settings``: in place of its own.

    Raises:
        SceneError: the generator makes no such meshes.
    """
    scene = scene.model_copy(update={"mesh": cells}) if isinstance(cells, TaggedMesh) else scene_on(scene, cells)
    changes: dict[str, Any] = {"solver": settings, "accuracy": accuracy}
    if isinstance(mesh := scene.mesh, MeshGenerator):
        changes["mesh"] = mesh.model_copy(update={"parameters": {**mesh.parameters, "cell": cell_of(element)}})
    changes["element"] = scene.element.model_copy(update={"degree": int(element[1])})
    return scene.model_copy(update=changes)


def varied(scene: Scene, comm: MPI.Comm) -> VariedProblem:
    """A scene with a mesh from a generator, as studies solve it."""
    mesh = scene.mesh
    parameters = simplex_parameters(mesh.generator, mesh.parameters) if isinstance(mesh, MeshGenerator) else None

    def on(*variation: Any) -> Callable[[], Solution]:
        return partial(solve, varied_scene(scene, *variation), comm, check=False)

    def mesh_for(factor: float, element: str) -> TaggedMesh:
        return load_mesh(varied_scene(scene, factor, element, scene.solver, None), comm)

    return VariedProblem(scene.statement, mesh_for, on, divisible=parameters is not None)
