"""Pictures of the convergence: active sets and residual over the linear solves, errors over the meshes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from signorini_fx.addons.pictures.style import BLUE, INK, MUTED, ORANGE, RULE, SCREEN, STYLE, finish
from signorini_fx.machine.csv_text import Table
from signorini_fx.tuned import ZERO_IN_SOLUTION

# Columns of history.csv, by their labels; in 3D slip has no sign, and slip_plus counts all nodes that slip.
_SETS = {
    2: {"active_contact": "contact", "slip_plus": "slip $+$", "slip_minus": "slip $-$"},
    3: {"active_contact": "contact", "slip_plus": "slip"},
}
_SET_STYLES = (
    {"color": INK, "marker": "o", "linewidth": 1.3},
    {"color": ORANGE, "marker": "^", "linewidth": 2.2},
    {"color": BLUE, "marker": "v", "linewidth": 1.1, "linestyle": (0, (3, 1.5)), "markerfacecolor": "white"},
)
# Columns of convergence_table.csv: label, colour, marker, line.
_ERRORS = {
    "energy": ("displacement (energy)", INK, "o", "-"),
    "pressure": ("contact pressure", BLUE, "s", "--"),
    "peak": ("largest pressure", ORANGE, "^", "-."),
    "zone": ("contact zone", MUTED, "D", ":"),
}


def iteration_history(
    path_stem: str | Path, columns: Table, *, suffixes: Sequence[str] = SCREEN, dimension: int = 2
) -> None:
    """Draw the curves over the linear solves: sizes of the active sets, changed nodes, residual.

    Args:
        path_stem: where to write, without suffix.
        columns: those of ``history.csv``, each of shape (n,).
        suffixes: of the files to write.
        dimension: of the body.

    Raises:
        ValueError: there are no rows.
    """
    solve = np.asarray(columns["solve"], dtype=np.float64)
    if not solve.size:
        raise ValueError("the history has no linear solves")
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(min(6.4, max(4.4, 2.5 + 0.12 * solve.size)), 4.4), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.25, 1))
        upper.bar(solve, columns["changed"], width=0.8, color=RULE, label="nodes that change state")
        for (name, label), style in zip(_SETS[dimension].items(), _SET_STYLES, strict=False):
            if name == "active_contact" or np.any(columns[name]):
                upper.plot(solve, columns[name], label=label, markersize=3, **style)
        upper.set(ylabel="number of nodes", ylim=(0, None))
        residual = np.asarray(columns["residual"], dtype=np.float64)
        # A new outer iteration is a new problem: its residuals are a separate line.
        firsts = np.flatnonzero(np.diff(np.asarray(columns["outer"], dtype=np.float64))) + 1
        broken = [np.insert(values, firsts, np.nan) for values in (solve, np.where(residual > 0, residual, np.nan))]
        lower.semilogy(*broken, color=INK, marker="o", markersize=3, linewidth=1.3)
        for first in firsts:
            lower.axvline(solve[first] - 0.5, color=MUTED, linewidth=0.5, zorder=0)
        lower.set(ylabel="relative residual", xlabel="linear solve", xlim=(solve[0] - 0.6, solve[-1] + 0.6))
        lower.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        figure.legend(*upper.get_legend_handles_labels(), loc="outside lower center", ncols=2)
        finish(figure, path_stem, "", suffixes)


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
    seconds = list(itertools.accumulate(row["seconds"] for row in rows))
    costs = {"unknowns": [row["dofs"] for row in rows], "seconds, all meshes so far": seconds}
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.4, 3.2), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (name, cost) in zip(panels, costs.items(), strict=True):
            for quantity, (label, colour, marker, line) in _ERRORS.items():
                known = [k for k, row in enumerate(rows) if row[quantity] and row[quantity] > ZERO_IN_SOLUTION]
                solved = [k for k in known if not rows[k]["predicted"]]
                if not solved:
                    continue
                style = {"color": colour, "linestyle": line, "marker": marker, "markersize": 4.5}
                axes.plot([cost[k] for k in solved], [rows[k][quantity] for k in solved], label=label, **style)
                ahead = [solved[-1], *(k for k in known if rows[k]["predicted"])]
                style |= {"markerfacecolor": "white", "markevery": slice(1, None), "linewidth": 0.6}
                axes.plot([cost[k] for k in ahead], [rows[k][quantity] for k in ahead], **style)
            axes.set(xscale="log", yscale="log", xlabel=name)
            decade = max(cost) < 20 * min(cost)  # or a little more: 2 and 5 have numbers too
            axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if decade else (1,), numticks=8))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.grid(visible=True, which="major", color=RULE, linewidth=0.4)
        panels[0].set_ylabel("estimated relative error")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        finish(figure, path_stem, title, suffixes)
