"""What stands beside and on the picture of a body: its true lengths, and the place of the largest value."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from signorini_fx.addons.pictures.style import INK, MUTED, Floats, math_number
from signorini_fx.mechanics.statement.units import unit
from signorini_fx.tuned import ARROWS_AROUND, SAME_PLACE_IN_CELL

_DIGITS = 3  # of a value
_POINTS = 8.5  # of the letters of a length


def draw_lengths(
    axes: Axes,
    points: Floats,
    flat: Callable[[Floats], Floats] = np.asarray,
    *,
    below: Floats | None = None,
    inch: float | None = None,
) -> None:
    """An arrow beside the body along each axis, with the length of the undeformed body.

    Args:
        axes: where to draw.
        points: of the undeformed body, shape (n, d).
        flat: from points in 3D to the picture; in 2D the points themselves.
        below: in 2D the lowest coordinates that are seen, shape (2,): the arrows are beyond them.
        inch: of a body in 3D, how many inches of the figure its unit of length is: axes and figure become as large
            as arrows and labels need.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    corners = flat(np.array(list(itertools.product(*zip(low, high, strict=True)))))
    middle = flat(0.5 * (low + high))
    beside = ARROWS_AROUND * float(np.ptp(corners, axis=0).max())
    reach = []
    for axis, name in enumerate("xyz"[: len(low)]):
        transverse = [k for k in range(len(low)) if k != axis]
        ends = []
        for choice in itertools.product(*(((low[k], high[k])) for k in transverse)):
            start, end = np.array(low), np.array(high)
            start[transverse] = end[transverse] = choice
            ends.append(flat(np.stack((start, end))))
        # The edge that is lowest in the picture, of the upright ones that on the left.
        upright = axis == len(low) - 1
        start, end = min(ends, key=lambda line: float(line.mean(axis=0)[0 if upright else 1]))
        if below is not None:
            start[1 - axis] = end[1 - axis] = below[1 - axis]
        along = (end - start) / (float(np.linalg.norm(end - start)) or 1.0)
        aside = np.array([-along[1], along[0]])
        aside *= math.copysign(beside, float(aside @ (0.5 * (start + end) - middle)))
        style = {"arrowstyle": "-|>", "color": MUTED, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7}
        axes.annotate("", tuple(end + aside), tuple(start + aside), arrowprops=style, annotation_clip=False)
        x, y = 0.5 * (start + end) + 1.6 * aside
        side, far = aside / beside if beside > 0 else aside, 0.4  # beyond it the text begins or ends at the arrow
        length = math_number(float(f"{high[axis] - low[axis]:.4g}"))
        text = f"{name}: ${length}$ {unit('length')}".rstrip()
        across = "right" if side[0] < -far else "left" if side[0] > far else "center"
        upwards = "top" if side[1] < -far else "bottom" if side[1] > far else "center"
        axes.text(x, y, text, ha=across, va=upwards, color=INK, fontsize=_POINTS, clip_on=False)
        wide = {"right": (-1.0, 0.0), "left": (0.0, 1.0), "center": (-0.5, 0.5)}[across]
        room = len(text.replace("$", "")) * 0.7 * _POINTS / 72 / (inch or 1.0)
        reach += [start + aside, end + aside, *((x + share * room, y - beside) for share in wide)]
    if inch is not None:
        _widen(axes, np.array(reach), inch)


def _widen(axes: Axes, reach: Floats, inch: float) -> None:
    """Make axes as large as it takes to show points of shape (n, 2), and their figure by so much larger."""
    figure = axes.figure
    assert isinstance(figure, Figure)
    old = np.array([axes.get_xlim(), axes.get_ylim()])
    new = np.stack((np.minimum(old[:, 0], reach.min(axis=0)), np.maximum(old[:, 1], reach.max(axis=0))), axis=1)
    axes.set(xlim=new[0], ylim=new[1])
    figure.set_size_inches(*(figure.get_size_inches() + inch * (np.ptp(new, axis=1) - np.ptp(old, axis=1))))
    if (grid := axes.get_gridspec()) is not None:
        ratios = np.array(grid.get_width_ratios(), dtype=np.float64)
        ratios[0] *= np.ptp(new[0]) / np.ptp(old[0])
        grid.set_width_ratios(ratios.tolist())


@dataclass(frozen=True)
class Largest:
    """The largest value of a field, as all figures of a result have it.

    Attributes:
        place: in the undeformed body, length, shape (d,).
        text: its value, a number in digits.
    """

    place: Floats
    text: str

    @classmethod
    def of(cls, points: Floats, values: Floats) -> Largest | None:
        """The value of the largest size at points of shapes (n, d), (n,); None: it is no number anywhere."""
        if not np.isfinite(values).any():
            return None
        at = int(np.nanargmax(np.abs(np.where(np.isfinite(values), values, np.nan))))
        return cls(points[at], f"{values[at]:.{_DIGITS}g}")

    def nearest(self, points: Floats) -> int:
        """Which of these points of the undeformed body, shape (n, d), is next to it."""
        return int(np.argmin(np.linalg.norm(points - self.place, axis=1)))

    def moved(self, points: Floats, cells: npt.NDArray[np.int64], values: Floats, moved: Floats) -> Floats:
        """Its place in the picture of a plane body, shape (2,): it moves with the cell around it, of several, such as
        those of bodies that touch there, with that of the largest value.

        Args:
            points: of the undeformed body, shape (n, 2).
            cells: their perimeters, shape (m, p).
            values: the field in each cell, shape (m,) or (m, q).
            moved: the points in the picture, shape (n, 2).
        """
        corners = points[cells]
        edges, arms = np.roll(corners, -1, axis=1) - corners, self.place - corners
        turns = edges[..., 0] * arms[..., 1] - edges[..., 1] * arms[..., 0]
        twice = np.sum(corners[..., 0] * edges[..., 1] - corners[..., 1] * edges[..., 0], axis=1)  # of the area
        outside = np.max(-np.sign(twice)[:, None] * turns / np.linalg.norm(edges, axis=2), axis=1)
        around = outside <= max(float(outside.min()), 0.0) + SAME_PLACE_IN_CELL * np.sqrt(np.abs(twice))
        sizes = np.abs(values.reshape(len(cells), -1)).max(axis=1)
        cell = cells[int(np.argmax(np.where(around & np.isfinite(sizes), sizes, -np.inf)))]
        affine = np.column_stack((np.ones(len(cell)), points[cell] - self.place))
        return np.asarray(np.linalg.lstsq(affine, moved[cell], rcond=None)[0][0])


def mark_largest(axes: Axes, point: Floats, text: str, *, behind: bool = False) -> None:
    """A small circle at a place in the picture, shape (2,), with a number; open if it is behind."""
    text = f"${math_number(float(text))}$" + (" behind" if behind else "")
    fill = "none" if behind else "white"
    axes.plot(
        *point, marker="o", markersize=5, markerfacecolor=fill, markeredgecolor=INK, markeredgewidth=0.9, zorder=7
    )
    box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
    axes.annotate(
        text,
        (float(point[0]), float(point[1])),
        (6, 6),
        textcoords="offset points",
        fontsize=8,
        color=INK,
        bbox=box,
        zorder=7,
    )
