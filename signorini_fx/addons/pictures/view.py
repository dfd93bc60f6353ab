"""How surfaces in 3D are seen: directions, perspective, axes in the picture, and their names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.pictures.style import Floats
from signorini_fx.tuned import ALONG_AXIS, UPRIGHT, VIEW_DISTANCE

_CENTRING = 6  # steps that move what is seen to the middle of the window


@dataclass(frozen=True)
class View:
    """A direction of sight, and what is right and above in it.

    Attributes:
        right, up, toward: orthonormal, right-handed; ``toward`` points from the picture to the viewer; each of
            shape (3,).
    """

    right: Floats
    up: Floats
    toward: Floats

    @property
    def axes(self) -> Floats:
        """Its three directions, shape (3, 3)."""
        return np.stack((self.right, self.up, self.toward))

    def flat(self, points: Floats) -> Floats:
        """Points of shape (..., 3) in the picture, shape (..., 2)."""
        return np.stack((points @ self.right, points @ self.up), axis=-1)


@dataclass(frozen=True)
class Camera:
    """A view in perspective, of the part of space that is seen in a window.

    Attributes:
        view: its directions.
        centre: the point in the middle of the window, in whose distance lengths in the picture are those in 3D;
            shape (3,).
        distance: from there to the viewer.
        half: half the width and height of the window, shape (2,).
    """

    view: View
    centre: Floats
    distance: float
    half: Floats

    @classmethod
    def on(cls, view: View, points: Floats, margin: float = 0.06) -> Camera:
        """One that sees all points, shape (n, 3), with a margin over the longer side of the window."""
        low, high = (np.array([bound(points @ axis) for axis in view.axes]) for bound in (np.min, np.max))
        centre = 0.5 * (low + high) @ view.axes
        distance = VIEW_DISTANCE * (float(np.linalg.norm(high - low)) or 1.0)
        camera = cls(view, centre, distance, np.ones(2))
        for _ in range(_CENTRING):
            flat = camera.flat(points)
            middle = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
            camera = cls(view, camera.centre + middle @ view.axes[:2], distance, np.ones(2))
        half = np.abs(camera.flat(points)).max(axis=0)
        return cls(view, camera.centre, distance, half + margin * (float(half.max()) or 1.0))

    def flat(self, points: Floats) -> Floats:
        """Points of shape (..., 3) in the picture, shape (..., 2)."""
        away = points - self.centre
        return np.asarray(self.view.flat(away) / (1 - away @ self.view.toward / self.distance)[..., None])

    @property
    def position(self) -> Floats:
        """Of the viewer, shape (3,)."""
        return self.centre + self.distance * self.view.toward


def along(direction: Floats) -> View:
    """The view along a direction, shape (3,): upright as far as possible.

    A direction close to a coordinate axis is replaced by it.  Upwards is z, or y if one looks up or down.
    """
    sight = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    axis = int(np.argmax(np.abs(sight)))
    if abs(sight[axis]) > ALONG_AXIS:
        sight = np.sign(sight[axis]) * np.eye(3)[axis]
    up = np.eye(3)[1 if abs(sight[2]) > UPRIGHT else 2]
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
        return np.eye(3)[axis], f"${'xyz'[axis]}$", bool(direction[axis] < 0)
    return direction, f"${combination(direction)}$", False


def combination(direction: Floats) -> str:
    """A unit vector as a combination of coordinates, for mathtext."""
    text = ""
    for axis, share in enumerate(direction):
        if abs(share) < 0.005:
            continue
        size = "" if abs(share) > 0.995 else rf"{abs(share):.2f}\,"
        sign = ("-" if share < 0 else "+") if text else ("-" if share < 0 else "")
        text += f"{sign}{size}{'xyz'[axis]}"
    return text


def outline(points: Floats, polygons: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Edges that belong to one polygon only, shape (e, 2), of polygons of shape (m, k)."""
    a, b = polygons.ravel(), np.roll(polygons, -1, axis=1).ravel()
    key = np.minimum(a, b) * len(points) + np.maximum(a, b)
    _, where, count = np.unique(key, return_index=True, return_counts=True)
    once = where[count == 1]
    return np.column_stack((a[once], b[once]))
