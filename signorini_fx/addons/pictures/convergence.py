"""Pictures of the convergence: active sets and residual over the linear solves, errors over the meshes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from signorini_fx.addons.pictures.style import BLUE, INK, MUTED, ORANGE, RULE, SCREEN, STYLE, Floats, finish
from signorini_fx.machine.csv_text import Table
from signorini_fx.tuned import ZERO_IN_SOLUTION


def iteration_history(
    path_stem: str | Path,
    rows: Sequence[Mapping[str, Any]] | Table,
    *,
    suffixes: Sequence[str] = SCREEN,
    dimension: int = 2,
) -> None:
    """Draw the convergence history over the linear solves: sizes of the active sets, changed nodes, residual.

    Args:
        path_stem: where to write, without suffix.
        rows: one mapping per linear solve with the columns of ``history.csv`` (solve, outer, active_contact, slip_plus,
            slip_minus, changed, residual), or these columns as arrays of shape (n,), as ``read_csv`` gives them.
        suffixes: of the files to write.
        dimension: of the body; in 3D slip has no sign, and slip_plus counts all nodes that slip.

    Raises:
        ValueError: there are no rows.
    """
    names = ("solve", "outer", "active_contact", "slip_plus", "slip_minus", "changed", "residual")
    data: dict[str, Floats] = {
        name: np.asarray(rows[name] if isinstance(rows, Mapping) else [row[name] for row in rows], dtype=np.float64)
        for name in names
    }
    solve = data["solve"]
    if not solve.size:
        raise ValueError("the history has no linear solves")
    size = min(3.5, max(1.2, 240 / solve.size))
    firsts = np.flatnonzero(np.diff(data["outer"])) + 1
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(min(6.4, max(4.4, 2.5 + 0.12 * solve.size)), 4.4), layout="constrained")
        grid = figure.add_gridspec(2, 1, height_ratios=(1.25, 1))
        upper = figure.add_subplot(grid[0])
        lower = figure.add_subplot(grid[1], sharex=upper)
        upper.bar(solve, data["changed"], width=0.8, color=RULE, linewidth=0, label="nodes that change state")
        curves: list[tuple[str, str, dict[str, Any]]] = [
            ("active_contact", r"contact $|\mathcal{A}_c|$", {"color": INK, "marker": "o", "lw": 1.3})
        ]
        if dimension == 3 and np.any(data["slip_plus"]):
            slip: dict[str, Any] = {"color": ORANGE, "marker": "^", "lw": 1.3, "ls": (0, (4.5, 1.8))}
            curves.append(("slip_plus", r"slip  $|\mathcal{A}_f|$", slip))
        elif np.any(data["slip_plus"]) or np.any(data["slip_minus"]):
            plus: dict[str, Any] = {"color": ORANGE, "marker": "^", "lw": 2.2}
            minus: dict[str, Any] = {"color": BLUE, "marker": "v", "lw": 1.1, "ls": (0, (3, 1.5)), "mfc": "white"}
            curves.append(("slip_plus", r"slip $+$  $|\mathcal{A}_{f,+}|$", plus))
            curves.append(("slip_minus", r"slip $-$  $|\mathcal{A}_{f,-}|$", minus))
        for name, label, style in curves:
            upper.plot(solve, data[name], label=label, markersize=size, **style)
        upper.set(ylabel="number of nodes", ylim=(0, None))
        upper.tick_params(axis="x", length=0, labelbottom=False)
        residual = np.where(data["residual"] > 0, data["residual"], np.nan)
        # A new outer iteration is a new problem: its residuals are a separate line.
        broken = [np.insert(values, firsts, np.nan) for values in (solve, residual)]
        lower.semilogy(*broken, color=INK, marker="o", markersize=size, lw=1.3)
        lower.set(ylabel="relative residual", xlabel="linear solve", xlim=(solve[0] - 0.6, solve[-1] + 0.6))
        lower.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        _mark_outer(upper, lower, solve, data["outer"], firsts)
        figure.legend(*upper.get_legend_handles_labels(), loc="outside lower center", ncols=2, columnspacing=3)
        finish(figure, path_stem, "", suffixes)


def _mark_outer(upper: Axes, lower: Axes, solve: Floats, outer: Floats, firsts: npt.NDArray[np.intp]) -> None:
    """Lines between outer iterations, with their numbers on top if there is room."""
    if not firsts.size:
        return
    borders = [solve[0] - 0.6, *(0.5 * (solve[firsts - 1] + solve[firsts])), solve[-1] + 0.6]
    for axes in (upper, lower):
        for border in borders[1:-1]:
            axes.axvline(border, color=MUTED, linewidth=0.5 if firsts.size < 30 else 0.25, zorder=0)
    room = 0.03 * (borders[-1] - borders[0])
    ticks, labels, free_from = [], [], -math.inf
    for (left_border, right_border), number in zip(itertools.pairwise(borders), outer[[0, *firsts]], strict=True):
        middle = 0.5 * (left_border + right_border)
        if middle >= free_from:
            ticks.append(middle)
            labels.append(f"{number:.0f}")
            free_from = middle + room
    top = upper.secondary_xaxis("top")
    top.set_ticks(ticks, labels)
    top.tick_params(length=0, pad=1)
    top.spines["top"].set_visible(False)
    top.set_xlabel("outer iteration")


_QUANTITIES = {
    "energy": ("displacement (energy)", INK, "o", "-"),
    "pressure": ("contact pressure", BLUE, "s", "--"),
    "peak": ("largest pressure", ORANGE, "^", "-."),
    "zone": ("contact zone", MUTED, "D", ":"),
}


def errors_and_costs(
    path_stem: str | Path, rows: Sequence[Mapping[str, Any]], *, title: str = "", suffixes: Sequence[str] = SCREEN
) -> None:
    """Estimated errors against the unknowns, and against the time: one point per mesh, open the next one, predicted.

    The time is that of all meshes up to this one, as a nested iteration needs them all.

    Args:
        path_stem: the files without their ending.
        rows: the rows of convergence_table.csv, coarsest mesh first, the predicted one last.
        title: title of the scene.
        suffixes: of the files to write.
    """
    costs = {"unknowns": [row["dofs"] for row in rows], "seconds, all meshes so far": _total_seconds(rows)}
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.4, 3.2), layout=ConstrainedLayoutEngine(wspace=0.06))
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (name, cost) in zip(panels, costs.items(), strict=True):
            for quantity, (label, colour, marker, style) in _QUANTITIES.items():
                _draw_errors(axes, cost, rows, quantity, color=colour, marker=marker, linestyle=style, label=label)
            axes.set(xscale="log", yscale="log", xlabel=name)
            axes.set_xlim(min(cost) / 1.5, max(cost) * 1.5)
            decades = math.log10(max(cost) / min(cost))
            axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if decades < 1.3 else (1,), numticks=8))
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.10g}".replace(",", "\N{THIN SPACE}"))
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.grid(visible=True, which="major", color=RULE, linewidth=0.4)
        panels[0].set_ylabel("estimated relative error")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2, columnspacing=2)
        finish(figure, path_stem, title, suffixes)


def _total_seconds(rows: Sequence[Mapping[str, Any]]) -> list[float]:
    return list(itertools.accumulate(row["seconds"] for row in rows))


def _draw_errors(axes: Axes, cost: Sequence[float], rows: Sequence[Mapping[str, Any]], name: str, **style: Any) -> None:
    """One quantity: filled where it was solved, open and thin where it is predicted."""
    present = [k for k, row in enumerate(rows) if row[name] and row[name] > ZERO_IN_SOLUTION]
    solved = [k for k in present if not rows[k]["predicted"]]
    if not solved:
        return
    axes.plot([cost[k] for k in solved], [rows[k][name] for k in solved], linewidth=1.3, markersize=4.5, **style)
    ahead = [k for k in present if rows[k]["predicted"]]
    if ahead:
        way = [solved[-1], *ahead]
        style = style | {"label": "_", "markerfacecolor": "white", "markevery": slice(1, None)}
        axes.plot([cost[k] for k in way], [rows[k][name] for k in way], linewidth=0.6, markersize=4.5, **style)
