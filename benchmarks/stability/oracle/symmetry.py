"""Planes of symmetry of two bodies: supports hold both across the same plane, beyond which is their
mirror image.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from benchmarks.stability.oracle.elements import Array, Ints

# A surface whose normal has a larger component across the plane has an edge there (docs/theory.md).
_SMOOTH = 0.2
_NEAR = 1e-6


def across_planes(body: Any, normals: Array, slave: Ints, master: Ints) -> Array:
    """Projections onto the directions across planes of symmetry at nodes, shape (nodes, d, d);
    supports along axes.
    """
    x, dimension = body.x, body.x.shape[1]
    found = np.zeros((len(x), dimension, dimension))
    size = max(
        float(np.linalg.norm(np.ptp(x[nodes], axis=0)))
        for side in (slave, master)
        for nodes in side
    )
    others = np.unique(master)
    for axis in range(dimension):
        unit = np.eye(dimension)[axis]
        at_rest = (np.abs(body.held @ unit - unit).max(axis=1) < _NEAR) & _still(body, axis)
        theirs = others[at_rest[others]]
        for node in np.unique(slave)[at_rest[np.unique(slave)]]:
            if not theirs.size or not normals[node].any() or abs(normals[node, axis]) > _SMOOTH:
                continue
            away = cdist(x[[node]], x[others])[0]
            near = np.abs(x[theirs, axis] - x[node, axis]) < _NEAR * size
            near &= cdist(x[[node]], x[theirs])[0] <= size + away.min()
            own = _ways_out(x[:, axis], slave, node, _NEAR * size)
            if any(
                own & _ways_out(x[:, axis], master, other, _NEAR * size) for other in theirs[near]
            ):
                found[node, axis, axis] = 1.0
    return found


def _ways_out(place: Array, facets: Ints, node: int, close: float) -> set[str]:
    """To which sides of a plane through a node no facet of it goes; ``place``: of all nodes, across
    the plane.
    """
    ends = place[np.unique([facet for facet in facets if node in facet])] - place[node]
    return {
        name for name, beyond in (("left", -ends.min()), ("right", ends.max())) if beyond <= close
    }


def _still(body: Any, axis: int) -> Array:
    """Whether supports do not move a node along an axis in any load step."""
    steps: Iterable[int] = range(body.steps)
    return np.all([body.prescribed(step)[:, axis] == 0 for step in steps], axis=0)
