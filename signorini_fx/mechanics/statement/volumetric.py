"""How the change of volume enters an element, as far as a scene knows it; on a mesh: ``elasticity.choice_of_law``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class VolumetricTreatment:
    """What ``element.volumetric`` asks for.

    Attributes:
        words: the feature of a scene that it is; "": that of every scene.
        reduced: whether the volumetric term is to be integrated with fewer points: True, False, or None where some
            material locks.
        pressed: whether a pressure of one degree less is an unknown of its own.  It needs Poisson's ratios above 0, and
            allows for 1/2.
        refuses: the features of a scene that it does not go together with, and why.
    """

    words: str = ""
    reduced: bool | None = False
    pressed: bool = False
    refuses: Mapping[str, str] = field(default_factory=dict)


TREATMENTS = {
    "full": VolumetricTreatment(),
    "auto": VolumetricTreatment(reduced=None),
    "reduced": VolumetricTreatment("reduced integration", reduced=True),
    "mixed": VolumetricTreatment(
        "mixed element",
        pressed=True,
        refuses={
            "krylov": "must not be 'krylov' where element.volumetric = 'mixed': multigrid needs a positive definite "
            "matrix",
        },
    ),
}


def treatment_of(statement: Any) -> VolumetricTreatment:
    """That of a scene."""
    return TREATMENTS[statement.element.volumetric]
