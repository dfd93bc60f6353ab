"""The pressure of a fluid at rest up to a level."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Literal

from signorini_fx.mechanics.statement.effect import Coefficients, Contradictions, Force
from signorini_fx.mechanics.statement.values import NonNegative, TimedSampledValue


class Fluid(Force):
    """Pressure of a fluid at rest on a boundary: its weight times the depth below its level, and none above.

    Attributes:
        boundary: its name.
        level: height of the surface of the fluid along ``up``, length.
        weight: of the fluid, force per volume.
        up: the axis against gravity, ``x``, ``y`` or ``z``; None: y in 2D, z in 3D.
        factors: one number per load step; None: 1 in every step.
    """

    boundary: str
    level: TimedSampledValue
    weight: NonNegative
    up: Literal["x", "y", "z"] | None = None

    @property
    def given(self) -> dict[str, Any]:
        return {"level": self.level, "weight": self.weight}

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        if self.up == "x" and statement.kinematics.refused_axis((1.0, 0.0)):
            yield ("fluid", number, "up"), "must be along the axis of the body: y"
        if statement.kinematics.out_of_section and self.up is None:
            yield ("fluid", number, "up"), "say along which axis of the section it rises: up = 'y'"

    @property
    def acts(self) -> bool:
        return self.weight > 0

    @cached_property
    def varies(self) -> bool:
        return True

    def density(self, on: Coefficients) -> Any:
        depth = on.value(self.level) - on.position[self.axis_in(len(on.position))]
        return -on.value(self.weight) * (depth + abs(depth)) / 2 * on.normal

    def axis_in(self, dimension: int) -> int:
        """The number of the axis along which it rises."""
        return dimension - 1 if self.up is None else "xyz".index(self.up)


Entry = Fluid
