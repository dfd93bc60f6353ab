"""How a field becomes colours, and principal stresses strokes: the same in 2D and in 3D."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from signorini_fx.addons.pictures.fields import Field, principal
from signorini_fx.addons.pictures.style import BLUE, ORANGE, VALUES, Floats, decimal_power, unit_of
from signorini_fx.tuned import USUAL_COLOURS

STROKES = 26  # side by side along the longer side of the picture


def upper_tone(values: Floats, area: Floats) -> float:
    """The value drawn in the last colour: the largest or, if that is far above, what 99 % of the area stay below."""
    finite = np.isfinite(values)
    values, area = values[finite], area[finite]
    largest = float(values.max(initial=0.0))
    if not largest > 0:
        return 1.0
    order = np.argsort(values)
    share = np.cumsum(area[order])
    usual = float(values[order][np.searchsorted(share, USUAL_COLOURS * share[-1])])
    return usual if 0 < 1.5 * usual < largest else largest


def _both_tones(values: Floats, area: Floats) -> tuple[float, float]:
    """Lowest and highest value of a scale that contains zero; if they are far off, those of 98 % of the area."""
    finite = np.isfinite(values)
    values, area = values[finite], area[finite]
    low, high = float(values.min(initial=0.0)), float(values.max(initial=0.0))
    if low == high:
        return 0.0, 1.0
    order = np.argsort(values)
    share = np.cumsum(area[order]) / area.sum()
    first, last = (float(values[order][np.searchsorted(share, part)]) for part in (1 - USUAL_COLOURS, USUAL_COLOURS))
    first, last = min(first, 0.0), max(last, 0.0)
    return (first, last) if 0 < 1.5 * (last - first) < high - low else (low, high)


class Tones:
    """The scale of a field.

    Args:
        field: what it is.
        values: one per cell or point, shape (m,).
        area: of each cell, or that belongs to each point, shape (m,).
        top: the upper end of the scale of a field without sign; None: the largest value or, if that is far above the
            others, what 99 % of the area stay below.

    Attributes:
        field: what it is.
        power: the figures at the colour bar are multiplied by this power of ten.
        low, high: ends of the scale, before that.
    """

    def __init__(self, field: Field, values: Floats, area: Floats, top: float | None = None) -> None:
        self.field = field
        self._values = values[np.isfinite(values)]
        if field.signed:
            self.low, self.high = _both_tones(values, area)
        else:
            self.low, self.high = 0.0, upper_tone(values, area) if top is None else top
        self.power = decimal_power(max(-self.low, self.high))

    @property
    def colours(self) -> Any:
        """The colour map."""
        return VALUES if self.field.colours is None else self.field.colours

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
            ScalarMappable(self.norm, self.colours),
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


def draw_principal(axes: Axes, points: Floats, stress: Floats, size: float) -> None:
    """Strokes along the principal stresses at some of the points of a plane, as many as are readable.

    Args:
        axes: where to draw.
        points: in the picture, shape (m, 2).
        stress: tensors, shape (m, 3, 3).
        size: of the longer side of the picture.
    """
    rows = thinned(points, size / STROKES)
    flat = np.column_stack((points[rows], np.zeros(len(rows))))
    pressed, drawn_out = strokes(flat, stress[rows], size / STROKES, plane=True)
    # White rims keep both colours apart from any ground.
    for lines, colour, width in ((pressed, BLUE, 1.7), (drawn_out, ORANGE, 1.1)):
        for tone, rim in (("white", 1.0), (colour, 0.0)):
            axes.add_collection(
                LineCollection(list(lines[..., :2]), colors=tone, linewidths=width + rim, capstyle="butt", zorder=4),
                autolim=False,
            )


def strokes(points: Floats, stress: Floats, spacing: float, *, plane: bool = False) -> tuple[Floats, Floats]:
    """Lines along principal stresses, as long as these are large.

    Args:
        points: their middles, shape (m, 3).
        stress: tensors, shape (m, 3, 3).
        spacing: between the points; the lines are hardly longer.
        plane: leave out what points along z.

    Returns:
        The ends of those of compression and of those of tension, each of shape (., 2, 3).
    """
    values, directions = principal(stress)
    usual = float(np.nanquantile(np.abs(values).max(axis=1, initial=0.0), 0.95)) if len(values) else 0.0
    if not usual > 0:
        return np.empty((0, 2, 3)), np.empty((0, 2, 3))
    along = directions.swapaxes(1, 2) * np.clip(values / usual, -1.2, 1.2)[..., None] * 0.42 * spacing
    along = along * [1.0, 1.0, 0.0] if plane else along
    ends = np.stack((points[:, None] - along, points[:, None] + along), axis=2)
    long = np.linalg.norm(along, axis=2) > 0.02 * spacing
    return ends[long & (values < 0)], ends[long & (values > 0)]


def thinned(points: Floats, spacing: float) -> npt.NDArray[np.intp]:
    """Rows of points of shape (m, 2), of each square of this size the one next to its middle."""
    square = np.floor(points / spacing)
    away = np.linalg.norm(points / spacing - square - 0.5, axis=1)
    order = np.lexsort((away, square[:, 1], square[:, 0]))
    first = np.ones(len(order), dtype=bool)
    first[1:] = np.any(np.diff(square[order], axis=0) != 0, axis=1)
    return order[first]


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
