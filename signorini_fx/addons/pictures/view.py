"""Views of surfaces in 3D: directions of sight, axes in the picture, and their names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signorini_fx.addons.pictures.style import MINUS
from signorini_fx.arrays import Array, Ints
from signorini_fx.tuned import ALONG_AXIS

_MARGIN = 0.06  # around the visible points, as a share of the longer side


@dataclass(frozen=True)
class View:
    """A direction of sight, and the directions right and up in the picture.

    Attributes:
        right, up, toward: orthonormal, right-handed; ``toward`` points from the picture to the
            viewer; each of shape (3,).
    """

    right: Array
    up: Array
    toward: Array

    def flat(self, points: Array) -> Array:
        """Return points of shape (..., 3) projected onto the picture, shape (..., 2)."""
        return np.stack((points @ self.right, points @ self.up), axis=-1)

    @classmethod
    def against(cls, sight: Array, up: Array) -> View:
        """Return the view along a unit vector, with another one upwards as far as possible."""
        up = up - (up @ sight) * sight
        up = up / np.linalg.norm(up)
        return cls(np.asarray(np.cross(sight, up)), np.asarray(up), -sight)


@dataclass(frozen=True)
class Camera:
    """A view in parallel projection, of the part of space that is seen in a window."""

    view: View  # its directions
    centre: Array  # the point in the middle of the window, shape (3,)
    half: Array  # half the width and height of the window, length, shape (2,)

    @classmethod
    def on(cls, view: View, points: Array) -> Camera:
        """Return a camera that sees all points, shape (n, 3)."""
        axes = np.stack((view.right, view.up, view.toward))
        low = (points @ axes.T).min(axis=0)
        high = (points @ axes.T).max(axis=0)
        half = 0.5 * (high - low)[:2]
        return cls(view, 0.5 * (low + high) @ axes, half + _MARGIN * (float(half.max()) or 1.0))

    def flat(self, points: Array) -> Array:
        """Return points of shape (..., 3) projected onto the picture, relative to its middle, shape
        (..., 2).
        """
        return self.view.flat(points - self.centre)


def along(direction: Array) -> View:
    """Return the view along a direction, shape (3,), upright as far as possible.

    A direction close to a coordinate axis is replaced by it.  Upwards is z, or y if the direction
    is along z.
    """
    sight = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    axis = int(np.argmax(np.abs(sight)))
    if abs(sight[axis]) > ALONG_AXIS:
        sight = np.sign(sight[axis]) * np.eye(3)[axis]
    return View.against(sight, np.eye(3)[1 if abs(sight[2]) > ALONG_AXIS else 2])


def oblique(azimuth: float = -58.0, elevation: float = 24.0) -> View:
    """Return the view from the front, the right and above; angles in degrees."""
    turn, lift = np.radians((azimuth, elevation))
    sight = -np.array([np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)])
    return View.against(sight, np.eye(3)[2])


def coordinate(direction: Array) -> tuple[str, bool]:
    """Return the name of the coordinate at an axis of a picture, and whether it decreases in the
    given direction.

    Against a coordinate axis the name of the coordinate itself is written.
    """
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) > 1 - 1e-12:
        return "xyz"[axis], bool(direction[axis] < 0)
    return combination(direction), False


def combination(direction: Array) -> str:
    """Return a unit vector as a linear combination of coordinates, in words."""
    text = ""
    for axis, share in enumerate(direction):
        if abs(share) < 0.005:
            continue
        sign = MINUS if share < 0 else "+" * bool(text)
        size = "" if abs(share) > 0.995 else f"{abs(share):.2f} "
        text += f"{f' {sign} ' if text else sign}{size}{'xyz'[axis]}"
    return text


def outline(points: Array, polygons: Ints) -> Ints:
    """Return the edges that belong to one polygon only, shape (e, 2).

    Args:
        points: the points.
        polygons: their numbers at the corners of each polygon, shape (m, k).
    """
    a = polygons.ravel()
    b = np.roll(polygons, -1, axis=1).ravel()
    key = np.minimum(a, b) * len(points) + np.maximum(a, b)
    _, where, count = np.unique(key, return_index=True, return_counts=True)
    once = where[count == 1]
    return np.column_stack((a[once], b[once]))
