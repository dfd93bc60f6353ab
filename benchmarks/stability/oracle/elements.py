"""Lagrange elements of degree 1 and 2 on lines, triangles, quadrilaterals, tetrahedra and
hexahedra.

Nodes are the corners, then the middles of the edges of ``EDGES``, then those of the faces of a
hexahedron, then that of a quadrilateral or hexahedron.  Corner number k of a line, square or cube
is at (k mod 2, k // 2 mod 2, k // 4).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

# By dimension and number of corners.
EDGES: dict[tuple[int, int], tuple[tuple[int, int], ...]] = {
    (1, 2): ((0, 1),),
    (2, 3): ((1, 2), (0, 2), (0, 1)),
    (2, 4): ((0, 1), (0, 2), (1, 3), (2, 3)),
    (3, 4): ((2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)),
    (3, 8): tuple((a, a + step) for a in range(8) for step in (1, 2, 4) if not a & step),
}
FACES: dict[tuple[int, int], tuple[tuple[int, ...], ...]] = {
    (2, 3): EDGES[2, 3],
    (2, 4): EDGES[2, 4],
    (3, 4): ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)),
    (3, 8): ((0, 1, 2, 3), (0, 1, 4, 5), (0, 2, 4, 6), (1, 3, 5, 7), (2, 3, 6, 7), (4, 5, 6, 7)),
}
# Corners and degree by dimension and number of nodes.
KINDS = {
    (1, 2): (2, 1),
    (1, 3): (2, 2),
    (2, 3): (3, 1),
    (2, 6): (3, 2),
    (2, 4): (4, 1),
    (2, 9): (4, 2),
}
KINDS |= {(3, 4): (4, 1), (3, 10): (4, 2), (3, 8): (8, 1), (3, 27): (8, 2)}


def between(dim: int, corners: int) -> list[tuple[int, ...]]:
    """The corners that each further node of an element of degree 2 is in the middle of."""
    found: list[tuple[int, ...]] = [*EDGES[dim, corners]]
    if corners == 8:
        found += FACES[dim, corners]
    return [*found, tuple(range(corners))] if dim > 1 and corners == 2**dim else found


def face_nodes(dim: int, nodes: int) -> list[list[int]]:
    """The nodes on each face of a cell with so many nodes, in the order of the element of the
    face.
    """
    corners, degree = KINDS[dim, nodes]
    groups = [frozenset((k,)) for k in range(corners)]
    groups += [frozenset(group) for group in between(dim, corners)] if degree == 2 else []
    found = []
    for face in FACES[dim, corners]:
        inner = (
            [tuple(face[k] for k in group) for group in between(dim - 1, len(face))]
            if degree == 2
            else []
        )
        found.append(
            [groups.index(frozenset(group)) for group in [*((corner,) for corner in face), *inner]]
        )
    return found


def reference_nodes(dim: int, nodes: int) -> Array:
    """Where the nodes are on the reference cell, shape (nodes, dim)."""
    corners, degree = KINDS[dim, nodes]
    if dim > 1 and corners == dim + 1:
        x = np.concatenate([np.zeros((1, dim)), np.eye(dim)])
    else:
        x = np.array([[k >> axis & 1 for axis in range(dim)] for k in range(corners)], dtype=float)
    middles = (
        [x[list(group)].mean(axis=0)[None] for group in between(dim, corners)]
        if degree == 2
        else []
    )
    return np.concatenate([x, *middles])


def shape(dim: int, nodes: int, xi: Array) -> tuple[Array, Array]:
    """Shape functions (points, nodes) and gradients (points, nodes, dim) of the element with so
    many nodes.
    """
    corners, degree = KINDS[dim, nodes]
    if dim > 1 and corners == dim + 1:
        bary = np.column_stack([1 - xi.sum(axis=1), xi])
        slopes = np.concatenate([-np.ones((1, dim)), np.eye(dim)])
        if degree == 1:
            return bary, np.broadcast_to(slopes, (len(xi), dim + 1, dim)).copy()
        values = [b * (2 * b - 1) for b in bary.T]
        gradients = [(4 * b - 1)[:, None] * slope for b, slope in zip(bary.T, slopes, strict=True)]
        for i, j in EDGES[dim, corners]:
            values.append(4 * bary[:, i] * bary[:, j])
            gradients.append(4 * (bary[:, i, None] * slopes[j] + bary[:, j, None] * slopes[i]))
        return np.stack(values, axis=1), np.stack(gradients, axis=1)
    # The nodes of a line are its ends 0 and 1, then the middle.
    order = np.array(
        [{0.0: 0, 1.0: 1, 0.5: 2}[v] for v in reference_nodes(dim, nodes).ravel()]
    ).reshape(-1, dim)
    along = [_line(degree, xi[:, axis]) for axis in range(dim)]
    f = [values[:, order[:, axis]] for axis, (values, _) in enumerate(along)]
    d = [slopes[:, order[:, axis]] for axis, (_, slopes) in enumerate(along)]
    products = [
        np.prod([d[k] if k == axis else f[k] for k in range(dim)], axis=0) for axis in range(dim)
    ]
    return np.prod(f, axis=0), np.stack(products, axis=2)


def _line(degree: int, s: Array) -> tuple[Array, Array]:
    """Shape functions on [0, 1], ends first, and their derivatives, at the points s: shape (points,
    nodes).
    """
    if degree == 1:
        return np.stack([1 - s, s], axis=1), np.stack([-np.ones_like(s), np.ones_like(s)], axis=1)
    values = np.stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)], axis=1)
    return values, np.stack([4 * s - 3, 4 * s - 1, 4 - 8 * s], axis=1)


def cube(dim: int, points: int) -> tuple[Array, Array]:
    """Gauss's rule on the unit line, square or cube, so many points along each edge."""
    x, w = np.polynomial.legendre.leggauss(points)
    at = np.stack(np.meshgrid(*[(x + 1) / 2] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    weights = (
        np.stack(np.meshgrid(*[w / 2] * dim, indexing="ij"), axis=-1).reshape(-1, dim).prod(axis=1)
    )
    return at, weights


def simplex(dim: int, points: int) -> tuple[Array, Array]:
    """Gauss's rule on the square or cube, folded onto the simplex: exact up to degree 2 points -
    dim.
    """
    x, weights = cube(dim, points)
    left = np.ones(len(x))
    for axis in range(dim):
        share = x[:, axis].copy()
        x[:, axis] *= left
        weights = weights * left
        left = left * (1 - share)
    return x, weights


def cell_rule(dim: int, nodes: int, geometry_degree: int) -> tuple[Array, Array]:
    """The rule that a(., .) is defined with: exact on straight simplices and parallelepipeds.

    On other cells the integrand is rational, so that the rule is a part of the element: on squares
    and cubes so many points along each edge that its factors together are integrated exactly where
    the Jacobian is constant, on triangles of degree 2 the six points of Strang and Fix.
    """
    corners, degree = KINDS[dim, nodes]
    if (dim, nodes) == (2, 6):
        rows = []
        for a, w in (
            (0.445948490915965, 0.223381589678011),
            (0.091576213509771, 0.109951743655322),
        ):
            rows += [(a, a, w / 2), (1 - 2 * a, a, w / 2), (a, 1 - 2 * a, w / 2)]
        return np.array(rows)[:, :2], np.array(rows)[:, 2]
    return (
        simplex(dim, 2 * degree) if corners == dim + 1 else cube(dim, degree + geometry_degree + 1)
    )


def reduced_rule(dim: int, nodes: int) -> tuple[Array, Array]:
    """The rule of the volumetric term where it is reduced: one point, two along each edge for
    Q2.
    """
    corners, degree = KINDS[dim, nodes]
    if corners == dim + 1:
        return np.full((1, dim), 1 / (dim + 1)), np.array([1 / math.factorial(dim)])
    return cube(dim, degree)


def at_points(expression: Any, x: Array) -> Array:
    """A value of a scene of the oracle itself, a number or an expression for Python, at points of
    shape (n, d).
    """
    if isinstance(expression, int | float):
        return np.full(len(x), float(expression))
    names = {name: getattr(np, name) for name in ("cos", "exp", "sin", "sqrt")} | {
        "pi": np.pi,
        "abs": abs,
    }
    names["where"] = lambda condition, yes, no: yes if condition else no
    code = compile(expression, "scene", "eval")
    return np.array([float(eval(code, {"__builtins__": {}}, {**names, "x": point})) for point in x])
