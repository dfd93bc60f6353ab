"""Facets of two flat parallel sides in space that do not match: the polygons that a facet of each shares, in triangles.

The displacement of either side is a polynomial on each of these triangles.  They serve integration alone, so that thin
ones do no harm: no cell is divided.  The stress has the closest linear traction on each facet; what is left of a
traction is orthogonal to linear functions there, and its work has a constant, see ``korn.work_beside_linear``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.facets import bernstein, coefficients
from signorini_fx.addons.bounds.simplices import Simplices
from signorini_fx.addons.bounds.split_triangles import clipped
from signorini_fx.tuned import SAME_DIRECTION

_EPS = float(np.finfo(float).eps)
# The vertices of a triangle and the middles of its edges.
_NODES: Array = np.concatenate((np.eye(3), (np.ones((3, 3)) - np.eye(3)) / 2))


@dataclass(frozen=True)
class FacetTractions:
    """Linear on each facet of the side with the contact points, f of them.

    Attributes:
        pressure: at the vertices, stress, shape (f, 3).
        shear: see ``pressure``, shape (f, 3, 3).
        least: of which the size of the shear is at most, shape (f, 3).
    """

    pressure: Array
    shear: Array
    least: Array


@dataclass(frozen=True)
class CommonRefinement:
    """The triangles of one contact, m of them.

    Attributes:
        facets: of both sides that have some, shapes (f,) and (g,).
        row: of the triangles among these, shapes (m,).
        local: barycentric coordinates of their vertices in the facets of both sides, shapes (m, 3, 3).
        area: of them, shape (m,).
    """

    facets: tuple[Ints, Ints]
    row: tuple[Ints, Ints]
    local: tuple[Array, Array]
    area: Array

    @classmethod
    def of(cls, t: Simplices, slave: Ints, master: Ints, tiny: float) -> CommonRefinement | None:
        """Of two sides that are projected onto each other along their normal; None: they are not flat and parallel.

        Args:
            t: the cells.
            slave: facets of one side.
            master: of the other one.
            tiny: by how much a side may be off its plane, length.
        """
        along = t.normal[slave[0]]
        if max(np.abs(t.normal[slave] - along).max(), np.abs(t.normal[master] + along).max()) > SAME_DIRECTION:
            return None
        if max(float(np.ptp(t.x[t.facets[side]] @ along)) for side in (slave, master)) > tiny:
            return None
        axes = np.linalg.svd(along[None])[2][1:]
        flat = [t.x[t.facets[side]] @ axes.T for side in (slave, master)]
        pairs = _near(*flat)
        corners, number = _shared(flat[0][pairs[:, 0]], flat[1][pairs[:, 1]])
        of = pairs[number]
        area = np.abs(_doubled(corners)) / 2
        positive = area > _EPS * t.area[slave[of[:, 0]]]
        corners, of, area = corners[positive], of[positive], area[positive]
        numbers = [np.unique(of[:, side], return_inverse=True) for side in (0, 1)]
        local = [_barycentric(flat[side][of[:, side]], corners) for side in (0, 1)]
        return cls(
            (slave[numbers[0][0]], master[numbers[1][0]]),
            (numbers[0][1].ravel(), numbers[1][1].ravel()),
            (local[0], local[1]),
            area,
        )

    def facet(self, side: int) -> Ints:
        """The facet of a side that each triangle is on, shape (m,)."""
        return self.facets[side][self.row[side]]

    def on_triangles(self, linear: Array, side: int = 0) -> Array:
        """Functions that are linear on the facets of a side, shape (f, 3, ...), at the vertices of the triangles."""
        return np.einsum("mka,ma...->mk...", self.local[side], linear[self.row[side]])

    def moments(self, values: Array, side: int = 0) -> Array:
        """Sums over the triangles of what is given at their vertices, shape (m, 3, ...), with the values of the hat
        functions of the facets of a side there, shape (f, 3, ...).
        """
        total = np.zeros((len(self.facets[side]), *values.shape[1:]))
        np.add.at(total, self.row[side], np.einsum("mka,mk...->ma...", self.local[side], values))
        return total

    def covered(self, side: int = 0) -> Array:
        """The area of the triangles on each facet, shape (f,)."""
        return np.asarray(np.bincount(self.row[side], self.area, len(self.facets[side])), dtype=np.float64)

    def coefficients_from(self, side: int) -> Array:
        """From those of Bernstein on a facet of a side to those on the triangles, shape (m, 6, 6)."""
        at = _NODES @ self.local[side]
        return coefficients(bernstein(at.reshape(-1, 3)).reshape(len(at), 6, 6))

    def projected(self, traction: Array, side: int, area: Array) -> tuple[Array, Array]:
        """The linear functions on the facets of a side that are closest to one that is linear on the triangles and zero
        elsewhere, at the vertices, shape (f, 3, 3); and the integrals of the products of the components of the
        difference, shape (f, 3, 3).

        Args:
            traction: at the vertices of the triangles, stress, shape (m, 3, 3).
            side: 0 or 1.
            area: of all facets, shape (n,).
        """
        areas = area[self.facets[side]]
        integrals = self.moments(_with_hats(traction, self.area), side)
        closest = (12 * integrals - 3 * integrals.sum(axis=1, keepdims=True)) / areas[:, None, None]
        linear = self.on_triangles(closest, side)
        missed = traction - linear
        # Where there is no triangle the difference is minus the linear function.
        uncovered = np.einsum("mki,mkj->mij", _with_hats(missed, self.area), missed) - np.einsum(
            "mki,mkj->mij", _with_hats(linear, self.area), linear
        )
        everywhere = np.einsum("fai,faj->fij", _with_hats(closest, areas), closest)
        total = everywhere.copy()
        np.add.at(total, self.row[side], uncovered)
        size = np.trace(everywhere, axis1=1, axis2=2)
        np.add.at(size, self.row[side], np.einsum("mki,mki->m", _with_hats(traction, self.area), traction))
        return closest, total + 64 * _EPS * size[:, None, None] * np.eye(3)

    def projected_on_parts(
        self, traction: Array, side: int, rows: Ints, parts: Array, areas: Array
    ) -> tuple[Array, Array]:
        """As ``projected`` on parts of some facets, at the vertices of these, shape (n, p, 3, 3), and the integrals of
        the squares of the difference over each facet, shape (n,).

        Args:
            traction: at the vertices of the triangles, stress, shape (m, 3, 3).
            side: 0 or 1.
            rows: of the facets, shape (n,).
            parts: barycentric coordinates of the vertices of the parts, which are of one size, shape (p, 3, 3).
            areas: of these facets, shape (n,).
        """
        count, flat = len(parts), parts[:, :, 1:]
        order = np.full(len(self.facets[side]), -1)
        order[rows] = np.arange(len(rows))
        triangle = np.flatnonzero(order[self.row[side]] >= 0)
        at = self.local[side][triangle][:, :, 1:]
        meet = ((at.max(axis=1)[:, None] > flat.min(axis=1)) & (flat.max(axis=1) > at.min(axis=1)[:, None])).all(axis=2)
        first, part = np.nonzero(meet)
        corners, number = _shared(at[first], flat[part])
        triangle, first, part = triangle[first[number]], first[number], part[number]
        owner = order[self.row[side][triangle]]
        area = np.abs(_doubled(corners)) * areas[owner]
        values = _barycentric(at[first], corners) @ traction[triangle]
        local = _barycentric(flat[part], corners)
        integrals, squares = np.zeros((len(rows), count, 3, 3)), np.zeros(len(rows))
        hats = _with_hats(values, area)
        np.add.at(integrals, (owner, part), local.transpose(0, 2, 1) @ hats)
        np.add.at(squares, owner, np.einsum("mki,mki->m", hats, values))
        unit = (areas / count)[:, None, None, None]
        closest = (12 * integrals - 3 * integrals.sum(axis=2, keepdims=True)) / unit
        missed = squares - np.einsum("npai,npai->n", integrals, closest)
        return closest, missed.clip(min=0.0) + 64 * _EPS * squares

    def largest(self, excess: Array, side: int) -> Array:
        """The largest coefficient on the triangles of each facet of a side, shape (m, c) to (f,)."""
        largest = np.full(len(self.facets[side]), -np.inf)
        np.maximum.at(largest, self.row[side], excess.max(axis=1))
        return largest


def _with_hats(values: Array, area: Array) -> Array:
    """Integrals over triangles of linear functions, given at the vertices, times the hat functions, (m, 3, ...)."""
    shape = (-1, *[1] * (values.ndim - 1))
    return np.asarray(area.reshape(shape) / 12 * (values + values.sum(axis=1, keepdims=True)))


def _shared(first: Array, second: Array) -> tuple[Array, Ints]:
    """The triangles that polygons shared by triangles of the plane are divided into, shapes (p, 3, 2) to (m, 3, 2), and
    the number of the pair that each one is of, shape (m,).
    """
    first, second = (
        np.where((_doubled(corners) < 0)[:, None, None], corners[:, ::-1], corners) for corners in (first, second)
    )
    triangles: list[Array] = [np.zeros((0, 3, 2))]
    numbers = list[int]()
    for number in range(len(first)):
        polygon = clipped(np.asarray(first[number]), np.asarray(second[number]))
        if len(polygon) > 2:
            fan = np.stack([polygon[[0, k, k + 1]] for k in range(1, len(polygon) - 1)])
            triangles.append(fan)
            numbers += [number] * len(fan)
    return np.concatenate(triangles), np.array(numbers, dtype=np.int64)


def _doubled(corners: Array) -> Array:
    """Twice the areas of triangles, positive where they are counterclockwise, shape (m, 3, 2) to (m,)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


