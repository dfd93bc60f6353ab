"""Lagrange elements of degree 1 and 2 on tetrahedra and hexahedra: shape functions and quadrature rules.

Nodes of a tetrahedron: the corners, then the middles of the edges of ``EDGES``.  Nodes of a hexahedron: the corners, of
which number k is at (k mod 2, k // 2 mod 2, k // 4) of the unit cube, then the middles of the edges, of the faces, and
of the cell.  Facets are the elements of the plane.
"""

from __future__ import annotations

import numpy as np

from benchmarks.stability.oracle.elements import Array, gauss, line

EDGES = {
    4: ((2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)),
    8: tuple((a, a + step) for a in range(8) for step in (1, 2, 4) if not a & step),
}
FACES = {
    4: ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)),
    8: ((0, 1, 2, 3), (0, 1, 4, 5), (0, 2, 4, 6), (1, 3, 5, 7), (2, 3, 6, 7), (4, 5, 6, 7)),
}
# Number of nodes -> (corners, degree).
KINDS = {4: (4, 1), 10: (4, 2), 8: (8, 1), 27: (8, 2)}
# Sides of a facet in the order of the nodes on it.
_SIDES = {3: ((1, 2), (0, 2), (0, 1)), 4: ((0, 1), (0, 2), (1, 3), (2, 3))}


def face_nodes(nodes: int) -> list[list[int]]:
    """The nodes on each face of a cell with so many nodes, in the order of the element of the plane."""
    corners, degree = KINDS[nodes]
    found = []
    for number, face in enumerate(FACES[corners]):
        here = list(face)
        if degree == 2:
            for i, j in _SIDES[len(face)]:
                here.append(corners + EDGES[corners].index((min(face[i], face[j]), max(face[i], face[j]))))
            if corners == 8:
                here.append(corners + len(EDGES[8]) + number)
        found.append(here)
    return found


def reference_nodes(nodes: int) -> Array:
    """Where the nodes are on the reference cell, shape (nodes, 3)."""
    corners, degree = KINDS[nodes]
    if corners == 4:
        x = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    else:
        x = np.array([[k % 2, k // 2 % 2, k // 4] for k in range(8)], dtype=float)
    if degree == 1:
        return x
    groups = [*EDGES[corners], *((*FACES[8], tuple(range(8))) if corners == 8 else ())]
    return np.concatenate([x, [x[list(group)].mean(axis=0) for group in groups]])


def shape(nodes: int, xi: Array) -> tuple[Array, Array]:
    """Shape functions (points, nodes) and gradients (points, nodes, 3) of the element with so many nodes."""
    corners, degree = KINDS[nodes]
    if corners == 4:
        bary = np.column_stack([1 - xi.sum(axis=1), xi])
        slopes = np.concatenate([-np.ones((1, 3)), np.eye(3)])
        if degree == 1:
            return bary, np.broadcast_to(slopes, (len(xi), 4, 3)).copy()
        values = [b * (2 * b - 1) for b in bary.T]
        gradients = [(4 * b - 1)[:, None] * slope for b, slope in zip(bary.T, slopes, strict=True)]
        for i, j in EDGES[4]:
            values.append(4 * bary[:, i] * bary[:, j])
            gradients.append(4 * (bary[:, i, None] * slopes[j] + bary[:, j, None] * slopes[i]))
        return np.stack(values, axis=1), np.stack(gradients, axis=1)
    along = [line(degree, xi[:, axis]) for axis in range(3)]
    # The nodes of a line are its ends 0 and 1, then the middle.
    order = np.array([{0.0: 0, 1.0: 1, 0.5: 2}[v] for v in reference_nodes(nodes).ravel()]).reshape(-1, 3)
    f = [values[:, order[:, axis]] for axis, (values, _) in enumerate(along)]
    d = [slopes[:, order[:, axis]] for axis, (_, slopes) in enumerate(along)]
    return f[0] * f[1] * f[2], np.stack([d[0] * f[1] * f[2], f[0] * d[1] * f[2], f[0] * f[1] * d[2]], axis=2)


def cube(points: int) -> tuple[Array, Array]:
    """Gauss's rule on the unit cube, so many points along each edge."""
    x, w = gauss(points)
    a, b, c = np.meshgrid(x, x, x, indexing="ij")
    weights = w[:, None, None] * w[None, :, None] * w[None, None, :]
    return np.stack([a.ravel(), b.ravel(), c.ravel()], axis=1), weights.ravel()


def tetrahedron(points: int) -> tuple[Array, Array]:
    """Gauss's rule on the cube, folded onto the tetrahedron: exact up to degree 2 points - 3."""
    xi, w = cube(points)
    a, b, c = xi.T
    x = np.stack([a, b * (1 - a), c * (1 - a) * (1 - b)], axis=1)
    return x, w * (1 - a) ** 2 * (1 - b)


def cell_rule(nodes: int, geometry_degree: int) -> tuple[Array, Array]:
    """The rule that a(., .) is defined with: exact on straight tetrahedra and parallelepipeds.

    On other hexahedra the integrand is rational, so that the rule is a part of the element: so many points along each
    edge that its factors together are integrated exactly where the Jacobian is constant.
    """
    corners, degree = KINDS[nodes]
    return tetrahedron(2 * degree) if corners == 4 else cube(degree + geometry_degree + 1)


def reduced_rule(nodes: int) -> tuple[Array, Array]:
    """The rule of the volumetric term where it is reduced: one point, 2 x 2 x 2 for Q2."""
    if KINDS[nodes][0] == 4:
        return np.full((1, 3), 0.25), np.array([1 / 6])
    return cube(2 if nodes == 27 else 1)
