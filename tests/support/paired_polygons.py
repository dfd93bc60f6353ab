"""Convex polygons in 2D of a facet: what two of them share, a quadrature on it, and places in reference facets.

It shares no code with ``pairs``; see ``paired_facets``.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# Steps of Newton's method at most, and a place in a reference facet that is round-off.
STEPS, ROUND_OFF = 15, 1e-14


@cache
def gauss(count: int) -> tuple[Array, Array]:
    """Points and weights of Gauss and Legendre's rule on [-1, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return np.asarray(nodes), np.asarray(weights)


def _signed(polygon: Array) -> Array:
    """The area of polygons of shape (..., c, 2), negative where their corners run clockwise."""
    x, y = polygon[..., 0], polygon[..., 1]
    return np.asarray((x * np.roll(y, -1, axis=-1) - np.roll(x, -1, axis=-1) * y).sum(axis=-1) / 2)


def positive(polygon: Array) -> Array:
    """The same polygon, counterclockwise."""
    return polygon if _signed(polygon) > 0 else polygon[::-1]


def cut(polygon: Array, window: Array) -> Array:
    """What of a convex polygon is on the left of all edges of another one, shape (c, 2)."""
    for edge in range(len(window)):
        a, along = window[edge], window[(edge + 1) % len(window)] - window[edge]
        heights = along[0] * (polygon - a)[:, 1] - along[1] * (polygon - a)[:, 0]
        corners = []
        for k in range(len(polygon)):
            p, q, hp, hq = polygon[k - 1], polygon[k], heights[k - 1], heights[k]
            if (hp < 0) != (hq < 0):
                corners.append(p + hp / (hp - hq) * (q - p))
            if hq >= 0:
                corners.append(q)
        if len(corners) < 3:
            return np.zeros((0, 2))
        polygon = np.array(corners)
    return polygon


def collapsed(polygon: Array, count: int) -> tuple[Array, Array]:
    """Points and weights on a polygon: triangles at its first corner, each a collapsed square."""
    nodes, weights = gauss(count)
    s, w = (nodes + 1) / 2, weights / 2
    u, v = (grid.ravel() for grid in np.meshgrid(s, s))
    square_weights = np.outer(w, w).ravel() * u
    points, triangle_weights = [], []
    for corner in range(1, len(polygon) - 1):
        first, across = polygon[corner] - polygon[0], polygon[corner + 1] - polygon[corner]
        points.append(polygon[0] + u[:, None] * (first + v[:, None] * across))
        triangle_weights.append(square_weights * abs(first[0] * across[1] - first[1] * across[0]))
    return np.concatenate(points), np.concatenate(triangle_weights)


def place_in(part: Array, flat: Array, p: Array) -> tuple[Array, Array]:
    """Where points of the plane are in the reference facet.

    Args:
        part: corners of the linear part that each point is in, in the reference facet, shape (q, c, 2) or (1, c, 2).
        flat: the same in 2D.
        p: the points, shape (q, 2).

    Returns:
        Places, shape (q, 2), and the projected area of a unit of the reference facet there, shape (q,).
    """
    if part.shape[1] == 3:
        matrix = np.concatenate((flat.swapaxes(1, 2), np.ones((len(flat), 1, 3))), axis=1)
        shares = np.linalg.solve(matrix, np.column_stack((p, np.ones(len(p))))[:, :, None])[:, :, 0]
        return (shares[:, None] @ part)[:, 0], np.broadcast_to(np.abs(_signed(flat) / _signed(part)), len(p))
    s = np.full(p.shape, 0.5)
    for _ in range(STEPS):
        shares, slopes = _bilinear(s)
        jacobian = (slopes @ flat).swapaxes(1, 2)
        step = np.linalg.solve(jacobian, (p - (shares[:, None] @ flat)[:, 0])[:, :, None])[:, :, 0]
        s = s + step
        if np.abs(step).max() < ROUND_OFF:
            break
    shares, slopes = _bilinear(s)
    areas = [np.linalg.det(slopes @ corners) for corners in (flat, part)]
    return (shares[:, None] @ part)[:, 0], np.abs(areas[0] / areas[1])


def _bilinear(s: Array) -> tuple[Array, Array]:
    """The functions of the corners of a square, shape (q, 4), and their derivatives, shape (q, 2, 4)."""
    a, b = s.T
    shares = np.stack(((1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b), axis=1)
    first = np.stack((b - 1, 1 - b, b, -b), axis=1)
    return shares, np.stack((first, np.stack((a - 1, -a, a, 1 - a), axis=1)), axis=1)
