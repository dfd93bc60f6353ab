"""The files of a study: its table, its advice, and one picture for each quantity."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from signorini_fx.addons.pictures.style import INK, PRINT, RULE, SCREEN, STYLE, finish
from signorini_fx.addons.studies.conclusions import (
    advice,
    cheapest_front,
    coarseness,
    lasting_errors,
    quantities_with_errors,
)
from signorini_fx.addons.studies.methods import FAMILIES
from signorini_fx.addons.studies.work_precision import QUANTITIES, Row, Study, run_study
from signorini_fx.machine.csv_text import write_csv

__all__ = ["FILES", "advice", "draw", "run_study", "write_study"]
# Everything that a study may write.
FILES = (
    *("work_precision.csv", "reference.csv", "advice.txt"),
    *(f"work_precision_{quantity}.{kind}" for quantity in QUANTITIES for kind in ("png", "pdf")),
)
_COLOURS = ("#1a1a1a", "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#6b6b6b", "#8c6d1f")
_MARKERS = "os^Dv<>PX"


def write_study(study: Study, folder: Path, *, pdf: bool = False) -> None:
    """Write work_precision.csv, reference.csv, advice.txt and one picture per quantity, also as a PDF if wanted."""
    folder.mkdir(parents=True, exist_ok=True)
    write_csv(folder / "work_precision.csv", study.rows)
    rows = [{"quantity": name, "may_be_wrong_by": error, "is": study.reference} for name, error in study.floor.items()]
    write_csv(folder / "reference.csv", rows)
    (folder / "advice.txt").write_text(advice(study) + "\n", encoding="utf-8")
    for quantity in quantities_with_errors(study):
        draw(folder / f"work_precision_{quantity}", study, quantity, PRINT if pdf else SCREEN)


def draw(stem: Path, study: Study, quantity: str, suffixes: Sequence[str] = SCREEN) -> None:
    """Error against time: the Pareto front of all methods at the top, the families below it."""
    errors = lasting_errors(study.rows, quantity)
    points = [(row, e) for row, e in zip(study.rows, errors, strict=True) if e and row["seconds"]]
    if not points:
        return
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 10.2), layout="constrained")
        grid = figure.add_gridspec(4, 2, height_ratios=(1.35, 1, 1, 1))
        large = figure.add_subplot(grid[0, :])
        small: list[Axes] = []
        for k in range(6):
            shared = small[0] if small else None
            small.append(figure.add_subplot(grid[1 + k // 2, k % 2], sharex=large, sharey=shared))
        times, values = [row["seconds"] for row, _ in points], [error for _, error in points]
        large.set(xscale="log", yscale="log", xlim=(min(times) / 8, 1.6 * max(times)))
        floor = study.floor[quantity]
        low = min(values) / 2
        large.set_ylim(low, 2 * max(values))
        small[0].set(yscale="log", ylim=(low / 3, 2 * max(values)))  # room for the names
        for axes in (large, *small[:5]):
            axes.plot(times, values, "o", color=RULE, markersize=2.5, zorder=1)
            axes.grid(visible=True, which="major", color=RULE, linewidth=0.35, zorder=0)
            if floor and floor > low:
                axes.axhspan(low, floor, facecolor="#f3e9e9", zorder=0)
        _front(large, study, quantity)
        for axes, (family, title) in zip(small, FAMILIES.items(), strict=False):
            _family(axes, points, family)
            axes.set_title(title, loc="left")
        large.set_title("The cheapest method for each accuracy", loc="left", fontweight="bold")
        large.set_ylabel(f"relative error: {QUANTITIES[quantity]}")
        for axes in (large, *small[3:5]):
            axes.set_xlabel("seconds for the whole solve")
        for axes in small[0:5:2]:
            axes.set_ylabel("relative error")
        small[5].set_axis_off()
        small[5].text(0.0, 0.98, _how_to_read(study, floor, low), va="top", fontsize=7, transform=small[5].transAxes)
        finish(figure, stem, f"What accuracy costs: {study.title}", suffixes)


def _front(axes: Axes, study: Study, quantity: str) -> None:
    """The front as a staircase; a name where the method changes, in the empty corner below it and above it in turn."""
    front = cheapest_front(study.rows, quantity, study.floor[quantity])
    seconds, errors = [row["seconds"] for row, _ in front], [error for _, error in front]
    axes.step(seconds, errors, where="post", color=INK, linewidth=1.2, zorder=3)
    axes.plot(seconds, errors, "o", color=INK, markersize=4, zorder=4)
    last = [k for k, (row, _) in enumerate(front) if k + 1 == len(front) or front[k + 1][0]["method"] != row["method"]]
    for number, (row, error) in enumerate(front[k] for k in last):
        placement: dict[str, Any] = {"xytext": (-5, -3), "ha": "right", "va": "top"}
        if number % 2:
            placement = {"xytext": (5, 3), "ha": "left", "va": "bottom"}
        name = f"{row['method']}\n{row['dofs']} unknowns"
        axes.annotate(name, (row["seconds"], error), **placement, textcoords="offset points", fontsize=7, zorder=5)


def _family(axes: Axes, points: Sequence[tuple[Row, float]], family: str) -> None:
    """One line per method of the family."""
    names = dict.fromkeys(row["method"] for row, _ in points if family in row["families"].split("; "))
    for name, colour, marker in zip(names, _COLOURS, _MARKERS, strict=False):
        curve = sorted(((r["seconds"], e, coarseness(r)) for r, e in points if r["method"] == name), key=_coarsest)
        axes.plot(*zip(*((s, e) for s, e, _ in curve), strict=True), f"-{marker}", color=colour, lw=1, ms=3, label=name)
    style = {"facecolor": "white", "framealpha": 0.85, "edgecolor": "none", "frameon": True}
    axes.legend(loc="lower left", fontsize=7, handlelength=1.3, labelspacing=0.2, handletextpad=0.5, **style)


def _coarsest(point: tuple[float, float, float]) -> float:
    return -point[2]


def _how_to_read(study: Study, floor: float | None, low: float) -> str:
    """The text beside the last picture."""
    lines = [
        "How to read this",
        "Each point is one method on one mesh; a line joins",
        "the meshes of a method, coarse to fine. Lower is more",
        "accurate, further left is cheaper. Gray: all methods.",
        "The error shown is the largest on this and finer",
        "meshes: chance on one mesh does not count.",
        "Exact: without regularisation. Unless stated otherwise:",
        "Q1, cold start, the program's own gamma and linear",
        "algebra; Coulomb friction by a fixed point (FP).",
        "Times are medians, machine code of forms excluded.",
    ]
    if floor and floor > low:
        lines += ["Shaded: possible error of the reference itself."]
    failed = [row["method"] for row in study.rows if row["status"] != "converged"]
    counts = [f"{name} ({failed.count(name)})" for name in dict.fromkeys(failed)]
    lines += [f"{len(failed)} of {len(study.rows)} runs failed:" if failed else "No run failed."]
    lines += [f"   {text}" for text in counts[:3]] + (["   and others: see the table"] if len(counts) > 3 else [])
    return "\n".join(lines)
