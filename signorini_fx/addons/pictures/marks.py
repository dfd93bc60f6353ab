"""What stands beside and on the picture of a body: its true lengths in 3D, and the place of the largest value."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from signorini_fx.addons.pictures.body import DrawnBody
from signorini_fx.addons.pictures.style import INK, MUTED, Floats, math_number
from signorini_fx.mechanics.statement.units import unit
from signorini_fx.tuned import ARROWS_AROUND, DIGITS_OF_FILES

if TYPE_CHECKING:
    from signorini_fx.addons.pictures.view import Camera


def draw_lengths(axes: Axes, points: Floats, camera: Camera) -> None:
    """An arrow beside a body in 3D along each axis, with the length of the undeformed body, whose points are given."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = camera.flat(0.5 * (low + high))
    beside = ARROWS_AROUND * 2 * float(camera.half.max())
    for axis, name in enumerate("xyz"):
        edges = []
        for corner in itertools.product(*zip(low, high, strict=True)):
            start, end = np.array(corner), np.array(corner)
            start[axis], end[axis] = low[axis], high[axis]
            edges.append(camera.flat(np.stack((start, end))))
        # The edge that is lowest in the picture, of the upright ones that on the left.
        start, end = min(edges, key=lambda edge: float(edge.mean(axis=0)[0 if name == "z" else 1]))
        along = (end - start) / (float(np.linalg.norm(end - start)) or 1.0)
        aside = np.array([-along[1], along[0]])
        aside = aside if aside @ (0.5 * (start + end) - middle) > 0 else -aside
        style = {"arrowstyle": "-|>", "color": MUTED, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7}
        start, end = start + beside * aside, end + beside * aside
        axes.annotate("", tuple(end), tuple(start), arrowprops=style, annotation_clip=False)
        text = f"{name}: ${math_number(float(f'{high[axis] - low[axis]:.4g}'))}$ {unit('length')}".rstrip()
        across = "right" if aside[0] < -0.4 else "left" if aside[0] > 0.4 else "center"
        upwards = "top" if aside[1] < -0.4 else "bottom" if aside[1] > 0.4 else "center"
        x, y = 0.5 * (start + end) + 0.5 * beside * aside
        axes.text(x, y, text, ha=across, va=upwards, color=INK, fontsize=8.5)


@dataclass(frozen=True)
class Largest:
    """The largest value of a field, as all figures of a result have it."""

    place: Floats  # in the undeformed body, length, shape (d,)
    text: str  # its value, a number in digits

    @classmethod
    def of(cls, body: DrawnBody, field: str) -> Largest | None:
        """The value of the largest size; None: it is no number anywhere."""
        values = body.values[field].ravel()
        if not np.isfinite(values).any():
            return None
        at = int(np.nanargmax(np.abs(np.where(np.isfinite(values), values, np.nan))))
        return cls(body.points[body.within.ravel()[at]], f"{values[at]:.3g}")

    def nearest(self, body: DrawnBody, field: str) -> int:
        """The point of the body next to it; of several, as of bodies that touch, that with the largest value."""
        points = body.within.ravel()
        away = np.linalg.norm(body.points[points] - self.place, axis=1)
        sizes = np.abs(np.nan_to_num(body.values[field].ravel()))
        next_to = away <= away.min() + DIGITS_OF_FILES * body.size
        return int(points[np.argmax(np.where(next_to, sizes, -1.0))])

    def moved(self, body: DrawnBody, field: str, factor: float) -> Floats:
        """Its place where the displacement is times a factor, shape (d,)."""
        point = self.nearest(body, field)
        return np.asarray(self.place + body.moved(factor)[point] - body.points[point])


def mark_largest(axes: Axes, point: Floats, text: str, *, behind: bool = False) -> None:
    """A small circle at a place in the picture, shape (2,), with a number; open if it is behind."""
    text = f"${math_number(float(text))}$" + (" behind" if behind else "")
    fill = "none" if behind else "white"
    axes.plot(
        *point, marker="o", markersize=5, markerfacecolor=fill, markeredgecolor=INK, markeredgewidth=0.9, zorder=7
    )
    box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
    x, y = map(float, point)
    axes.annotate(text, (x, y), (6, 6), textcoords="offset points", fontsize=8, color=INK, bbox=box, zorder=7)
