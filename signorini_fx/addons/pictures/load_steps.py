"""Curves over the load steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from signorini_fx.addons.pictures.style import (
    BLUE,
    INK,
    MUTED,
    ORANGE,
    RULE,
    STYLE,
    decimal_power,
    largest_of,
    plain,
    unit_of,
)
from signorini_fx.arrays import Array, Columns
from signorini_fx.records import Status
from signorini_fx.tuned import NEGLIGIBLE

_COLOURS = (INK, BLUE, ORANGE, "#009e73", "#cc79a7", MUTED)
_MOST_PROFILES = 5
_NOUGHT = 1e-6  # of the largest force: components below are zero up to round-off, and are not shown


@dataclass(frozen=True)
class _Curve:
    """A column of a table, drawn over another one."""

    label: str
    over: Array
    values: Array
    dashed: bool = False


@mpl.rc_context(STYLE)
def load_steps(
    steps: Columns,
    *,
    around: bool = False,
    between: Sequence[tuple[float, Mapping[str, float]]] = (),
) -> Figure:
    """Draw the forces of the foundation on the body over the load steps.

    Below is the largest component of the friction force over the motion, or the torque of friction;
    with several boundaries the largest components of each.  On a boundary that closes around a body
    forces balance each other: there the integral of the pressure and the moment of friction are
    drawn.

    Args:
        steps: columns of ``steps.csv``.
        around: whether the body is axisymmetric, so that radial forces cancel.
        between: times and figures of all time steps; their energies are drawn for dynamic problems.
    """
    solved = steps["status"] == Status.CONVERGED.value
    if solved.any():  # the figures of a step without a solution mean nothing
        steps = {name: column[solved] for name, column in steps.items()}
    # What the names of the columns of each boundary end with.
    ends = [
        name.removeprefix("contact_force_x") for name in steps if name.startswith("contact_force_x")
    ]
    axes = "y" if around or "torque" in steps else "xyz"  # over a revolution the others cancel
    forces = list[_Curve]()
    motions = list[_Curve]()
    moments = list[_Curve]()
    for end in ends:
        contact, friction = (
            _columns(steps, f"{kind}_force", axes, end) for kind in ("contact", "friction")
        )
        pressing = _columns(steps, "pressure_integral", [""], end)
        if pressing and _largest([*contact, *friction]) <= NEGLIGIBLE * _largest(pressing):
            forces += pressing
            moments.append(max(_columns(steps, "friction_moment", ["", *"xyz"], end), key=_size))
            continue
        forces += (
            [*contact, *friction]
            if len(ends) == 1
            else [max(contact, key=_size), max(friction, key=_size)]
        )
        motions.append(_over_motion(steps, end, friction))
    panels = [
        ("time", "force", forces),
        ("mean tangential displacement", "force", motions),
        ("time", "moment", moments),
        ("time", "energy", _energies(between)),
    ]
    panels = [(over, kind, curves) for over, kind, curves in panels if _largest(curves) > 0]
    figure = Figure(figsize=(4.4, 0.6 + 2.4 * max(len(panels), 1)), layout="constrained")
    for part, (over, kind, curves) in zip(
        figure.subplots(max(len(panels), 1), squeeze=False)[:, 0], panels, strict=False
    ):
        _draw(part, over, "moment" if curves is motions and "torque" in steps else kind, curves)
    return figure


def _energies(between: Sequence[tuple[float, Mapping[str, float]]]) -> list[_Curve]:
    """Return the curves of kinetic energy, strain energy, and their sum."""
    rows = [(time, told) for time, told in between if "kinetic_energy" in told]
    times = np.array([time for time, _ in rows])
    kinetic, strain = (
        np.array([told[f"{name}_energy"] for _, told in rows]) for name in ("kinetic", "strain")
    )
    curves = {"both": kinetic + strain, "kinetic energy": kinetic, "strain energy": strain}
    return [_Curve(label, times, values) for label, values in curves.items()]


def _columns(steps: Columns, kind: str, axes: Sequence[str], end: str) -> list[_Curve]:
    """Return the components of a quantity of a boundary over time, as curves."""
    words = {
        "friction_moment": "moment of friction",
        "pressure_integral": "integral of the pressure",
    }
    where = f" on {plain(end.strip())}" if end else ""
    name = words.get(kind, kind.replace("_", " "))
    found = {axis: f"{kind}{axis and '_'}{axis}{end}" for axis in axes}
    return [
        _Curve(
            f"{name} {axis}".rstrip() + where,
            steps["time"],
            steps[column],
            kind.startswith("friction"),
        )
        for axis, column in found.items()
        if column in steps
    ]


def _over_motion(steps: Columns, end: str, friction: Sequence[_Curve]) -> _Curve:
    """Return the largest component of friction over the motion in its direction, in 2D along the
    boundary; or the torque over the motion around the axis.
    """
    name = "mean_tangential_displacement"
    if "torque" in steps:
        return _Curve("torque", steps[f"{name}_z"], steps["torque"])
    largest = max(friction, key=_size)
    axis = largest.label.removeprefix("friction force ")[0]
    in_space = f"{name}_{axis}{end}"  # there the motion is a vector
    return _Curve(
        largest.label, steps[in_space if in_space in steps else f"{name}{end}"], largest.values
    )


def _size(curve: _Curve) -> float:
    return largest_of(curve.values)


def _largest(curves: Sequence[_Curve]) -> float:
    return max(map(_size, curves), default=0.0)


def _draw(axes: Axes, over: str, kind: str, curves: Sequence[_Curve]) -> None:
    """Draw the curves of one panel, with a legend."""
    shown = [curve for curve in curves if _size(curve) > _NOUGHT * _largest(curves)]
    power = decimal_power(_largest(shown))
    along = 0 if over == "time" else decimal_power(largest_of(*(curve.over for curve in shown)))
    for number, curve in enumerate(shown):
        axes.plot(
            curve.over * 10.0**along,
            curve.values * 10.0**power,
            label=curve.label,
            color=_COLOURS[number % len(_COLOURS)],
            marker="o",
            markersize=2.5,
            linewidth=1.3,
            linestyle=(0, (4.5, 1.8)) if curve.dashed else "-",
        )
    axes.axhline(0.0, color=RULE, linewidth=0.6, zorder=0)
    length = "" if over == "time" else unit_of(along, "length")
    axes.set(xlabel=f"{over}{length}", ylabel=f"{kind}{unit_of(power, kind)}")
    axes.locator_params(axis="x", nbins=6)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0))


@mpl.rc_context(STYLE)
def profiles_by_step(table: Columns, names: Sequence[str]) -> Figure:
    """Draw what effects in time add to contact, such as wear, along the boundary with the largest
    value, after some of the load steps; later ones are darker.

    Args:
        table: columns of ``contact_steps.csv``.
        names: the columns to draw.
    """
    steps = np.unique(table["step"])
    several = min(len(steps), _MOST_PROFILES)
    chosen = steps[np.linspace(0, len(steps) - 1, several).round().astype(int)]
    figure = Figure(figsize=(4.4, 0.6 + 2.0 * len(names)), layout="constrained")
    for axes, name in zip(figure.subplots(len(names), squeeze=False)[:, 0], names, strict=True):
        most = np.argmax(np.abs(table[name]))
        on = table["boundary"] == table["boundary"][most]
        shown = on & (np.abs(table[name]) > NEGLIGIBLE * np.abs(table[name][most]))
        power = decimal_power(largest_of(table[name][on]))
        for number, step in enumerate(chosen):
            rows = np.flatnonzero(on & (table["step"] == step))
            rows = rows[np.argsort(table["s"][rows])]
            light = 0.8 * (1 - (number + 1) / several)
            axes.plot(
                table["s"][rows],
                table[name][rows] * 10.0**power,
                label=f"load step {step:g}",
                color=str(light),
                linewidth=1.3,
            )
        if shown.any():
            places = table["s"][shown]
            beside = 0.1 * np.ptp(places)
            axes.set_xlim(
                max(places.min() - beside, table["s"][on].min()),
                min(places.max() + beside, table["s"][on].max()) or None,
            )
        axes.axhline(0.0, color=RULE, linewidth=0.6, zorder=0)
        unit = f"10^{-power}" if power else ""
        axes.set(xlabel="arc length s", ylabel=" ".join((name, unit)).rstrip())
        axes.legend(loc="best")
    return figure
