"""Facets of a body, edges or faces: points on them, and polynomials of Bernstein of degree 2.

The polynomials are those of the vertices, and of the edges in the order of ``EDGES_OF_FACET``.
"""

from __future__ import annotations

import numpy as np

from signorini_fx.addons.bounds.simplices import EDGES_OF_FACET, Array

# Points of Gauss' rule along an edge: integrands have kinks where slip turns.
_POINTS = np.polynomial.legendre.leggauss(8)


def _collapsed() -> tuple[Array, Array]:
    """Barycentric points and weights of Gauss' rule on a triangle, collapsed, shapes (q, 3) and (q,)."""
    s, w = (_POINTS[0] + 1) / 2, _POINTS[1] / 2
    a, b = (grid.ravel() for grid in np.meshgrid(s, s, indexing="ij"))
    products = np.outer(2 * w * (1 - s), w).ravel()
    return np.column_stack((1 - a - b * (1 - a), a, b * (1 - a))), np.asarray(products, dtype=np.float64)


# By dimension: barycentric points of quadrature on a facet, and their weights.
POINTS: dict[int, Array] = {2: np.column_stack((1 - _POINTS[0], 1 + _POINTS[0])) / 2, 3: _collapsed()[0]}
WEIGHTS: dict[int, Array] = {2: _POINTS[1] / 2, 3: _collapsed()[1]}


def bernstein(local: Array) -> Array:
    """Values of the polynomials at barycentric points, shape (q, d) to (q, 3) or (q, 6)."""
    a, b = EDGES_OF_FACET[local.shape[1]].T
    return np.column_stack((local**2, 2 * local[:, a] * local[:, b]))


def coefficients(nodal: Array) -> Array:
    """Of these polynomials, from values at vertices and at the middles of edges, shape (m, 3 or 6, ...)."""
    d = 2 if nodal.shape[1] == 3 else 3
    ends = nodal[:, :d]
    return np.concatenate((ends, 2 * nodal[:, d:] - ends[:, EDGES_OF_FACET[d]].mean(axis=2)), axis=1)
