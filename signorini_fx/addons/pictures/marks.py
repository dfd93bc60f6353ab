"""Annotations of the picture of a body: its lengths in 3D, the largest value, and the
colour bar.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from signorini_fx.addons.pictures.body import DrawnBody
from signorini_fx.addons.pictures.fields import Field
from signorini_fx.addons.pictures.style import INK, MUTED, VALUES, decimal_power, number, unit_of
from signorini_fx.arrays import Array
from signorini_fx.mechanics.statement.units import unit
from signorini_fx.tuned import ARROWS_AROUND, USUAL_COLOURS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from signorini_fx.addons.pictures.view import Camera


def draw_lengths(axes: Axes, points: Array, camera: Camera) -> None:
    """Draw an arrow beside a body in 3D along each axis, with the length of the undeformed body,
    given by its points.
    """
    low = points.min(axis=0)
    high = points.max(axis=0)
    middle = camera.flat(0.5 * (low + high))
    beside = ARROWS_AROUND * 2 * float(camera.half.max())
    for axis, name in enumerate("xyz"):
        edges = []
        for corner in itertools.product(*zip(low, high, strict=True)):
            start = np.array(corner)
            end = np.array(corner)
            start[axis] = low[axis]
            end[axis] = high[axis]
            edges.append(camera.flat(np.stack((start, end))))
        # The edge that is lowest in the picture, of the upright ones that on the left.
        start, end = min(edges, key=lambda edge: float(edge.mean(axis=0)[0 if name == "z" else 1]))
        along = (end - start) / (float(np.linalg.norm(end - start)) or 1.0)
        aside = np.array([-along[1], along[0]])
        aside = aside if aside @ (0.5 * (start + end) - middle) > 0 else -aside
        style = {
            "arrowstyle": "-|>",
            "color": MUTED,
            "linewidth": 0.8,
            "shrinkA": 0,
            "shrinkB": 0,
            "mutation_scale": 7,
        }
        start = start + beside * aside
        end = end + beside * aside
        axes.annotate("", tuple(end), tuple(start), arrowprops=style, annotation_clip=False)
        text = f"{name}: {number(float(f'{high[axis] - low[axis]:.4g}'))} {unit('length')}".rstrip()
        across = "right" if aside[0] < -0.4 else "left" if aside[0] > 0.4 else "center"
        upwards = "top" if aside[1] < -0.4 else "bottom" if aside[1] > 0.4 else "center"
        x, y = 0.5 * (start + end) + 0.5 * beside * aside
        axes.text(x, y, text, ha=across, va=upwards, color=INK, fontsize=8.5)


@dataclass(frozen=True)
class Largest:
    """The largest value of the field that is drawn."""

    point: int  # its number in the body
    text: str  # the value, a number in digits

    @classmethod
    def of(cls, body: DrawnBody, field: str) -> Largest | None:
        """Return the value of largest magnitude, or None if no value is finite."""
        values = body.values[field].ravel()
        if not np.isfinite(values).any():
            return None
        at = int(np.nanargmax(np.abs(np.where(np.isfinite(values), values, np.nan))))
        return cls(int(body.within.ravel()[at]), f"{values[at]:.3g}")


def mark_largest(axes: Axes, point: Array, text: str, *, behind: bool = False) -> None:
    """Draw a small circle at a place in the picture, shape (2,), with a number; the circle is open
    if the place is behind.
    """
    text = number(float(text)) + (" behind" if behind else "")
    fill = "none" if behind else "white"
    axes.plot(
        *point,
        marker="o",
        markersize=5,
        markerfacecolor=fill,
        markeredgecolor=INK,
        markeredgewidth=0.9,
        zorder=7,
    )
    box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
    x, y = map(float, point)
    axes.annotate(
        text, (x, y), (6, 6), textcoords="offset points", fontsize=8, color=INK, bbox=box, zorder=7
    )


def usual_range(values: Array, area: Array, *, signed: bool = False) -> tuple[float, float]:
    """Return the lowest and highest value of a colour scale that contains zero.

    If extreme values are far off, as at a singular corner, the scale ends at the value that 99 % of
    the area do not exceed, at either end.

    Args:
        values: the values.
        area: the area of each value.
        signed: whether the scale may begin below zero.
    """
    finite = np.isfinite(values)
    values = values[finite]
    area = area[finite]
    low = float(values.min(initial=0.0)) if signed else 0.0
    high = float(values.max(initial=0.0))
    if low == high:
        return 0.0, 1.0
    order = np.argsort(values)
    share = np.cumsum(area[order])
    ends = np.array([1 - USUAL_COLOURS, USUAL_COLOURS]) * share[-1]
    first, last = map(float, values[order][np.searchsorted(share, ends)])
    first = min(first, 0.0) if signed else 0.0
    last = max(last, 0.0)
    return (first, last) if 0 < 1.5 * (last - first) < high - low else (low, high)


@dataclass(frozen=True)
class Tones:
    """The colour scale of a field."""

    field: Field
    values: Array  # of cells or points, shape (m,)
    low: float  # the value of the first colour
    high: float  # that of the last one

    @property
    def power(self) -> int:
        """The power of ten by which the figures at the colour bar are multiplied."""
        return decimal_power(max(-self.low, self.high))

    @property
    def norm(self) -> Normalize:
        """The norm from values times this power of ten to [0, 1]."""
        return Normalize(self.low * 10.0**self.power, self.high * 10.0**self.power)

    def bar(self, figure: Figure, axes: Axes | Sequence[Axes]) -> Colorbar:
        """Return the colour bar below the axes, with arrowheads where values exceed the scale."""
        margin = 1e-3 * (self.high - self.low)
        values = self.values[np.isfinite(self.values)]
        below = self.field.signed and float(values.min(initial=self.low)) < self.low - margin
        above = float(values.max(initial=self.high)) > self.high + margin
        bar = figure.colorbar(
            ScalarMappable(self.norm, VALUES),
            ax=axes,
            orientation="horizontal",
            extend={(0, 0): "neither", (0, 1): "max", (1, 0): "min", (1, 1): "both"}[
                int(below), int(above)
            ],
            shrink=0.7,
            aspect=40,
            pad=0.02 if figure.get_layout_engine() else 0.2,
        )
        bar.ax.locator_params(
            nbins=min(6, max(3, round(1.1 * figure.get_figwidth())))
        )  # numbers beside each other
        bar.set_label(f"{self.field.label}{unit_of(self.power, self.field.quantity)}")
        return bar


def spaced(points: Array, rows: npt.NDArray[np.intp], spacing: float) -> npt.NDArray[np.intp]:
    """Return rows of points, shape (m, 2), in their order, without those that are closer than
    ``spacing`` to an earlier one.

    If the rows are in order along a line, the remaining points are evenly spaced, up to the
    distances between points.
    """
    chosen: list[int] = []
    while len(rows):
        chosen.append(int(rows[0]))
        away = np.linalg.norm(points[rows] - points[rows[0]], axis=1)
        rows = rows[
            away > (1 - 1e-9) * spacing
        ]  # those of a regular mesh may be equal to it but for round-off
    return np.array(chosen, dtype=np.intp)
