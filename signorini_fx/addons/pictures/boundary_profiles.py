"""Curves along the contact boundary: pressure, shear with its bounds, displacements, and the state
of each node.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, cycle, groupby, pairwise
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch

from signorini_fx.addons.pictures.style import (
    BLUE,
    INK,
    LIMIT,
    MINUS,
    MOTION,
    MULTIPLIER,
    MUTED,
    ORANGE,
    RULE,
    STYLE,
    decimal_power,
    largest_of,
    plain,
    unit_of,
)
from signorini_fx.arrays import Array, Columns, Flags, Ints
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.statement.units import bracketed
from signorini_fx.tuned import SMALL_PART

AROUND = {"color": ORANGE, "linewidth": 1.5, "linestyle": (0, (6.0, 1.2, 1.2, 1.2))}
# Lightness decreases from open to stick, so that the order of the states is visible in a gray
# print.
STATES = {
    "open": ("#f0f0f0", "open"),
    "slip": (ORANGE, "slip"),  # in 3D, where it has a direction in place of a sign
    "slip+": (ORANGE, "slip +"),
    "slip-": (BLUE, f"slip {MINUS}"),
    "stick": ("#262626", "stick"),
    "contact": ("#8c8c8c", "in contact, no friction"),
}

_FEWEST = 5  # nodes of a part that is drawn alone: with fewer a curve is hardly visible


@dataclass(frozen=True)
class ContactColumns:
    """A contact boundary with its name and its columns of ``contact.csv``, each of shape (n,)."""

    name: str
    columns: Columns

    def floats(self, name: str) -> Array:
        """Return a numeric column, shape (n,)."""
        return np.asarray(self.columns[name], dtype=np.float64)

    def vectors(self, begin: str) -> Array:
        """Return the columns whose names are ``begin`` and an axis, as vectors, shape (n, d)."""
        return np.column_stack(
            [self.floats(f"{begin}{axis}") for axis in "xyz" if f"{begin}{axis}" in self.columns]
        )

    @property
    def has_friction(self) -> bool:
        """Whether a friction law acts anywhere on the boundary."""
        return bool(np.any(self.columns["friction"] != "none") or np.any(self.floats("bound") != 0))

    @property
    def out_of_section(self) -> bool:
        """Whether tangential vectors have a component around the axis of the body, of which this is
        the section.
        """
        return "shear_z" in self.columns and "s" in self.columns

    def along(self, name: str) -> Array:
        """Return the component of a tangential vector along t = (-n_y, n_x)."""
        if not self.out_of_section:
            return self.floats(name)
        parts = ((f"{name}_x", -self.floats("n_y")), (f"{name}_y", self.floats("n_x")))
        return np.asarray(sum(self.floats(part) * axis for part, axis in parts))

    @property
    def against(self) -> str:
        """The boundary of another body that it may touch; "" for a rigid foundation."""
        return str(self.columns["against"][0]) if "against" in self.columns else ""

    @property
    def touching(self) -> Flags:
        """Which nodes are in contact, shape (n,)."""
        return self.columns["state"] != "open"

    @property
    def states(self) -> list[str]:
        """The state of each node as a key of ``STATES``, "open" outside contact.

        Tresca friction acts on open nodes too, where stick and slip would be misleading.
        """
        closed = np.where(self.columns["friction"] != "none", self.columns["state"], "contact")
        return [str(key) for key in np.where(self.touching, closed, "open")]


def by_boundary(table: Columns, polygons: Ints) -> Iterator[tuple[ContactColumns, Ints]]:
    """Yield each contact boundary in 3D with its polygons.

    Args:
        table: columns of ``contact.csv``.
        polygons: rows of the table at the corners of each polygon, shape (m, k).
    """
    names = table["boundary"]
    for name in dict.fromkeys(map(str, names)):
        rows = np.flatnonzero(names == name)
        number = np.full(len(names), -1)
        number[rows] = np.arange(len(rows))
        columns = {key: column[rows] for key, column in table.items()}
        yield ContactColumns(plain(name), columns), number[polygons[names[polygons[:, 0]] == name]]


@dataclass(frozen=True)
class PlaneBoundary(ContactColumns):
    """A boundary in 2D with the coordinate to draw against, its label, and the rows where connected
    pieces start.
    """

    coordinate: Array
    label: str
    starts: list[int]

    def draw(self, axes: Axes, values: Array, **style: Any) -> None:
        """Draw values as a line that is interrupted between the pieces."""
        axes.plot(
            np.insert(self.coordinate, self.starts[1:], np.nan),
            np.insert(values, self.starts[1:], np.nan),
            **style,
        )

    def at(self, rows: Ints) -> PlaneBoundary:
        """Return the boundary with some of its nodes, which are connected where they are
        neighbours.
        """
        piece = np.searchsorted(self.starts, rows, side="right")
        apart = (np.abs(np.diff(rows)) > 1) | (np.diff(piece) != 0)
        columns = {key: column[rows] for key, column in self.columns.items()}
        starts = [0, *map(int, np.flatnonzero(apart) + 1)]
        return replace(self, columns=columns, coordinate=self.coordinate[rows], starts=starts)

    def near(self) -> PlaneBoundary:
        """Return the boundary around its nodes in contact if these cover a small part of it,
        otherwise the whole boundary.
        """
        x = self.coordinate
        inside = x[self.touching]
        whole = float(np.ptp(x))
        if not inside.size:
            return self
        first = float(inside.min())
        last = float(inside.max())
        around = 0.75 * (last - first) + 2 * min(whole / max(len(x) - 1, 1), 0.02 * whole)
        away = np.sort(np.maximum(first - x, x - last))
        around = max(around, float(away[:_FEWEST][-1]))
        first = max(first - around, float(x.min()))
        last = min(last + around, float(x.max()))
        if last - first >= SMALL_PART * whole:
            return self
        return replace(
            self.at(np.flatnonzero((x >= first) & (x <= last))),
            label=f"{self.label}, the part in contact",
        )


# A name for the legend, "" for none, values at the nodes, and the style of the line.
Curve = tuple[str, Array, Mapping[str, Any]]


@dataclass(frozen=True)
class Panel:
    """Quantities of one unit, drawn on one axis."""

    unit: str  # stress or length
    curves: Sequence[Curve]  # the most important one first
    reach: float = math.inf  # what lies further from zero is cut off
    least: float = 0.0  # what the axis shows at least, so that round-off looks like zero

    def draw(self, axes: Axes, boundary: PlaneBoundary, name: str) -> None:
        """Draw the curves, with the name of the boundary above them if it has one."""
        power = decimal_power(
            max(min(largest_of(*(curve[1] for curve in self.curves)), self.reach), self.least)
        )
        for label, values, style in reversed(self.curves):
            boundary.draw(
                axes, values * 10.0**power, **style, **({"label": label} if label else {})
            )
        everything = np.concatenate([values for _, values, _ in self.curves])
        everything = (
            np.clip(everything[np.isfinite(everything)], -self.reach, self.reach) * 10.0**power
        )
        low = float(everything.min(initial=0.0))
        high = float(everything.max(initial=0.0))
        if max(-low, high) < self.least * 10.0**power:
            low = -self.least * 10.0**power
            high = self.least * 10.0**power
        margin = 0.05 * (high - low) or 1.0
        axes.set(
            ylim=(low - margin, high + margin), ylabel=f"{self.unit}{unit_of(power, self.unit)}"
        )
        low = float(boundary.coordinate.min())
        high = float(boundary.coordinate.max())
        axes.set_xlim(low, high if high > low else low + 1.0)
        axes.axhline(0.0, color=RULE, linewidth=0.6, zorder=0)
        axes.xaxis.set_visible(False)
        axes.spines["bottom"].set_visible(False)
        axes.locator_params(axis="y", nbins=6)
        handles, labels = axes.get_legend_handles_labels()
        legend = axes.legend(
            handles[::-1],
            labels[::-1],
            title=name or None,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.01),
            alignment="left",
        )
        legend.get_title().set_fontweight("bold")


def draw_pressures(axes: Axes, boundaries: Sequence[PlaneBoundary]) -> None:
    """Draw the contact pressure along several boundaries, with a legend of their names."""
    pressures = [boundary.floats("pressure") for boundary in boundaries]
    power = decimal_power(largest_of(*pressures))
    colours = cycle((INK, BLUE, ORANGE, MUTED))
    for boundary, pressure, colour in zip(boundaries, pressures, colours, strict=False):
        boundary.draw(axes, pressure * 10.0**power, color=colour, label=boundary.name)
    label = boundaries[0].label if len(boundaries) == 1 else "along each boundary"
    axes.set(xlabel=f"{label}{bracketed('length')}", ylabel=f"pressure{unit_of(power, 'stress')}")
    axes.axhline(0.0, color=RULE, linewidth=0.6, zorder=0)
    axes.margins(x=0.0)
    if len(boundaries) > 1:
        axes.legend()


def panels_of(boundary: PlaneBoundary, side: str) -> list[Panel]:
    """Return the panels of stresses and of lengths for a boundary.

    Args:
        boundary: the boundary.
        side: ``contact`` for pressure, normal displacement and gap; ``friction`` for shear, its
            bounds and tangential displacement.
    """
    moves = "relative " if boundary.against else ""
    if side == "contact":
        pressure, motion, gap = (boundary.floats(name) for name in ("pressure", "u_n", "gap"))
        opposite = "the other body" if boundary.against else "rigid foundation"
        # The foundation is drawn where it is near, and its nearest point is always visible.
        nearest = float(np.abs(gap).min(initial=np.inf, where=np.isfinite(gap)))
        lengths = [
            (f"{moves}normal displacement", motion, MOTION),
            (opposite, gap, LIMIT),
        ]
        return [
            Panel("stress", [("contact pressure", pressure, MULTIPLIER)]),
            Panel("length", lengths, max(2.5 * largest_of(motion), 1.2 * nearest)),
        ]
    bound = boundary.floats("bound")
    inside = " in the section" if boundary.out_of_section else ""
    shears = [(f"shear stress{inside}", boundary.along("shear"), MULTIPLIER)]
    motions = [(f"{moves}tangential displacement{inside}", boundary.along("u_t"), MOTION)]
    if boundary.out_of_section:
        shears.append(("around the axis", boundary.floats("shear_z"), AROUND))
        motions.append(("around the axis", boundary.floats("u_t_z"), AROUND))
    # A bound that is never reached, or that is practically infinite, should not flatten the shear;
    # a bond has none.
    reach = 10 * largest_of(*(values for _, values, _ in shears)) or math.inf
    bounds = (
        [("friction bound", bound, LIMIT), ("", -bound, LIMIT)] if np.isfinite(bound).any() else []
    )
    least = 1e-4 * largest_of(*(values for _, values, _ in motions), boundary.floats("u_n"))
    return [Panel("stress", [*shears, *bounds], reach), Panel("length", motions, least=least)]


@mpl.rc_context(STYLE)
def boundary_profiles(table: ContactTable) -> Figure:
    """Draw the curves along the contact boundary, one block per boundary.

    Left: contact pressure lambda, and below it the normal displacement and the rigid foundation, or
    the distance of the other body.  Right, with friction: shear stress mu with its bounds, and
    below it the tangential displacement, for torsion also around the axis.  Foundation and bounds
    are cut off where they lie far beyond the other curves. The strip shows the state of the
    contact. If little of a boundary is in contact, only the surroundings of that part are drawn,
    which the label of the coordinate states.
    """
    boundaries = [boundary.near() for boundary in boundaries_of(table)]
    rubs = any(boundary.has_friction for boundary in boundaries)
    sides = ("contact", "friction") if rubs else ("contact",)
    size = (7.2 if len(sides) == 2 else 4.2, 3.9 * len(boundaries) + 0.4)
    figure = Figure(
        figsize=size, layout=ConstrainedLayoutEngine(hspace=0.0, h_pad=0.03, wspace=0.05)
    )
    heights = [1, 0.8, 0.055] * len(boundaries)
    grid = figure.add_gridspec(3 * len(boundaries), len(sides), height_ratios=heights)
    seen: set[str] = set()
    for i, boundary in enumerate(boundaries):
        for j, side in enumerate(sides):
            name = boundary.name if len(boundaries) > 1 else ""
            upper = figure.add_subplot(grid[3 * i, j])
            if side == "friction" and not boundary.has_friction:
                upper.set_axis_off()
                upper.text(
                    0.5,
                    0.5,
                    f"{name}: no friction",
                    color=MUTED,
                    ha="center",
                    transform=upper.transAxes,
                )
                continue
            lower = figure.add_subplot(grid[3 * i + 1, j], sharex=upper)
            strip = figure.add_subplot(grid[3 * i + 2, j], sharex=upper)
            for axes, panel in zip((upper, lower), panels_of(boundary, side), strict=True):
                panel.draw(axes, boundary, name if axes is upper else "")
            seen.update(boundary.states)
            state_strip(strip, boundary)
    state_legend(figure, seen)
    return figure


def state_legend(figure: Figure, states: set[str]) -> None:
    """Draw a legend of the states that occur, in a fixed order, below a figure."""
    patches = [
        Patch(facecolor=color, edgecolor=MUTED, linewidth=0.5, label=label)
        for state, (color, label) in STATES.items()
        if state in states
    ]
    figure.legend(handles=patches, loc="outside lower center", ncols=len(patches), handlelength=1.6)


def boundaries_of(table: ContactTable) -> list[PlaneBoundary]:
    """Return the boundaries in 2D in the order in which they appear; a closed piece ends with its
    first row.
    """
    paths = defaultdict[str, list[Ints]](list)
    for path in table.paths:
        paths[str(table.columns["boundary"][path[0]])].append(path)
    boundaries = []
    for name, pieces in paths.items():
        rows = np.concatenate(pieces)
        starts = [0, *accumulate(map(len, pieces))][:-1]
        columns = {key: column[rows] for key, column in table.columns.items()}
        arcs = [table.arc(path) for path in pieces]
        before = accumulate((float(arc[-1]) for arc in arcs), initial=0.0)
        s = np.concatenate([arc + start for arc, start in zip(arcs, before, strict=False)])
        flat = np.ptp(columns["y"]) <= 1e-9 * np.ptp(columns["x"])
        along = (columns["x"], "x") if flat else (s, "arc length s")
        boundaries.append(PlaneBoundary(plain(name), columns, *along, starts))
    return boundaries


def state_strip(axes: Axes, boundary: PlaneBoundary) -> None:
    """Draw the state of the boundary as a coloured strip: each node colours it up to halfway to its
    neighbours, and nodes of equal state share a rectangle.
    """
    states = boundary.states
    for first, end in pairwise([*boundary.starts, len(states)]):
        x = boundary.coordinate[first:end]
        borders = np.concatenate((x[:1], 0.5 * (x[1:] + x[:-1]), x[-1:]))
        start = 0
        for state, run in groupby(states[first:end]):
            stop = start + len(list(run))
            axes.axvspan(borders[start], borders[stop], color=STATES[state][0], linewidth=0)
            start = stop
    axes.set(ylim=(0, 1), xlabel=f"{boundary.label}{bracketed('length')}")
    axes.yaxis.set_visible(False)
    axes.spines[:].set_visible(True)
    axes.spines[:].set_linewidth(0.5)
