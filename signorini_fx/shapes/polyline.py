"""A line of straight pieces in the plane."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from signorini_fx.scene.rigid_shape import Array, Shape
from signorini_fx.scene.values import Finite

# Products of points and pieces that are compared at a time.
_AT_A_TIME = 4_000_000

Points = Annotated[tuple[tuple[Finite, Finite], ...], Field(min_length=2, max_length=100_000)]


class Line(Shape):
    """A line through points: the body is on its left, or outside where the last point is the first one.

    Attributes:
        points: in order, lengths; beyond the first and the last one the line goes straight on.
    """

    exists_in = (2,)

    points: Points

    @model_validator(mode="after")
    def _goes_on(self) -> Self:
        x = np.array(self.points)
        still = np.flatnonzero((np.diff(x, axis=0) == 0).all(axis=1))
        if still.size:
            raise ValueError(f"points: numbers {still[0] + 1} and {still[0] + 2} are the same")
        if self.closed and len(x) < 4:
            raise ValueError("points: a closed line needs three, and the first one again")
        return self

    @property
    def closed(self) -> bool:
        """Whether it ends where it begins."""
        return self.points[0] == self.points[-1]

    @property
    def walked(self) -> Array:
        """Its points in the order in which the body is on the left, shape (m, 2)."""
        x = np.array(self.points)
        turning = float(x[:-1, 0] @ x[1:, 1] - x[1:, 0] @ x[:-1, 1])
        return x[::-1] if self.closed and turning > 0 else x


class Polyline(Line):
    """A line of straight pieces.

    Attributes:
        points: in order, lengths; beyond the first and the last one the line goes straight on.
    """

    shape: Literal["polyline"] = "polyline"

    def initial(self, x: Array) -> tuple[Array, Array]:
        """See ``Shape``."""
        walked = self.walked
        count = len(walked) - 1
        pieces = np.column_stack((np.arange(count), np.arange(1, count + 1)))
        if self.closed:
            pieces[-1, 1] = 0
        return from_pieces(x, walked, pieces)


def nearest(x: Array, begin: Array, along: Array, first: Array, last: Array) -> tuple[npt.NDArray[np.int64], Array]:
    """The straight piece closest to each point, and the place of the closest point on it, shapes (n,) and (n,).

    Args:
        x: points, shape (n, 2).
        begin: where the pieces begin, shape (m, 2).
        along: their unit vectors, shape (m, 2).
        first: the lowest place on each, length, shape (m,).
        last: the highest one.
    """
    chosen, place = np.zeros(len(x), dtype=np.int64), np.zeros(len(x))
    step = max(1, _AT_A_TIME // len(begin))
    for start in range(0, len(x), step):
        rows = slice(start, start + step)
        away = x[rows, None] - begin
        foot = np.clip(np.einsum("nmd,md->nm", away, along), first, last)
        chosen[rows] = np.linalg.norm(away - foot[..., None] * along, axis=2).argmin(axis=1)
        place[rows] = foot[np.arange(len(foot)), chosen[rows]]
    return chosen, place


def from_pieces(x: Array, corners: Array, pieces: npt.NDArray[np.int64]) -> tuple[Array, Array]:
    """Signed distances from straight pieces, positive on their left, and the normals at the closest points.

    Args:
        x: points, shape (n, 2).
        corners: ends of the pieces, shape (c, 2).
        pieces: the corner at which each begins, and that at which it ends, shape (m, 2); one at a free end goes on.

    Returns:
        Shapes (n,) and (n, 2).
    """
    begin, along = corners[pieces[:, 0]], corners[pieces[:, 1]] - corners[pieces[:, 0]]
    length = np.linalg.norm(along, axis=1)
    along = along / length[:, None]
    left = np.column_stack((-along[:, 1], along[:, 0]))
    at_corner = np.zeros_like(corners)
    for column in (0, 1):
        np.add.at(at_corner, pieces[:, column], left)
    first = np.where(np.isin(pieces[:, 0], pieces[:, 1]), 0.0, -np.inf)
    last = np.where(np.isin(pieces[:, 1], pieces[:, 0]), length, np.inf)
    chosen, place = nearest(x, begin, along, first, last)
    away = x - begin[chosen] - place[:, None] * along[chosen]
    normal = left[chosen].copy()
    signed = np.einsum("nd,nd->n", away, normal)
    # At a corner the sign is that of the mean of both normals (Baerentzen and Aanaes, IEEE Trans. Vis. Comput. Graph.
    # 11 (2005) 243-253), and the normal that of the distance.
    for end, column in ((first[chosen], 0), (last[chosen], 1)):
        size = np.linalg.norm(away, axis=1)
        here = (place == end) & (size > 0)
        mean = at_corner[pieces[chosen[here], column]]
        size = size[here] * np.where(np.einsum("nd,nd->n", away[here], mean) < 0, -1.0, 1.0)
        signed[here], normal[here] = size, away[here] / size[:, None]
    return signed, normal


Entry = Polyline
