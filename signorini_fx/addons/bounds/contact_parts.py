"""The parts of a contact: pieces of facets of one body opposite pieces of facets of another body,
or of a foundation.

Matching facets of both sides are parts as they are.  Between two flat parallel sides the parts are
the overlaps of their facets, divided into segments or triangles: the displacement of either side is
a polynomial there.  They serve integration alone, so that thin ones do no harm: no cell is divided.
The stress has the closest linear traction on each facet; the rest of a traction is orthogonal to
linear functions there, see ``liftings``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import basix
import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.addons.bounds.simplices import (
    EDGES_OF_FACET,
    EPS,
    Simplices,
    closest_linear,
    with_hats,
)
from signorini_fx.arrays import Array, Ints, quotient
from signorini_fx.mechanics.pairs.overlap import clip
from signorini_fx.mechanics.pairs.search import Patches, candidates
from signorini_fx.tuned import NOTHING_LEFT, ROOT_OF_EPS, SAME_LENGTH

# Sides of a contact: that with the contact points, and the other one.
SLAVE, MASTER = 0, 1


@dataclass(frozen=True)
class ContactParts:
    """The m parts of one contact; tuples have an entry for each side, or for the first side alone
    on a foundation.
    """

    facets: tuple[Ints, ...]  # facets of each side with parts, shapes (f,) and (g,)
    row: tuple[Ints, ...]  # position of the facet of each part among these, shapes (m,)
    local: tuple[
        Array, ...
    ]  # barycentric coordinates of their vertices in the facets of each side, shapes (m, d, d)
    area: Array  # area of the parts, shape (m,)
    normal: Array  # to the foundation or the other body, shape (m, d)
    by_facets: bool  # whether they are whole facets of each side

    @classmethod
    def on_foundation(cls, t: Simplices, facets: Ints, normal: Array) -> ContactParts:
        """Return whole facets as parts, with the directions to their foundation, shapes (m,) and
        (m, d).
        """
        count, d = normal.shape
        return cls(
            (facets,),
            (np.arange(count),),
            (np.tile(np.eye(d), (count, 1, 1)),),
            t.area[facets],
            normal,
            True,
        )

    @classmethod
    def between(cls, t: Simplices, slave: Ints, master: Ints) -> ContactParts:
        """Return the parts of two sides, the side with the contact points first.

        They are the overlaps of flat parallel sides along their normal; for other sides, facets at
        the same places.
        """
        along = t.normal[slave[0]]
        tiny = SAME_LENGTH * float(np.ptp(t.x, axis=0).max())
        flat = (
            max(np.abs(t.normal[slave] - along).max(), np.abs(t.normal[master] + along).max())
            <= ROOT_OF_EPS
        )
        flat &= max(float(np.ptp(t.x[t.facets[side]] @ along)) for side in (slave, master)) <= tiny
        matching = cls._matching(
            t, slave, master, t.x - np.outer(t.x @ along, along) if flat else t.x, tiny
        )
        if not flat or len(matching.area) == len(slave):
            return matching
        axes = np.linalg.svd(along[None])[2][1:]
        places = [t.x[t.facets[side]] @ axes.T for side in (slave, master)]
        apart = abs(float((t.x[t.facets[master[0], 0]] - t.x[t.facets[slave[0], 0]]) @ along))
        one = Patches(t.x[t.facets[slave]], t.normal[slave])
        other = Patches(t.x[t.facets[master]], t.normal[master])
        pairs = np.column_stack(candidates(one, other, apart, np.zeros(len(slave))))
        corners, number = _shared(places[0][pairs[:, 0]], places[1][pairs[:, 1]])
        of = pairs[number]
        area = np.abs(_sizes(corners))
        positive = area > NOTHING_LEFT * t.area[slave[of[:, 0]]]
        corners = corners[positive]
        of = of[positive]
        area = area[positive]
        numbers = [np.unique(of[:, side], return_inverse=True) for side in (SLAVE, MASTER)]
        return cls(
            (slave[numbers[0][0]], master[numbers[1][0]]),
            (numbers[0][1].ravel(), numbers[1][1].ravel()),
            (
                _barycentric(places[0][of[:, 0]], corners),
                _barycentric(places[1][of[:, 1]], corners),
            ),
            area,
            np.tile(along, (len(area), 1)),
            False,
        )

    @classmethod
    def _matching(
        cls, t: Simplices, slave: Ints, master: Ints, places: Array, tiny: float
    ) -> ContactParts:
        """Return pairs of facets whose vertices have the same places, shape (v, d), up to a tiny
        length.
        """
        d = t.dimension
        vertices = np.unique(t.facets[master])
        away, nearest = cKDTree(places[vertices]).query(places)
        over = np.where(away <= tiny, vertices[nearest], -1)[t.facets[slave]]
        keys = t.keys(t.facets[master])
        by_key = np.argsort(keys)
        candidate = by_key[
            np.searchsorted(keys, t.keys(np.sort(over, axis=1)), sorter=by_key).clip(
                max=len(keys) - 1
            )
        ]
        met = np.flatnonzero((t.facets[master[candidate]] == np.sort(over, axis=1)).all(axis=1))
        order = np.argsort(np.argsort(over[met], axis=1), axis=1)
        rows = np.arange(len(met))
        identity = np.tile(np.eye(d), (len(met), 1, 1))
        facets = slave[met], master[candidate[met]]
        return cls(
            facets,
            (rows, rows),
            (identity, np.eye(d)[order]),
            t.area[slave[met]],
            t.normal[slave[met]],
            True,
        )

    @property
    def sides(self) -> range:
        """The numbers of the sides."""
        return range(len(self.facets))

    def facet(self, side: int) -> Ints:
        """Return the facet of a side that each part is on, shape (m,)."""
        return self.facets[side][self.row[side]]

    def nodes(self, t: Simplices, side: int) -> tuple[Ints, Ints]:
        """Return vertices and edges of the facet of each part on a side, see ``nodes_of_facets``;
        for whole facets in the order of the vertices of the part.
        """
        nodes = t.nodes_of_facets[self.facet(side)]
        d = t.dimension
        if self.by_facets:
            order = self.local[side].argmax(axis=2)
            edges = (
                order if d == 3 else np.zeros_like(order[:, :1])
            )  # in 3D each edge is opposite a vertex
            nodes = np.take_along_axis(nodes, np.column_stack((order, d + edges)), axis=1)
        return nodes[:, :d], nodes[:, d:]

    def on_parts(self, linear: Array, side: int = SLAVE) -> Array:
        """Return functions that are linear on the facets of a side, given at their vertices, shape
        (f, d, ...), at the vertices of the parts, shape (m, d, ...).
        """
        return np.einsum("mka,ma...->mk...", self.local[side], linear[self.row[side]])

    def moments(self, values: Array, side: int = SLAVE) -> Array:
        """Return sums over the parts of values at their vertices, shape (m, d, ...), times the
        values of the hat functions of the facets of a side there, shape (f, d, ...).
        """
        total = np.zeros((len(self.facets[side]), *values.shape[1:]))
        np.add.at(total, self.row[side], np.einsum("mka,mk...->ma...", self.local[side], values))
        return total

    def covered(self, side: int = SLAVE) -> Array:
        """Return the area of the parts on each facet of a side, shape (f,)."""
        return np.asarray(
            np.bincount(self.row[side], self.area, len(self.facets[side])), dtype=np.float64
        )

    def restricted(self, of_facets: Array, side: int) -> Array:
        """Return Bernstein coefficients on the parts from those on the facets of a side, both in
        the order of ``facet``.
        """
        d = self.normal.shape[1]
        nodes = np.concatenate((np.eye(d), np.eye(d)[EDGES_OF_FACET[d]].mean(axis=1)))
        at = nodes @ self.local[side]
        values = np.einsum(
            "mqc,mc...->mq...", bernstein(at.reshape(-1, d)).reshape(*at.shape[:2], -1), of_facets
        )
        return coefficients(values)

    def projected(self, traction: Array, side: int, area: Array) -> tuple[Array, Array]:
        """Return the linear functions on the facets of a side that are closest to a traction, and
        the relative error.

        The error is the integral of the square of the difference over that of the traction, shape
        (f,).

        Args:
            traction: traction at the vertices of the parts, linear on them and zero elsewhere,
                stress, shape (m, d, d).
            side: the side.
            area: areas of all facets.
        """
        areas = area[self.facets[side]]
        closest, missed, squares = _closest(
            traction, self.area, self.local[side], self.row[side], areas
        )
        return closest, quotient(missed, squares)

    def projected_on_pieces(
        self, traction: Array, side: int, rows: Ints, pieces: Array, areas: Array
    ) -> tuple[Array, Array]:
        """Return the closest functions that are linear on pieces of some facets, at the vertices of
        the pieces, shape (n, p, d, d), and the integrals of the squares of the difference over each
        facet, shape (n,).

        Args:
            traction: traction at the vertices of the parts, stress, shape (m, d, d).
            side: the side of the facets.
            rows: the facets, as rows of this side, shape (n,).
            pieces: barycentric coordinates of the vertices of the pieces, which have equal size,
                shape (p, d, d).
            areas: areas of these facets, shape (n,).
        """
        count = len(pieces)
        d = traction.shape[2]
        flat = pieces[:, :, 1:]
        order = np.full(len(self.facets[side]), -1)
        order[rows] = np.arange(len(rows))
        part = np.flatnonzero(order[self.row[side]] >= 0)
        at = self.local[side][part][:, :, 1:]
        meet = (
            (at.max(axis=1)[:, None] > flat.min(axis=1))
            & (flat.max(axis=1) > at.min(axis=1)[:, None])
        ).all(axis=2)
        first, piece = np.nonzero(meet)
        corners, number = _shared(at[first], flat[piece])
        part = part[first[number]]
        first = first[number]
        piece = piece[number]
        owner = order[self.row[side][part]]
        area = factorial(d - 1) * np.abs(_sizes(corners)) * areas[owner]
        values = _barycentric(at[first], corners) @ traction[part]
        local = _barycentric(flat[piece], corners)
        numbers = owner * count + piece
        sizes = np.repeat(areas / count, count)
        closest, missed, squares = _closest(values, area, local, numbers, sizes)
        missed = missed.reshape(-1, count).sum(axis=1)
        squares = squares.reshape(-1, count).sum(axis=1)
        return closest.reshape(-1, count, d, d), missed.clip(min=0.0) + 64 * EPS * squares


def _closest(
    values: Array, area: Array, local: Array, owner: Ints, areas: Array
) -> tuple[Array, Array, Array]:
    """Return the closest functions that are linear on facets (the owners) to functions that are
    linear on parts, at the vertices of the owners, and the integrals over the owners of the squares
    of the difference and of the functions.

    Args:
        values: values at the vertices of the parts.
        area: areas of the parts.
        local: barycentric coordinates of their vertices in the owners.
        owner: owner of each part.
        areas: areas of the owners.
    """
    hats = with_hats(values, area)
    shape = (len(areas), *values.shape[1:])
    integrals = np.zeros(shape)
    squares = np.zeros(len(areas))
    np.add.at(integrals, owner, local.transpose(0, 2, 1) @ hats)
    np.add.at(squares, owner, np.einsum("mki,mki->m", hats, values))
    closest = closest_linear(integrals / areas[:, None, None])
    return closest, squares - np.einsum("fai,fai->f", integrals, closest), squares


def _shared(first: Array, second: Array) -> tuple[Array, Ints]:
    """Return the overlaps of pairs of segments or triangles as segments or triangles, from shape
    (p, d, d - 1) to (m, d, d - 1), and the pair that each belongs to, shape (m,).
    """
    if first.shape[1] == 2:
        lowest = np.maximum(first.min(axis=1), second.min(axis=1))
        highest = np.minimum(first.max(axis=1), second.max(axis=1))
        numbers = np.flatnonzero((highest > lowest)[:, 0])
        return np.stack((lowest, highest), axis=1)[numbers], numbers
    polygon, count = clip(_counterclockwise(first), _counterclockwise(second))
    number, corner = np.nonzero(np.arange(2, polygon.shape[1]) < count[:, None])
    return polygon[
        number[:, None], np.column_stack((np.zeros_like(corner), corner + 1, corner + 2))
    ], number


def _counterclockwise(corners: Array) -> Array:
    """Return triangles with their corners in counterclockwise order, shape (n, 3, 2)."""
    return np.where((_sizes(corners) < 0)[:, None, None], corners[:, ::-1], corners)


def _sizes(corners: Array) -> Array:
    """Return signed lengths of segments or areas of triangles, from shape (m, d, d - 1) to (m,)."""
    return np.linalg.det(corners[:, 1:] - corners[:, :1]) / factorial(corners.shape[2])


def _barycentric(simplices: Array, points: Array) -> Array:
    """Return the barycentric coordinates of k points in each of m segments or triangles, shape (m,
    k, d).

    Args:
        simplices: corners, shape (m, d, d - 1).
        points: the points, shape (m, k, d - 1).
    """
    map_ = (simplices[:, 1:] - simplices[:, :1]).transpose(0, 2, 1)
    inner = np.linalg.solve(map_[:, None], (points - simplices[:, :1])[..., None])[..., 0]
    return np.concatenate((1 - inner.sum(axis=2, keepdims=True), inner), axis=2)


# By dimension: barycentric points of Gauss' rule on a facet, and their weights; integrands have
# kinks where slip turns.
_RULES = {
    d: basix.make_quadrature(facet, 15, rule=basix.QuadratureType.gauss_jacobi)
    for d, facet in ((2, basix.CellType.interval), (3, basix.CellType.triangle))
}
POINTS: dict[int, Array] = {
    d: np.column_stack((1 - at.sum(axis=1), at)) for d, (at, _) in _RULES.items()
}
WEIGHTS: dict[int, Array] = {d: weights / weights.sum() for d, (_, weights) in _RULES.items()}


def bernstein(local: Array) -> Array:
    """Return values of the Bernstein polynomials of degree 2 at barycentric points, from shape (q,
    d) to (q, 3) or (q, 6).
    """
    a, b = EDGES_OF_FACET[local.shape[1]].T
    return np.column_stack((local**2, 2 * local[:, a] * local[:, b]))


def coefficients(nodal: Array) -> Array:
    """Return the Bernstein coefficients of the quadratic polynomials with these values at vertices
    and middles of edges, shape (m, 3 or 6, ...).
    """
    d = 2 if nodal.shape[1] == 3 else 3
    ends = nodal[:, :d]
    return np.concatenate(
        (ends, 2 * nodal[:, d:] - ends[:, EDGES_OF_FACET[d]].mean(axis=2)), axis=1
    )
