"""The overlap of two sides.

In 2D points are projected along a continuous direction n(s) on the slave side, which interpolates
those at the nodes: the slave point under a master point x has (x - x_s(s)) x n(s) = 0.  Between the
images of the ends of a master facet all integrands are smooth.

In 3D (Puso and Laursen, Comput. Methods Appl. Mech. Engrg. 193 (2004) 601-629) each linear part of
a slave facet has a plane through its centroid, across the direction of projection there.  Both
parts are projected onto it, the polygon that they share is found by clipping, and a fan of
triangles around its centre carries the quadrature.  Points are mapped back into both facets;
weights are areas of the undeformed slave surface.
"""

from __future__ import annotations

import basix
import numpy as np
from mpi4py import MPI

from signorini_fx.arrays import Array, Ints, matvec, quotient
from signorini_fx.machine import parallel
from signorini_fx.mechanics.pairs.pair_side import Lagrange, Overlap, PairSurface
from signorini_fx.mechanics.pairs.search import Parts, candidates
from signorini_fx.tuned import MANY_STEPS, NOTHING_LEFT, SAME_LENGTH, SAME_NUMBER, ZERO_COMPONENT

# Degrees of the quadrature on each triangle, by the degree of the functions; on quadrilaterals and
# on curved triangles integrands are no polynomials, but bilinear functions on parallelograms are.
_DEGREES = {1: 2, 2: 4}
_RATIONAL = 12
_PARALLELOGRAMS = 4
# Gauss points and weights in [-1, 1] for a segment of the overlap in 2D.  The rule is part of the
# definition of the map: integrands are rational where normals turn, and not polynomials on curved
# facets.
_PLACES_OF_RULE, _WEIGHTS_OF_RULE = np.polynomial.legendre.leggauss(8)


def space_overlap(
    slave_parts: Parts, master_parts: Parts, reach: float, directions: Array | None, comm: MPI.Comm
) -> Overlap:
    """Return the overlap in 3D, divided into triangles for each pair of parts that meet;
    collective.

    ``reach``: distance beyond which parts are not paired, length. ``directions``: directions of
    projection at the slave nodes that have test functions, shape (N, 3);
        None: the normals of the parts.
    """
    slave = slave_parts.side
    master = master_parts.side
    along = slave_parts.normal
    turning = np.asarray(np.zeros(len(slave_parts.facet)), dtype=np.float64)
    if directions is not None:
        along, turning = _along(slave, slave_parts, directions)
    slave_numbers, master_numbers = candidates(slave_parts, master_parts, reach, turning)
    centre = slave_parts.centre[slave_numbers]
    axes = axes_across(along[slave_numbers])
    flat, flat_master = (
        np.einsum("mcd,mkd->mck", corners - centre[:, None], axes)
        for corners in (slave_parts.corners[slave_numbers], master_parts.corners[master_numbers])
    )
    polygon, count = clip(counterclockwise(flat_master), counterclockwise(flat))
    nonempty = _areas(polygon, count) > NOTHING_LEFT * np.abs(
        _areas(flat, np.full(len(flat), flat.shape[1]))
    )
    slave_numbers = slave_numbers[nonempty]
    master_numbers = master_numbers[nonempty]
    count = count[nonempty]
    flat, flat_master, polygon, centre, axes = (
        entry[nonempty] for entry in (flat, flat_master, polygon, centre, axes)
    )
    triangles, pair = _fan(polygon, count)
    functions = slave.functions, master.functions
    met = (slave, slave_parts.facet[slave_numbers]), (master, master_parts.facet[master_numbers])
    degree = _degree(functions, affine=all(_affine(side, numbers) for side, numbers in met))
    points, weights = basix.make_quadrature(
        basix.CellType.triangle, int(parallel.global_max(comm, degree))
    )
    first, second = (triangles[:, k] - triangles[:, 0] for k in (1, 2))
    p = triangles[:, :1] + points[:, :1] * first[:, None] + points[:, 1:] * second[:, None]
    area = np.abs(_cross(first, second))[:, None] * weights
    slave_numbers = slave_numbers[pair]
    master_numbers = master_numbers[pair]
    linear = [entry.linear for entry in functions]
    at, projected = _back(linear[0], flat[pair], slave_parts.reference[slave_numbers], p)
    over, _ = _back(linear[1], flat_master[pair], master_parts.reference[master_numbers], p)
    true = slave.sizes(slave_parts.facet[slave_numbers], at)
    if max(entry.degree for entry in functions) > 1:
        p = np.einsum(
            "mqd,mkd->mqk",
            slave.positions(slave_parts.facet[slave_numbers], at) - centre[pair][:, None],
            axes[pair],
        )
        over = projected_places(
            master, master_parts.facet[master_numbers], over, p, centre[pair], axes[pair]
        )
    return Overlap(
        slave_parts.facet[slave_numbers],
        master_parts.facet[master_numbers],
        at,
        over,
        area * true / projected,
    )


