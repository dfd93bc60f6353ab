"""Surfaces in space as images: which triangle is seen in each pixel, how light falls on it, and which lines are hidden.

A picture of few triangles could be sorted by distance, but neither polygons that are large beside their neighbours nor
fields that vary within a facet can be drawn in that way: here every pixel has the value of the field at its place.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]
_AT_ONCE = 2_000_000  # pixels that are looked at together, for the sake of memory
_STEP = 1.5  # pixels between two points at which a line is found to be visible or hidden
_BESIDE = 9  # pixels around a point where a surface that it is apart from may not be
_SLACK = 2.0  # pixels by which a line may be behind the surface that it is on


@dataclass(frozen=True)
class Image:
    """What is seen of a surface in a parallel projection.

    Attributes:
        low: coordinates of the middle of the first pixel, shape (2,).
        pixel: size of a pixel.
        triangle: the nearest one in each pixel, -1 where there is none, shape (h, w); the first row is the lowest.
        weights: barycentric coordinates in it, shape (h, w, 3).
        depth: how near it is to the viewer, -inf where there is none, shape (h, w).
    """

    low: Floats
    pixel: float
    triangle: Rows
    weights: Floats
    depth: Floats

    def interpolated(self, values: Floats) -> Floats:
        """Values at the corners of the triangles, shape (t, 3, ...), in the pixels that show one, shape (n, ...), in
        the order of ``triangle >= 0``.
        """
        shown = self.triangle >= 0
        return np.asarray(np.einsum("nk,nk...->n...", self.weights[shown], values[self.triangle[shown]]))

    def visible(self, points: Floats, *, apart: bool = False) -> npt.NDArray[np.bool_]:
        """Which points, given by two coordinates and nearness, shape (n, 3), the surface does not hide.

        Those on it are visible, unless ``apart``: then only those that are clearly in front of it or beside it.
        """
        column, row = np.rint((points[:, :2] - self.low) / self.pixel).astype(np.int64).T
        inside = (column >= 0) & (column < self.depth.shape[1]) & (row >= 0) & (row < self.depth.shape[0])
        # At its rim a surface is so steep that the next pixels have to be asked as well.
        nearest = maximum_filter(self.depth, size=_BESIDE) if apart else minimum_filter(self.depth, size=3)
        slack = _SLACK * self.pixel * (1 if apart else -1)
        found = ~inside
        found[inside] = points[inside, 2] >= nearest[row[inside], column[inside]] + slack
        return found

    def visible_parts(self, lines: Sequence[Floats], *, apart: bool = False) -> list[Floats]:
        """The parts of lines that are not hidden, as lines of shape (k, 2).

        Args:
            lines: two coordinates and nearness of the points along each, shape (k, 3).
            apart: see ``visible``.
        """
        fine = [_finely(line, _STEP * self.pixel) for line in lines]
        if not fine:
            return []
        shown = self.visible(np.concatenate(fine), apart=apart)
        parts = []
        for line, here in zip(fine, np.split(shown, np.cumsum([len(line) for line in fine])[:-1]), strict=True):
            both = np.concatenate(([False], here[:-1] & here[1:], [False]))
            starts, ends = np.flatnonzero(~both[:-1] & both[1:]), np.flatnonzero(both[:-1] & ~both[1:])
            parts += [line[start : end + 1, :2] for start, end in zip(starts, ends, strict=True)]
        return parts


def _finely(line: Floats, step: float) -> Floats:
    """A line with more points, none further from the next than the step."""
    pieces = []
    for start, way in zip(line[:-1], np.diff(line, axis=0), strict=True):
        count = max(1, math.ceil(math.hypot(way[0], way[1]) / step))
        pieces.append(start + (np.arange(count) / count)[:, None] * way)
    return np.concatenate([*pieces, line[-1:]])


def render(corners: Floats, low: Floats, pixel: float, shape: tuple[int, int]) -> Image:
    """Find the nearest triangle in each pixel.

    Args:
        corners: two coordinates and nearness to the viewer, shape (t, 3, 3).
        low: coordinates of the middle of the first pixel, shape (2,).
        pixel: size of a pixel.
        shape: rows and columns of the image.
    """
    depth = np.full(shape, -np.inf).ravel()
    triangle = np.full(depth.shape, -1, dtype=np.int64)
    weights = np.zeros((len(depth), 3))
    flat = np.asarray((corners[..., :2] - low) / pixel, dtype=np.float64)
    first = np.maximum(np.ceil(flat.min(axis=1) - 1e-9), 0).astype(np.int64)
    last = np.minimum(np.floor(flat.max(axis=1) + 1e-9), np.array(shape[::-1]) - 1).astype(np.int64)
    extent = (last - first + 1).max(axis=1)
    possible = (last >= first).all(axis=1)
    for size in 2 ** np.arange(0, 1 + math.ceil(math.log2(max(shape)))):
        rows = np.flatnonzero(possible & (extent <= size) & (2 * extent > size))
        step = max(1, _AT_ONCE // int(size) ** 2)
        for some in (rows[k : k + step] for k in range(0, len(rows), step)):
            pixels, of, share = _covered(flat[some], first[some], last[some], int(size))
            near = np.einsum("nk,nk->n", share, corners[some[of], :, 2])
            place = pixels[:, 1] * shape[1] + pixels[:, 0]
            before = depth[place]
            np.maximum.at(depth, place, near)
            won = (depth[place] == near) & (near > before)
            triangle[place[won]], weights[place[won]] = some[of[won]], share[won]
    return Image(low, pixel, triangle.reshape(shape), weights.reshape(*shape, 3), depth.reshape(shape))


def _covered(flat: Floats, first: Rows, last: Rows, size: int) -> tuple[Rows, Rows, Floats]:
    """The pixels, shape (n, 2), in triangles of shape (m, 3, 2) that are not larger than ``size``; the triangle of
    each, shape (n,), and its barycentric coordinates, (n, 3).
    """
    y, x = np.divmod(np.arange(size * size), size)
    pixels = first[:, None] + np.column_stack((x, y))
    away = pixels - flat[:, None, 0]
    one, other = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    twice = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):  # triangles that are seen from the side
        b = (away[..., 0] * other[:, None, 1] - away[..., 1] * other[:, None, 0]) / twice[:, None]
        c = (one[:, None, 0] * away[..., 1] - one[:, None, 1] * away[..., 0]) / twice[:, None]
        inside = (b >= -1e-9) & (c >= -1e-9) & (b + c <= 1 + 1e-9) & (pixels <= last[:, None]).all(axis=2)
    of, which = np.nonzero(inside)
    share = np.stack((1 - b[of, which] - c[of, which], b[of, which], c[of, which]), axis=-1)
    return pixels[of, which], of, share


def fans(polygons: Rows) -> Rows:
    """Triangles from the first corner of each polygon, shape (m (k - 2), 3)."""
    k = np.arange(1, polygons.shape[1] - 1)
    first = np.broadcast_to(polygons[:, :1], (len(polygons), len(k)))
    return np.stack((first, polygons[:, k], polygons[:, k + 1]), axis=2).reshape(-1, 3)


def normals_of(points: Floats, facets: Rows) -> Floats:
    """Outward normals of polygons, as long as their areas, shape (m, 3)."""
    corners = points[facets] - points[facets].mean(axis=1, keepdims=True)
    return np.asarray(0.5 * np.cross(corners, np.roll(corners, -1, axis=1)).sum(axis=1))


def smooth_normals(points: Floats, triangles: Rows, sharp: float) -> Floats:
    """Unit normals at the corners of triangles, shape (t, 3, 3), that turn smoothly except at sharp edges.

    At a point they are the mean over the triangles that meet there, as far as these are connected by edges that are not
    sharp, as in any program that shades surfaces.

    Args:
        points: shape (n, 3).
        triangles: their points, shape (t, 3).
        sharp: the cosine of the angle from which on an edge is sharp.
    """
    area = normals_of(points, triangles)
    normal = area / np.maximum(np.linalg.norm(area, axis=1), 1e-300)[:, None]
    ends = np.sort(np.stack((triangles, np.roll(triangles, -1, axis=1)), axis=2).reshape(-1, 2), axis=1)
    key = ends[:, 0] * len(points) + ends[:, 1]
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(np.diff(key[order]) == 0)
    one, other = order[pair] // 3, order[pair + 1] // 3
    smooth = np.einsum("ij,ij->i", normal[one], normal[other]) >= sharp
    links = coo_array((np.ones(smooth.sum()), (one[smooth], other[smooth])), shape=(len(triangles),) * 2)
    _, part = connected_components(links, directed=False)
    place = triangles * (int(part.max(initial=0)) + 1) + part[:, None]
    _, number = np.unique(place, return_inverse=True)
    number = number.reshape(-1)
    total = np.zeros((int(number.max(initial=-1)) + 1, 3))
    for axis in range(3):
        total[:, axis] = np.bincount(number, area[:, None, axis].repeat(3, axis=1).ravel())
    found = total[number].reshape(-1, 3, 3)
    return np.asarray(found / np.maximum(np.linalg.norm(found, axis=2, keepdims=True), 1e-300))
