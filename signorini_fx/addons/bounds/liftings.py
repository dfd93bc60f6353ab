"""Bounds of the work of tractions on facets and forces in cells that stresses of Johnson and
Mercier cannot represent.

A traction r that is orthogonal to linear vectors on a facet F of a cell K does no work on rigid
motions of K.  Its work on a displacement v is at most the norm of a *lifting* times the energy norm
of v in K: a symmetric stress in K without divergence, with the traction r on F and none on the
other facets.  F is divided into parts that are similar to it: m in 2D, m^2 triangles in 3D, where
every other one is turned, and

    r = (Pi r) + (r - Pi r),

where Pi is the projection onto functions that are linear on each part.  The first term is lifted by
stresses of Johnson and Mercier in K divided into m^d cells.  The second one is orthogonal to linear
vectors on each part; it is lifted in the same way in cells of which these parts are facets, with
apexes chosen so that the cells do not meet: for a part like F a cell like K, for a turned one a
cell like K', the tetrahedron of F turned by half a turn about its centroid c with the apex of K
(its corners are 2 c - p_i).  The cells for K' are like K' and, for turned parts, like K.  So the
largest norms per |r|, c_K and c_K', are at most those of Pi r, C_K and C_K', plus q = 1 / sqrt(m)
times one of the two, and as both terms are orthogonal

    max(c_K, c_K')^2 <= max(C_K, C_K')^2 + q^2 max(c_K, c_K')^2.

They are finite by Korn's inequality.

The stress of ``johnson_mercier`` balances forces that are constant on the parts of a cell, which
are between its facets and its centroid.  A force that is linear in the cell leaves a rest r,
orthogonal to linear vectors.  Its work on a displacement is at most the norm of a *lifting* times
the energy norm of the displacement, where the lifting is a symmetric stress with the divergence -r
and no traction on the facets.  Stresses of degree 2 on the parts contain such liftings: those of
one reference cell are mapped to other cells as A s A^T, whose divergence is A (div s).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import permutations, product
from math import factorial

import basix
import numpy as np

from signorini_fx.addons.bounds.johnson_mercier import (
    LocalStress,
    equations,
    forces_of_parts,
    turn_of,
)
from signorini_fx.addons.bounds.simplices import (
    CELLS,
    CORNERS_OF_PARTS,
    EPS,
    ROWS,
    TWICE,
    Moduli,
    Simplices,
    lagrange,
    motions_of,
)
from signorini_fx.arrays import Array, Ints
from signorini_fx.tuned import ROUNDED_FORMS

# Cells whose systems are solved at the same time.
_CHUNK = 16


@dataclass(frozen=True)
class DividedFacet:
    """A facet divided into p = m^(d - 1) parts, and a cell on it divided into m^d cells."""

    times: int  # m
    # barycentric coordinates of the vertices of its parts, in the order of those of the facet that
    # they are similar to, shape (p, d, d)
    parts: Array
    # from values at the vertices of the parts to those of the closest linear function, shape (d, d
    # p)
    mean: Array
    # barycentric coordinates of vertices in the cell, shape (v, d + 1); those of the facet are
    # first
    x: Array
    corners: Ints  # of its parts, shape (m^d, d + 1)


@cache
def divided_facet(d: int, m: int) -> DividedFacet:
    """Return the division of a facet of cells in d dimensions into m parts along each edge."""
    places = [np.array(counts) for counts in product(range(m + 2), repeat=d)]
    straight = [counts + np.eye(d) for counts in places if counts.sum() == m - 1]
    turned = [
        counts - np.eye(d)
        for counts in places
        if d == 3 and counts.sum() == m + 1 and counts.min() > 0
    ]
    parts = np.array(straight + turned) / m
    # Integrals of hat functions of the parts times those of the facet, over its area.
    mass = _mass(d)
    moments = np.einsum("pia,ij->apj", parts, mass).reshape(d, -1) / len(parts)
    numbers = dict[tuple[int, ...], int]()
    corners = []
    for cube in product(range(m), repeat=d):
        for order in permutations(range(d)):
            path = np.cumsum([np.array(cube), *np.eye(d, dtype=np.int64)[list(order)]], axis=0)
            if (np.diff(path.mean(axis=0)) < 0).all():
                corners.append(
                    [numbers.setdefault(tuple(point.tolist()), len(numbers)) for point in path]
                )
    at = np.array(list(numbers))
    x = -np.diff(np.column_stack((np.full(len(at), m), at, np.zeros(len(at)))), axis=1) / m
    return DividedFacet(m, parts, np.linalg.solve(mass, moments), x, np.array(corners))


def _mass(d: int) -> Array:
    """Return mean values of the products of the d hat functions of a simplex, shape (d, d)."""
    return (np.ones((d, d)) + np.eye(d)) / (d * (d + 1))


@dataclass(frozen=True)
class Liftings:
    """The liftings of tractions on one facet of each of n cells."""

    facet: DividedFacet  # how facets are divided
    # squares of the norms of liftings in K of tractions that are linear on the parts, from values
    # at their vertices, shape (n, d^2 p, d^2 p)
    forms: Array
    constant: Array  # a bound of c_K and c_K', shape (n,)

    @classmethod
    def of(cls, corners: Array, moduli: Moduli, m: int) -> Liftings:
        """Return the liftings of cells with m parts along each edge.

        Args:
            corners: corners of the cells, the one opposite the facet last, shape (n, d + 1, d).
            moduli: moduli of the cells.
            m: number of parts along each edge.
        """
        n = len(corners)
        d = corners.shape[2]
        facet = divided_facet(d, m)
        kinds = d - 1
        turned = corners.copy()
        turned[:, :d] = 2 * corners[:, :d].mean(axis=1, keepdims=True) - corners[:, :d]
        cells = np.stack((corners, turned)[:kinds], axis=1).reshape(-1, d + 1, d)
        owner = np.repeat(np.arange(n), kinds)
        forms = [
            _forms(facet, cells[first : first + _CHUNK], moduli.of(owner[first : first + _CHUNK]))
            for first in range(0, len(cells), _CHUNK)
        ]
        form = np.concatenate(forms)
        size = d * d * len(facet.parts)
        lost = rounded(cells, moduli.of(owner)) * np.linalg.norm(form, 2, axis=(1, 2))
        form += lost[:, None, None] * np.eye(size)
        # Orthonormal functions on the facet of area 1 that are orthogonal to linear ones.
        root = np.kron(np.eye(len(facet.parts)), np.linalg.cholesky(_mass(d) / len(facet.parts)).T)
        linear = np.linalg.qr(root @ facet.parts.reshape(-1, d), mode="complete")[0][:, d:]
        free = np.kron(np.linalg.solve(root, linear), np.eye(d))
        largest = np.linalg.eigvalsh(free.T @ form @ free)[:, -1] / _areas(cells)
        constant = np.sqrt(largest.reshape(n, kinds).max(axis=1) / (1 - 1 / m))
        return cls(facet, form[::kinds], constant)

    def norms(self, values: Array, missed: Array) -> Array:
        """Return bounds of the norms of liftings, shape (n,).

        Args:
            values: the projections of the tractions, at the vertices of the parts, shape (n, p, d,
                d).
            missed: integrals of the squares of the differences from the tractions, shape (n,).
        """
        n = len(values)
        d = values.shape[3]
        on_parts = values.reshape(n, -1, d)
        closest = self.facet.parts.reshape(-1, d) @ (self.facet.mean @ on_parts)
        difference = (on_parts - closest).reshape(n, -1)
        squares = np.einsum("nk,nkl,nl->n", difference, self.forms, difference, optimize=True)
        return self.constant * np.sqrt(missed / self.facet.times) + np.sqrt(squares.clip(min=0.0))


def _areas(corners: Array) -> Array:
    """Return the areas of the facets opposite the last corners, shape (n, d + 1, d) to (n,)."""
    d = corners.shape[2]
    along = corners[:, 1:d] - corners[:, :1]
    return np.sqrt(np.linalg.det(along @ along.transpose(0, 2, 1))) / factorial(d - 1)


def rounded(corners: Array, moduli: Moduli) -> Array:
    """Return the round-off of forms relative to their norm, see ``ROUNDED_FORMS``, shape (n,)."""
    d = corners.shape[2]
    # The edges from the first corner of a regular cell have cosines of one half between them.
    regular = np.linalg.cholesky((np.ones((d, d)) + np.eye(d)) / 2).T
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1) @ np.linalg.inv(regular)
    root = np.sqrt(TWICE[d])
    sizes = np.linalg.eigvalsh(moduli.stiffness * root[:, None] / root)
    return ROUNDED_FORMS * EPS * sizes[:, -1] / sizes[:, 0] * np.linalg.cond(edges) ** 4


def _forms(facet: DividedFacet, corners: Array, moduli: Moduli) -> Array:
    """Return ``Liftings.forms`` of some cells, shape (n, d^2 p, d^2 p)."""
    n = len(corners)
    d = corners.shape[2]
    vertices = len(facet.x)
    cells = len(facet.corners)
    m = facet.times
    q = d * d
    k = d * d * (d + 1)
    x = facet.x @ corners
    at_corners = x[:, facet.corners]
    negative = np.linalg.det(at_corners[:, :, 1:] - at_corners[:, :, :1]) < 0
    swapped = facet.corners[:, [*range(d - 1), d, d - 1]]
    ordered = np.where(negative[:, :, None], swapped, facet.corners)
    numbers = (ordered + vertices * np.arange(n)[:, None, None]).reshape(-1, d + 1)
    t = Simplices(x.reshape(-1, d), numbers, moduli.of(np.repeat(np.arange(n), cells)))
    local = LocalStress(t)
    count = len(t.facets) // n  # those of each cell together, in the same order
    places = (d * local.places[..., None] + np.arange(d)).reshape(
        n, cells, k
    ) - q * count * np.arange(n)[:, None, None]
    system = np.zeros((n, q * count, q * count))
    for number in range(n):
        compliance = local.compliance[number * cells : (number + 1) * cells]
        np.add.at(
            system[number], (places[number, :, :, None], places[number, :, None, :]), compliance
        )
    facets = t.facets[:count]
    keys = t.keys(facets)
    places_of_vertices = np.rint(m * facet.x)
    moments = np.zeros((q * count, q * len(facet.parts)))
    mass = _mass(d) / len(facet.parts)
    for part, corners_of_part in enumerate(np.rint(m * facet.parts)):
        vertex = (places_of_vertices[:, :d] == corners_of_part[:, None]).all(axis=2).argmax(axis=1)
        number = int(np.searchsorted(keys, t.keys(np.sort(vertex))))
        order = np.argsort(np.argsort(vertex))
        rows = (q * number + d * order[:, None] + np.arange(d)).ravel()
        moments[rows, q * part : q * (part + 1)] = np.kron(mass, np.eye(d))
    away = x[:, facets].reshape(n, -1, d) - x.mean(axis=1)[:, None]
    modes = np.linalg.qr(motions_of(away).reshape(n, q * count, -1))[0]
    scale = np.einsum("nii->n", system) / (q * count)
    full = system + scale[:, None, None] * (modes @ modes.transpose(0, 2, 1))
    solved = np.linalg.solve(full, np.broadcast_to(moments, (n, *moments.shape)))
    forms = moments.T @ solved * (_areas(corners) ** 2)[:, None, None]
    return (forms + forms.transpose(0, 2, 1)) / 2


def _reference_liftings(d: int) -> Array:
    """Return the stresses in the reference cell that lift the forces e_i (l_j - Q l_j), shape (d^2,
    d + 1, nodes, 3 or 6).

    l_j is the barycentric coordinate of the j-th unit vector, and Q l_j are the constants on the
    parts with its moments; the number of a force is d i + j.  Nodes are the vertices and the
    middles of the edges of the parts, in the order of ``EDGES``.
    """
    count = d + 1
    equilibrium = equations(d, 2)
    moments = _mass(count)
    beside_constants = CORNERS_OF_PARTS[d] - (forces_of_parts(d) @ moments)[:, None]
    forces = np.einsum("pcj,ai->pcaij", beside_constants[..., 1:], np.eye(d)).reshape(-1, d * d)
    matrix = np.concatenate(equilibrium)
    right = np.concatenate((np.zeros((len(matrix) - len(forces), d * d)), -forces))
    liftings = np.linalg.pinv(matrix) @ right
    return liftings.T.reshape(d * d, count, -1, len(ROWS[d]))


@cache
def _products(d: int) -> Array:
    """Return means over the cell of the products of the components c and e of the liftings i and j,
    shape (c, e, i, j).
    """
    liftings = _reference_liftings(d)
    points, weights = basix.make_quadrature(CELLS[d], 4)
    values, _ = lagrange(d, 2, points)
    mass = values.T @ (weights[:, None] * values) / weights.sum() / (d + 1)
    return np.einsum("ipac,ab,jpbe->ceij", liftings, mass, liftings, optimize=True)


def lifted_forces(t: Simplices, linear: Array) -> Array:
    """Return bounds of the norms of the liftings for forces that are linear in cells, for each
    cell, roots of energies, shape (n,).

    Args:
        t: the cells.
        linear: force per volume at their corners, shape (n, d + 1, d).
    """
    d = t.dimension
    slopes = np.linalg.solve(
        t.jacobian, (linear[:, 1:] - linear[:, :1]).transpose(0, 2, 1)
    ).reshape(-1, d * d)
    turn = turn_of(t.jacobian)
    compliance = TWICE[d][:, None] * t.moduli.compliance * t.volume[:, None, None]
    turned = turn.transpose(0, 2, 1) @ compliance @ turn
    squares = np.einsum("nce,ceij,ni,nj->n", turned, _products(d), slopes, slopes, optimize=True)
    return np.sqrt(squares.clip(min=0.0))
