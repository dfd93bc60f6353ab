"""A smooth line through points in the plane."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from signorini_fx.scene.rigid_shape import Array
from signorini_fx.shapes.polyline import Line, nearest

# Pieces between two points to begin with, and Newton steps from there.
_BETWEEN, _STEPS = 16, 12
# Share of the square of the slope that the second derivative of half the squared distance has at least.
_CONVEX = 0.1


class Spline(Line):
    """The cubic spline through points by the lengths of their chords, without curvature at its ends.

    Attributes:
        points: in order, lengths; beyond the first and the last one the line goes straight on.
    """

    shape: Literal["spline"] = "spline"

    def initial(self, x: Array) -> tuple[Array, Array]:
        """See ``Shape``: Newton's method for the closest point, from that of a line of many pieces."""
        from scipy.interpolate import CubicSpline

        walked = self.walked
        at = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(walked, axis=0), axis=1))))
        curve = CubicSpline(at, walked, bc_type="periodic" if self.closed else "natural")
        fine = np.interp(np.arange(_BETWEEN * (at.size - 1) + 1) / _BETWEEN, np.arange(at.size), at)
        corners = curve(fine)
        chords = np.diff(corners, axis=0)
        length = np.linalg.norm(chords, axis=1)
        first, last = np.zeros_like(length), length.copy()
        if not self.closed:
            first[0], last[-1] = -np.inf, np.inf
        chosen, on = nearest(x, corners[:-1], chords / length[:, None], first, last)
        place = fine[chosen] + on / length[chosen] * np.diff(fine)[chosen]
        inside = np.clip(place, fine[0], fine[-1])
        low, high = inside - np.diff(fine).max(), inside + np.diff(fine).max()
        if not self.closed:
            low[place <= fine[0]], high[place >= fine[-1]] = -np.inf, np.inf
        for _ in range(_STEPS):
            position, slope, bend = self._at(curve, place)
            square = np.einsum("nd,nd->n", slope, slope)
            curvature = square + np.einsum("nd,nd->n", position - x, bend)
            # Where the distance is not convex, as beyond a centre of curvature, a step of Gauss and Newton.
            rate = np.where(curvature > _CONVEX * square, curvature, square)
            place = np.clip(place - np.einsum("nd,nd->n", position - x, slope) / rate, low, high)
        position, slope, _ = self._at(curve, place)
        left = np.column_stack((-slope[:, 1], slope[:, 0])) / np.linalg.norm(slope, axis=1)[:, None]
        return np.einsum("nd,nd->n", x - position, left), left

    def _at(self, curve: Any, place: Array) -> tuple[Array, Array, Array]:
        """Position, and first and second derivative; beyond the ends it goes straight on."""
        if self.closed:
            return curve(place), curve(place, 1), curve(place, 2)
        inside = np.clip(place, curve.x[0], curve.x[-1])
        beyond = (place - inside)[:, None]
        return curve(inside) + beyond * curve(inside, 1), curve(inside, 1), np.where(beyond == 0, curve(inside, 2), 0.0)


Entry = Spline
