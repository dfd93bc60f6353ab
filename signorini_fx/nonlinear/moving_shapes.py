"""Rigid shapes as nodes at finite displacements see them: distance, direction, curvature and motion of the shape.

A node X that is displaced by u is outside of a shape if phi(X + u) >= 0, with phi the signed distance of the shape.
With the unit normal n_f = grad phi at X + u the condition for a new displacement y is, to first order,
- n_f . y <= phi(X + u) - n_f . u: a gap and a direction as every foundation has them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.tuned import NORMAL_DIFFERENCE

Array = npt.NDArray[np.float64]


@dataclass
class MovingShape:
    """The shape of one foundation, and where it was at the end of the last step.

    Attributes:
        shape: any object with ``distance``, see ``scene.rigid_shape.Shape``, where it is now.
        settled: the same where it was.
        added: what is added to its distance at the nodes, length, shape (n,).
        nodes: of the foundation, local numbers, ghosts included, shape (n,).
        x: their initial positions, length, shape (n, d).
    """

    shape: Any
    settled: Any
    added: Array
    nodes: npt.NDArray[np.int64]
    x: Array

    def seen_from(self, u: Array) -> tuple[Array, Array]:
        """The linearised gap, length, shape (n,), and the direction to the shape, unit vectors of shape (n, d).

        Args:
            u: displacements of the nodes, shape (n, d).
        """
        signed, normal = self.shape.distance(self.x + u)
        return np.asarray(signed + self.added - np.einsum("ni,ni->n", normal, u)), -normal

    def curvature(self, places: Array, size: float) -> Array:
        """The second derivatives of the distance, 1 / length, shape (n, d, d), by central differences of the normal.

        Args:
            places: points, shape (n, d).
            size: of the body, length.
        """
        dimension, step = places.shape[1], NORMAL_DIFFERENCE * size
        hessian = np.zeros((len(places), dimension, dimension))
        for k, axis in enumerate(step * np.eye(dimension)):
            ahead, behind = (self.shape.distance(places + sign * axis)[1] for sign in (1, -1))
            hessian[:, :, k] = (ahead - behind) / (2 * step)
        return np.asarray((hessian + hessian.transpose(0, 2, 1)) / 2)

    def moved(self, places: Array) -> Array:
        """How far its closest points have moved since the last step, length, shape (n, d)."""
        if self.shape == self.settled:
            return np.zeros_like(places)
        return np.asarray(self.shape.moved_from(self.settled, places))
