"""A circle in 2D: a cylinder across it."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from signorini_fx.mechanics.statement.rigid_shape import Array, Shape, normalised
from signorini_fx.mechanics.statement.values import Positive, Vector


class Ball(Shape):
    """All points that are closer to a centre than a radius, in 2D or in 3D.

    Attributes:
        centre: its centre, length.
        radius: length.
    """

    centre: Vector
    radius: Positive

    @property
    def inradius(self) -> float:
        return math.inf if self.hollow else self.radius

    def initial(self, x: Array) -> tuple[Array, Array]:
        size, normal = normalised(x - np.array(self.centre), np.eye(x.shape[1])[0])
        return size - self.radius, normal


class Circle(Ball):
    """A circle.

    Attributes:
        centre: its centre, length.
        radius: length.
    """

    exists_in = (2,)

    shape: Literal["circle"] = "circle"


Entry = Circle
