"""Frames half-way between a body and a round foundation, as those of two curved bodies are.

With the outward normals n_b of the body and n_f of the foundation at its closest point, the direction of contact is
their mean m = (n_b - n_f) / |n_b - n_f|, and the gap is the distance along it.  With n_f alone a part of the approach,
the share a/R of it, counts as slip.  B stays the one that selects: the motion of the foundation, which is rigid, enters
at the point itself, so that B is zero on every joint rigid motion.

Where the two do not face each other, or the way along m misses the foundation or grazes it, contact is far away: there
the direction is -n_f, and the gap the distance from the closest point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

Array = npt.NDArray[np.float64]

# Cosines of the angles between n_b and -n_f, and between m and -n_f where it ends, up to which frames are half-way.
FACING, GRAZING = 0.2, 0.1
# Newton's method along m: quadratic, one-sided after its first step.
_STEPS, _ROUND_OFF = 40, 1e-15


@dataclass(frozen=True)
class HalfWay:
    """Gap and direction at the nodes of a contact boundary, like ``scene.rigid_shape.Distance``.

    Attributes:
        shape: the foundation, see ``scene.rigid_shape.Shape``.
        outward: unit normals of the body at these nodes, means of those around each, shape (n, d).
    """

    shape: Any
    outward: Array

    @classmethod
    def on(
        cls,
        shape: Any,
        space: fem.FunctionSpace,
        facets: npt.NDArray[np.int32],
        nodes: npt.NDArray[np.signedinteger[Any]],
    ) -> HalfWay:
        """That of some facets at some nodes of them by their local numbers, ghosts may be among them; collective."""
        from signorini_fx.body.paired_points import Side

        side, found = Side.of(space, facets), space.dofmap.index_map.local_to_global(nodes.astype(np.int32))
        return cls(shape, side.surface.directions[np.searchsorted(side.nodes, found)])

    def __call__(self, x: Array) -> Array:
        """The gap at the nodes, given as points of shape (3, n), shape (n,)."""
        return self._at(x)[0]

    def direction(self, x: Array) -> Array:
        """The unit vector to the foundation, shape (d, n)."""
        return self._at(x)[1].T

    def _at(self, x: Array) -> tuple[Array, Array]:
        return half_way(self.shape, np.ascontiguousarray(x[: self.outward.shape[1]].T), self.outward)


def half_way(shape: Any, x: Array, outward: Array) -> tuple[Array, Array]:
    """Gaps and directions of contact.

    Args:
        shape: the foundation, see ``scene.rigid_shape.Shape``.
        x: points, length, shape (n, d).
        outward: unit normals of the body at them, shape (n, d).

    Returns:
        Shapes (n,) and (n, d).
    """
    away, normal = shape.distance(x)
    mean = outward - normal
    size = np.linalg.norm(mean, axis=1, keepdims=True)
    mean = np.divide(mean, size, out=np.zeros_like(mean), where=size > 0)
    use = -np.einsum("ni,ni->n", outward, normal) > FACING
    way, left, along = np.zeros(len(x)), away, normal
    for _ in range(_STEPS):
        slope = -np.einsum("ni,ni->n", along, mean)
        use &= slope > GRAZING
        step = np.where(use, left / np.maximum(slope, GRAZING), 0.0)
        way += step
        if not (np.abs(step) > _ROUND_OFF * np.abs(x).max(initial=0.0)).any():
            break
        left, along = shape.distance(x + way[:, None] * mean)
    return np.where(use, way, away), np.where(use[:, None], mean, -normal)
