"""Projections of surfaces in space: viewing directions, axes in the picture, and their names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.report.style import Floats

# Above this cosine a direction is taken for that of the nearest coordinate axis.
_ALONG = 0.99
_UPRIGHT = 0.9


@dataclass(frozen=True)
class View:
    """A parallel projection.

    Attributes:
        right, up, toward: orthonormal, right-handed; ``toward`` points from the picture to the viewer; each of
            shape (3,).
    """

    right: Floats
    up: Floats
    toward: Floats

    def flat(self, points: Floats) -> Floats:
        """Points of shape (..., 3) in the picture, shape (..., 2)."""
        return np.stack((points @ self.right, points @ self.up), axis=-1)

    def depth(self, points: Floats) -> Floats:
        """How near points of shape (..., 3) are to the viewer, shape (...)."""
        nearness: Floats = points @ self.toward
        return nearness


def along(direction: Floats) -> View:
    """The view along a direction, shape (3,): upright as far as possible.

    A direction close to a coordinate axis is replaced by it.  Upwards is x_3, or x_2 if one looks up or down.
    """
    sight = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    axis = int(np.argmax(np.abs(sight)))
    if abs(sight[axis]) > _ALONG:
        sight = np.sign(sight[axis]) * np.eye(3)[axis]
    up = np.eye(3)[1 if abs(sight[2]) > _UPRIGHT else 2]
    up = up - (up @ sight) * sight
    up = up / np.linalg.norm(up)
    return View(np.cross(sight, up), up, -sight)


def oblique(azimuth: float = -58.0, elevation: float = 24.0) -> View:
    """From the front, the right and above; degrees."""
    turn, lift = np.radians((azimuth, elevation))
    sight = -np.array([np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)])
    up = np.array([0.0, 0.0, 1.0])
    up = up - (up @ sight) * sight
    up = up / np.linalg.norm(up)
    return View(np.cross(sight, up), up, -sight)


def coordinate(direction: Floats) -> tuple[Floats, str, bool]:
    """The coordinate to write at an axis of a picture.

    Returns:
        The unit vector that it is measured along, its name, and whether it decreases in the given direction: against a
        coordinate axis the coordinate itself is written.
    """
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) > 1 - 1e-12:
        return np.eye(3)[axis], f"$x_{axis + 1}$", bool(direction[axis] < 0)
    return direction, f"${combination(direction)}$", False


def combination(direction: Floats) -> str:
    """A unit vector as a combination of coordinates, for mathtext."""
    text = ""
    for axis, share in enumerate(direction):
        if abs(share) < 0.005:
            continue
        size = "" if abs(share) > 0.995 else rf"{abs(share):.2f}\,"
        sign = ("-" if share < 0 else "+") if text else ("-" if share < 0 else "")
        text += f"{sign}{size}x_{axis + 1}"
    return text


def outline(points: Floats, polygons: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Edges that belong to one polygon only, shape (e, 2), of polygons of shape (m, k)."""
    a, b = polygons.ravel(), np.roll(polygons, -1, axis=1).ravel()
    key = np.minimum(a, b) * len(points) + np.maximum(a, b)
    _, where, count = np.unique(key, return_index=True, return_counts=True)
    once = where[count == 1]
    return np.column_stack((a[once], b[once]))


def lines_of(edges: npt.NDArray[np.int64]) -> list[list[int]]:
    """Edges of shape (e, 2) as lines, each given by the points along it, so that dashes continue across edges.

    A line begins and ends where there is not exactly one other edge to continue with; the remaining lines are closed.
    """
    rest: dict[int, list[int]] = {}
    for a, b in ((int(a), int(b)) for a, b in edges):
        rest.setdefault(a, []).append(b)
        rest.setdefault(b, []).append(a)
    ends = [point for point, near in rest.items() if len(near) != 2]
    inner = set(rest) - set(ends)
    lines = []
    for start in [*ends, *rest]:
        while rest[start]:
            line = [start]
            while rest[line[-1]] and (len(line) == 1 or line[-1] in inner):
                following = rest[line[-1]].pop()
                rest[following].remove(line[-1])
                line.append(following)
            lines.append(line)
    return lines
