"""Polygons that facets of two sides share, and points in them, for the certificates of pairs in 3D."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.tuned import PARALLEL, SAME_NUMBER

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]


def triangle_rule(count: int) -> tuple[Array, Array]:
    """Points of the triangle with the corners (0, 0), (1, 0), (0, 1), from those of a square, and their weights."""
    places, weights = np.polynomial.legendre.leggauss(count)
    s, t = (grid.ravel() for grid in np.meshgrid((places + 1) / 2, (places + 1) / 2, indexing="ij"))
    return np.column_stack((s, t * (1 - s))), np.outer(weights, weights).ravel() / 4 * (1 - s)


def _inside(points: Array, window: Array, tolerance: Array) -> npt.NDArray[np.bool_]:
    """Which points of the plane, shape (m, v, 2), are in convex polygons, corners counterclockwise, shape (m, k, 2), or
    outside by at most these lengths, shape (m,); shape (m, v).
    """
    edges = np.roll(window, -1, axis=1) - window
    away = points[:, :, None] - window[:, None]
    height = edges[:, None, :, 0] * away[..., 1] - edges[:, None, :, 1] * away[..., 0]
    return np.asarray((height >= -tolerance[:, None, None] * np.linalg.norm(edges, axis=2)[:, None]).all(axis=2))


def common_polygons(first: Array, second: Array) -> tuple[Array, Numbers]:
    """The polygons that pairs of convex ones share, corners counterclockwise: shape (m, v, 2), of which the first
    corners are there, and how many, shape (m,).

    Where edges of both are on one line but for round-off, corners are theirs, as no crossing is to be had.

    Args:
        first: corners counterclockwise, shape (m, k, 2).
        second: likewise, shape (m, l, 2).
    """
    start, along = first[:, :, None], (np.roll(first, -1, axis=1) - first)[:, :, None]
    begin, across = second[:, None], (np.roll(second, -1, axis=1) - second)[:, None]
    turn = along[..., 0] * across[..., 1] - along[..., 1] * across[..., 0]
    away = begin - start
    crosses = np.abs(turn) > PARALLEL * np.linalg.norm(along, axis=-1) * np.linalg.norm(across, axis=-1)
    apart = away[..., 0] * across[..., 1] - away[..., 1] * across[..., 0]
    at = np.divide(apart, turn, out=np.zeros_like(turn), where=crosses)
    count, edges = len(first), first.shape[1] * second.shape[1]  # there may be no pair
    crossings = (start + at[..., None] * along).reshape(count, edges, 2)
    points = np.concatenate((first, second, crossings), axis=1)
    kept = np.ones(points.shape[:2], dtype=bool)
    kept[:, first.shape[1] + second.shape[1] :] = crosses.reshape(count, edges)
    tolerance = SAME_NUMBER * np.maximum(*(np.ptp(polygon, axis=1).max(axis=1) for polygon in (first, second)))
    kept &= _inside(points, first, tolerance) & _inside(points, second, tolerance)
    number = kept.sum(axis=1)
    middle = np.where(kept[..., None], points, 0.0).sum(axis=1) / np.maximum(number, 1)[:, None]
    arms = points - middle[:, None]
    angle = np.where(kept, np.arctan2(arms[..., 1], arms[..., 0]), np.inf)
    order = np.argsort(angle, axis=1, kind="stable")[:, : int(number.max(initial=1))]
    return np.take_along_axis(points, order[..., None], axis=1), np.where(number < 3, 0, number)


def polygon_areas(polygons: Array, number: Numbers) -> Array:
    """Of polygons, corners counterclockwise, of which the first ones are there, shapes (m, v, 2) and (m,)."""
    valid = np.arange(polygons.shape[1]) < number[:, None]
    arms = np.where(valid[..., None], polygons - polygons[:, :1], 0.0)
    return np.asarray((arms[:, :-1, 0] * arms[:, 1:, 1] - arms[:, :-1, 1] * arms[:, 1:, 0]).sum(axis=1) / 2)


def places_in_polygons(corners: Array, p: Array) -> Array:
    """The places of points of the plane, shape (r, 2), in facets with corners of shape (r, k, 2)."""

    def cross(a: Array, b: Array) -> Array:
        return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

    away, first, last = corners[:, 0] - p, corners[:, 1] - corners[:, 0], corners[:, -1] - corners[:, 0]
    if corners.shape[1] == 3:
        size = cross(first, last)
        return np.column_stack((cross(last, away) / size, cross(away, first) / size))
    twist = corners[:, 2] - corners[:, 1] - last
    square, linear, constant = cross(last, twist), cross(away, twist) + cross(last, first), cross(away, first)
    root = np.sqrt(np.maximum(linear**2 - 4 * square * constant, 0.0))
    half = -(linear + np.where(linear >= 0, root, -root)) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = np.stack((constant / half, half / square))
    roots = np.where(np.isfinite(roots), roots, np.inf)
    t = np.take_along_axis(roots, np.abs(roots - 0.5).argmin(axis=0)[None], axis=0)[0]
    along, offset = first + t[:, None] * twist, away + t[:, None] * last
    return np.column_stack((-np.sum(offset * along, axis=1) / np.sum(along**2, axis=1), t))


def near_lines(middles: Array, ways: Array, tree: cKDTree, width: Array, reach: float) -> tuple[Numbers, Numbers]:
    """Which points of a tree may be within a distance from lines through others, at most so far along them as the
    reach and this distance: a few more, numbers of both, shape (m,).

    Args:
        middles: points on the lines, shape (n, 3).
        ways: their directions, of length one, shape (n, 3).
        tree: of the other points.
        width: the distances, shape (n,).
        reach: length.
    """
    low, high = tree.mins, tree.maxes
    beyond = float(np.linalg.norm(np.maximum(high, middles.max(axis=0)) - np.minimum(low, middles.min(axis=0))))
    widest = float(width.max())
    length = min(reach, beyond) + widest
    stations = np.arange(-int(np.ceil(length / (2 * widest))), int(np.ceil(length / (2 * widest))) + 1) * 2 * widest
    # A place on the line is at most as far from a station as it is wide.
    radius = np.sqrt(2.0) * widest * (1 + SAME_NUMBER)
    met = [np.zeros((0, 2), dtype=np.int64)]
    for station in stations:
        places = middles + station * ways
        close = np.flatnonzero(np.isfinite(tree.query(places, distance_upper_bound=radius)[0]))
        balls = tree.query_ball_point(places[close], radius)
        sizes = np.array([len(numbers) for numbers in balls], dtype=np.int64)
        if sizes.sum():
            met.append(np.column_stack((np.repeat(close, sizes), np.concatenate(balls).astype(np.int64))))
    line, point = np.divmod(np.unique(np.concatenate(met) @ np.array([tree.n, 1])), tree.n)
    return line, point
