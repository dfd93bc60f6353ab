"""Load steps: the contact boundary as an animation."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from signorini_fx.addons.pictures.boundary_profiles import (
    AROUND,
    PlaneBoundary,
    boundaries_of,
    finish_panel,
    state_patches,
    state_strip,
)
from signorini_fx.addons.pictures.style import LIMIT, MOTION, MULTIPLIER, STYLE, decimal_power, largest_of, unit_of
from signorini_fx.machine.csv_text import Table

_MOST_FRAMES = 120
_GIF_DPI = 110
_FRAMES_A_SECOND = 4


def step_animation(path: str | Path, table: Table) -> None:
    """Write a GIF of pressure, shear and states along the contact boundary, one frame per load step.

    Scales are the same in all frames.  If there are more than 120 steps, every second, third, ... is shown, and the
    last.

    Args:
        path: the file.
        table: columns of ``contact_steps.csv``, each of shape (n,): those of ``contact.csv`` that
            ``boundary_profiles`` needs except for the lengths, and ``step``.

    Raises:
        ValueError: the table has no rows.
    """
    numbers = np.asarray(table["step"], dtype=np.float64)
    steps = np.unique(numbers)
    if not steps.size:
        raise ValueError("the table has no load steps")
    stride = math.ceil(steps.size / _MOST_FRAMES)
    stresses = [np.asarray(table[name], dtype=np.float64) for name in ("pressure", "shear")]
    power = decimal_power(largest_of(*stresses))
    values = np.concatenate([column[np.isfinite(column)] for column in stresses]) * 10.0**power
    low, high = float(values.min(initial=0.0)), float(values.max(initial=0.0))
    margin = 0.06 * (high - low) or 1.0
    with mpl.rc_context(STYLE):
        count = len(dict.fromkeys(table["boundary"]))
        figure = Figure(figsize=(4.4, 2.5 * count + 0.5), layout=ConstrainedLayoutEngine(hspace=0.0, h_pad=0.03))
        grid = figure.add_gridspec(2 * count, 1, height_ratios=[1, 0.07] * count)
        panels = []
        for i in range(count):
            panel = figure.add_subplot(grid[2 * i])
            panels.append((panel, figure.add_subplot(grid[2 * i + 1], sharex=panel)))
        used = {key for boundary in boundaries_of(table) for key in boundary.states}
        patches = state_patches(used)
        figure.legend(handles=patches, loc="outside lower center", ncols=max(1, len(patches)), handlelength=1.6)
        heading = figure.suptitle(" ", fontsize=9)
        writer = PillowWriter(fps=_FRAMES_A_SECOND)
        with writer.saving(figure, str(path), _GIF_DPI):
            for step in (*steps[:-1:stride], steps[-1]):
                step_columns = {name: np.asarray(column)[numbers == step] for name, column in table.items()}
                for (panel, strip), boundary in zip(panels, boundaries_of(step_columns), strict=True):
                    panel.clear()
                    strip.clear()
                    _stress_panel(panel, boundary, power, boundary.name if count > 1 else "")
                    panel.set_ylim(low - margin, high + margin)
                    state_strip(strip, boundary)
                heading.set_text(f"load step {step:.0f} of {steps[-1]:.0f}")
                writer.grab_frame()
                figure.set_layout_engine("none")  # the first frame has placed everything, and it is slow


def _stress_panel(axes: Axes, boundary: PlaneBoundary, power: int, name: str) -> None:
    """Pressure, shear and its bounds, with one scale for all."""
    pressure, shear, bound = (boundary.floats(key) * 10.0**power for key in ("pressure", "shear", "bound"))
    if boundary.has_friction:
        if np.isfinite(bound).any():  # a bond has none
            boundary.draw(axes, bound, **LIMIT, label=r"friction bounds $\pm\,\mathfrak{F}\,g$")
            boundary.draw(axes, -bound, **LIMIT)
        boundary.draw(axes, shear, **MOTION, label=r"shear stress $\mu$")
        if boundary.out_of_section:
            boundary.draw(
                axes, boundary.floats("shear_z") * 10.0**power, **AROUND, label=r"around the axis $\mu_\theta$"
            )
    boundary.draw(axes, pressure, **MULTIPLIER, label=r"contact pressure $\lambda$")
    finish_panel(axes, boundary, name, [pressure, shear], math.inf)
    axes.set_ylabel(f"stress{unit_of(power, 'stress')}")
