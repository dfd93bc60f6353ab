"""Lines through points in 2D: of straight pieces, or smooth."""

from __future__ import annotations

from itertools import chain
from typing import Annotated, Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from signorini_fx.mechanics.statement.rigid_shape import Array, Shape
from signorini_fx.mechanics.statement.values import Finite
from signorini_fx.tuned import MANY_STEPS, SAME_LENGTH, ZERO_COMPONENT

# Products of points and pieces that are compared at a time, and pieces that are so few that all are.
_AT_A_TIME, _FEW = 1_000_000, 256
# Of a spline: pieces between two points to begin with, and those to each side of the closest one that are searched.
_BETWEEN, _AROUND = 16, 4
# Every which of these pieces' corners the line has that must not cross itself.
_COARSER = 4

Rows = npt.NDArray[np.int64]

Points = Annotated[tuple[tuple[Finite, Finite], ...], Field(min_length=2, max_length=100_000)]


class LineShape(Shape):
    """A line through points: the body is on its left, or outside where the last point is the first one.

    Attributes:
        points: in order, lengths; beyond the first and the last one the line goes straight on.
    """

    exists_in = (2,)

    points: Points

    @model_validator(mode="after")
    def _goes_on(self) -> Self:
        x = np.array(self.points)
        still = np.flatnonzero((np.diff(x, axis=0) == 0).all(axis=1))
        if still.size:
            raise ValueError(f"points: numbers {still[0] + 1} and {still[0] + 2} are the same")
        if self.closed and len(x) < 4:
            raise ValueError("points: a closed line needs three, and the first one again")
        if self.closed and self._area == 0:
            raise ValueError("points: a closed line must enclose an area")
        return self

    @property
    def closed(self) -> bool:
        """Whether it ends where it begins."""
        return self.points[0] == self.points[-1]

    @property
    def inradius(self) -> float:
        """Of a closed line its area over its perimeter, which no inradius is below."""
        if self.hollow or not self.closed:
            return np.inf
        return self._area / float(np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1).sum())

    @property
    def _area(self) -> float:
        """Inside a closed line, length squared."""
        x = np.array(self.points) - self.points[0]
        return abs(float(x[:-1, 0] @ x[1:, 1] - x[1:, 0] @ x[:-1, 1])) / 2

    @property
    def walked(self) -> Array:
        """Its points in the order in which the body is on the left, shape (m, 2)."""
        x = np.array(self.points)
        turning = float(x[:-1, 0] @ x[1:, 1] - x[1:, 0] @ x[:-1, 1])
        return x[::-1] if self.closed and turning > 0 else x


class Polyline(LineShape):
    """A line of straight pieces.

    Attributes:
        points: in order, lengths; beyond the first and the last one the line goes straight on.
    """

    shape: Literal["polyline"] = "polyline"

    @model_validator(mode="after")
    def _has_sides(self) -> Self:
        if (crossed := crossing_pieces(np.array(self.points))) is not None:
            first, second = (f"points {number + 1} and {number + 2}" for number in crossed)
            reason = f"that between {first} crosses that between {second}: the body has no side of such a line"
            raise ValueError(f"points: of its pieces {reason}; leave the loop out")
        return self

    def initial(self, x: Array) -> tuple[Array, Array]:
        walked = self.walked
        count = len(walked) - 1
        pieces = np.column_stack((np.arange(count), np.arange(1, count + 1)))
        if self.closed:
            pieces[-1, 1] = 0
        return StraightPieces(walked, pieces)(x)


