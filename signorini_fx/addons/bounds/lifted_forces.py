"""Bounds of the work of forces in tetrahedra that are linear but for constants on their quarters.

The stress of ``johnson_mercier`` balances forces that are constant on the quarters of a tetrahedron, which are between
its faces and its centroid.  Of one that is linear in it a force r is left, orthogonal to linear vectors.  Its work on a
displacement is at most the norm of a *lifting*, a symmetric stress with the divergence -r and no traction on the faces,
times the energy norm of the displacement.  Stresses of degree 2 on the quarters have such liftings: those of one
reference tetrahedron are turned into those of others as A s A^T, of which the divergence is A (div s), and the one of
least norm is found in each.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.initial_stress import simplex_rule
from signorini_fx.addons.bounds.johnson_mercier import forces_of_parts, turn_of
from signorini_fx.addons.bounds.lifted_tractions import rounded
from signorini_fx.addons.bounds.simplices import COLUMNS, EDGES, FACETS, ROWS, TWICE, Simplices
from signorini_fx.tuned import SAME_NUMBER

# Tetrahedra whose systems are solved at the same time.
_CHUNK = 500
# Functions of degree 2 in a quarter: those of its corners, and of its edges.
_NODES = [*combinations(range(4), 1), *combinations(range(4), 2)]


@dataclass(frozen=True)
class Quarters:
    """Tetrahedra divided by their centroids, with stresses of degree 2 on the parts.

    Attributes:
        x: vertices, the centroids last, length, shape (v, 3).
        corners: of the quarters, those of each tetrahedron together, the centroid last, shape (4 n, 4).
        tractions: from the stresses at the nodes of the quarters, shape (4 n, 10, 6) in one column, to the jumps of
            tractions and the tractions on the boundary at nodes of faces.
        divergence: to the divergence at the corners of the quarters, shape (48 n, 240 n).
    """

    x: Array
    corners: Ints
    tractions: Array
    divergence: Array

    @classmethod
    def of(cls, x: Array, corners: Ints) -> Quarters:
        """Of tetrahedra.

        Args:
            x: vertices, length, shape (v, 3).
            corners: of them, shape (n, 4).
        """
        centroids = np.tile(len(x) + np.arange(len(corners))[:, None, None], (1, 4, 1))
        quarters: Ints = np.concatenate((corners[:, FACETS[3]], centroids), axis=2).reshape(-1, 4)
        x = np.concatenate((x, x[corners].mean(axis=1)))
        steps = x[quarters][:, 1:] - x[quarters][:, :1]
        gradients = np.linalg.inv(steps.transpose(0, 2, 1))
        gradients = np.concatenate((-gradients.sum(axis=1, keepdims=True), gradients), axis=1)
        sides: dict[tuple[int, ...], list[tuple[int, int]]] = {}
        for quarter, number in np.ndindex(len(quarters), 4):
            vertices = np.sort(quarters[quarter, FACETS[3][number]])
            sides.setdefault(tuple(map(int, vertices)), []).append((quarter, number))
        tractions = []
        for face, beside in sides.items():
            normal = gradients[beside[0]] / np.linalg.norm(gradients[beside[0]])
            for node in [*((vertex,) for vertex in face), *combinations(face, 2)]:
                row = np.zeros((3, len(quarters), 10, 6))
                for sign, (quarter, _) in zip((1, -1), beside, strict=False):
                    local = tuple(sorted(quarters[quarter].tolist().index(vertex) for vertex in node))
                    row[:, quarter, _NODES.index(local)] = sign * _times(normal)
                tractions.append(row.reshape(3, -1))
        divergence = np.zeros((len(quarters), 4, 3, len(quarters), 10, 6))
        for quarter in range(len(quarters)):
            for corner in range(4):
                slopes = _slopes(np.eye(4)[corner]) @ gradients[quarter]
                divergence[quarter, corner, :, quarter] = np.stack([_times(slope) for slope in slopes], axis=1)
        size = 12 * len(quarters)
        return cls(x, quarters, np.concatenate(tractions), divergence.reshape(size, -1))


def _times(vector: Array) -> Array:
    """From the components of a symmetric tensor to its product with a vector, shape (3, 6)."""
    rows = np.zeros((3, 6))
    for k, (i, j) in enumerate(zip(ROWS[3], COLUMNS[3], strict=True)):
        rows[i, k] += vector[j]
        if i != j:
            rows[j, k] += vector[i]
    return rows


def _slopes(coordinates: Array) -> Array:
    """Derivatives of the functions of degree 2 of the nodes by the barycentric coordinates, at a place, (10, 4)."""
    edges = np.zeros((6, 4))
    first, second = EDGES[3].T
    edges[range(6), first], edges[range(6), second] = 4 * coordinates[second], 4 * coordinates[first]
    return np.concatenate((np.diag(4 * coordinates - 1), edges))


def mass_of_nodes() -> Array:
    """Integrals of the products of these functions over the volume, shape (10, 10)."""
    local, weights = simplex_rule(3, 4)
    values = np.concatenate((local * (2 * local - 1), 4 * local[:, EDGES[3][:, 0]] * local[:, EDGES[3][:, 1]]), axis=1)
    return np.asarray(values.T @ (weights[:, None] * values))


@dataclass(frozen=True)
class _Reference:
    """Liftings in the tetrahedron with the corners 0 and the unit vectors.

    Attributes:
        products: integrals over the volume of the products of the components c and d of the stresses i and j: of k
            stresses without divergence, and then of a lifting of each force e_i (l_j - Q l_j), where l_j is the
            barycentric coordinate of the j-th unit vector and Q l_j the constants on quarters with its moments, number
            3 i + j; shape (36, (k + 9)^2).
        count: k.
    """

    products: Array
    count: int


@cache
def _reference() -> _Reference:
    corners = np.concatenate((np.zeros((1, 3)), np.eye(3)))
    cell = Quarters.of(corners, np.arange(4)[None])
    mean = np.full(4, 0.25)
    local = np.stack([np.concatenate((np.eye(4)[facet], mean[None])) for facet in FACETS[3]])  # (4, 4, 4)
    moments = (np.ones((4, 4)) + np.eye(4)) / 20
    beside_constants = local - (forces_of_parts(3) @ moments)[:, None]  # of the four coordinates
    forces = np.einsum("pcj,ai->pcaij", beside_constants[..., 1:], np.eye(3)).reshape(48, 9)
    matrix = np.concatenate((cell.tractions, cell.divergence))
    _, sizes, directions = np.linalg.svd(matrix)
    free = directions[int((sizes > SAME_NUMBER * sizes[0]).sum()) :]
    right_side = np.concatenate((np.zeros((len(cell.tractions), 9)), -forces))
    liftings = np.linalg.lstsq(matrix, right_side, rcond=SAME_NUMBER)[0]
    stresses = np.concatenate((free, liftings.T)).reshape(-1, 4, 10, 6)
    products = np.einsum("ipac,ab,jpbd->cdij", stresses, mass_of_nodes() / 4, stresses, optimize=True)
    return _Reference(products.reshape(36, -1), len(free))


def lifted_forces(t: Simplices, linear: Array) -> Array:
    """Bounds of the work of what constants on quarters miss of linear forces, per unit of the energy norm, shape (n,).

    Args:
        t: the tetrahedra.
        linear: the force at their corners, force per volume, shape (n, 4, 3).
    """
    reference, bounds = _reference(), np.zeros(len(linear))
    count = reference.count
    slopes = np.linalg.solve(t.jacobian, (linear[:, 1:] - linear[:, :1]).transpose(0, 2, 1)).reshape(-1, 9)
    turn = turn_of(t.jacobian)
    for first in range(0, len(linear), _CHUNK):
        chunk = slice(first, first + _CHUNK)
        strain, unit = t.moduli.scaled_strain(np.tile(np.eye(6), (len(slopes[chunk]), 1, 1)), chunk)
        compliance = strain * TWICE[3] * (t.volume[chunk] / unit)[:, None, None]
        turned = turn[chunk].transpose(0, 2, 1) @ compliance @ turn[chunk]
        size = count + 9
        products = (turned.reshape(-1, 36) @ reference.products).reshape(-1, size, size)
        load = slopes[chunk][:, :, None]
        beside = products[:, :count, count:] @ load
        alone = (load.transpose(0, 2, 1) @ products[:, count:, count:] @ load)[:, 0, 0]
        least = np.linalg.solve(products[:, :count, :count], beside)
        squares = alone - (beside * least).sum(axis=(1, 2))
        bounds[chunk] = squares.clip(min=0.0) + _rounded_share(t, chunk) * alone
    return np.sqrt(bounds)


def _rounded_share(t: Simplices, chunk: slice) -> Array:
    """Round-off of the square of a norm as a share of that of the lifting which is the best one in the reference."""
    cells = np.arange(len(t.corners))[chunk]
    return rounded(t.x[t.corners[cells]], t.moduli.of(cells))
