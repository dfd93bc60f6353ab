"""Lagrange elements of degree 1 and 2 on triangles and quadrilaterals: shape functions and quadrature rules.

Nodes of a triangle: the corners 0, 1, 2, then the middles of the sides (1, 2), (0, 2), (0, 1).  Nodes of a
quadrilateral: the corners (0, 0), (1, 0), (0, 1), (1, 1) of the unit square, then the middles of the sides (0, 1),
(0, 2), (1, 3), (2, 3), then the centre.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

SIDES = {3: ((1, 2), (0, 2), (0, 1)), 4: ((0, 1), (0, 2), (1, 3), (2, 3))}
# Number of nodes -> (corners, degree).
KINDS = {3: (3, 1), 6: (3, 2), 4: (4, 1), 9: (4, 2)}


def line(degree: int, s: Array) -> tuple[Array, Array]:
    """Shape functions on [0, 1], ends first, and their derivatives, at the points s: shape (points, nodes)."""
    if degree == 1:
        return np.stack([1 - s, s], axis=1), np.stack([-np.ones_like(s), np.ones_like(s)], axis=1)
    values = np.stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)], axis=1)
    return values, np.stack([4 * s - 3, 4 * s - 1, 4 - 8 * s], axis=1)


def shape(nodes: int, xi: Array) -> tuple[Array, Array]:
    """Shape functions (points, nodes) and gradients (points, nodes, 2) of the element with so many nodes."""
    corners, degree = KINDS[nodes]
    if corners == 3:
        bary = np.stack([1 - xi[:, 0] - xi[:, 1], xi[:, 0], xi[:, 1]], axis=1)
        slopes = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
        if degree == 1:
            return bary, np.broadcast_to(slopes, (len(xi), 3, 2)).copy()
        values = [b * (2 * b - 1) for b in bary.T]
        gradients = [(4 * b - 1)[:, None] * slope for b, slope in zip(bary.T, slopes, strict=True)]
        for i, j in SIDES[3]:
            values.append(4 * bary[:, i] * bary[:, j])
            gradients.append(4 * (bary[:, i, None] * slopes[j] + bary[:, j, None] * slopes[i]))
        return np.stack(values, axis=1), np.stack(gradients, axis=1)
    (fx, dx), (fy, dy) = line(degree, xi[:, 0]), line(degree, xi[:, 1])
    # (index along x, index along y) of each node; 2 is the middle.
    order = [(0, 0), (1, 0), (0, 1), (1, 1)]
    if degree == 2:
        order += [(2, 0), (0, 2), (1, 2), (2, 1), (2, 2)]
    values = np.stack([fx[:, i] * fy[:, j] for i, j in order], axis=1)
    gradients = np.stack([np.stack([dx[:, i] * fy[:, j], fx[:, i] * dy[:, j]], axis=1) for i, j in order], axis=1)
    return values, gradients


def gauss(points: int) -> tuple[Array, Array]:
    """Gauss's rule on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(points)
    return (x + 1) / 2, w / 2


def square(points: int) -> tuple[Array, Array]:
    """Gauss's rule on the unit square, so many points along each side."""
    x, w = gauss(points)
    a, b = np.meshgrid(x, x, indexing="ij")
    return np.stack([a.ravel(), b.ravel()], axis=1), np.outer(w, w).ravel()


def triangle(points: int) -> tuple[Array, Array]:
    """Gauss's rule on the square, folded onto the triangle: exact up to degree 2 points - 2."""
    xi, w = square(points)
    return np.stack([xi[:, 0], xi[:, 1] * (1 - xi[:, 0])], axis=1), w * (1 - xi[:, 0])


def triangle_of_degree_four() -> tuple[Array, Array]:
    """The six points of Strang and Fix: the rule that the curved triangles of degree 2 are defined with."""
    rows = []
    for a, w in ((0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322)):
        rows += [(a, a, w / 2), (1 - 2 * a, a, w / 2), (a, 1 - 2 * a, w / 2)]
    table = np.array(rows)
    return table[:, :2], table[:, 2]


def stiffness_rule(nodes: int, *, curved: bool) -> tuple[Array, Array]:
    """The rule that a(., .) is defined with: exact on straight triangles and parallelograms.

    On other cells the integrand is rational, so that the rule is a part of the element: quadrilaterals have 3 x 3
    points with degree 1, 4 x 4 with degree 2 and 5 x 5 where they are curved.
    """
    corners, degree = KINDS[nodes]
    if corners == 3:
        return triangle_of_degree_four() if degree == 2 else (np.array([[1 / 3, 1 / 3]]), np.array([0.5]))
    return square(5 if curved else degree + 2)


def reduced_rule(nodes: int) -> tuple[Array, Array]:
    """The rule of the volumetric term where it is reduced: one point, 2 x 2 for Q2."""
    if nodes == 9:
        return square(2)
    return (np.array([[1 / 3, 1 / 3]]), np.array([0.5])) if KINDS[nodes][0] == 3 else square(1)


def at_points(expression: Any, x: Array) -> Array:
    """A value of a scene, a number or an expression of x[0] and x[1], at points of shape (n, 2).

    The scenes are the oracle's own, so that Python itself may evaluate them.
    """
    if isinstance(expression, int | float):
        return np.full(len(x), float(expression))
    names = {name: getattr(np, name) for name in ("cos", "exp", "sin", "sqrt")} | {"pi": np.pi, "abs": abs}
    names["where"] = lambda condition, yes, no: yes if condition else no
    code = compile(expression, "scene", "eval")
    return np.array([float(eval(code, {"__builtins__": {}}, {**names, "x": point})) for point in x])