def turned(parts: Parts, directions: Array, comm: MPI.Comm) -> float:
    """Return how far given directions of projection differ from those of a first projection, the
    maximum over the parts of all ranks; collective.

    It is the difference of unit vectors in 2D and the tangent of an angle in 3D.
    """
    slave = parts.side
    if slave.dimension == 2:
        return float(np.abs(directions - slave.nodal_normals)[slave.points].max())
    return parallel.largest(comm, _along(slave, parts, directions)[1])


def _along(side: PairSurface, parts: Parts, directions: Array) -> tuple[Array, Array]:
    """Return the direction of projection at the middle of each part, and the tangent of its angle
    to the normal of the part.
    """
    shape = side.functions.tests.values(parts.reference.mean(axis=1))
    along = np.einsum("pt,ptd->pd", shape, directions[side.points[parts.facet]])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal = parts.normal
    cosine = np.sum(along * normal, axis=1)
    sine = np.linalg.norm(np.cross(along, normal), axis=1)
    return along, sine / cosine


def _affine(side: PairSurface, facets: Ints) -> bool:
    """Return whether the maps from the reference facet to these facets are affine."""
    corners = side.corners[np.unique(facets)]
    places = side.functions.places
    away = np.linalg.norm(corners - Lagrange(places[:3]).values(places) @ corners[:, :3], axis=2)
    return bool(
        (away <= SAME_LENGTH * np.linalg.norm(corners[:, 1:2] - corners[:, :1], axis=2)).all()
    )


def _degree(functions: tuple[Lagrange, Lagrange], *, affine: bool) -> int:
    """Return the degree of the quadrature on each triangle.

    ``affine``: whether the maps of the facets of both sides are affine.
    """
    highest = max(lagrange.degree for lagrange in functions)
    simplices = all(lagrange.simplex for lagrange in functions)
    if not affine or (highest > 1 and not simplices):
        return _RATIONAL
    return _DEGREES[highest] if simplices else _PARALLELOGRAMS


def projected_places(
    side: PairSurface, facets: Ints, at: Array, p: Array, centre: Array, axes: Array
) -> Array:
    """Return the reference coordinates on curved facets of the points whose projections are ``p``,
    by Newton's method from ``at``.

    Args:
        side: the surface that the facets belong to.
        facets: numbers of the facets, shape (m,).
        at: initial reference coordinates, shape (m, q, 2).
        p: points in the plane of each facet, length, shape (m, q, 2).
        centre: origin of each plane, length, shape (m, 3).
        axes: axes of each plane, shape (m, 2, 3).
    """
    return _places_of(
        side.functions, (side.corners[facets] - centre[:, None]) @ axes.transpose(0, 2, 1), p, at
    )


def _places_of(functions: Lagrange, nodes: Array, p: Array, at: Array) -> Array:
    """Return the reference coordinates, shape (m, q, 2), at which the interpolation of ``nodes``
    equals ``p``, by Newton's method from ``at``.

    ``nodes``: nodal positions in the plane, shape (m, k, 2); ``p``: points of it, shape (m, q, 2).
    """
    at = at.copy()
    moving = np.arange(len(at))
    for _ in range(1 if functions.degree == 1 and functions.simplex else MANY_STEPS):
        place = at[moving]
        flat = nodes[moving]
        residual = p[moving] - functions.values(place) @ flat
        first, second = functions.slopes(place) @ flat
        step = (
            np.stack((_cross(residual, second), _cross(first, residual)), axis=-1)
            / _cross(first, second)[..., None]
        )
        at[moving] = place + step
        moving = moving[np.abs(step).max(axis=(1, 2)) >= SAME_LENGTH]
        if not moving.size:
            break
    return at


