"""Scenes whose mesh one rank has made, on all ranks."""

from mpi4py import MPI

from signorini_fx.mechanics.mesh.tagged import TaggedMesh, arrays_of, from_arrays

WORLD = MPI.COMM_WORLD


def on_all_ranks(scene):
    """The scene with its mesh, which each rank has alone, shared by all of them; other meshes are
    made when needed.
    """
    if not isinstance(scene.mesh, TaggedMesh):
        return scene
    arrays = arrays_of(scene.mesh)
    return scene.model_copy(update={"mesh": from_arrays(WORLD, lambda: arrays)})
