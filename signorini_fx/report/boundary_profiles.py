"""Curves along the contact boundary: pressure, shear with its bounds, displacements, and the state of each node."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch

from signorini_fx.report.reading import Table
from signorini_fx.report.style import (
    BLUE,
    BOTH,
    LIMIT,
    MOTION,
    MULTIPLIER,
    MUTED,
    ORANGE,
    RULE,
    STYLE,
    Floats,
    decimal_power,
    finish,
    largest_of,
    plain,
    times_power,
)

# Lightness decreases from open to stick, so that the order of the states is visible in a gray print.
STATES = {
    "open": ("#f0f0f0", "open"),
    "slip": (ORANGE, "slip"),  # in space, where it has a direction in place of a sign
    "slip+": (ORANGE, r"slip $+$"),
    "slip-": (BLUE, r"slip $-$"),
    "stick": ("#262626", "stick"),
    "contact": ("#8c8c8c", "in contact, no friction"),
}


@dataclass(frozen=True)
class Boundary:
    """One contact boundary: its columns, the coordinate to draw against, and where its connected pieces start."""

    name: str
    columns: Table
    coordinate: Floats
    label: str
    starts: list[int]

    def floats(self, name: str) -> Floats:
        """A numeric column, shape (n,)."""
        return np.asarray(self.columns[name], dtype=np.float64)

    def draw(self, axes: Axes, values: Floats, **style: Any) -> None:
        """A line that is interrupted between the pieces."""
        axes.plot(
            np.insert(self.coordinate, self.starts[1:], np.nan), np.insert(values, self.starts[1:], np.nan), **style
        )

    @property
    def has_friction(self) -> bool:
        """Whether a friction law acts anywhere on it."""
        return bool(np.any(self.columns["friction"] != "none") or np.any(self.floats("bound") != 0))

    def states(self, *, of_friction: bool) -> list[str]:
        """Keys of ``STATES``, n of them: the state in the contact, or that of the friction law wherever it acts."""
        state, friction = self.columns["state"], self.columns["friction"]
        without = np.where(state == "open", "open", "contact")
        acts = friction != "none"
        return [str(key) for key in np.where(acts, friction if of_friction else state, without)]


def boundary_profiles(
    path_stem: str | Path,
    table: Table,
    *,
    title: str = "",
    sides: Sequence[str] = ("friction", "contact"),
    suffixes: Sequence[str] = BOTH,
) -> None:
    """Draw the curves along the contact boundary, as in Figures 3 and 4 of the paper, one row per boundary.

    Left: shear stress mu, its bounds and the tangential displacement.  Right: contact pressure lambda, rigid foundation
    and normal displacement.  Lengths are multiplied by a power of ten that the legend states.  Foundation and bounds
    are cut off where they lie far beyond the other curves.  The colours of the strip below show, on the left, the state
    of the friction law wherever it acts (Tresca friction acts on open nodes too), on the right the state of the
    contact. Without friction there is only the right panel.

    Args:
        path_stem: where to write, without suffix.
        table: columns of ``contact.csv``, each of shape (n,), nodes in order along each boundary: s, x, y, gap, u_n,
            u_t, pressure, shear, bound as floats, state, friction, boundary as strings.
        title: title of the picture.
        sides: which of the two panels to draw.
        suffixes: of the files to write.

    Raises:
        ValueError: the table has no rows.
    """
    boundaries = boundaries_of(table)
    if not boundaries:
        raise ValueError("the contact table has no rows")
    if not any(boundary.has_friction for boundary in boundaries):
        sides = ["contact"]
    with mpl.rc_context(STYLE):
        size = (7.2 if len(sides) == 2 else 4.4, 2.95 * len(boundaries) + 0.4)
        figure = Figure(figsize=size, layout=ConstrainedLayoutEngine(hspace=0.0, h_pad=0.03, wspace=0.05))
        grid = figure.add_gridspec(2 * len(boundaries), len(sides), height_ratios=[1, 0.055] * len(boundaries))
        seen: set[str] = set()
        for i, boundary in enumerate(boundaries):
            for j, side in enumerate(sides):
                name = boundary.name if len(boundaries) > 1 else ""
                panel = figure.add_subplot(grid[2 * i, j])
                if side == "friction" and not boundary.has_friction:
                    panel.set_axis_off()
                    panel.text(0.5, 0.5, f"{name}: no friction", color=MUTED, ha="center", transform=panel.transAxes)
                    continue
                strip = figure.add_subplot(grid[2 * i + 1, j], sharex=panel)
                (_tangential_panel if side == "friction" else _normal_panel)(panel, boundary, name)
                states = boundary.states(of_friction=side == "friction")
                seen.update(states)
                state_strip(strip, boundary, states, side)
        patches = state_patches(seen)
        figure.legend(handles=patches, loc="outside lower center", ncols=len(patches), handlelength=1.6)
        finish(figure, path_stem, title, suffixes)


def state_patches(states: set[str]) -> list[Patch]:
    """Entries of a legend, in a fixed order, for the states that occur."""
    return [
        Patch(facecolor=color, edgecolor=MUTED, linewidth=0.5, label=label)
        for state, (color, label) in STATES.items()
        if state in states
    ]


def boundaries_of(table: Table) -> list[Boundary]:
    """The boundaries in the order in which they appear."""
    names = [str(name) for name in table["boundary"]]
    found = []
    for name in dict.fromkeys(names):
        here = np.array([other == name for other in names])
        columns = {key: np.asarray(column)[here] for key, column in table.items()}
        x, y, s = (np.asarray(columns[key], dtype=np.float64) for key in ("x", "y", "s"))
        # The arc length starts again at 0 with each connected piece.
        starts = [0, *(int(k) + 1 for k in np.flatnonzero(np.diff(s) <= 0))]
        if np.ptp(y) <= 1e-9 * np.ptp(x):
            found.append(Boundary(plain(name), columns, x, "$x_1$", starts))
        else:
            before = np.zeros_like(s)
            for start in starts[1:]:
                before[start:] += s[start - 1]
            found.append(Boundary(plain(name), columns, s + before, "arc length $s$", starts))
    return found


def _tangential_panel(axes: Axes, boundary: Boundary, name: str) -> None:
    stresses, motion = boundary.floats("shear"), boundary.floats("u_t")
    # A bound that is never reached, or that is practically infinite, should not flatten the other curves.
    bound, reach = boundary.floats("bound"), 10 * largest_of(stresses)
    stress = min(largest_of(stresses, bound), reach) if reach > 0 else largest_of(bound)
    up, out = _powers(stress, motion, boundary)
    shear, bound, motion = stresses * 10.0**up, bound * 10.0**up, motion * 10.0**out
    boundary.draw(axes, bound, **LIMIT, label=rf"friction bounds $\pm\,\mathfrak{{F}}\,g${times_power(up)}")
    boundary.draw(axes, -bound, **LIMIT)
    boundary.draw(axes, motion, **MOTION, label=rf"tangential displacement $\tau_T\,\mathbf{{y}}${times_power(out)}")
    boundary.draw(axes, shear, **MULTIPLIER, label=rf"shear stress $\mu${times_power(up)}")
    reach = max(10 * largest_of(shear), 2.5 * largest_of(motion)) or largest_of(bound)
    finish_panel(axes, boundary, name, [shear, motion, bound, -bound], reach)
    axes.set_ylabel(f"stress{times_power(up)},  length{times_power(out)}")


def _normal_panel(axes: Axes, boundary: Boundary, name: str) -> None:
    pressure, gap, motion = boundary.floats("pressure"), boundary.floats("gap"), boundary.floats("u_n")
    up, out = _powers(largest_of(pressure), motion, boundary)
    pressure, gap, motion = pressure * 10.0**up, gap * 10.0**out, motion * 10.0**out
    boundary.draw(axes, gap, **LIMIT, label=f"rigid foundation $d${times_power(out)}")
    boundary.draw(axes, motion, **MOTION, label=rf"normal displacement $\tau_N\,\mathbf{{y}}${times_power(out)}")
    boundary.draw(axes, pressure, **MULTIPLIER, label=rf"contact pressure $\lambda${times_power(up)}")
    # The foundation is drawn where it is near, and its nearest point is always visible.
    reach = max(
        2.5 * largest_of(pressure, motion), 1.2 * float(np.abs(gap).min(initial=np.inf, where=np.isfinite(gap)))
    )
    finish_panel(axes, boundary, name, [pressure, motion, gap], reach)
    axes.set_ylabel(f"stress{times_power(up)},  length{times_power(out)}")


def _powers(stress: float, motion: Floats, boundary: Boundary) -> tuple[int, int]:
    """Powers of ten for stresses and lengths: alike in size within a factor of about 3, and readable.

    A motion that is negligible compared with the whole displacement (stick everywhere) should look like zero.
    """
    up = decimal_power(stress)
    length = max(largest_of(motion), 1e-4 * largest_of(boundary.floats("u_n"), boundary.floats("u_t")))
    if length == 0:
        return up, 0
    return up, round(math.log10(stress / length)) + up if stress > 0 else decimal_power(length)


def finish_panel(axes: Axes, boundary: Boundary, name: str, curves: list[Floats], reach: float) -> None:
    """Axes and legend; what lies further from zero than ``reach`` is cut off."""
    values = np.concatenate(curves)
    values = np.clip(values[np.isfinite(values)], -reach, reach)
    low, high = float(values.min(initial=0.0)), float(values.max(initial=0.0))
    margin = 0.05 * (high - low) or 1.0
    axes.set_ylim(low - margin, high + margin)
    low, high = float(boundary.coordinate.min()), float(boundary.coordinate.max())
    axes.set_xlim(low, high if high > low else low + 1.0)
    axes.axhline(0.0, color=RULE, linewidth=0.6, zorder=0)
    axes.tick_params(axis="x", length=0, labelbottom=False)
    axes.spines["bottom"].set_visible(False)
    axes.locator_params(axis="y", nbins=6)
    handles, labels = axes.get_legend_handles_labels()
    legend = axes.legend(
        handles[::-1], labels[::-1], title=name or None, alignment="left", loc="lower left", bbox_to_anchor=(0.0, 1.01)
    )
    legend.get_title().set_fontweight("bold")


def state_strip(axes: Axes, boundary: Boundary, states: list[str], name: str) -> None:
    """Every node colours the boundary up to halfway to its neighbours; nodes of equal state are one rectangle."""
    for first, end in itertools.pairwise([*boundary.starts, len(states)]):
        x = boundary.coordinate[first:end]
        borders = np.concatenate((x[:1], 0.5 * (x[1:] + x[:-1]), x[-1:]))
        start = 0
        for state, run in itertools.groupby(states[first:end]):
            stop = start + len(list(run))
            axes.axvspan(borders[start], borders[stop], color=STATES[state][0], linewidth=0)
            start = stop
    axes.set(ylim=(0, 1), yticks=[], xlabel=boundary.label)
    axes.spines[:].set_visible(True)
    axes.spines[:].set_linewidth(0.5)
    axes.set_ylabel(name, rotation=0, ha="right", va="center")