def axes_across(normal: Array) -> Array:
    """Return two unit vectors perpendicular to each normal, shape (m, 2, 3); with it they form a
    right-handed frame.
    """
    least = np.abs(normal).argmin(axis=1)
    first = np.cross(normal, np.eye(3)[least])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack((first, np.cross(normal, first)), axis=1)


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _areas(polygon: Array, count: Ints) -> Array:
    """Return the signed areas, shape (m,), of polygons of shape (m, v, 2) that use only their first
    ``count`` corners.
    """
    valid = np.arange(polygon.shape[1]) < count[:, None]
    arms = np.where(valid[..., None], polygon - polygon[:, :1], 0.0)
    return _cross(arms[:, :-1], arms[:, 1:]).sum(axis=1) / 2


def counterclockwise(polygon: Array) -> Array:
    """Return the polygons with their corners in counterclockwise order."""
    area = _areas(polygon, np.full(len(polygon), polygon.shape[1]))
    return np.where((area < 0)[:, None, None], polygon[:, ::-1], polygon)


def clip(subject: Array, window: Array) -> tuple[Array, Ints]:
    """Clip convex polygons, or lines of two corners, by convex windows (Sutherland and Hodgman).

    Both are counterclockwise, of shapes (m, a, 2) and (m, b, 2).  Returns the corners of the
    intersections, shape (m, v, 2), and how many of them are valid, shape (m,).
    """
    polygon = subject
    count = np.full(len(subject), subject.shape[1])
    for edge in range(window.shape[1]):
        start = window[:, edge, None]
        along = window[:, (edge + 1) % window.shape[1], None] - start
        size = polygon.shape[1]
        valid = np.arange(size) < count[:, None]
        following = (np.arange(size) + 1)[None] % np.maximum(count, 1)[:, None]
        next_corners = np.take_along_axis(polygon, following[..., None], axis=1)
        height = _cross(along, polygon - start)
        height_after = _cross(along, next_corners - start)
        inside = valid & (height >= 0)
        crosses = valid & ((height >= 0) != (height_after >= 0))
        share = quotient(height, height - height_after, crosses)
        cut = polygon + share[..., None] * (next_corners - polygon)
        # Of each side first the corner that stays, then where it crosses the edge.
        corners = np.stack((polygon, cut), axis=2).reshape(len(polygon), 2 * size, 2)
        stays = np.stack((inside, crosses), axis=2).reshape(len(polygon), 2 * size)
        # One more than before; where corners are on the edge but for round-off the cut may go to
        # and fro along it.
        count = stays.sum(axis=1)
        order = np.argsort(~stays, axis=1, kind="stable")[:, : count.max(initial=1)]
        polygon = np.take_along_axis(corners, order[..., None], axis=1)
    return polygon, count


def _fan(polygon: Array, count: Ints) -> tuple[Array, Ints]:
    """Return triangles around the centre of each polygon, shape (t, 3, 2), and the number of the
    polygon of each triangle, shape (t,).
    """
    size = polygon.shape[1]
    valid = np.arange(size) < count[:, None]
    centre = np.where(valid[..., None], polygon, 0.0).sum(axis=1) / np.maximum(count, 1)[:, None]
    following = (np.arange(size) + 1)[None] % np.maximum(count, 1)[:, None]
    next_corners = np.take_along_axis(polygon, following[..., None], axis=1)
    middle = np.broadcast_to(centre[:, None], polygon.shape)
    triangles = np.stack((middle, polygon, next_corners), axis=2)
    return triangles[valid], np.nonzero(valid)[0]


def _back(functions: Lagrange, flat: Array, reference: Array, p: Array) -> tuple[Array, Array]:
    """Return the reference coordinates of points of the plane, and the ratio of areas in the plane
    to those in the reference facet.
    """
    at = _places_of(functions, flat, p, np.full(p.shape, 0.5))
    slopes = functions.slopes(at)
    return functions.values(at) @ reference, np.abs(
        _cross(*(slopes @ flat)) / _cross(*(slopes @ reference))
    )


