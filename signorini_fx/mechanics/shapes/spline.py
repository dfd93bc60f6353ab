"""A smooth line through points in 2D."""

from __future__ import annotations

from typing import Any, Literal, Self

import numpy as np
from pydantic import model_validator

from signorini_fx.mechanics.shapes.polyline import LineShape, NearestPiece, crossing_pieces
from signorini_fx.mechanics.statement.rigid_shape import Array
from signorini_fx.tuned import MANY_STEPS, ZERO_COMPONENT

# Pieces between two points to begin with, and pieces to each side of the closest of them that are searched.
_BETWEEN, _AROUND = 16, 4
# Every which of these pieces' corners the line has that must not cross itself.
_COARSER = 4


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
        """See ``Shape``: Newton's method for the closest point, from that of a line of many pieces."""
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


Entry = Spline
