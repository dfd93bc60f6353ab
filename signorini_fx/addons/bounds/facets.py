"""Facets of a body, edges or faces: points on them, and polynomials of Bernstein of degree 2.

The polynomials are those of the vertices, and of the edges in the order of ``EDGES_OF_FACET``.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.simplices import EDGES_OF_FACET

# Mean values on an edge of the products of three hat functions of its ends.
TRIPLE: Array = np.full((2, 2, 2), 1 / 12)
TRIPLE[0, 0, 0] = TRIPLE[1, 1, 1] = 1 / 4

# Gauss' rule on (0, 1).
GAUSS = (np.polynomial.legendre.leggauss(8)[0] + 1) / 2, np.polynomial.legendre.leggauss(8)[1] / 2


def _collapsed(count: int) -> tuple[Array, Array]:
    """Barycentric points and weights of Gauss' rule on a triangle, collapsed, shapes (q, 3) and (q,)."""
    points, weights = np.polynomial.legendre.leggauss(count)
    s, w = (points + 1) / 2, weights / 2
    a, b = (grid.ravel() for grid in np.meshgrid(s, s, indexing="ij"))
    products = np.outer(2 * w * (1 - s), w).ravel()
    return np.column_stack((1 - a - b * (1 - a), a, b * (1 - a))), np.asarray(products, dtype=np.float64)


def _lattice(d: int, n: int) -> Array:
    """Barycentric coordinates of points of a facet that are multiples of 1 / n, shape (q, d)."""
    points = [place for place in product(range(n + 1), repeat=d) if sum(place) == n]
    return np.array(points[::-1]) / n


# By dimension: barycentric points of quadrature on a facet, their weights, and the points at which gaps and friction
# bounds are looked at; those between two of them are assumed to be bounded by what is seen there.
POINTS: dict[int, Array] = {2: np.column_stack((1 - GAUSS[0], GAUSS[0])), 3: _collapsed(6)[0]}
WEIGHTS: dict[int, Array] = {2: GAUSS[1], 3: _collapsed(6)[1]}
SEEN: dict[int, Array] = {2: _lattice(2, 32), 3: _lattice(3, 8)}


def _nodes(d: int) -> Ints:
    """The vertices and the middles of the edges among ``SEEN``."""
    middles = np.array([np.eye(d)[pair].mean(axis=0) for pair in EDGES_OF_FACET[d]])
    nodes = np.concatenate((np.eye(d), middles))
    return np.abs(SEEN[d] - nodes[:, None]).sum(axis=2).argmin(axis=1)


NODES: dict[int, Ints] = {d: _nodes(d) for d in (2, 3)}


def bernstein(local: Array) -> Array:
    """Values of the polynomials at barycentric points, shape (q, d) to (q, 3) or (q, 6)."""
    a, b = EDGES_OF_FACET[local.shape[1]].T
    return np.column_stack((local**2, 2 * local[:, a] * local[:, b]))


def coefficients(nodal: Array) -> Array:
    """Of these polynomials, from values at vertices and at the middles of edges, shape (m, 3 or 6, ...)."""
    d = 2 if nodal.shape[1] == 3 else 3
    ends = nodal[:, :d]
    return np.concatenate((ends, 2 * nodal[:, d:] - ends[:, EDGES_OF_FACET[d]].mean(axis=2)), axis=1)


def linear_below(sampled: Array, d: int) -> Array:
    """At the vertices of facets a linear function that is not negative and at most a given one, shape (m, d).

    The linear function between the vertices is lowered as a whole.  Where it would be negative at a vertex it must not
    be raised to zero there, or it is above the given one beside this; what it is above the least value is made less by
    a factor instead.

    Args:
        sampled: the given one at ``SEEN``, not negative, shape (m, s).
        d: the dimension.
    """
    nodal = sampled[:, NODES[d][:d]]
    chord = nodal @ SEEN[d].T
    lowered = nodal - (chord - sampled).max(axis=1, initial=0.0)[:, None]
    smallest = sampled.min(axis=1)[:, None]
    height = chord - smallest
    factor = (
        np.divide(sampled - smallest, height, out=np.ones_like(sampled), where=height > 0).clip(max=1.0).min(axis=1)
    )
    scaled = smallest + factor[:, None] * (nodal - smallest)
    lowered_counts = (lowered.min(axis=1) >= 0) & (lowered.sum(axis=1) >= scaled.sum(axis=1))
    return np.where(lowered_counts[:, None], lowered, scaled).clip(min=0.0)


def times_linear(linear: Array, quadratic: Array) -> Array:
    """Coefficients of Bernstein of degree 3 of the products of linear vectors with those of degree 2.

    They are those of the vertices, of each edge the one near its first vertex and the one near its second, and in space
    one inside.

    Args:
        linear: at the vertices, shape (m, d, k).
        quadratic: coefficients, shape (m, 3 or 6, k).
    """
    d = linear.shape[1]
    ends, edges = quadratic[:, :d], quadratic[:, d:]
    parts = [np.einsum("mak,mak->ma", linear, ends)]
    for column, (a, b) in enumerate(zip(*EDGES_OF_FACET[d].T, strict=True)):
        parts += [
            (2 * (linear[:, i] * edges[:, column]).sum(axis=1) + (linear[:, j] * ends[:, i]).sum(axis=1))[:, None] / 3
            for i, j in ((a, b), (b, a))
        ]
    if d == 3:  # its i-th edge is opposite its i-th vertex
        parts.append(np.einsum("mak,mak->m", linear, edges)[:, None] / 3)
    return np.concatenate(parts, axis=1)


def cubic(local: Array) -> Array:
    """Values of these polynomials of degree 3 at barycentric points, shape (q, d) to (q, 4) or (q, 10)."""
    parts = [local**3]
    for a, b in zip(*EDGES_OF_FACET[local.shape[1]].T, strict=True):
        parts.append(3 * np.stack((local[:, a] ** 2 * local[:, b], local[:, a] * local[:, b] ** 2), axis=1))
    if local.shape[1] == 3:
        parts.append(6 * local.prod(axis=1, keepdims=True))
    return np.concatenate(parts, axis=1)
