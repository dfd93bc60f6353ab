"""Weight: the density of each material times the acceleration of gravity."""

from __future__ import annotations

from typing import Any

from signorini_fx.mechanics.statement.effect import Coefficients, Contradictions, VectorForce, without_density


class Gravity(VectorForce):
    """Weight of the whole body, from the ``density`` of its materials.

    Attributes:
        x: component of the acceleration along x[0], length / time^2.
        y: component of the acceleration along x[1], length / time^2.
        z: component of the acceleration along x[2], length / time^2; only in 3D.
        factors: one number per load step; None: 1 in every step.
    """

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        yield from without_density(statement, "gravity") if self.acts else ()

    def density(self, on: Coefficients) -> Any:
        return on.density * super().density(on)


Entry = Gravity
