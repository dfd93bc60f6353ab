"""A plane, in 2D a straight line."""

from __future__ import annotations

from typing import Literal

import numpy as np

from signorini_fx.mechanics.statement.rigid_shape import Array, Shape, unit
from signorini_fx.mechanics.statement.values import Direction, Vector


class Plane(Shape):
    """A half-space.

    Attributes:
        point: of its surface, length.
        normal: out of it, towards the body, any length.
    """

    shape: Literal["plane"] = "plane"
    point: Vector
    normal: Direction

    @property
    def narrows(self) -> bool:
        return False

    def initial(self, x: Array) -> tuple[Array, Array]:
        normal = unit(self.normal)
        return (x - np.array(self.point)) @ normal, np.broadcast_to(normal, x.shape)


Entry = Plane
