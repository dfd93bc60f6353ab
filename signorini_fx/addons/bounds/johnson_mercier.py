"""Symmetric stresses on triangles or tetrahedra divided at their centroids: linear on the parts,
with linear tractions on the facets and a force that is constant on each part.

It is the element of Johnson and Mercier (C. Johnson and B. Mercier, Numer. Math. 30 (1978) 103-116;
in 3D M. Krizek, Apl. Mat. 27 (1982) 46-69; J. Gopalakrishnan, J. Guzman, J. J. Lee, The
Johnson-Mercier elasticity element in any dimensions, 2024).  In 3D it has 96 numbers with 54
conditions between the parts; the remaining 42 are determined by tractions (36) and forces (12, of
which 6 follow from balance).  In 2D 27 numbers with 12 conditions leave 15, determined by 12 and 6
(3 follow from balance).
"""

from __future__ import annotations

from functools import cache
from itertools import combinations
from math import factorial

import numpy as np

from signorini_fx.addons.bounds.simplices import (
    COLUMNS,
    CORNERS_OF_PARTS,
    EDGES,
    FACETS,
    ROWS,
    TWICE,
    Simplices,
    lagrange,
    motions_of,
)
from signorini_fx.arrays import Array, Ints

# Numbers in the stresses of the cells whose matrices are made at the same time.
_CHUNK = 3_500_000


