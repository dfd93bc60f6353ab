"""Shapes with a formula: plane, circle, sphere, cylinder and cone."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from signorini_fx.mechanics.statement.rigid_shape import Array, Shape, across, normalised, unit
from signorini_fx.mechanics.statement.values import Direction, Finite, Positive, Vector


class Plane(Shape):
    """A half-space; in 2D its surface is a straight line.

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
    """A circle in 2D: a cylinder across it.

    Attributes:
        centre: its centre, length.
        radius: length.
    """

    exists_in = (2,)

    shape: Literal["circle"] = "circle"


class Sphere(Ball):
    """A sphere.

    Attributes:
        centre: its centre, length.
        radius: length.
    """

    exists_in = (3,)

    shape: Literal["sphere"] = "sphere"


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


class Cone(Shape):
    """A cone without end, with a sharp or rounded tip; in 2D a wedge.

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
        """A rounded tip is at the distance of its radius around a sharp one inside."""
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
