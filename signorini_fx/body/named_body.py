"""An elastic body with the names of its parts: what results, bounds and proofs read, of scenes and of forms alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from signorini_fx.body.cellwise_stiffness import CellwiseStiffness
from signorini_fx.body.elastic import ElasticBody
from signorini_fx.body.rigid_bodies import RigidBodies
from signorini_fx.contact.friction import PointFriction
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.scene.model import Scene

if TYPE_CHECKING:
    from signorini_fx.body.paired_points import PairedSides


@dataclass(frozen=True, kw_only=True)
class NamedBody(ElasticBody):
    """An elastic body with the names of its parts.

    Attributes:
        scene: what is known of contact, loads and supports by name, and the settings; of forms of a user's own this is
            less than all that acts.
        tagged: the mesh; where displacements have a component out of it a section in space.
        lame: Lame parameters as coefficients of the forms; None: they are not known.
        moduli: stiffness of each cell where a material is not isotropic; None: all are.
        law: the friction law; None where no law can act.
        pairs: both sides of each contact of two bodies, by its place in ``scene.contact``.
        rigid: the rigid bodies whose motion is an unknown.
    """

    scene: Scene
    tagged: TaggedMesh
    lame: tuple[Any, Any]
    moduli: CellwiseStiffness | None
    law: PointFriction | None
    pairs: Mapping[int, PairedSides]
    rigid: RigidBodies