class LocalStress:
    """The stresses of cells, one by one, in terms of the moments of their tractions: integrals
    times the hat functions of the vertices of facets.

    Similar triangles have the same matrices, so that only those of the first part of each of the m
    cells of the mesh are stored.  A cell has k = d^2 (d + 1) moments.

    Attributes:
        places: position of the moments of each cell among those of all facets, by facet and vertex,
            shape (n, d + 1, d).
        compliance: balanced moments per displacement of the vertices of the facets, force per
            length, shape (m, k, k).
        energy: traces of the squares of the norm per square of the moments, shape (m,).
    """

    def __init__(self, t: Simplices) -> None:
        self._t = t
        d = t.dimension
        rank = np.argsort(np.argsort(t.corners[:, FACETS[d]], axis=2), axis=2)
        self.places: Ints = d * t.facets_of[:, :, None] + rank
        self._determinant = factorial(d) * t.volume
        self._inverse = np.linalg.inv(t.jacobian)
        # sigma = F s F^T / J^2; tractions times areas are F (s n) / J, the divergence F (div s) /
        # J^2.
        self._turn = turn_of(t.jacobian / self._determinant[:, None, None])
        n = len(t.corners) // t.parts
        k = d * d * (d + 1)
        forces = d * (d + 1)
        self.compliance: Array = np.zeros((n, k, k))
        self.energy: Array = np.zeros(n)
        self._alone: Array = np.zeros((n, k, forces))
        step = max(_CHUNK // ((d + 1) ** 2 * len(ROWS[d]) * k), 1)
        for first in range(0, n, step):
            self._invert(slice(first, min(first + step, n)))

    def _invert(self, chunk: slice) -> None:
        """Compute the matrices of some cells: those of least energy with balanced moments."""
        # Stresses of thin cells grow with the square of their aspect: a factor of the energy is
        # inverted, not itself.
        t = self._t
        d = self._t.dimension
        operator = reference(self._t.dimension)[0]
        count = d + 1
        parts = (d + 1) ** 2
        k = d * d * (d + 1)
        map_ = self._determinant[chunk, None, None] * self._inverse[chunk]
        n = len(map_)
        # Linear tractions at the vertices of a facet of area 1 from their moments.
        from_moments = d * (d + 1) * np.eye(d) - d
        data = np.einsum("ij,ab,nkl->niakjbl", np.eye(count), from_moments, map_).reshape(n, k, k)
        root = self._root_of_energy(chunk)
        stress = self._weighted(root, (operator[:, :k] @ data).reshape(n, parts, -1, k))
        self.energy[chunk] = (stress**2).sum(axis=(1, 2))
        centre = t.x[t.corners[chunk]].mean(axis=1)
        size = t.volume[chunk] ** (1 / d)
        arm = (t.x[t.corners[chunk]] - centre[:, None]) / size[:, None, None]
        balance = _resultants(arm[:, FACETS[d]].reshape(n, -1, d)).transpose(0, 2, 1)
        directions, lengths = np.linalg.qr(balance, mode="complete")
        rank = balance.shape[2]
        loaded = directions[:, :, :rank]
        free = directions[:, :, rank:]
        q, r = np.linalg.qr(stress @ free)
        root_of_compliance = free @ np.linalg.inv(r)
        self.compliance[chunk] = root_of_compliance @ root_of_compliance.transpose(0, 2, 1)
        # Forces of the parts on the reference cell from the integrals of the force, and its
        # resultants.
        divided = forces_of_parts(d) / t.volume[chunk, None, None]
        forces = -np.einsum(
            "nij,nkl->nikjl",
            divided,
            self._inverse[chunk] * self._determinant[chunk, None, None] ** 2,
        )
        inside = operator[:, k:].reshape(parts * len(ROWS[d]), -1) @ forces.reshape(
            n, d * count, d * count
        )
        opposite = -loaded @ np.linalg.solve(lengths[:, :rank].transpose(0, 2, 1), _resultants(arm))
        beside = stress @ opposite + self._weighted(root, inside.reshape(n, parts, -1, d * count))
        self._alone[chunk] = opposite - root_of_compliance @ (q.transpose(0, 2, 1) @ beside)

    def _root_of_energy(self, chunk: slice) -> Array:
        """Return the matrices from stresses of reference cells to vectors whose squared norm is the
        energy, shape (n, 3 or 6, 3 or 6).
        """
        t = self._t
        d = self._t.dimension
        root = np.linalg.cholesky(TWICE[d][:, None] * t.moduli.of(chunk).compliance).transpose(
            0, 2, 1
        )
        root *= np.sqrt(t.volume[chunk] / ((d + 1) ** 2 * (d + 2)))[:, None, None]
        return root @ self._turn[chunk]

    def _weighted(self, root: Array, stress: Array) -> Array:
        """Return vectors whose squared norm is the energy, shape (n, rows, k), from stresses of
        reference cells at corners of parts.
        """
        count = self._t.dimension + 1
        n, _, _, k = stress.shape
        at = (root[:, None] @ stress).reshape(n, count, count, -1, k)
        # The root of the mass matrix 1 + ones.
        return (at + (np.sqrt(1 + count) - 1) / count * at.sum(axis=2, keepdims=True)).reshape(
            n, -1, k
        )

    def alone(self, body: Array) -> Array:
        """Return the moments that balance a body force if the vertices of the facets do not move,
        force, shape (n, k).

        Args:
            body: integrals of the body force times the barycentric coordinates, force, shape (n, d
                + 1, d).
        """
        # The triangle between three similar ones is turned by half a turn, which changes no sign
        # here.
        moments = self._alone @ body.reshape(self._t.parts, len(self._alone), -1, 1)
        return moments.reshape(len(body), -1)

    def stress(self, tractions: Array, body: Array) -> tuple[Array, Array]:
        """Return the stress on each part of the cells, and the share of its data that it misses in
        each cell, shape (n,).

        The stress has shape (n, d + 1, d + 1, 3 or 6): parts are opposite their corner of the cell;
        it is given at the corners of the part, those of the facet and the centroid.

        Args:
            tractions: tractions at the vertices of the facets of each cell, out of it, stress,
                shape (n, d + 1, d, d).
            body: see ``alone``.
        """
        t = self._t
        d = self._t.dimension
        n = len(tractions)
        operator, conditions = reference(d)
        inverse = self._inverse.transpose(0, 2, 1)
        forces = (
            tractions
            * t.area[t.facets_of][:, :, None, None]
            * self._determinant[:, None, None, None]
        )
        moments = (forces.reshape(n, -1, d) @ inverse).reshape(n, -1)
        inside = -(constant_forces(t, body) * (self._determinant**2)[:, None, None]) @ inverse
        data = np.concatenate((moments, inside.reshape(n, -1)), axis=1)
        local = data @ operator.T
        count = local.shape[1]
        missed = local @ conditions[:, :count].T - data @ conditions[:, count:].T
        missed_share = np.abs(missed).max(axis=1) / np.abs(data).max(axis=1, initial=1e-300)
        stress = local.reshape(n, (d + 1) ** 2, -1) @ self._turn.transpose(0, 2, 1)
        return stress.reshape(n, d + 1, d + 1, -1), missed_share


def turn_of(f: Array) -> Array:
    """Return the matrices that map the components of symmetric tensors s to those of F s F^T, shape
    (n, 3, 3) or (n, 6, 6).
    """
    rows = ROWS[f.shape[1]]
    columns = COLUMNS[f.shape[1]]
    once = f[:, rows][:, :, rows] * f[:, columns][:, :, columns]
    twice = f[:, rows][:, :, columns] * f[:, columns][:, :, rows]
    return once + np.where(rows == columns, 0.0, twice)


def _resultants(arm: Array) -> Array:
    """Return the matrices from forces at q points to their resultant force, and their couple by the
    arms, shape (n, 3 or 6, d q).
    """
    n, q, d = arm.shape
    return motions_of(arm).transpose(0, 3, 1, 2).reshape(n, -1, q * d)


def slopes_of_parts(d: int) -> Array:
    """Return gradients of the barycentric coordinates of each part of the reference cell, those of
    the corners of its facet and that of the centroid, shape (d + 1, d + 1, d).
    """
    corners = CORNERS_OF_PARTS[d][..., 1:]  # those of the reference cell are 0 and the unit vectors
    slopes = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    return np.concatenate((-slopes.sum(axis=1, keepdims=True), slopes), axis=1)


def tensor_times(vector: Array) -> Array:
    """Return the matrix that maps the components of a symmetric tensor to its product with a
    vector, shape (d, 3 or 6).
    """
    rows = ROWS[len(vector)]
    columns = COLUMNS[len(vector)]
    product = np.zeros((len(vector), len(rows)))
    components = np.arange(len(rows))
    product[rows, components] = vector[columns]
    product[columns, components] = vector[rows]
    return product


def equations(d: int, degree: int) -> tuple[Array, Array, Array]:
    """Return the equations of stresses of degree 1 or 2 on the parts of the reference cell, as
    three matrices.

    They map stresses at the vertices of the parts, and for degree 2 at the middles of their edges,
    to: tractions on the facets at these nodes, times the area; jumps of tractions at facets between
    parts; divergences, for degree 2 at the corners of the parts.
    """
    count = d + 1
    slopes = slopes_of_parts(d)
    nodes = [*combinations(range(count), 1), *(tuple(edge) for edge in EDGES[d] if degree == 2)]
    # Vertices of the parts: those of the cell, and its centroid with the number d + 1.
    numbers = [[*map(int, facet), count] for facet in FACETS[d]]
    _, derivatives = lagrange(d, degree, np.eye(count)[:, 1:])

    def row(*entries: tuple[int, int, Array]) -> Array:
        """Return the matrix of the sum of products of stresses of parts at nodes with vectors."""
        tensors = np.zeros((d, count, len(nodes), len(ROWS[d])))
        for part, node, vector in entries:
            tensors[:, part, node] = tensor_times(vector)
        return tensors.reshape(d, -1)

    outer = list[Array]()
    inner = list[Array]()
    divergences = list[Array]()
    for part in range(count):
        normal = -slopes[part, d] / (factorial(d - 1) * count)
        outer += [row((part, k, normal)) for k, node in enumerate(nodes) if d not in node]
        for corner in range(count if degree == 2 else 1):
            gradients = derivatives[:, corner].T @ slopes[part, 1:]
            divergences.append(
                row(*((part, k, np.asarray(vector)) for k, vector in enumerate(gradients)))
            )
    for i, j in combinations(range(count), 2):
        opposite = numbers[i].index(j)
        normal = slopes[i, opposite] / np.linalg.norm(slopes[i, opposite])
        for k, node in enumerate(nodes):
            if opposite not in node:
                twin = tuple(sorted(numbers[j].index(numbers[i][vertex]) for vertex in node))
                inner.append(row((i, k, normal), (j, nodes.index(twin), -normal)))
    return np.concatenate(outer), np.concatenate(inner), np.concatenate(divergences)


@cache
def reference(d: int) -> tuple[Array, Array]:
    """Return the matrix from tractions at the vertices of the facets and divergences of the parts
    to the stress of the reference cell, and the conditions with their right-hand sides.

    Shapes are (27, 18) and (30, 27 + 18) in 2D, (96, 48) and (102, 96 + 48) in 3D.  The conditions
    determine the stress; they are compatible if the cell is in equilibrium.
    """
    outer, inner, divergences = equations(d, 1)
    conditions = np.concatenate((outer, inner, divergences))
    right = np.zeros((len(conditions), len(outer) + len(divergences)))
    right[: len(outer), : len(outer)] = np.eye(len(outer))
    right[-len(divergences) :, len(outer) :] = np.eye(len(divergences))
    return np.linalg.pinv(conditions) @ right, np.column_stack((conditions, right))


def forces_of_parts(d: int) -> Array:
    """Return the matrix from integrals times barycentric coordinates, over the volume, to constants
    on the parts, shape (d + 1, d + 1).
    """
    share = (np.full((d + 1, d + 1), d + 2.0) - (d + 1) * np.eye(d + 1)) / (
        d + 1
    ) ** 3  # int of l_j over the i-th part
    return np.asarray(np.linalg.inv(share))


def constant_forces(t: Simplices, body: Array) -> Array:
    """Return the force per volume, constant on parts, that has given integrals times barycentric
    coordinates, shape (n, d + 1, d).
    """
    return np.einsum("ij,njd->nid", forces_of_parts(t.dimension), body) / t.volume[:, None, None]


def from_strain(t: Simplices, strain: Array) -> Array:
    """Return the stress of linear strains, given at the corners of cells, on the parts at their
    corners, see ``LocalStress.stress``.
    """
    corner_stress = t.moduli.stress(strain)
    centre = np.repeat(corner_stress.mean(axis=1)[:, None, None], t.dimension + 1, axis=1)
    return np.concatenate((corner_stress[:, FACETS[t.dimension]], centre), axis=2)


def square(t: Simplices, stress: Array) -> Array:
    """Return integrals of sigma : C^-1 sigma over each cell, from stresses on its parts, energies,
    shape (n,).
    """
    d = t.dimension
    strain = t.moduli.strain(stress) * TWICE[t.dimension]
    sums = (stress * strain).sum(axis=(1, 2, 3)) + (stress.sum(axis=2) * strain.sum(axis=2)).sum(
        axis=(1, 2)
    )
    return (t.volume / ((d + 1) ** 2 * (d + 2)) * sums).clip(min=0.0)


def energy(t: Simplices, strain: Array) -> Array:
    """Return squares of energy norms of linear strains, given at corners, for each cell, see
    ``square``.
    """
    return square(t, from_strain(t, strain))
