"""Shapes with a formula: plane, circle, sphere, cylinder and cone; lines of straight pieces through
points in 2D.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from signorini_fx.arrays import Array, Ints, inner
from signorini_fx.mechanics.statement.rigid_shape import Corners, Shape, across, normalised, unit
from signorini_fx.mechanics.statement.values import Accepts, Direction, Finite, Positive, Vector
from signorini_fx.tuned import SAME_ANGLE, SAME_NUMBER

# Numbers that are compared at a time.
_AT_A_TIME = 1_000_000


Points = Annotated[
    Accepts[Sequence[Sequence[float]], tuple[tuple[Finite, Finite], ...]],
    Field(min_length=2, max_length=10_000),
]


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


class Round(Shape):
    """All points that are closer to a centre, or to an axis through it, than a radius.

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


class Circle(Round):
    """A circle in 2D: a cylinder across it."""

    exists_in = (2,)

    shape: Literal["circle"] = "circle"


class Sphere(Round):
    """A sphere."""

    exists_in = (3,)

    shape: Literal["sphere"] = "sphere"


class Cylinder(Round):
    """A cylinder without ends.

    Attributes:
        centre: a point of its axis, length.
        axis: direction of its axis, any length.
        radius: length.
    """

    exists_in = (3,)

    shape: Literal["cylinder"] = "cylinder"
    axis: Direction

    def initial(self, x: Array) -> tuple[Array, Array]:
        away = x - np.array(self.centre)
        axis = unit(self.axis)
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
        """Return signed distance and normal: a rounded cone is all points within its radius of a
        sharp cone inside it.
        """
        axis = unit(self.axis)
        sine = math.sin(math.radians(self.angle))
        cosine = math.cos(math.radians(self.angle))
        away = x - np.array(self.tip) - self.radius / sine * axis
        height = away @ axis
        radius, outwards = normalised(away - np.outer(height, axis), across(axis))
        # Distance from the side and the foot on it, measured from the tip.
        signed = cosine * radius - sine * height
        foot = sine * radius + cosine * height
        normal = cosine * outwards - sine * axis
        round_off = SAME_NUMBER * float(np.abs(x).max(initial=0.0))
        from_tip = foot <= round_off
        signed[from_tip], normal[from_tip] = normalised(away[from_tip], -axis, round_off)
        return signed - self.radius, normal

    def initial_corners(self, dimension: int) -> Corners:
        if self.hollow:
            return Corners.none(dimension)
        axis = unit(self.axis)
        angle = math.radians(self.angle)
        tip = np.array(self.tip) + self.radius / math.sin(angle) * axis
        aside = math.cos(angle) * across(axis)
        sides = np.stack((aside, -aside)) - math.sin(angle) * axis
        none = Corners.none(dimension)
        return replace(none, places=tip[None], radius=np.array([self.radius]), sides=sides[None])


class Polyline(Shape):
    """A line of straight pieces: the body is on its left, or outside where the last point is the
    first one.

    Attributes:
        points: in order, lengths; beyond the first and the last one the line goes straight on.
    """

    exists_in = (2,)

    shape: Literal["polyline"] = "polyline"
    points: Points

    @model_validator(mode="after")
    def _goes_on(self) -> Self:
        x = np.array(self.points)
        still = np.flatnonzero((np.diff(x, axis=0) == 0).all(axis=1))
        if still.size:
            raise ValueError(f"points: numbers {still[0] + 1} and {still[0] + 2} are the same")
        if self.closed and len(x) < 4:
            raise ValueError("points: a closed line needs three, and the first one again")
        if self.closed and self._area == 0:
            raise ValueError("points: a closed line must enclose an area")
        if (crossed := crossing_pieces(x)) is not None:
            first, second = (f"{number + 1}-{number + 2}" for number in crossed)
            raise ValueError(f"points: segments {first} and {second} intersect: remove the loop")
        return self

    @property
    def closed(self) -> bool:
        """Whether the line ends where it begins."""
        return self.points[0] == self.points[-1]

    @property
    def inradius(self) -> float:
        """The inradius, length; for a closed line its area over its perimeter, a lower bound.
        Infinite for open lines and hollow shapes.
        """
        if self.hollow or not self.closed:
            return np.inf
        return abs(self._area) / float(
            np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1).sum()
        )

    @property
    def _area(self) -> float:
        """The area inside a closed line, length squared; negative if it is clockwise."""
        x = np.array(self.points) - self.points[0]
        return float(x[:-1, 0] @ x[1:, 1] - x[1:, 0] @ x[:-1, 1]) / 2

    @property
    def _pieces(self) -> StraightPieces:
        corners = np.array(self.points)
        pieces = np.arange(len(corners) - 1)[:, None] + np.arange(2)
        if self.closed:  # the body is on the left of a clockwise line
            pieces[-1, 1] = 0
            pieces = pieces[::-1, ::-1] if self._area > 0 else pieces
        return StraightPieces(corners, pieces)

    def initial(self, x: Array) -> tuple[Array, Array]:
        return self._pieces(x)

    def initial_corners(self, dimension: int) -> Corners:
        return self._pieces.convex_corners(hollow=self.hollow)


