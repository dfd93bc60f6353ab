"""The mesh of a scene: that of one table ``mesh``, or those of all bodies in one."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from mpi4py import MPI

from signorini_fx.mechanics.mesh.bodies import together
from signorini_fx.mechanics.mesh.files.gmsh_files import DRAWN
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, check_dimension, generate_mesh, load_file
from signorini_fx.mechanics.statement.mesh_sources import Body, MeshFile, MeshGenerator
from signorini_fx.scenes.scene import Scene


def load_mesh(scene: Scene, comm: MPI.Comm) -> TaggedMesh:
    """The mesh that a scene names, or that its bodies make together.

    Raises:
        SceneError: unknown generator, or wrong parameters.
        MeshError: the file is not a mesh; the mesh is a shell, or in another plane than that of x[0] and x[1].
    """
    if scene.body:

        def load(body: Body, ranks: MPI.Comm) -> TaggedMesh:
            return _load_one(scene, body.mesh, ranks, scene.sections_of(body.name))

        return TaggedMesh(**together(scene.body, load, scene.statement.touching, comm))
    return _load_one(scene, scene.mesh, comm, scene.statement.sections)


def _load_one(scene: Scene, source: Any, comm: MPI.Comm, sections: Collection[str]) -> TaggedMesh:
    """The mesh that a table ``mesh`` of a scene names, with sections; see ``load_mesh``."""
    match source:
        case TaggedMesh():
            tagged = source
        case MeshFile():
            # A drawing gets curved cells if the degree of the elements permits.
            curved = scene.element.degree == 2 and source.file.suffix.lower() in DRAWN
            tagged = load_file(source, comm, 0, 2 if curved else None, sections, scene.statement.touching)
        case MeshGenerator(generator=name, parameters=parameters):
            tagged = generate_mesh(name, parameters, comm)
        case _:
            raise TypeError(f"no mesh: {source!r}")
    check_dimension(tagged, section=bool(scene.statement.kinematics.out_of_section))
    return tagged
