"""The table, the CSV files and the picture."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import clock
import matplotlib as mpl
import numpy as np
from clock import Sample
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from row import Row, Sizes

# From light to dark in the order of the phases, so that they can be distinguished in gray print too.
_PHASES = {
    "compile": "#ffffff",
    "assemble": "#d9e6f2",
    "condense": "#8fb8de",
    "factorise": "#8fb8de",
    "iterate": "#e69f00",
    "solve": "#e69f00",
    "certify": "#7a7a7a",
    "rest": "#262626",
}
_LABELS = {
    "tresca": "Tresca",
    "newton": "Coulomb, newton",
    "fp": "Coulomb, fixed point",
    "mumps": "linear solve, MUMPS",
    "cholmod": "linear solve, CHOLMOD",
}
_COLUMNS = ("group", "what", "mesh", "value", "low", "high", "repeats", "unit", "target", "at_least", "verdict", "note")
_INK, _MUTED = "#1a1a1a", "#6b6b6b"
_FARTHEST = 3.0  # of the targets' axis
_STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8,
    "axes.titlesize": 9,
    "axes.titlelocation": "right",
    "axes.edgecolor": _MUTED,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "hatch.linewidth": 0.4,
    "text.color": _INK,
}


def table(rows: Sequence[Row]) -> str:
    """The rows as text; ratios, except for the rows that have a unit."""
    width = max(len(row.what) for row in rows)
    lines = [f"{'what':{width}} {'mesh':>16} {'value':>9} {'range':>13}  must be  verdict"]
    for row in rows:
        value = f"{row.value:.2f}{' ' + row.unit if row.unit else ''}"
        spread = f"{min(row.measured):.2f}-{max(row.measured):.2f}" if len(row.measured) > 1 else ""
        target = "" if row.target is None else f"{'>=' if row.at_least else '<='} {row.target:g}"
        lines.append(f"{row.what:{width}} {row.size:>16} {value:>9} {spread:>13}  {target:8} {row.verdict}")
        if row.note:
            lines.append(f"    {row.note}")
        if row.verdict == "NOT REACHED" and row.where:
            lines.append(f"    where the time goes: {_shares(row.where)}")
    return "\n".join(lines)


def _shares(where: dict[str, float]) -> str:
    whole = sum(where.values())
    shares = sorted(((seconds / whole, name) for name, seconds in where.items()), reverse=True)
    return ", ".join(f"{name} {share:.0%}" for share, name in shares if share >= 0.005)


def information(samples: Sequence[Sample]) -> str:
    """Median seconds, for information, and the CPU seconds of each run."""
    lines = ["median seconds of this run, for information (CPU seconds in parentheses)"]
    for key in dict.fromkeys((s.name, s.nx) for s in samples):
        wall, cpu = (np.median(clock.series(samples, key, cpu=flag)) for flag in (False, True))
        lines.append(f"    {key[0]:24} {key[1]:>5}x{key[1] // 3:<4} {wall:9.3f} ({cpu:.3f})")
    return "\n".join(lines)


def write(folder: Path, rows: Sequence[Row], samples: Sequence[Sample], facts: dict[str, Any]) -> None:
    """``rows.csv``, ``samples.csv``, ``facts.csv``, and ``table.md`` for people."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "table.md").write_text(markdown(rows), encoding="utf-8")
    with (folder / "rows.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(_COLUMNS)
        for row in rows:
            low, high = min(row.measured), max(row.measured)
            target = "" if row.target is None else row.target
            numbers = [f"{value:.6g}" for value in (row.value, low, high)]
            where = _shares(row.where) if row.where else ""
            head = [row.group, row.what, row.size, *numbers, len(row.measured), row.unit or "ratio", target]
            writer.writerow([*head, row.at_least, row.verdict, row.note, where])
    names = list(dict.fromkeys(name for s in samples for name in s.phases))
    with (folder / "samples.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["contestant", "nx", "repeat", "seconds", "cpu", *names])
        for s in samples:
            own = [f"{s.phases[name]:.6f}" if name in s.phases else "" for name in names]
            writer.writerow([s.name, s.nx, s.repeat, f"{s.seconds:.6f}", f"{s.cpu:.6f}", *own])
    with (folder / "facts.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(facts.items())


def markdown(rows: Sequence[Row]) -> str:
    """The rows as a table of Markdown; what is counted has no decimals."""
    lines = ["| what | mesh | value | range | must be | |", "|---|---|---|---|---|---|"]
    for row in rows:
        counted = row.unit and all(float(value).is_integer() for value in row.measured)
        value, low, high = (
            f"{one:.{0 if counted else 2}f}" for one in (row.value, min(row.measured), max(row.measured))
        )
        spread = f"{low} to {high}" if len(row.measured) > 1 else ""
        target = "" if row.target is None else f"{'at least' if row.at_least else 'at most'} {row.target:g}"
        verdict = "" if row.target is None else row.verdict.replace("NOT REACHED", "**not reached**")
        lines.append(f"| {' | '.join((row.what, row.size, f'{value} {row.unit}'.strip(), spread, target, verdict))} |")
    return "\n".join(lines) + "\n"


def picture(folder: Path, rows: Sequence[Row], samples: Sequence[Sample], sizes: Sizes) -> Path:
    """``performance.png``: where the time goes, and how far each row is from its target."""
    judged = [row for row in rows if row.target is not None and np.isfinite(row.value)]
    bars = [(name, nx) for nx in (sizes.middle, sizes.large) for name in _LABELS if clock.phases(samples, (name, nx))]
    height = 0.9 + 0.19 * len(bars), 0.9 + 0.19 * len(judged)
    with mpl.rc_context(_STYLE):
        if bars:
            figure = Figure(figsize=(7.2, max(3.0, sum(height))), layout="constrained")
            upper, lower = figure.subplots(2, 1, height_ratios=[max(h, 1.3) for h in height])
            _where(upper, samples, bars)
        else:
            figure = Figure(figsize=(7.2, max(1.3, height[1])), layout="constrained")
            lower = figure.subplots()
        _distances(lower, judged)
        path = folder / "performance.png"
        figure.savefig(path, dpi=160)
    return path


def _where(axes: Axes, samples: Sequence[Sample], bars: Sequence[clock.Key]) -> None:
    axes.set_title("Where the time goes, in units of one linear solve (MUMPS) of the same size")
    shown: set[str] = set()
    for place, key in enumerate(bars):
        found = clock.phases(samples, key)
        mumps = clock.series(samples, ("mumps", key[1]))
        unit = float(np.median(mumps)) if mumps.size else sum(found.values())
        left = 0.0
        for name, colour in _PHASES.items():
            if name not in found:
                continue
            label = name if name not in shown else None
            hatch = "////" if name in ("factorise", "solve") else None
            width = found[name] / unit
            axes.barh(place, width, 0.72, left, color=colour, edgecolor=_INK, linewidth=0.4, hatch=hatch, label=label)
            shown.add(name)
            left += width
        white = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
        axes.text(left + 0.02, place, f"{left:.2f}", va="center", fontsize=7, bbox=white)
    axes.set_yticks(range(len(bars)), [f"{_LABELS[name]}, {nx}x{nx // 3}" for name, nx in bars])
    axes.invert_yaxis()
    axes.axvline(1.0, color=_MUTED, linewidth=0.8, linestyle=(0, (4, 2)), zorder=0)
    axes.legend(ncols=4, loc="upper center", bbox_to_anchor=(0.45, -0.08), fontsize=7, handlelength=1.4)


def _distances(axes: Axes, judged: Sequence[Row]) -> None:
    axes.set_title("Value over target, or target over value where large values are good; hollow: target not reached")
    for place, row in enumerate(judged):
        assert row.target is not None
        share = row.target / row.value if row.at_least else row.value / row.target
        reached = row.verdict == "reached"
        # A value beyond the axis is an arrow at its end.
        marker, at = ("o", share) if share < _FARTHEST else (">", _FARTHEST)
        axes.plot(at, place, marker, color=_INK, markerfacecolor=_INK if reached else "white", markersize=5)
        value = f"{row.value:.2f} ({'>=' if row.at_least else '<='} {row.target:g})"
        white = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
        axes.text(0.017, place, value, va="center", fontsize=6.5, color=_MUTED, bbox=white)
    axes.set_xscale("log")
    axes.axvline(1.0, color=_MUTED, linewidth=0.8)
    axes.grid(axis="y", color="#e4e4e4", linewidth=0.5)
    axes.set_yticks(range(len(judged)), [f"{row.what}, {row.size}".rstrip(", ") for row in judged], fontsize=6.5)
    axes.invert_yaxis()
    axes.set_xlim(0.015, 1.15 * _FARTHEST)
    ticks = [0.1, 0.2, 0.5, 1.0, 2.0]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
