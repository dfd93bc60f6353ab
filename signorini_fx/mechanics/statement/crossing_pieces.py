"""Whether a line of straight pieces crosses itself, and where."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]

# Pairs of pieces that are compared at a time.
_AT_A_TIME = 1_000_000


def crossing_pieces(points: Array) -> tuple[int, int] | None:
    """The first two pieces that cross, by their numbers from 0, the lower first; None: there are none.

    Pieces that touch without going over to the other side do not cross; nor do those that have an end in common.

    Args:
        points: of the line, in order, length, shape (m + 1, 2).
    """
    from scipy.spatial import cKDTree

    begin, way = points[:-1], np.diff(points, axis=0)
    length = np.linalg.norm(way, axis=1)
    # Two pieces that cross have parts that do, no longer than the mean piece, whose middles are no farther apart.
    longest = float(length.mean())
    parts = np.ceil(length / longest).astype(np.int64)
    owner = np.repeat(np.arange(len(way)), parts)
    number = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    middle = begin[owner] + ((number + 0.5) / parts[owner])[:, None] * way[owner]
    tree = cKDTree(middle)
    counts = tree.query_ball_point(middle, longest, return_length=True)
    crossings = list[tuple[int, int]]()
    for batch in np.split(np.arange(len(middle)), np.flatnonzero(np.diff(np.cumsum(counts) // _AT_A_TIME)) + 1):
        near = tree.query_ball_point(middle[batch], longest)
        first = np.repeat(owner[batch], [len(neighbours) for neighbours in near])
        second = owner[np.concatenate(near).astype(np.int64)]
        pairs = np.unique(np.column_stack((first, second))[first < second - 1], axis=0)
        crossings += map(tuple, pairs[_cross(points, pairs)].tolist())
    return min(crossings) if crossings else None


def _cross(points: Array, pairs: Rows) -> npt.NDArray[np.bool_]:
    """Which pairs of pieces cross, shape (p,)."""
    count, closed = len(points) - 1, bool((points[0] == points[-1]).all())
    # A corner that lies on the other piece counts as the one that comes after it.
    sides = [_sides(points, piece, second, count, closed=closed) for piece, second in (pairs.T, pairs.T[::-1])]
    return np.all([ahead * beyond < 0 for ahead, beyond in sides], axis=0)


def _sides(points: Array, piece: Rows, second: Rows, count: int, *, closed: bool) -> tuple[Array, Array]:
    """On which side of pieces both ends of others are, 1, -1 or 0, shapes (p,)."""
    begin, along = points[piece], points[piece + 1] - points[piece]

    def side(of: Array) -> Array:
        away = of - begin
        return np.asarray(np.sign(along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0]))

    first, last = side(points[second]), side(points[second + 1])
    beyond = np.where(closed, (second + 1) % count + 1, np.minimum(second + 2, count))
    return first, np.where(last == 0, side(points[beyond]), last)
