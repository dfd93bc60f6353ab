"""The meshes of one generator from coarse to fine: a scene on larger cells."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from signorini_fx.mesh.tagged import coarser_parameters
from signorini_fx.scene.model import MeshGenerator, Scene


def scene_on(scene: Scene, factor: float) -> Scene:
    """The scene on a mesh with elements ``factor`` times as large.

    Raises:
        SceneError: the generator cannot make such a mesh.
    """
    if scene.body:
        return scene.model_copy(
            update={"body": tuple(one.model_copy(update={"mesh": _mesh_on(one.mesh, factor)}) for one in scene.body)}
        )
    return scene.model_copy(update={"mesh": _mesh_on(scene.mesh, factor)})


def _mesh_on(mesh: Any, factor: float) -> MeshGenerator:
    assert isinstance(mesh, MeshGenerator)
    return MeshGenerator(
        generator=mesh.generator, parameters=coarser_parameters(mesh.generator, mesh.parameters, factor)
    )


def coarser_scenes(scene: Scene, levels: int) -> list[Scene]:
    """The scene on ``levels - 1`` coarser meshes, each with elements twice as large as the next, coarsest first.

    There are fewer if a mesh has so few cells that the coarser one would be the same.
    """
    if levels == 1:
        return []
    scenes = [scene_on(scene, 2**k) for k in range(levels - 1, -1, -1)]
    return [coarse for coarse, fine in pairwise(scenes) if (coarse.mesh, coarse.body) != (fine.mesh, fine.body)]
