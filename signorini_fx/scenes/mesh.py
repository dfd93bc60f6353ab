"""The mesh of a scene, with all of its bodies, and the scene with larger or smaller cells."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial
from itertools import pairwise

from mpi4py import MPI

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.mesh.bodies import naming, together
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, check_dimension, generate_mesh, load_file
from signorini_fx.mechanics.statement.mesh_sources import (
    MeshFile,
    MeshGenerator,
    contact_sizes,
    with_larger_contact_sizes,
)
from signorini_fx.scenes.scene import Scene


def load_mesh(scene: Scene, comm: MPI.Comm) -> TaggedMesh:
    """Return the mesh of a scene, or of its bodies together, with the boundaries that its contacts
    join; collective.
    """
    tagged = _loaded(scene, comm)
    for contact in scene.contact:
        if contact.against is not None:
            tagged = tagged.with_joined(contact.against)
    return tagged


def _loaded(scene: Scene, comm: MPI.Comm) -> TaggedMesh:
    """Return the mesh from the sources of the scene; collective."""
    if scene.body:
        made = (
            mesh.drawn if isinstance(mesh, MeshFile) else getattr(mesh, "origin", True)
            for mesh in scene.meshes
        )
        if (sizes := contact_sizes(scene)) and not any(made):
            reason = (
                "needs CAD or a gmsh generator: these meshes are ready-made, so make their cells "
                "in contact smaller"
            )
            raise SceneError.at(sizes[0].path, reason)
        scene = with_cells_alike(scene, comm)
        return together(scene.body, partial(_load_one, scene), comm)
    return _load_one(scene, None, comm)


def with_cells_alike(scene: Scene, comm: MPI.Comm) -> Scene:
    """Return the scene with the same kind of cell for all mesh generators; collective.

    It is the kind that the scene gives to one of them, or that of a mesh with given cells,
    otherwise the first default that all generators can make.
    """
    able = dict[int, tuple[str, ...]]()
    meshes = scene.meshes
    for number, mesh in enumerate(meshes):
        if isinstance(mesh, MeshGenerator):
            with naming(number, scene.body[number]) if scene.body else nullcontext():
                able[number] = mesh.cells
    given = [
        meshes[number].parameters["cell"] for number in able if "cell" in meshes[number].parameters
    ]
    other = next((number for number in range(len(meshes)) if number not in able), None)
    if able and not given and other is not None:
        with naming(other, scene.body[other]):
            given = [_load_one(scene, other, comm).mesh.topology.cell_name()]
    common = [
        cell
        for cells in able.values()
        for cell in cells[:1]
        if all(cell in others for others in able.values())
    ]
    wanted = next(iter((*given, *common)), None)
    if all(cells[:1] == (wanted,) for cells in able.values()):
        return scene
    for number, cells in able.items():
        if wanted in cells:
            meshes[number] = meshes[number].having(**{"cell": wanted, **meshes[number].parameters})
    return scene.with_meshes(meshes)


def _load_one(scene: Scene, number: int | None, comm: MPI.Comm, halvings: int = 0) -> TaggedMesh:
    """Return the mesh of one body; collective.

    Args:
        scene: the scene.
        number: number of the body; None: the scene has only one mesh.
        comm: the ranks.
        halvings: how often the cell sides of a file are halved.
    """
    source = scene.mesh if number is None else scene.body[number].mesh
    sizes = contact_sizes(scene, number)
    match source:
        case TaggedMesh():
            tagged = source
            if sizes and number is None and not tagged.origin:
                reason = (
                    "the mesh is given with its cells: make those in contact shorter where "
                    "it is made"
                )
                raise SceneError.at(sizes[0].path, reason)
        case MeshFile():
            # A drawing gets curved cells if the degree of the elements permits.
            curved = scene.element.degree == 2 and source.drawn
            if number is not None and not source.drawn:
                sizes = ()  # they are for the other body
            tagged = load_file(source, comm, halvings, 2 if curved else None, sizes)
        case MeshGenerator(generator=name, parameters=parameters):
            tagged = generate_mesh(name, parameters, comm, sizes)
    check_dimension(tagged, section=bool(scene.statement.kinematics.out_of_section))
    return tagged


def scene_on(scene: Scene, factor: float) -> Scene:
    """Return the scene on a mesh with cells ``factor`` times as large."""
    scene = scene.model_copy(update={"contact": with_larger_contact_sizes(scene.contact, factor)})
    return scene.with_meshes(mesh.coarser(factor) for mesh in scene.meshes)


def with_halved_bodies(scene: Scene, halvings: int, comm: MPI.Comm) -> Scene:
    """Return the scene with the cell sides of all bodies halved ``halvings`` times; collective.

    Generators and drawings make new cells on the true shape; cells of other files are divided on
    their own geometry.
    """
    halved = []
    for number, mesh in enumerate(scene.meshes):
        with naming(number, scene.body[number]):
            if isinstance(mesh, MeshFile):
                mesh = _load_one(scene, number, comm, halvings)
            elif isinstance(mesh, MeshGenerator):
                mesh = mesh.coarser(0.5**halvings)
            else:
                for _ in range(halvings):
                    mesh = refine(mesh)
        halved.append(mesh)
    contacts = with_larger_contact_sizes(scene.contact, 0.5**halvings)
    return scene.with_meshes(halved).model_copy(update={"contact": contacts})


def coarser_scenes(scene: Scene, levels: int) -> list[Scene]:
    """Return the scene on at most ``levels - 1`` coarser meshes, from the coarsest on, each with
    cells twice as large as the next.
    """
    if levels == 1:
        return []
    scenes = [scene_on(scene, 2**k) for k in range(levels - 1, -1, -1)]
    return [
        coarse
        for coarse, fine in pairwise(scenes)
        if (coarse.mesh, coarse.body) != (fine.mesh, fine.body)
    ]
