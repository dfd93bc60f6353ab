"""A force whose total is given, spread over a boundary."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from signorini_fx.mechanics.statement.effect import Coefficients, VectorForce
from signorini_fx.mechanics.statement.values import SampledValue


class TotalForce(VectorForce):
    """A force on a boundary, spread evenly over it or in proportion to a value.

    Attributes:
        boundary: its name.
        x: component along x[0], force (in 2D per thickness).
        y: component along x[1], force (in 2D per thickness).
        z: component along x[2], force; only in 3D.
        spread: to what the force per area is proportional; its integral over the boundary must not be zero.
        factors: one number per load step; None: 1 in every step.
    """

    boundary: str
    spread: SampledValue = 1.0

    @cached_property
    def varies(self) -> bool:
        """The components are those of the total, see ``Effect``."""
        return not isinstance(self.spread, float)

    def density(self, on: Coefficients) -> Any:
        """F s over the integral of s, see ``Force``."""
        return super().density(on) * on.value(self.spread) / on.total(self)


Entry = TotalForce