def plane_overlap(
    slave_parts: Parts, master_parts: Parts, reach: float, directions: Array | None, comm: MPI.Comm
) -> Overlap:
    """Return the overlap in 2D, one piece for each pair of facets that meet.

    For the arguments see ``space_overlap``; without ``directions`` the nodal normals of the slave
    are used.
    """
    slave = slave_parts.side
    master = master_parts.side
    facets = slave_parts.facet
    normals = (slave.nodal_normals if directions is None else directions)[slave.nodes[facets]]
    cosine = matvec(normals, slave_parts.normal)
    sine = _cross(normals, slave_parts.normal[:, None])
    turning = (np.abs(sine) / np.maximum(cosine, SAME_NUMBER)).max(axis=1)
    numbers, master_facets = candidates(slave_parts, master_parts, reach, turning)
    slave_facets = facets[numbers]
    normals = normals[numbers]
    corners = slave.corners[slave_facets]
    ways = slave.functions.polynomials(normals)[:, :, None]
    # Projections of both ends of the master facet onto the slave facet, for each pair.
    ends = place_under(
        slave.functions, corners, ways, master.positions(master_facets, np.array([[[0.0], [1.0]]]))
    )
    ends.sort(axis=1)
    meets = ends[:, 1] - ends[:, 0] > NOTHING_LEFT
    slave_facets = slave_facets[meets]
    master_facets = master_facets[meets]
    ends = ends[meets]
    normals = normals[meets]
    corners = corners[meets]
    width = ends[:, 1] - ends[:, 0]
    at = ends[:, :1] + width[:, None] * (_PLACES_OF_RULE + 1) / 2
    shape = slave.functions.values(at[..., None])
    over = place_under(
        master.functions, master.corners[master_facets], (shape @ normals)[:, None], shape @ corners
    )
    weight = slave.sizes(slave_facets, at[..., None]) * _WEIGHTS_OF_RULE / 2 * width[:, None]
    return Overlap(slave_facets, master_facets, at[..., None], over[..., None], weight)


def place_under(functions: Lagrange, corners: Array, ways: Array, x: Array) -> Array:
    """Return the coordinates s in [0, 1] on slave facets whose directions of projection pass
    through the points ``x``; 0 or 1 where a point projects beyond that end.

    Args:
        functions: shape functions of the facets.
        corners: nodal positions of the facets, length, shape (m, k, d).
        ways: coefficients of the powers of s in the directions, shape (m, w, q or 1, d).
        x: points to project, length, shape (m, q, d).
    """
    places = functions.polynomials(corners - corners[:, :1])[:, :, None]
    along = places[:, 1:].sum(axis=1)
    # The misses are polynomials of the place: along the facet they fall or rise, as its normal is
    # on its right or left.
    misses = np.zeros((2 * places.shape[1] - 1, *x.shape[:2]))
    misses[: ways.shape[1]] = _cross((x - corners[:, :1])[:, None], ways).swapaxes(0, 1)
    for power in range(1, places.shape[1]):
        misses[power : power + ways.shape[1]] -= _cross(places[:, power, None], ways).swapaxes(0, 1)
    misses *= np.sign(_cross(along, ways[:, 0] + ways.sum(axis=1)))
    at = np.where(misses[0] <= 0, 0.0, 1.0)
    within = (misses[0] > 0) & (misses.sum(axis=0) < 0)
    at[within] = _crossing(misses[:, within])
    return at


def _crossing(factors: Array) -> Array:
    """Return the root in [0, 1] of each polynomial, which is positive at 0 and negative at 1: by
    the quadratic formula, or Newton's method safeguarded by bisection.
    """
    if len(factors) == 3:
        constant, slope, curve = factors
        root = np.sqrt(np.maximum(slope**2 - 4.0 * curve * constant, 0.0))
        return np.minimum(2.0 * constant / (root - slope), 1.0)
    low, high, at = (np.full(factors.shape[1:], end) for end in (0.0, 1.0, 0.5))
    rates = (factors[1:].T * np.arange(1, len(factors))).T
    for _ in range(MANY_STEPS):
        value = _powers(factors, at)
        slope = _powers(rates, at)
        low = np.where(value > 0, at, low)
        high = np.where(value > 0, high, at)
        step = quotient(value, slope, slope != 0, otherwise=np.nan)
        following = np.clip(at - step, 0.0, 1.0)
        following = np.where((following >= low) & (following <= high), following, (low + high) / 2)
        step = following - at
        at = following
        if np.abs(step).max(initial=0.0) < ZERO_COMPONENT:
            break
    return at


def _powers(factors: Array, s: Array) -> Array:
    """Return the values at s of polynomials whose coefficients, by ascending powers, are along the
    first axis.
    """
    value = factors[-1]
    for factor in factors[-2::-1]:
        value = value * s + factor
    return value
