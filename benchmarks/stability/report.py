"""The table, the CSV file and the picture."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from benchmarks.stability.case import CONVERGED, GOOD, RED, REPORTED, Row
from benchmarks.stability.groups import GROUPS

_INK, _MUTED, _ALARM = "#1a1a1a", "#6b6b6b", "#d55e00"
_STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 7,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.edgecolor": _MUTED,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.color": _INK,
}
_COLOURS = {GOOD: _INK, REPORTED: "#e69f00", RED: _ALARM}
# Range of errors relative to their limit that is drawn; others are at the edge.
_LEFT, _RIGHT = 1e-10, 1e2
# Cases of the sweep over gamma.
_SWEEP = re.compile(r"\w+, gamma = (\S+) E/L")


def table(rows: Sequence[Row]) -> str:
    """The rows as text, group by group."""
    width = max((len(row.case) for row in rows), default=4)
    outcomes = max((len(row.outcome) for row in rows), default=7)
    lines: list[str] = []
    for group in dict.fromkeys(row.group for row in rows):
        lines += ["", f"{group}: {GROUPS.get(group, '')}"]
        head = f"{'case':{width}} {'outcome':{outcomes}} solves certificate    error  allowed ranks  verdict"
        lines.append(f"  {head}")
        for row in (row for row in rows if row.group == group):
            lines.append(
                f"  {row.case:{width}} {row.outcome:{outcomes}} {row.solves:6d} {_figure(row.certificate):>11}"
                f" {_figure(row.error):>8} {_figure(row.target):>8} {row.ranks:5d}  {row.verdict}"
            )
            if row.note:
                lines.append(f"      {row.note}")
    return "\n".join(lines[1:])


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.1e}"


def tally(rows: Sequence[Row]) -> str:
    """How many rows have which verdict."""
    counts = {verdict: sum(row.verdict == verdict for row in rows) for verdict in (GOOD, REPORTED, RED)}
    return f"{len(rows)} cases: " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items())


def write(folder: Path, rows: Sequence[Row]) -> None:
    """``stability.csv`` and ``stability.txt``."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "stability.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    (folder / "stability.txt").write_text(f"{table(rows)}\n\n{tally(rows)}\n", encoding="utf-8")


def picture(folder: Path, rows: Sequence[Row]) -> Path:
    """``stability.png``: the error of every case relative to its limit, and the accuracy over gamma."""
    groups = [group for group in dict.fromkeys(row.group for row in rows) if group in GROUPS]
    sweep = [row for row in rows if _SWEEP.fullmatch(row.case)]
    heights = [0.8 + 0.42 * len(groups), *([2.4] if sweep else [])]
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(7.2, sum(heights) + 0.3), layout="constrained")
        panels = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
        _distances(panels[0], groups, rows)
        if sweep:
            _accuracy(panels[1], sweep)
        path = folder / "stability.png"
        figure.savefig(path, dpi=160)
    return path


def _distances(axes: Any, groups: Sequence[str], rows: Sequence[Row]) -> None:
    """One line per group, one mark per case: its error over its limit."""
    axes.set_title("Error relative to its limit\n(cross: no solution, and reported as such; bar: certificate only)")
    for place, group in enumerate(groups):
        own = [row for row in rows if row.group == group]
        for k, row in enumerate(own):
            high = place + 0.28 * (2 * ((0.618034 * k) % 1) - 1)  # spread, the same in every run
            colour = _COLOURS[row.verdict]
            if row.outcome != CONVERGED or row.error is None or row.target is None:
                marker = "|" if row.outcome == CONVERGED else "x"
                axes.plot(_LEFT * 2, high, marker, color=colour, markersize=3, markeredgewidth=0.7)
                continue
            share = row.error / row.target if row.target > 0 else (0.0 if row.error == 0 else np.inf)
            face = colour if row.verdict == GOOD else "white"
            x = min(max(share, _LEFT), _RIGHT)
            axes.plot(x, high, "o", color=colour, markerfacecolor=face, markersize=2.6, markeredgewidth=0.7)
        count = [sum(row.verdict == verdict for row in own) for verdict in (GOOD, REPORTED, RED)]
        said = f"{count[0]} of {len(own)}"
        said += f", {count[1]} reported" if count[1] else ""
        said += f", {count[2]} RED" if count[2] else ""
        axes.text(_RIGHT * 1.6, place, said, va="center", fontsize=7, color=_ALARM if count[2] else _INK)
    axes.axvline(1.0, color=_MUTED, linewidth=0.8)
    axes.set_xscale("log")
    axes.set_xlim(_LEFT, _RIGHT)
    axes.set_yticks(range(len(groups)), [GROUPS[group] for group in groups])
    axes.set_ylim(len(groups) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)


def _accuracy(axes: Any, sweep: Sequence[Row]) -> None:
    """Error against gamma for every law of the sweep."""
    axes.set_title("Error against the unregularised limit (hollow: 'residual stagnates')")
    for law, marker in zip(dict.fromkeys(row.case.split(",")[0] for row in sweep), "os^", strict=False):
        found = [(float(_SWEEP.fullmatch(row.case).group(1)), row) for row in sweep if row.case.startswith(law)]
        shown = [(gamma, row) for gamma, row in found if row.error]
        axes.plot([g for g, _ in shown], [row.error for _, row in shown], color=_MUTED, linewidth=0.6)
        for solved in (True, False):
            some = [(g, row.error) for g, row in shown if (row.outcome == CONVERGED) == solved]
            label = law if solved else None
            face = _INK if solved else "white"
            axes.plot(*zip(*some, strict=True), marker, color=_INK, markerfacecolor=face, markersize=3.5, label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(top=1e3)
    axes.set_xlabel("gamma in units of E over the diameter")
    axes.legend(frameon=False, fontsize=7)
