"""Which elastic law a scene has."""

from __future__ import annotations

from typing import Any

from dolfinx import fem

from signorini_fx.body.cellwise_stiffness import CellwiseStiffness, cellwise_stiffness
from signorini_fx.body.elastic_law import CellwiseLaw, IsotropicLaw, SceneLaw, VolumeForces
from signorini_fx.body.mixed import MixedLaw, PressureForces
from signorini_fx.body.moduli import lame_coefficients, reduced_degree
from signorini_fx.body.pieces import BodyPieces
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.records import Inventory
from signorini_fx.scene.model import Scene
from signorini_fx.scene.volumetric import treatment_of

# Lame parameters, the stiffness of each cell, and the degree of the reduced term, see ``SceneLaw``.
Moduli = tuple[tuple[Any, Any], CellwiseStiffness | None, int | None]


def elastic_law(
    scene: Scene,
    tagged: TaggedMesh,
    space: fem.FunctionSpace,
    inventory: Inventory,
    pieces: BodyPieces | None = None,
    moduli: Moduli | None = None,
) -> SceneLaw:
    """That of a scene on its mesh; collective.

    Args:
        scene: the scene.
        tagged: its mesh.
        space: of the displacement.
        inventory: where forms are compiled.
        pieces: into which the mesh falls; None: only terms and stresses are asked for.
        moduli: those of the scene; None: they are computed.
    """
    lame, stiffness, reduced = moduli or (
        lame_coefficients(scene, tagged),
        cellwise_stiffness(scene, tagged),
        reduced_degree(scene, tagged.mesh),
    )
    if treatment_of(scene).pressed:
        return MixedLaw(scene, tagged, space, lame, pieces, inventory)
    if stiffness is not None:
        return CellwiseLaw(scene, tagged, space, lame, stiffness)
    return IsotropicLaw(scene, tagged, space, lame, reduced)


def volume_forces(scene: Scene) -> VolumeForces:
    """The second opinion of the law of a scene."""
    return PressureForces() if treatment_of(scene).pressed else VolumeForces()