def _barycentric(triangles: Array, points: Array) -> Array:
    """Coordinates of k points in each of some triangles of the plane, shapes (m, 3, 2) and (m, k, 2) to (m, k, 3)."""
    map_ = (triangles[:, 1:] - triangles[:, :1]).transpose(0, 2, 1)
    inner = np.linalg.solve(map_[:, None], (points - triangles[:, :1])[..., None])[..., 0]
    return np.concatenate((1 - inner.sum(axis=2, keepdims=True), inner), axis=2)


def _near(first: Array, second: Array) -> Ints:
    """Triangles of the plane, shapes (m, 3, 2), whose boxes meet, shape (p, 2)."""
    centres = [corners.mean(axis=1) for corners in (first, second)]
    radii = [
        np.linalg.norm(corners - at[:, None], axis=2).max(axis=1)
        for corners, at in zip((first, second), centres, strict=True)
    ]
    around = cKDTree(centres[1]).query_ball_point(centres[0], radii[0] + radii[1].max())
    pairs = np.array([(k, number) for k, numbers in enumerate(around) for number in numbers], dtype=np.int64).reshape(
        -1, 2
    )
    lowest, highest = (
        np.stack([function(corners, axis=1)[pairs[:, side]] for side, corners in enumerate((first, second))])
        for function in (np.min, np.max)
    )
    return pairs[(lowest.max(axis=0) < highest.min(axis=0)).all(axis=1)]
