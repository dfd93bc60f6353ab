"""A cylinder without ends in 3D."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from signorini_fx.mechanics.statement.rigid_shape import Array, Shape, across, normalised, unit
from signorini_fx.mechanics.statement.values import Direction, Positive, Vector


class Cylinder(Shape):
    """A cylinder without ends.

    Attributes:
        centre: a point of its axis, length.
        axis: direction of its axis, any length.
        radius: length.
    """

    exists_in = (3,)

    shape: Literal["cylinder"] = "cylinder"
    centre: Vector
    axis: Direction
    radius: Positive

    @property
    def inradius(self) -> float:
        return math.inf if self.hollow else self.radius

    def initial(self, x: Array) -> tuple[Array, Array]:
        away, axis = x - np.array(self.centre), unit(self.axis)
        size, normal = normalised(away - np.outer(away @ axis, axis), across(axis))
        return size - self.radius, normal


Entry = Cylinder
