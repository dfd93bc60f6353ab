"""The table, the CSV file and the picture."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from stability.case import GOOD, NAMED, RED, Row
from stability.groups import GROUPS

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
# Errors below this are drawn at the edge.
_SMALLEST = 1e-17


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
    counts = {verdict: sum(row.verdict == verdict for row in rows) for verdict in (GOOD, NAMED, RED)}
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
    """``stability.png``: the error of every case beside what is allowed, one panel a group."""
    groups = [group for group in GROUPS if any(row.group == group for row in rows)]
    sizes = [sum(row.group == group for row in rows) for group in groups]
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(7.2, 0.8 + sum(0.55 + 0.135 * size for size in sizes)), layout="constrained")
        panels = figure.subplots(len(groups), 1, sharex=True, squeeze=False, height_ratios=[s + 1 for s in sizes])
        for axes, group in zip(panels[:, 0], groups, strict=True):
            own = [row for row in rows if row.group == group]
            axes.set_title(f"{GROUPS[group]}: {sum(row.verdict == GOOD for row in own)} of {len(own)}")
            for place, row in enumerate(own):
                _draw(axes, place, row)
            axes.set_xscale("log")
            axes.set_xlim(_SMALLEST / 3, 3.0)
            axes.set_yticks(range(len(own)), [row.case for row in own], fontsize=5.5)
            axes.set_ylim(len(own) - 0.4, -0.6)
            axes.grid(axis="y", color="#e9e9e9", linewidth=0.4)
            axes.tick_params(length=2)
        panels[-1, 0].set_xlabel(
            "relative error against the reference (dot), what is allowed (bar); a word: the outcome"
        )
        path = folder / "stability.png"
        figure.savefig(path, dpi=150)
    return path


def _draw(axes: Any, place: int, row: Row) -> None:
    colour = {GOOD: _INK, NAMED: "#e69f00", RED: _ALARM}[row.verdict]
    if row.target is not None:
        axes.plot(max(row.target, _SMALLEST), place, "|", color=_MUTED, markersize=6)
    if row.error is not None:
        face = colour if row.verdict == GOOD else "white"
        axes.plot(min(max(row.error, _SMALLEST), 2.0), place, "o", color=colour, markerfacecolor=face, markersize=3.5)
    if row.error is None or row.verdict != GOOD:
        axes.text(2e-17, place, row.outcome, va="center", fontsize=5.5, color=colour)
