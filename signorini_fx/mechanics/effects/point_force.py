"""Forces at single nodes; the stress at such a node is infinite."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from signorini_fx.mechanics.statement.effect import Coefficients, Features, VectorForce
from signorini_fx.mechanics.statement.values import Vector


class PointForce(VectorForce):
    """A force at a node.

    Attributes:
        at: a point, which must be a node of the mesh, length.
        region: of the point: the part of the body whose node is meant; None: there is only one node.
        x: component along x[0], force (in 2D per thickness, of a body of revolution of the whole ring).
        y: component along x[1], force (likewise).
        z: component along x[2], force; only in 3D.
        factors: one number per load step; None: 1 in every step.
    """

    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "point force": {
            "accuracy of the energy": "a force at a point does infinite work: take the 'force', 'pressure' or 'zone', "
            "or spread it over a boundary, in [[force]]",
            "local refinement": "cells at a force at a point would be divided without end: use 'uniform'",
        }
    }
    nodal: ClassVar[bool] = True
    vectors: ClassVar[tuple[str, ...]] = ("at",)

    at: Vector
    region: str | None = None

    @property
    def features(self) -> Features:
        return super().features if self.acts else ()

    def density(self, on: Coefficients) -> Any:
        """Zero: it has none, see ``Force``."""
        return on.vector((0.0, 0.0, 0.0))


Entry = PointForce
