"""How a field becomes colours: the same in 2D and in 3D."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from signorini_fx.addons.pictures.fields import Field
from signorini_fx.addons.pictures.style import VALUES, Floats, decimal_power, unit_of
from signorini_fx.tuned import USUAL_COLOURS


def usual_range(values: Floats, area: Floats, *, signed: bool = False) -> tuple[float, float]:
    """Lowest and highest value of a scale that contains zero; where these are far off, what is beyond 99 % of the area
    at either end has the last colour; ``signed``: whether the scale may begin below zero.
    """
    finite = np.isfinite(values)
    values, area = values[finite], area[finite]
    low, high = float(values.min(initial=0.0)) if signed else 0.0, float(values.max(initial=0.0))
    if low == high:
        return 0.0, 1.0
    order = np.argsort(values)
    share = np.cumsum(area[order])
    ends = np.array([1 - USUAL_COLOURS, USUAL_COLOURS]) * share[-1]
    first, last = map(float, values[order][np.searchsorted(share, ends)])
    first, last = min(first, 0.0) if signed else 0.0, max(last, 0.0)
    return (first, last) if 0 < 1.5 * (last - first) < high - low else (low, high)


class Tones:
    """The scale of a field.

    Args:
        field: what it is.
        values: one per cell or point, shape (m,).
        area: of each cell, or that belongs to each point, shape (m,).
        ends: lowest and highest value of the scale; None: see ``usual_range``.

    Attributes:
        field: what it is.
        power: the figures at the colour bar are multiplied by this power of ten.
        low, high: ends of the scale, before that.
    """

    def __init__(self, field: Field, values: Floats, area: Floats, ends: tuple[float, float] | None = None) -> None:
        self.field = field
        self._values = values[np.isfinite(values)]
        self.low, self.high = usual_range(values, area, signed=field.signed) if ends is None else ends
        self.power = decimal_power(max(-self.low, self.high))

    @property
    def norm(self) -> Normalize:
        """From values times the power of ten to [0, 1]."""
        return Normalize(self.low * 10.0**self.power, self.high * 10.0**self.power)

    def bar(self, figure: Figure, axes: Any) -> Colorbar:
        """The colour bar below the axes, with arrows where there is more than the scale shows."""
        margin = 1e-3 * (self.high - self.low)
        below = self.field.signed and float(self._values.min(initial=self.low)) < self.low - margin
        above = float(self._values.max(initial=self.high)) > self.high + margin
        bar = figure.colorbar(
            ScalarMappable(self.norm, VALUES),
            ax=axes,
            orientation="horizontal",
            extend={(0, 0): "neither", (0, 1): "max", (1, 0): "min", (1, 1): "both"}[int(below), int(above)],
            shrink=0.7,
            aspect=40,
            pad=0.02,
        )
        bar.ax.locator_params(nbins=min(6, max(3, round(1.1 * figure.get_figwidth()))))  # numbers beside each other
        bar.set_label(f"{self.field.label}{unit_of(self.power, self.field.quantity)}")
        return bar


def spaced(points: Floats, rows: npt.NDArray[np.intp], spacing: float) -> npt.NDArray[np.intp]:
    """Rows of points of shape (m, 2) in their order, without those that are closer than this to an earlier one.

    In order along a line the distances of those that are left are alike, but for the distances of the points.
    """
    chosen: list[int] = []
    while len(rows):
        chosen.append(int(rows[0]))
        away = np.linalg.norm(points[rows] - points[rows[0]], axis=1)
        rows = rows[away > (1 - 1e-9) * spacing]  # those of a regular mesh may be equal to it but for round-off
    return np.array(chosen, dtype=np.intp)
