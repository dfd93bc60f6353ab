"""Load steps: the forces from step to step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from signorini_fx.addons.pictures.style import (
    BLUE,
    INK,
    MUTED,
    ORANGE,
    RULE,
    SCREEN,
    STYLE,
    decimal_power,
    finish,
    largest_of,
    plain,
    unit_of,
)
from signorini_fx.machine.csv_text import Table
from signorini_fx.records import Status
from signorini_fx.tuned import NEGLIGIBLE

Floats = npt.NDArray[np.float64]

_COLOURS = (INK, BLUE, ORANGE, "#009e73", "#cc79a7", MUTED)  # of boundaries, or of axes where there is one
_DASHED = (0, (4.5, 1.8))  # of friction
_THIN, _WIDER = 1.3, 1.2  # points: the last line of several, and by how much each one before is wider
_NOUGHT = 1e-6  # of the largest force: components below are zero up to round-off, and are not shown


@dataclass(frozen=True)
class _Curve:
    """A quantity over the load steps, drawn over another one; ``axis``: of a component, "": it is none."""

    over: Floats
    values: Floats
    label: str = ""
    axis: str = ""
    rubs: bool = False


def load_steps(path_stem: str | Path, steps: Table, *, around: bool = False, suffixes: Sequence[str] = SCREEN) -> None:
    """Draw the forces of the foundation on the body step by step, and below the largest component of the friction force
    against the motion, or the torque of friction; between bodies the largest components of each boundary.  On a
    boundary that closes around a body forces balance each other: there the integral of the pressure and the moment of
    friction.

    Args:
        path_stem: where to write, without suffix.
        steps: columns of ``steps.csv`` of a scene with contact, each of shape (n,).
        around: whether the body is one of revolution: radial components cancel each other, and are no forces.
        suffixes: of the files to write.
    """
    solved = np.asarray(steps["status"]) == Status.CONVERGED.value
    if solved.any():  # the figures of a step without a solution mean nothing
        steps = {name: np.asarray(column)[solved] for name, column in steps.items()}
    # What the names of the columns of each boundary end with.
    ends = [name.removeprefix("contact_force_x") for name in steps if name.startswith("contact_force_x")]
    axes = "y" if around or "torque" in steps else "xyz"  # over a revolution the others cancel
    closed = [end for end in ends if _closes(steps, end, axes)]
    shown = closed if len(closed) == len(ends) else [end for end in ends if end not in closed]
    upper, lower = list[list[_Curve]](), list[list[_Curve]]()
    for end in shown:
        above, below = _moments(steps, end) if end in closed else _forces(steps, end, axes)
        upper.append(above)
        lower.append(below)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.4, 4.8 + 0.3 * len(shown)), layout="constrained")  # with room for the legend
        first, second = figure.subplots(2, 1)
        power = _draw(first, upper)
        first.set(xlabel="time", ylabel=_above("force", unit_of(power, "force")))
        first.axhline(0.0, color=RULE, linewidth=0.6, zorder=0)
        if any(curve.values.any() for curves in lower for curve in curves):
            _draw_resistance(second, lower, steps, closed=shown == closed)
        else:
            second.text(0.5, 0.5, "no friction", color=MUTED, ha="center", transform=second.transAxes)
            second.set_axis_off()
        _mark_names(first, steps)
        figure.legend(*first.get_legend_handles_labels(), loc="outside lower center", ncols=2)
        finish(figure, path_stem, "", suffixes)


def _column(steps: Table, name: str) -> Floats:
    return np.asarray(steps[name], dtype=np.float64)


def _curves(steps: Table, kind: str, end: str, axes: Sequence[str]) -> list[_Curve]:
    """The components of a quantity of a boundary over time; ``end``: what the names of its columns end with."""
    times, of = _column(steps, "time"), f"{plain(end.strip())}: " if end else ""
    columns = {axis: f"{kind}{axis and '_'}{axis}{end}" for axis in axes}
    words = {"friction_moment": "moment of friction", "pressure_integral": "integral of the pressure"}
    return [
        _Curve(
            times,
            _column(steps, name),
            f"{of}{words.get(kind, kind.replace('_', ' '))} {axis}".rstrip(),
            axis,
            kind.startswith("friction"),
        )
        for axis, name in columns.items()
        if name in steps
    ]


def _largest(curves: Sequence[_Curve]) -> _Curve:
    return max(curves, key=lambda curve: largest_of(curve.values))


def _closes(steps: Table, end: str, axes: str) -> bool:
    """Whether a boundary closes around a body, so that the forces on it balance each other."""
    if f"pressure_integral{end}" not in steps:
        return False
    forces = [curve for kind in ("contact_force", "friction_force") for curve in _curves(steps, kind, end, axes)]
    pressing = _column(steps, f"pressure_integral{end}")
    return largest_of(*(curve.values for curve in forces)) <= NEGLIGIBLE * largest_of(pressing)


def _moments(steps: Table, end: str) -> tuple[list[_Curve], list[_Curve]]:
    """Of a boundary that closes around a body, over time."""
    moments = _curves(steps, "friction_moment", end, ["", *"xyz"])
    return _curves(steps, "pressure_integral", end, [""]), [_largest(moments)]


def _forces(steps: Table, end: str, axes: str) -> tuple[list[_Curve], list[_Curve]]:
    """Of a boundary, or of all together: forces over time, and the largest one of friction over the motion along it."""
    pressing, rubbing = (_curves(steps, kind, end, axes) for kind in ("contact_force", "friction_force"))
    upper = [_largest(pressing), _largest(rubbing)] if end else [*pressing, *rubbing]
    if "torque" in steps:
        return upper, [_Curve(_column(steps, "mean_tangential_displacement_z"), _column(steps, "torque"))]
    resisting, name = _largest(rubbing), "mean_tangential_displacement"
    in_space = f"{name}_{resisting.axis}{end}"  # there the motion is a vector
    motion = _column(steps, in_space if in_space in steps else f"{name}{end}")
    return upper, [replace(resisting, over=motion, rubs=False)]


def _draw(axes: Axes, of_boundaries: Sequence[Sequence[_Curve]], out: int = 0) -> int:
    """Draw the curves of each boundary; returns the power of ten that their values are multiplied by."""
    scale = largest_of(*(curve.values for curves in of_boundaries for curve in curves))
    power, alone = decimal_power(scale), len(of_boundaries) == 1
    for number, curves in enumerate(of_boundaries):
        for curve in curves:
            if largest_of(curve.values) > _NOUGHT * scale:
                colour = "xyz".find(curve.axis) if alone and curve.axis else number
                style: dict[str, Any] = {"color": _COLOURS[colour % len(_COLOURS)], "marker": "o", "markersize": 2.5}
                # Forces in a chain of bodies are alike: what is drawn first is wider, and is seen below the others.
                style |= {"linewidth": _THIN + _WIDER * (len(of_boundaries) - 1 - number)}
                style |= {"linestyle": _DASHED} if curve.rubs else {}
                axes.plot(curve.over * 10.0**out, curve.values * 10.0**power, label=curve.label, **style)
    return power


def _draw_resistance(axes: Axes, lower: Sequence[Sequence[_Curve]], steps: Table, *, closed: bool) -> None:
    """Moments of friction over time, or what resists the motion over it."""
    axes.locator_params(axis="x", nbins=6)
    out = 0 if closed else decimal_power(largest_of(*(curve.over for curves in lower for curve in curves)))
    power = _draw(axes, lower, out)
    axes.axhline(0.0, color=RULE, linewidth=0.6, zorder=0)
    if closed:
        axes.set(xlabel="time", ylabel=_above("moment of friction", unit_of(power, "moment")))
        if len(lower) > 1:
            axes.legend(loc="best")
        return
    along = {curve.axis for curves in lower for curve in curves if curve.values.any()}
    direction = f" {along.pop()}" if len(along) == 1 and along != {""} else ""
    name, kind = f"friction force{direction}", "force"
    if "torque" in steps:
        direction, name, kind = " around the axis", "torque", "moment"
    elif not any(column.startswith("contact_force_z") for column in steps):
        direction = ""  # in 2D it is along the boundary
    axes.set(
        xlabel=f"mean tangential displacement{direction}{unit_of(out, 'length')}",
        ylabel=_above(name, unit_of(power, kind)),
    )


def _above(name: str, unit: str) -> str:
    """A label of two lines: the labels of both panels would run into each other; ``unit`` may be empty."""
    return f"{name}\n{unit.lstrip()}" if unit else name


def _mark_names(axes: Axes, steps: Table) -> None:
    """A line where a load step with another name begins, and the names above the axes."""
    times, names = _column(steps, "time"), np.asarray(steps["name"])
    if not any(names):
        return
    firsts = np.array([0, *(np.flatnonzero(names[1:] != names[:-1]) + 1)])
    begins, ends = times[np.maximum(firsts - 1, 0)], times[[*(firsts[1:] - 1), len(times) - 1]]
    for begin in begins[1:]:
        axes.axvline(begin, color=RULE, linewidth=0.6, zorder=0)
    top = axes.secondary_xaxis("top")
    middles = 0.5 * (begins + ends)
    top.set_ticks(middles, [plain(str(names[first])) for first in firsts], rotation=30, ha="left")
    top.tick_params(length=0, pad=1)
    top.spines["top"].set_visible(False)
