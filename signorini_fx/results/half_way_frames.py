"""Frames half-way between a body and a circle, a sphere or a cylinder, written without ``body.half_way``: where a line
meets these is the root of a quadratic equation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]

# See ``body.half_way``.
_FACING, _GRAZING = 0.2, 0.1


def frame_on(shape: Any, x: Array, outward: Array) -> tuple[Array, Array]:
    """Gap and direction of contact, shapes (n,) and (n, d), along the mean of both normals where that meets the shape.

    Args:
        shape: a circle, a sphere or a cylinder where it is now.
        x: points, length, shape (n, d).
        outward: unit normals of the body at them, shape (n, d).
    """
    away, normal = shape.distance(x)
    inwards = -1.0 if shape.hollow else 1.0
    # From the centre, or from the axis: there nothing counts that is along it.
    arm = (shape.radius + inwards * away)[:, None] * inwards * normal
    mean = outward - normal
    mean = mean / np.maximum(np.sqrt((mean**2).sum(axis=1)), 1e-300)[:, None]
    across = mean
    if hasattr(shape, "axis"):
        axis = Rotation.from_rotvec(np.deg2rad(shape.rotation or (0.0,) * 3)).apply(shape.axis)
        across = mean - np.outer(mean @ axis, axis) / (axis @ axis)
    # |arm + t across| = R
    square, product = (across**2).sum(axis=1), (arm * across).sum(axis=1)
    left = product**2 - square * ((arm**2).sum(axis=1) - shape.radius**2)
    root = np.sqrt(np.maximum(left, 0.0))
    meets = (root > _GRAZING * shape.radius) & ((outward * normal).sum(axis=1) < -_FACING)
    way = -(product + inwards * root) / np.where(square > 0, square, 1.0)
    return np.where(meets, way, away), np.where(meets[:, None], mean, -normal)
