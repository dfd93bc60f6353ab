"""A cone with a sharp or rounded tip; in 2D a wedge."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from signorini_fx.mechanics.statement.rigid_shape import Array, Shape, across, normalised, unit
from signorini_fx.mechanics.statement.values import Direction, Finite, Vector


class Cone(Shape):
    """A cone without end.

    Attributes:
        tip: where its sides meet, before they are rounded, length.
        axis: from the tip into the cone, any length.
        angle: between its axis and its side, degrees.
        radius: of the rounding of its tip, length; zero: sharp.
    """

    shape: Literal["cone"] = "cone"
    tip: Vector
    axis: Direction
    angle: Annotated[Finite, Field(gt=0, lt=90)]
    radius: Annotated[Finite, Field(ge=0)] = 0.0

    def initial(self, x: Array) -> tuple[Array, Array]:
        """See ``Shape``: a rounded tip is at the distance of its radius around a sharp one inside."""
        axis, sine, cosine = unit(self.axis), math.sin(math.radians(self.angle)), math.cos(math.radians(self.angle))
        away = x - np.array(self.tip) - self.radius / sine * axis
        height = away @ axis
        radius, outwards = normalised(away - np.outer(height, axis), across(axis))
        # Distance from the side and the foot on it, measured from the tip.
        signed, foot = cosine * radius - sine * height, sine * radius + cosine * height
        normal = cosine * outwards - sine * axis
        from_tip = foot < 0
        signed[from_tip], normal[from_tip] = normalised(away[from_tip], -axis)
        return signed - self.radius, normal


Entry = Cone
