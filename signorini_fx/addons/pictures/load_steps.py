"""Load steps: the forces from step to step."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
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
    LIMIT,
    MOTION,
    MULTIPLIER,
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
from signorini_fx.tuned import RESULTANT_OF_MESH

Floats = npt.NDArray[np.float64]

_DOTS: dict[str, Any] = {"marker": "o", "markersize": 2.5}
_COLOURS = (INK, BLUE, ORANGE, "#009e73", "#cc79a7", MUTED)  # of boundaries
_THIN, _WIDER = 1.3, 1.2  # points: the last line of several, and by how much each one before is wider


def load_steps(path_stem: str | Path, steps: Table, *, around: bool = False, suffixes: Sequence[str] = SCREEN) -> None:
    """Draw the forces of the foundation on the body step by step, and the friction force against the motion; the
    torque of friction where there is one; between bodies those of each boundary.  On a boundary that closes around a
    body forces balance each other: there the integral of the pressure and the moment of friction.

    Args:
        path_stem: where to write, without suffix.
        steps: columns of ``steps.csv`` of a scene with contact, each of shape (n,).
        around: whether the body is one of revolution: radial components cancel each other, and are no forces.
        suffixes: of the files to write.
    """
    solved = np.asarray(steps["status"]) == Status.CONVERGED.value
    if solved.any():  # the figures of a step without a solution mean nothing
        steps = {name: np.asarray(column)[solved] for name, column in steps.items()}
    with mpl.rc_context(STYLE):
        names = _boundaries(steps)
        figure = Figure(figsize=(4.4, 4.8 + 0.3 * len(names)), layout="constrained")  # with room for the legend
        upper, lower = figure.subplots(2, 1)
        if names:
            _draw_of_each(upper, lower, steps, names, around=around)
        else:
            _draw(upper, lower, steps, around=around)
        upper.set_xlabel("time")
        lower.locator_params(axis="x", nbins=6)
        _mark_names(upper, steps)
        figure.legend(*upper.get_legend_handles_labels(), loc="outside lower center", ncols=2)
        for axes in (upper, lower):
            axes.axhline(0.0, color=RULE, linewidth=0.6, zorder=0)
        finish(figure, path_stem, "", suffixes)


def _draw(upper: Axes, lower: Axes, steps: Table, *, around: bool) -> None:
    """The components of the forces over time, and the largest one of the friction force over the motion."""
    times = np.asarray(steps["time"], dtype=np.float64)
    turns, in_space = "torque" in steps, "contact_force_z" in steps
    shown = "y" if turns or around else "xyz" if in_space else "xy"  # over a revolution the others cancel
    count = len(shown)
    names = [f"{kind}_{axis}" for kind in ("contact_force", "friction_force") for axis in shown]
    forces = {name: np.asarray(steps[name], dtype=np.float64) for name in names}
    closed = _closed(steps, "", forces.values())
    if closed is not None:
        return _draw_closed(upper, lower, steps, [("", *closed)])
    scale = largest_of(*forces.values())
    power = decimal_power(scale)
    pressing = [MULTIPLIER, MULTIPLIER | {"color": MUTED}][:count]
    rubbing = [MOTION, MOTION | {"color": ORANGE}][:count]
    if in_space and not turns:  # most foundations are below, and push upwards
        pressing = [MULTIPLIER | {"linewidth": 0.7}, *pressing[::-1]]
        rubbing = [*rubbing, MOTION | {"linestyle": LIMIT["linestyle"]}]
    friction = max(names[count:], key=lambda name: largest_of(forces[name]))
    motion_name, direction = "mean_tangential_displacement", ""
    if in_space:  # the motion is a vector: its component along the force that is drawn against it
        motion_name = f"{motion_name}{friction[-2:]}"
        direction = f" {friction[-1]}"
    drawn, kind = friction.replace("_", " "), "force"
    resisting = forces[friction]
    if turns:
        drawn, kind, motion_name, direction = "torque", "moment", "mean_tangential_displacement_z", " around the axis"
        resisting = np.asarray(steps["torque"], dtype=np.float64)
    for name, style in zip(names, (*pressing, *rubbing), strict=True):
        if largest_of(forces[name]) > 1e-6 * scale:  # components that are zero up to round-off are not shown
            label = name.replace("_", " ")
            upper.plot(times, forces[name] * 10.0**power, label=label, **_DOTS, **style)
    upper.set_ylabel(_above("force", unit_of(power, "force")))
    if not resisting.any():
        lower.text(0.5, 0.5, "no friction", color=MUTED, ha="center", transform=lower.transAxes)
        lower.set_axis_off()
        lower.set_ylim(1, 2)  # without the line at zero
        return
    motion = np.asarray(steps[motion_name], dtype=np.float64)
    out = decimal_power(largest_of(motion))
    power = decimal_power(largest_of(resisting))
    lower.plot(motion * 10.0**out, resisting * 10.0**power, **_DOTS, **MULTIPLIER)
    lower.set(
        xlabel=f"mean tangential displacement{direction}{unit_of(out, 'length')}",
        ylabel=_above(drawn, unit_of(power, kind)),
    )


def _boundaries(steps: Table) -> list[str]:
    """The contact boundaries that have columns of their own, between bodies."""
    return [name.removeprefix("contact_force_x ") for name in steps if name.startswith("contact_force_x ")]


def _draw_of_each(upper: Axes, lower: Axes, steps: Table, boundaries: Sequence[str], *, around: bool) -> None:
    """The largest component of both forces of each boundary over time, and that of friction over its motion."""
    times = np.asarray(steps["time"], dtype=np.float64)
    axes = [axis for axis in ("y" if around else "xyz") if f"contact_force_{axis} {boundaries[0]}" in steps]

    def largest(kind: str, boundary: str) -> tuple[str, Floats]:
        """The axis, and the component."""
        components = {axis: np.asarray(steps[f"{kind}_{axis} {boundary}"], dtype=np.float64) for axis in axes}
        axis = max(components, key=lambda candidate: largest_of(components[candidate]))
        return axis, components[axis]

    closed = {
        name: turning
        for name in boundaries
        if (
            turning := _closed(
                steps, f" {name}", [largest(kind, name)[1] for kind in ("contact_force", "friction_force")]
            )
        )
    }
    if len(closed) == len(boundaries):
        return _draw_closed(upper, lower, steps, [(name, *closed[name]) for name in boundaries])
    boundaries = [name for name in boundaries if name not in closed]
    pressing, rubbing = ([largest(kind, name) for name in boundaries] for kind in ("contact_force", "friction_force"))
    in_space = len(axes) == 3
    motion = [
        np.asarray(steps[f"mean_tangential_displacement{f'_{axis}' * in_space} {name}"], dtype=np.float64)
        for name, (axis, _) in zip(boundaries, rubbing, strict=True)
    ]
    scale = largest_of(*(force for _, force in (*pressing, *rubbing)))
    power, out = decimal_power(scale), decimal_power(largest_of(*motion))
    resisting = decimal_power(largest_of(*(force for _, force in rubbing)))
    for k, name in enumerate(boundaries):
        colour = {"color": _COLOURS[k % len(_COLOURS)]}
        # Forces in a chain of bodies are alike: what is drawn first is wider, and is seen below the others.
        wide = {"linewidth": _THIN + _WIDER * (len(boundaries) - 1 - k)}
        for kind, curves, style in (("contact", pressing, MULTIPLIER), ("friction", rubbing, MOTION)):
            axis, force = curves[k]
            if largest_of(force) > 1e-6 * scale:
                label = f"{plain(name)}: {kind} force {axis}"
                upper.plot(times, force * 10.0**power, label=label, **(_DOTS | style | colour | wide))
        if largest_of(rubbing[k][1]) > 1e-6 * scale:
            lower.plot(motion[k] * 10.0**out, rubbing[k][1] * 10.0**resisting, **(_DOTS | MULTIPLIER | colour | wide))
    upper.set_ylabel(_above("force", unit_of(power, "force")))
    along = {axis for axis, force in rubbing if largest_of(force) > 1e-6 * scale}
    direction = f" {along.pop()}" if len(along) == 1 else ""
    lower.set(
        xlabel=f"mean tangential displacement{direction * in_space}{unit_of(out, 'length')}",
        ylabel=_above(f"friction force{direction}", unit_of(resisting, "force")),
    )


def _closed(steps: Table, behind: str, forces: Iterable[Floats]) -> tuple[Floats, dict[str, Floats]] | None:
    """Integral of the pressure and moment of friction, by axis, where a boundary closes around a body and the forces
    on it balance each other; None elsewhere.  ``behind``: what the names of its columns end with.
    """
    if f"pressure_integral{behind}" not in steps:
        return None
    pressing = np.asarray(steps[f"pressure_integral{behind}"], dtype=np.float64)
    if largest_of(*forces) > RESULTANT_OF_MESH * largest_of(pressing):
        return None
    names = {axis: f"friction_moment{axis and '_'}{axis}{behind}" for axis in ("", "x", "y", "z")}
    moments = {axis: np.asarray(steps[name], dtype=np.float64) for axis, name in names.items() if name in steps}
    return pressing, moments


def _draw_closed(
    upper: Axes, lower: Axes, steps: Table, closed: Sequence[tuple[str, Floats, dict[str, Floats]]]
) -> None:
    """Boundaries whose resultants are nought: integrals of the pressure, and the largest component of the moments of
    friction, over time.
    """
    times = np.asarray(steps["time"], dtype=np.float64)
    largest = [max(moments.items(), key=lambda entry: largest_of(entry[1])) for _, _, moments in closed]
    power = decimal_power(largest_of(*(pressing for _, pressing, _ in closed)))
    turning = decimal_power(largest_of(*(moment for _, moment in largest)))
    for k, (name, pressing, _) in enumerate(closed):
        colour = {"color": _COLOURS[k % len(_COLOURS)]}
        axis, moment = largest[k]
        of = f"{plain(name)}: " if name else ""
        upper.plot(
            times, pressing * 10.0**power, label=f"{of}integral of the pressure", **(_DOTS | MULTIPLIER | colour)
        )
        label = f"{of}moment of friction {axis}".rstrip()
        lower.plot(times, moment * 10.0**turning, label=label, **(_DOTS | MOTION | (colour if name else {})))
    upper.set_ylabel(_above("force", unit_of(power, "force")))
    lower.set(xlabel="time", ylabel=_above("moment of friction", unit_of(turning, "moment")))
    if len(closed) > 1:
        lower.legend(loc="best")


def _above(name: str, unit: str) -> str:
    """A label of two lines: the labels of both panels would run into each other; ``unit`` may be empty."""
    return f"{name}\n{unit.lstrip()}" if unit else name


def _mark_names(axes: Axes, steps: Table) -> None:
    """A line where a load step with another name begins, and the names above the axes."""
    times, names = np.asarray(steps["time"], dtype=np.float64), np.asarray(steps["name"])
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
