"""Finite rotations of rigid bodies by rotation vectors, in 2D by angles."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from signorini_fx.mechanics.statement.rigid_shape import turning

Array = npt.NDArray[np.float64]


def rigid_motion(x: Array, translation: Array, turn: Array, pivot: Array) -> Array:
    """How far a rigid body that has turned, and then moved, takes points, length, shape (n, d).

    Args:
        x: the points, shape (n, d).
        translation: of its pivot, shape (d,).
        turn: the rotation vector, radians, in 2D an angle, shape (1,) or (3,).
        pivot: length, shape (d,).
    """
    return np.asarray((x - pivot) @ (turn_of(turn) - np.eye(x.shape[1])).T + translation)


def turn_of(turn: Array) -> Array:
    """The matrix of a rotation vector in radians, in 2D of an angle, shape (d, d)."""
    degrees = [float(angle) for angle in np.degrees(turn)]
    return turning(tuple(degrees), 3) if turn.size == 3 else turning(degrees[0], 2)


def across_arms(turn: Array, arms: Array) -> Array:
    """Rotation vectors, shape (1,) or (3,), or one of each arm, times arms of shape (n, d): w x a, shape (n, d)."""
    if arms.shape[1] == 3:
        return np.asarray(np.cross(turn, arms))
    return np.asarray(turn[..., :1] * np.column_stack((-arms[:, 1], arms[:, 0])))


def turned_further(initial: float | tuple[float, ...], turn: Array, near: float | tuple[float, ...]) -> Any:
    """The rotation of a shape, degrees, that is turned further than it is given.

    Args:
        initial: its rotation, degrees, see ``Shape``.
        turn: the rotation vector by which it is turned then, radians.
        near: a rotation from which that is not far: of all whole turns more or fewer the nearest one is taken.
    """
    if turn.size == 1:
        assert isinstance(initial, float)
        return initial + float(np.degrees(turn[0]))
    first = np.zeros(3) + np.asarray(initial)
    if not first.any():
        return tuple(np.degrees(turn).tolist())
    together = (Rotation.from_rotvec(turn) * Rotation.from_rotvec(np.radians(first))).as_rotvec()
    size = float(np.linalg.norm(together))
    axis = together / size if size > 0 else first / np.linalg.norm(first)
    along = float(axis @ np.radians(np.zeros(3) + np.asarray(near)))
    turns = np.round((along - size) / (2 * np.pi))
    return tuple(np.degrees((size + 2 * np.pi * turns) * axis).tolist())
