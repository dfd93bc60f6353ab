"""The body with its result as plain arrays, from which pictures are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial import Delaunay

from signorini_fx.arrays import Array, Ints, diagonal


@dataclass(frozen=True, eq=False)
class Tiling:
    """Points of a triangle or a quadrilateral, and triangles between them, on each of which a field
    is drawn as linear.
    """

    # in the unit triangle or the unit square, shape (p, 2); first those along the perimeter, in
    # order
    points: Array
    corners: int  # how many corners the cell has, 3 or 4
    count: int  # how many pieces each side has
    triangles: Ints  # their points, counterclockwise, shape (t, 3)

    @property
    def rim(self) -> int:
        """The number of points along the perimeter."""
        return self.corners * self.count

    @property
    def vertices(self) -> Ints:
        """The points that are corners of the cell, in order, shape (3,) or (4,)."""
        return np.arange(self.corners) * self.count

    def within(self, first: Array, second: Array, last: Array) -> Array:
        """Return the points in a flat cell with straight sides, given by three of its corners,
        shape (p, d).
        """
        s, t = self.points.T[:, :, None]
        return first + s * (second - first) + t * (last - first)


@lru_cache
def tiling(corners: int, count: int) -> Tiling:
    """Return the tiling of a triangle (3) or a quadrilateral (4) whose sides have ``count`` pieces
    each.

    A quadrilateral is divided like a chessboard and each square is cut through its middle: single
    diagonals would make the picture of a symmetric field unsymmetric.
    """
    base = np.array(
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]][:corners]
        if corners == 4
        else np.eye(3, 2, k=-1)
    )
    ahead = np.roll(base, -1, axis=0) - base
    rim = (base[:, None] + (np.arange(count) / count)[:, None] * ahead[:, None]).reshape(-1, 2)
    s, t = (axis.ravel() / count for axis in np.meshgrid(np.arange(1, count), np.arange(1, count)))
    inner = np.column_stack((s, t))
    if corners == 3:
        inner = inner[s + t < 1 - 0.5 / count]
    else:
        middle = (np.arange(count) + 0.5) / count
        inner = np.concatenate(
            (inner, np.column_stack([axis.ravel() for axis in np.meshgrid(middle, middle)]))
        )
    points = np.concatenate((rim, inner))
    # In the equilateral triangle no four points are on a circle without others in it, so that there
    # is one answer.
    flat = points @ np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]]) if corners == 3 else points
    triangles = Delaunay(flat).simplices.astype(np.int64)
    ends = points[triangles]
    turn = np.linalg.det(ends[:, 1:] - ends[:, :1])
    triangles[turn < 0] = triangles[turn < 0][:, ::-1]
    return Tiling(points, corners, count, triangles)


@dataclass(frozen=True)
class DrawnBody:
    """The cells of a body in 2D, or the outer facets of a body in 3D."""

    points: Array  # positions, length, shape (n, d); in 2D each cell has its own
    # points of each cell or facet, shape (m, p): those of ``tiles``, of facets counterclockwise as
    # seen from outside
    within: Ints
    # how a cell or facet is divided: its corners, more points along sides that may be curved, and
    # some within
    tiles: Tiling
    displacement: Array  # at the points, length, shape (n, d)
    # fields at the points of each cell or facet, shape (m, p): those of two materials may have
    # different values at the points that they share
    values: Mapping[str, Array]
    recovered: bool  # whether the stress is the recovered one; else it is that of each cell
    outline: Ints | None = (
        None  # in 2D pairs of points along the boundary of the body, shape (e, 2)
    )

    @property
    def perimeters(self) -> Ints:
        """The points along the perimeter of each cell or facet, in order, shape (m, k)."""
        return self.within[:, : self.tiles.rim]

    @property
    def triangles(self) -> Ints:
        """The points of the triangles of all cells or facets, shape (t, 3)."""
        return self.within[:, self.tiles.triangles].reshape(-1, 3)

    def at_corners(self, field: str) -> Array:
        """Return a field at the corners of the triangles, shape (t, 3)."""
        return self.values[field][:, self.tiles.triangles].reshape(-1, 3)

    @property
    def size(self) -> float:
        """The diagonal of the body, length."""
        return diagonal(self.points) if len(self.points) else 0.0

    def moved(self, factor: float) -> Array:
        """Return the points with the displacement times a factor; points without a finite
        displacement, as after a failed solve, stay.
        """
        moved = self.points + factor * self.displacement
        return np.where(np.isfinite(moved), moved, self.points)


def normals_of(corners: Array) -> Array:
    """Return normals of polygons, as long as their areas, shape (m, 3); their sign follows the
    order of the corners.
    """
    corners = corners - corners.mean(axis=1, keepdims=True)
    return 0.5 * np.cross(corners, np.roll(corners, -1, axis=1)).sum(axis=1)