class NearestPiece:
    """Which of many straight pieces is the closest one: from where they begin, their unit vectors, both of shape (m,
    2), and the first and last places on each, length, shape (m,), infinite where it goes straight on.
    """

    def __init__(self, begin: Array, along: Array, first: Array, last: Array) -> None:
        self._begin, self._along, self._first, self._last = begin, along, first, last
        self._tree: Any = None
        # All are compared where they are few, and always those that have no end.
        searched = np.isfinite(first) & np.isfinite(last) & (len(begin) > _FEW)
        self._compared = np.flatnonzero(~searched)
        if searched.any():
            self._search(np.flatnonzero(searched))

    def _search(self, pieces: Rows) -> None:
        """Put the middles of parts of pieces into a tree."""
        from scipy.spatial import cKDTree

        first, length = self._first[pieces, None], (self._last - self._first)[pieces, None]
        begin, way = self._begin[pieces] + first * self._along[pieces], length * self._along[pieces]
        owner, middle, self._part = _parts_of(begin, way)
        self._owner, self._tree = pieces[owner], cKDTree(middle)

    def __call__(self, x: Array) -> tuple[Rows, Array]:
        """The closest piece of each point, the first one of several, and the place of the closest point on it, both of
        shape (n,), for points of shape (n, 2).
        """
        chosen = np.zeros(len(x), dtype=np.int64)
        counts, within = np.full(len(x), self._compared.size), np.zeros(len(x))
        if self._tree is not None:
            # The closest point is in a part, half of whose length is the most that it is away from its middle.
            within = (self._tree.query(x)[0] + self._part / 2) * (1 + SAME_LENGTH)
            counts += self._tree.query_ball_point(x, within, return_length=True)
        for batch in np.split(np.arange(len(x)), np.flatnonzero(np.diff(np.cumsum(counts) // _AT_A_TIME)) + 1):
            rows, pieces = np.repeat(batch, self._compared.size), np.tile(self._compared, batch.size)
            if self._tree is not None:
                near = self._tree.query_ball_point(x[batch], within[batch])
                rows = np.concatenate((rows, np.repeat(batch, [len(neighbours) for neighbours in near])))
                parts = np.fromiter(chain.from_iterable(near), np.int64)
                pieces = np.concatenate((pieces, self._owner[parts]))
                order = np.argsort(rows, kind="stable")
                rows, pieces = rows[order], pieces[order]
            at = self._share_of_closest(x[rows], pieces)[:, None]
            distance = np.linalg.norm(x[rows] - self._begin[pieces] - at * self._along[pieces], axis=1)
            starts = np.flatnonzero(np.diff(rows, prepend=-1))
            least = np.repeat(np.minimum.reduceat(distance, starts), np.diff(starts, append=len(rows)))
            chosen[batch] = np.minimum.reduceat(np.where(distance == least, pieces, len(self._begin)), starts)
        return chosen, self._share_of_closest(x, chosen)

    def _share_of_closest(self, x: Array, pieces: Rows) -> Array:
        """The place of the closest point on the piece of each point, shape (n,)."""
        foot = np.einsum("nd,nd->n", x - self._begin[pieces], self._along[pieces])
        return np.clip(foot, self._first[pieces], self._last[pieces])


def _parts_of(begin: Array, way: Array) -> tuple[Rows, Array, float]:
    """The owners and middles of equal parts of pieces, none of which is longer than the mean piece, and its length."""
    length = np.linalg.norm(way, axis=1)
    parts = np.maximum(np.ceil(length / (longest := float(length.mean()))), 1).astype(np.int64)
    owner = np.repeat(np.arange(len(way)), parts)
    number = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return owner, begin[owner] + ((number + 0.5) / parts[owner])[:, None] * way[owner], longest


class StraightPieces:
    """Signed distances from straight pieces, positive on their left, and the normals at the closest points.

    Args:
        corners: ends of the pieces, shape (c, 2).
        pieces: the corner at which each begins, and that at which it ends, shape (m, 2); one at a free end goes on.
    """

    def __init__(self, corners: Array, pieces: Rows) -> None:
        self._pieces, self._begin = pieces, corners[pieces[:, 0]]
        along = corners[pieces[:, 1]] - self._begin
        length = np.linalg.norm(along, axis=1)
        self._along = along / length[:, None]
        self._normals = np.column_stack((-self._along[:, 1], self._along[:, 0]))
        self._at_corner = np.zeros_like(corners)
        for column in (0, 1):
            np.add.at(self._at_corner, pieces[:, column], self._normals)
        self._first = np.where(np.isin(pieces[:, 0], pieces[:, 1]), 0.0, -np.inf)
        self._last = np.where(np.isin(pieces[:, 1], pieces[:, 0]), length, np.inf)
        self._nearest = NearestPiece(self._begin, self._along, self._first, self._last)

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Shapes (n,) and (n, 2), for points of shape (n, 2)."""
        chosen, parameter = self._nearest(x)
        away = x - self._begin[chosen] - parameter[:, None] * self._along[chosen]
        normal = self._normals[chosen].copy()
        signed = np.einsum("nd,nd->n", away, normal)
        # At a corner the sign is that of the mean of both normals (Baerentzen and Aanaes, IEEE Trans. Vis. Comput.
        # Graph. 11 (2005) 243-253), and the normal that of the distance.
        for end, column in ((self._first[chosen], 0), (self._last[chosen], 1)):
            size = np.linalg.norm(away, axis=1)
            at_end = (parameter == end) & (size > 0)
            mean = self._at_corner[self._pieces[chosen[at_end], column]]
            size = size[at_end] * np.where(np.einsum("nd,nd->n", away[at_end], mean) < 0, -1.0, 1.0)
            signed[at_end], normal[at_end] = size, away[at_end] / size[:, None]
        return signed, normal


def crossing_pieces(points: Array) -> tuple[int, int] | None:
    """The first two pieces that cross, by their numbers from 0, the lower first; None: there are none.

    Pieces that touch without going over to the other side do not cross; nor do those that have an end in common.
    """
    from scipy.spatial import cKDTree

    # Two pieces that cross have parts that do, no longer than the mean piece, whose middles are no farther apart.
    owner, middle, longest = _parts_of(points[:-1], np.diff(points, axis=0))
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


class Spline(LineShape):
    """The cubic spline through points by the lengths of their chords, without curvature at its ends.

    Attributes:
        points: in order, lengths; beyond the first and the last one the line goes straight on.
    """

    shape: Literal["spline"] = "spline"

    @model_validator(mode="after")
    def _has_sides(self) -> Self:
        curve, fine = self._curve_through(np.array(self.points))
        corners = curve(fine[::_COARSER])
        if self.closed:
            corners[-1] = corners[0]
        if (crossed := crossing_pieces(corners)) is not None:
            numbers = [piece * _COARSER // _BETWEEN + 1 for piece in crossed]
            first, second = (f"points {number} and {number + 1}" for number in numbers)
            reason = f"between {first} it crosses what is between {second}: the body has no side of such a line"
            raise ValueError(f"points: {reason}; leave the loop out")
        return self

    def _curve_through(self, points: Array) -> tuple[Any, Array]:
        """The curve, and places along it at which a line of many pieces has its corners, shape (c,)."""
        from scipy.interpolate import CubicSpline

        at = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
        curve = CubicSpline(at, points, bc_type="periodic" if self.closed else "natural")
        return curve, np.interp(np.arange(_BETWEEN * (at.size - 1) + 1) / _BETWEEN, np.arange(at.size), at)

    def initial(self, x: Array) -> tuple[Array, Array]:
        """Newton's method for the closest point, from that of a line of many pieces."""
        curve, fine = self._curve_through(self.walked)
        corners = curve(fine)
        chords = np.diff(corners, axis=0)
        length = np.linalg.norm(chords, axis=1)
        first, last = np.zeros_like(length), length.copy()
        if not self.closed:
            first[0], last[-1] = -np.inf, np.inf
        chosen, on = NearestPiece(corners[:-1], chords / length[:, None], first, last)(x)
        parameter = fine[chosen] + on / length[chosen] * np.diff(fine)[chosen]
        inside = np.clip(parameter, fine[0], fine[-1])
        # Near a centre of curvature the distance is flat, and the line of pieces may be closest some pieces away.
        piece = np.diff(fine).max()
        low, high = inside - _AROUND * piece, inside + _AROUND * piece
        if not self.closed:
            low[parameter <= fine[0]], high[parameter >= fine[-1]] = -np.inf, np.inf
        moving = np.arange(len(x))
        for _ in range(MANY_STEPS):
            position, slope, bend = self._at(curve, parameter[moving])
            rise = np.einsum("nd,nd->n", position - x[moving], slope)
            high[moving] = np.where(rise > 0, parameter[moving], high[moving])
            low[moving] = np.where(rise < 0, parameter[moving], low[moving])
            square = np.einsum("nd,nd->n", slope, slope)
            curvature = square + np.einsum("nd,nd->n", position - x[moving], bend)
            # Newton's step; near and beyond a centre of curvature, where it leads away, the bracket is halved.
            ahead = parameter[moving] - rise / np.where(curvature > 0, curvature, square)
            between = (curvature > 0) & (ahead > low[moving]) & (ahead < high[moving])
            halved = np.where(np.isfinite(high - low)[moving], (low[moving] + high[moving]) / 2, ahead)
            ahead = np.where(between, ahead, halved)
            moved, parameter[moving] = np.abs(ahead - parameter[moving]), ahead
            moving = moving[(moved > ZERO_COMPONENT * piece) & (rise != 0)]
            if not moving.size:
                break
        position, slope, _ = self._at(curve, parameter)
        normal = np.column_stack((-slope[:, 1], slope[:, 0])) / np.linalg.norm(slope, axis=1)[:, None]
        return np.einsum("nd,nd->n", x - position, normal), normal

    def _at(self, curve: Any, parameter: Array) -> tuple[Array, Array, Array]:
        """Position, and first and second derivative; beyond the ends it goes straight on."""
        if self.closed:
            return curve(parameter), curve(parameter, 1), curve(parameter, 2)
        inside = np.clip(parameter, curve.x[0], curve.x[-1])
        beyond = (parameter - inside)[:, None]
        return curve(inside) + beyond * curve(inside, 1), curve(inside, 1), np.where(beyond == 0, curve(inside, 2), 0.0)
