"""How a cell, or a facet of one, is divided for a picture: into triangles, on each of which a field is linear."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt
from scipy.spatial import Delaunay

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Tiling:
    """Points of a triangle or a quadrilateral, and triangles between them.

    Attributes:
        points: in the unit triangle or the unit square, shape (p, 2); first those along the perimeter, in order.
        corners: how many corners the cell has, 3 or 4.
        count: how many pieces each side has.
        triangles: their points, counterclockwise, shape (t, 3).
    """

    points: Floats
    corners: int
    count: int
    triangles: Rows

    @property
    def rim(self) -> int:
        """How many points are along the perimeter."""
        return self.corners * self.count

    @property
    def vertices(self) -> Rows:
        """The points that are corners of the cell, in order, shape (3,) or (4,)."""
        return np.arange(self.corners) * self.count

    @cached_property
    def mirrored(self) -> Rows:
        """For each point the one with both coordinates exchanged, shape (p,): the same cell seen from behind."""
        forth, back = (np.lexsort(np.round(points, 9).T) for points in (self.points, self.points[:, ::-1]))
        order = np.empty(len(forth), dtype=np.int64)
        order[back] = forth
        return order

    def within(self, first: Floats, second: Floats, last: Floats) -> Floats:
        """The points in a flat cell without curved sides, given by corners of shape (d,): shape (p, d)."""
        s, t = self.points.T[:, :, None]
        return np.asarray(first + s * (second - first) + t * (last - first))


@lru_cache
def tiling(corners: int, count: int) -> Tiling:
    """A triangle (3) or a quadrilateral (4) whose sides have ``count`` pieces each.

    A quadrilateral is divided like a chessboard and each field cut at its middle: diagonals would make the picture of a
    symmetric field unsymmetric.
    """
    base = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]][:corners] if corners == 4 else np.eye(3, 2, k=-1))
    ahead = np.roll(base, -1, axis=0) - base
    rim = (base[:, None] + (np.arange(count) / count)[:, None] * ahead[:, None]).reshape(-1, 2)
    s, t = (axis.ravel() / count for axis in np.meshgrid(np.arange(1, count), np.arange(1, count)))
    inner = np.column_stack((s, t))
    if corners == 3:
        inner = inner[s + t < 1 - 0.5 / count]
    else:
        middle = (np.arange(count) + 0.5) / count
        inner = np.concatenate((inner, np.column_stack([axis.ravel() for axis in np.meshgrid(middle, middle)])))
    points = np.concatenate((rim, inner))
    # In the equilateral triangle no four points are on a circle without others in it, so that there is one answer.
    flat = points @ np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]]) if corners == 3 else points
    triangles = Delaunay(flat).simplices.astype(np.int64)
    ends = points[triangles]
    turn = np.linalg.det(ends[:, 1:] - ends[:, :1])
    triangles[turn < 0] = triangles[turn < 0][:, ::-1]
    return Tiling(points, corners, count, triangles)


def refined(corners: Floats, enough: int) -> Floats:
    """Triangles that are cut into four until there are at least so many, shape (t, 3, ...).

    Between their corners they are linear in all that ``corners`` has, shape (m, 3, ...), and stay so.
    """
    while 0 < len(corners) < enough:
        ahead = 0.5 * (corners + np.roll(corners, -1, axis=1))
        outer = np.stack((corners, ahead, np.roll(ahead, 1, axis=1)), axis=2)
        corners = np.concatenate((outer.reshape(-1, *corners.shape[1:]), ahead))
    return corners
