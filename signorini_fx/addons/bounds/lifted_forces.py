"""Bounds of the work of forces in cells that are linear but for constants on their parts.

The stress of ``johnson_mercier`` balances forces that are constant on the parts of a cell, which are between its facets
and its centroid.  Of one that is linear in it a force r is left, orthogonal to linear vectors.  Its work on a
displacement is at most the norm of a *lifting* times the energy norm of the displacement.  A lifting is a symmetric
stress with the divergence -r and no traction on the facets.  Stresses of degree 2 on the parts have such liftings:
those of one reference cell are turned into those of others as A s A^T, of which the divergence is A (div s).
"""

from __future__ import annotations

from functools import cache
from itertools import combinations
from math import factorial, prod

import numpy as np

from signorini_fx.addons.bounds.johnson_mercier import forces_of_parts, turn_of
from signorini_fx.addons.bounds.simplices import COLUMNS, CORNERS_OF_PARTS, EDGES, FACETS, ROWS, TWICE, Array, Simplices


def reference_liftings(d: int) -> tuple[Array, Array]:
    """Stresses in the reference cell that lift the forces e_i (l_j - Q l_j), where l_j is the barycentric coordinate of
    the j-th unit vector and Q l_j the constants on the parts with its moments, number d i + j.

    Returns:
        At the vertices and the middles of the edges, in the order of ``EDGES``, of the parts, shape (d^2, d + 1, nodes,
        3 or 6); and the largest error of their divergence, tractions and jumps.
    """
    count, components = d + 1, len(ROWS[d])
    nodes = [*combinations(range(count), 1), *combinations(range(count), 2)]
    corners = CORNERS_OF_PARTS[d][..., 1:]  # in 3D, as those of the reference cell are 0 and the unit vectors
    steps = corners[:, 1:] - corners[:, :1]
    slopes = np.linalg.inv(steps.transpose(0, 2, 1))
    slopes = np.concatenate((-slopes.sum(axis=1, keepdims=True), slopes), axis=1)
    # Vertices of the parts: those of the cell, and its centroid with the number d + 1.
    numbers = [[*map(int, facet), count] for facet in FACETS[d]]
    sides: dict[tuple[int, ...], list[int]] = {}
    for part in range(count):
        for facet in FACETS[d]:
            sides.setdefault(tuple(sorted(numbers[part][k] for k in facet)), []).append(part)
    rows = []
    for facet, beside in sides.items():
        opposite = next(k for k, number in enumerate(numbers[beside[0]]) if number not in facet)
        normal = slopes[beside[0], opposite]
        for node in (*combinations(facet, 1), *combinations(facet, 2)):
            row = np.zeros((d, count, len(nodes), components))
            for sign, part in zip((1, -1), beside, strict=False):
                local = tuple(sorted(numbers[part].index(vertex) for vertex in node))
                row[:, part, nodes.index(local)] = sign * _times(normal)
            rows.append(row.reshape(d, -1))
    for part in range(count):
        for corner in range(count):
            row = np.zeros((d, count, len(nodes), components))
            gradients = _slopes_at(corner, d) @ slopes[part]
            row[:, part] = np.stack([_times(gradient) for gradient in gradients], axis=1)
            rows.append(row.reshape(d, -1))
    moments = (np.ones((count, count)) + np.eye(count)) / (count * (count + 1))
    beside_constants = CORNERS_OF_PARTS[d] - (forces_of_parts(d) @ moments)[:, None]
    forces = np.einsum("pcj,ai->pcaij", beside_constants[..., 1:], np.eye(d)).reshape(-1, d * d)
    matrix = np.concatenate(rows)
    right = np.concatenate((np.zeros((len(matrix) - len(forces), d * d)), -forces))
    liftings = np.linalg.pinv(matrix) @ right
    return liftings.T.reshape(d * d, count, len(nodes), components), np.abs(matrix @ liftings - right).max()


def _times(vector: Array) -> Array:
    """From the components of a symmetric tensor to its product with a vector, shape (d, 3 or 6)."""
    d = len(vector)
    rows = np.zeros((d, len(ROWS[d])))
    for k, (i, j) in enumerate(zip(ROWS[d], COLUMNS[d], strict=True)):
        rows[i, k] += vector[j]
        if i != j:
            rows[j, k] += vector[i]
    return rows


def _slopes_at(corner: int, d: int) -> Array:
    """Derivatives of the functions of degree 2 of vertices and edges by the barycentric coordinates at a corner."""
    at = np.eye(d + 1)[corner]
    edges = np.zeros((len(EDGES[d]), d + 1))
    first, second = EDGES[d].T
    rows = np.arange(len(EDGES[d]))
    edges[rows, first], edges[rows, second] = 4 * at[second], 4 * at[first]
    return np.concatenate((np.diag(4 * at - 1), edges))


@cache
def _products(d: int) -> Array:
    """Means over the cell of the products of the components c and e of the liftings i and j, shape (c, e, i, j)."""
    liftings = reference_liftings(d)[0]
    first, second = EDGES[d].T
    count = d + 1

    def mean(exponents: list[int]) -> float:
        """Of a product of powers of barycentric coordinates over a simplex."""
        return factorial(d) * prod(map(factorial, exponents)) / factorial(d + sum(exponents))

    # Functions of degree 2 as sums of products of two coordinates.
    pairs = [(a, b) for a in range(count) for b in range(a, count)]
    of_pairs = np.zeros((count + len(EDGES[d]), len(pairs)))
    for a in range(count):  # l (2 l - 1) = l^2 - l times the sum of the others
        for b in range(count):
            of_pairs[a, pairs.index((min(a, b), max(a, b)))] += 1.0 if a == b else -1.0
    for row, (a, b) in enumerate(zip(first, second, strict=True), start=count):
        of_pairs[row, pairs.index((int(a), int(b)))] = 4.0
    means = np.array([[mean([(*p, *q).count(k) for k in range(count)]) for q in pairs] for p in pairs])
    mass = of_pairs @ means @ of_pairs.T / count
    return np.einsum("ipac,ab,jpbe->ceij", liftings, mass, liftings, optimize=True)


def lifted_forces(t: Simplices, linear: Array) -> Array:
    """Bounds of the norms of what lifts the rest of linear forces, by cell, roots of energies, shape (n,).

    Args:
        t: the cells.
        linear: the force at their corners, force per volume, shape (n, d + 1, d).
    """
    d = t.dimension
    slopes = np.linalg.solve(t.jacobian, (linear[:, 1:] - linear[:, :1]).transpose(0, 2, 1)).reshape(-1, d * d)
    turn = turn_of(t.jacobian)
    compliance = TWICE[d][:, None] * t.moduli.compliance * t.volume[:, None, None]
    turned = turn.transpose(0, 2, 1) @ compliance @ turn
    squares = np.einsum("nce,ceij,ni,nj->n", turned, _products(d), slopes, slopes, optimize=True)
    return np.sqrt(squares.clip(min=0.0))