class StraightPieces:
    """Signed distances from straight pieces, positive on their left, and the normals at the closest
    points.

    ``corners``: their ends, length, shape (c, 2); ``pieces``: the numbers of the corners where each
    piece begins and ends, shape (m, 2).  A piece with a free end continues beyond it.
    """

    def __init__(self, corners: Array, pieces: Ints) -> None:
        self._pieces = pieces
        self._corners = corners
        self._begin = corners[pieces[:, 0]]
        along = corners[pieces[:, 1]] - self._begin
        length = np.linalg.norm(along, axis=1)
        self._along = along / length[:, None]
        self._normals = np.column_stack((-self._along[:, 1], self._along[:, 0]))
        self._at_corner = np.zeros_like(corners)
        for column in (0, 1):
            np.add.at(self._at_corner, pieces[:, column], self._normals)
        self._first = np.where(np.isin(pieces[:, 0], pieces[:, 1]), 0.0, -np.inf)
        self._last = np.where(np.isin(pieces[:, 1], pieces[:, 0]), length, np.inf)

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Return signed distances, shape (n,), and unit normals, shape (n, 2), at points of shape
        (n, 2).
        """
        chosen, parameter = self._nearest(x)
        away = x - self._begin[chosen] - parameter[:, None] * self._along[chosen]
        normal = self._normals[chosen].copy()
        signed = inner(away, normal)
        round_off = SAME_NUMBER * float(np.abs(self._begin).max())
        # At a corner the sign is that of the mean of both normals (Baerentzen and Aanaes, IEEE
        # Trans. Vis. Comput. Graph. 11 (2005) 243-253), and the normal that of the distance, or on
        # it the mean.
        for end, column in ((self._first[chosen], 0), (self._last[chosen], 1)):
            at_end = parameter == end
            mean = self._at_corner[self._pieces[chosen[at_end], column]]
            outside = np.where(inner(away[at_end], mean) < 0, -1.0, 1.0)
            size, along = normalised(
                away[at_end], outside[:, None] * normalised(mean, normal[at_end])[1], round_off
            )
            signed[at_end] = outside * size
            normal[at_end] = outside[:, None] * along
        return signed, normal

    def convex_corners(self, *, hollow: bool) -> Corners:
        """Return the corners where two consecutive pieces turn away from the body; if ``hollow``,
        the body is on the right.
        """
        ends, begins = (
            np.bincount(self._pieces[:, k], minlength=len(self._corners)) for k in (1, 0)
        )
        at = np.flatnonzero((ends == 1) & (begins == 1))
        before, after = np.zeros((2, len(self._corners)), dtype=np.int64)
        before[self._pieces[:, 1]] = after[self._pieces[:, 0]] = np.arange(len(self._pieces))
        first = self._along[before[at]]
        second = self._along[after[at]]
        turned = first[:, 1] * second[:, 0] - first[:, 0] * second[:, 1]  # clockwise
        side = -1.0 if hollow else 1.0
        # A line that turns back upon itself is as convex as it is concave.
        convex = (side * turned > math.sin(math.radians(SAME_ANGLE))) | (
            inner(first, second) < 0
        ) & (side * turned >= 0)
        at = at[convex]
        sides = side * np.stack((self._normals[before[at]], self._normals[after[at]]), axis=1)
        return replace(
            Corners.none(2), places=self._corners[at], radius=np.zeros(at.size), sides=sides
        )

    def _nearest(self, x: Array) -> tuple[Ints, Array]:
        """Return the closest piece to each point, the first one of several, and the coordinate of
        the closest point along it, length.
        """
        chosen = np.zeros(len(x), dtype=np.int64)
        place = np.zeros(len(x))
        for batch in np.array_split(np.arange(len(x)), 1 + x.size * len(self._begin) // _AT_A_TIME):
            away = x[batch, None] - self._begin
            places = np.clip(np.einsum("nmd,md->nm", away, self._along), self._first, self._last)
            distance = np.linalg.norm(away - places[:, :, None] * self._along, axis=2)
            chosen[batch] = distance.argmin(axis=1)
            place[batch] = places[np.arange(batch.size), chosen[batch]]
        return chosen, place


def crossing_pieces(points: Array) -> tuple[int, int] | None:
    """Return the numbers, from 0, of the first two segments that cross or touch; None if there are
    none.

    Consecutive segments, which have a point in common, do not count, nor do segments on one
    straight line.
    """
    from scipy.spatial import cKDTree

    # Two pieces that cross have parts that do, no longer than the mean piece, whose middles are no
    # farther apart.
    way = np.diff(points, axis=0)
    length = np.linalg.norm(way, axis=1)
    parts = np.maximum(np.ceil(length / (longest := float(length.mean()))), 1).astype(np.int64)
    owner = np.repeat(np.arange(len(way)), parts)
    number = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    middle = points[owner] + ((number + 0.5) / parts[owner])[:, None] * way[owner]
    near = owner[cKDTree(middle).query_pairs(longest, output_type="ndarray")]
    first, second = np.unique(np.sort(near, axis=1), axis=0).T
    around = (first == 0) & (second == len(way) - 1) & (points[0] == points[-1]).all()
    first, second = (pieces[(second > first + 1) & ~around] for pieces in (first, second))

    def sides(piece: Ints, other: Ints) -> Array:
        """Return the side of pieces on which each end of others is, 1, -1 or 0, shape (2, p)."""
        away = np.stack((points[other], points[other + 1])) - points[piece]
        return np.sign(way[piece, 0] * away[..., 1] - way[piece, 1] * away[..., 0])

    ahead = sides(first, second)
    behind = sides(second, first)
    crossed = np.flatnonzero(
        (ahead.prod(axis=0) <= 0) & (behind.prod(axis=0) <= 0) & ahead.any(axis=0)
    )
    return (int(first[crossed[0]]), int(second[crossed[0]])) if crossed.size else None
