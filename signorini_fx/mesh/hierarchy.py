"""The meshes of one generator from coarse to fine: a scene on larger cells."""

from __future__ import annotations

from itertools import pairwise

from signorini_fx.mesh.tagged import coarser_parameters
from signorini_fx.scene.model import MeshGenerator, Scene


def scene_on(scene: Scene, factor: float) -> Scene:
    """The scene on a mesh with elements ``factor`` times as large.

    Raises:
        SceneError: the generator cannot make such a mesh.
    """
    assert isinstance(scene.mesh, MeshGenerator)
    generator = scene.mesh.generator
    mesh = MeshGenerator(generator=generator, parameters=coarser_parameters(generator, scene.mesh.parameters, factor))
    return scene.model_copy(update={"mesh": mesh})


def coarser_scenes(scene: Scene, levels: int) -> list[Scene]:
    """The scene on ``levels - 1`` coarser meshes, each with elements twice as large as the next, coarsest first.

    There are fewer if a mesh has so few cells that the coarser one would be the same.
    """
    if levels == 1:
        return []
    scenes = [scene_on(scene, 2**k) for k in range(levels - 1, -1, -1)]
    return [coarse for coarse, fine in pairwise(scenes) if coarse.mesh != fine.mesh]
