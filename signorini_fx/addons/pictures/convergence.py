"""The picture of the convergence: errors over the meshes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from signorini_fx.addons.pictures.style import BLUE, INK, MUTED, ORANGE, RULE, SCREEN, STYLE, finish
from signorini_fx.tuned import ZERO_IN_SOLUTION

# Columns of convergence_table.csv: label, colour, marker, line.
_ERRORS = {
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
