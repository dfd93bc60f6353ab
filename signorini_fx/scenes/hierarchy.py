"""The meshes of a scene from coarse to fine: the scene on larger or smaller cells, those of all bodies alike."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from mpi4py import MPI

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mechanics.mesh.bodies import in_body
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, coarser_parameters, load_file
from signorini_fx.mechanics.statement.contact_sizes import contact_sizes, with_larger_contact_sizes
from signorini_fx.mechanics.statement.mesh_sources import DRAWN, MeshFile, MeshGenerator
from signorini_fx.scenes.scene import Scene


def scene_on(scene: Scene, factor: float) -> Scene:
    """The scene on a mesh with elements ``factor`` times as large.

    Raises:
        SceneError: the generator cannot make such a mesh.
    """
    contacts = with_larger_contact_sizes(scene.contact, factor)
    if scene.body:
        bodies = tuple(body.model_copy(update={"mesh": _mesh_on(body.mesh, factor)}) for body in scene.body)
        return scene.model_copy(update={"body": bodies, "contact": contacts})
    return scene.model_copy(update={"mesh": _mesh_on(scene.mesh, factor), "contact": contacts})


def _mesh_on(mesh: Any, factor: float) -> MeshGenerator:
    assert isinstance(mesh, MeshGenerator)
    parameters = coarser_parameters(mesh.generator, mesh.parameters, factor)
    size = None if mesh.contact_size is None else factor * mesh.contact_size
    return MeshGenerator(generator=mesh.generator, parameters=parameters, contact_size=size)


def with_halved_bodies(scene: Scene, halvings: int, comm: MPI.Comm) -> Scene:
    """The scene with the sides of all cells of all of its bodies halved that many times; collective.

    Generators and drawings make new cells on the true shape, cells of other files are divided on their own geometry,
    and those of a mesh from the caller as ``refine`` does it.

    Raises:
        SceneError: a generator cannot make such a mesh.
        MeshError: a mesh cannot be divided; the message names the body.
    """
    halved = []
    for number, body in enumerate(scene.body):
        mesh: Any = body.mesh
        try:
            if isinstance(mesh, MeshFile):
                drawn = mesh.file.suffix.lower() in DRAWN
                curved = scene.element.degree == 2 and drawn  # as without a given accuracy
                sections = scene.sections_of(body.name)
                sizes = contact_sizes(scene, number) if drawn else ()
                mesh = load_file(mesh, comm, halvings, 2 if curved else None, sections, sizes)
            elif isinstance(mesh, TaggedMesh):
                for _ in range(halvings):
                    mesh = refine(mesh)
        except SceneError as error:
            raise SceneError(in_body(number, error.problems)) from None
        except MeshError as error:
            raise MeshError(f"body {body.name!r}: {error}") from None
        if isinstance(mesh, MeshGenerator):
            mesh = _mesh_on(mesh, 0.5**halvings)
        halved.append(body.model_copy(update={"mesh": mesh}))
    contacts = with_larger_contact_sizes(scene.contact, 0.5**halvings)
    return scene.model_copy(update={"body": tuple(halved), "contact": contacts})


def coarser_scenes(scene: Scene, levels: int) -> list[Scene]:
    """The scene on ``levels - 1`` coarser meshes, each with elements twice as large as the next, coarsest first.

    There are fewer if a mesh has so few cells that the coarser one would be the same.
    """
    if levels == 1:
        return []
    scenes = [scene_on(scene, 2**k) for k in range(levels - 1, -1, -1)]
    return [coarse for coarse, fine in pairwise(scenes) if (coarse.mesh, coarse.body) != (fine.mesh, fine.body)]
