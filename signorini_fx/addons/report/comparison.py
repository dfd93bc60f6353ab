"""Two result folders side by side: figures, resultants, zones, and the curves along the contact boundary."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.machine.csv_text import Table
from signorini_fx.machine.display import clean, on_several_bodies
from signorini_fx.machine.result_files import ResultFiles, read_summary, seconds_of

Floats = npt.NDArray[np.float64]
_WIDTH = 36  # of a column with a value
# Name in the table -> where it stands in summary.json.
_WORDS: dict[str, tuple[str, ...]] = {"outcome": ("status",), "algorithm": ("algorithm",)}
_COUNTS: dict[str, tuple[str, ...]] = {
    "unknowns": ("dofs",),
    "contact nodes": ("contact_nodes",),
    "linear solves": ("linear_solves",),
}
_FIGURES: dict[str, tuple[str, ...]] = {
    "contact force": ("contact_force",),
    "friction force": ("friction_force",),
    "contact moment": ("contact_moment",),
    "friction moment": ("friction_moment",),
    "largest pressure": ("max_pressure",),
    "largest shear": ("max_shear",),
    "strain energy": ("strain_energy",),
    "von Mises stress": ("stress", "von_mises", "value"),
    "contact area": ("areas", "contact"),
    "stick area": ("areas", "stick"),
    "slip area": ("areas", "slip"),
}


def compare(first: Path, second: Path) -> str:
    """A table of two result folders, with relative differences; then how far their contact boundaries agree.

    Pressure and shear of the second are interpolated to the nodes of the first: along the boundary in 2D, from
    the nearest node in 3D.

    Raises:
        ResultError: one of them is no result folder.
        ValueError: a table of theirs cannot be read.
    """
    summaries = read_summary(first), read_summary(second)
    lines = [_row("", str(first), str(second), "difference")]
    for name, keys in (_WORDS | _COUNTS).items():
        values = [_at(summary, keys) for summary in summaries]
        if any(value is not None for value in values):
            lines.append(_row(name, _shown(values[0]), _shown(values[1]), "" if values[0] == values[1] else "differs"))
    several = any(map(on_several_bodies, summaries))
    for name, keys in _FIGURES.items():
        if several and keys[0].startswith(("contact_", "friction_")):  # their sum acts on none of the bodies
            lines += _of_each(name, keys[0], summaries) if name.endswith("force") else []
            continue
        values = [_at(summary, keys) for summary in summaries]
        if any(value is not None for value in values):
            a, b = _cleaned(name, values, summaries)
            lines.append(_row(name, _shown(a), _shown(b), _difference(a, b)))
    for name in ("contact", "stick", "slip"):
        zones = [_at(summary, ("zones", name)) for summary in summaries]
        lines += _zones(f"{name} zone", zones)
    seconds = [seconds_of(summary) for summary in summaries]
    ratio = f"{seconds[1] / seconds[0]:.2f} times" if seconds[0] > 0 else ""
    lines.append(_row("seconds", f"{seconds[0]:.3g}", f"{seconds[1]:.3g}", ratio))
    if all("contact_nodes" in summary for summary in summaries):
        lines += ["", *_boundaries(*(ResultFiles(folder).columns("contact.csv") for folder in (first, second)))]
    return "\n".join(line.rstrip() for line in lines)


def _of_each(name: str, key: str, summaries: tuple[dict[str, Any], dict[str, Any]]) -> list[str]:
    """The force of each contact boundary."""
    by_boundary = [
        {row["boundary"]: row.get(key) for row in summary.get("contact_boundaries", ())} for summary in summaries
    ]
    all_forces = [force for forces in by_boundary for force in forces.values() if force]
    size = max((float(np.abs(force).max()) for force in all_forces), default=0.0)
    lines = []
    for k, boundary in enumerate(dict.fromkeys([*by_boundary[0], *by_boundary[1]])):
        a, b = (clean(forces.get(boundary), size) for forces in by_boundary)
        first, second = (f"{_shown(value)} on {boundary}" for value in (a, b))
        lines.append(_row("" if k else name, first, second, _difference(a, b)))
    return lines


def _row(name: str, first: str, second: str, difference: str = "") -> str:
    return f"{name:18s}{first:{_WIDTH}s} {second:{_WIDTH}s} {difference}"


def _at(summary: dict[str, Any], keys: tuple[str, ...]) -> Any:
    """An entry of nested dictionaries, None where there is none."""
    value: Any = summary
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    return value


def _shown(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, list):
        return "(" + ", ".join(map(_shown, value)) + ")"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _cleaned(name: str, values: list[Any], summaries: tuple[dict[str, Any], dict[str, Any]]) -> list[Any]:
    """Forces and moments without what is round-off of all that are at work."""
    kind = name.rpartition(" ")[2]
    if kind not in ("force", "moment"):
        return values
    forces = [summary.get(f"{of}_{kind}") for summary in summaries for of in ("contact", "friction")]
    size = max((float(np.abs(value).max()) for value in forces if value), default=0.0)
    return [clean(value, size) for value in values]


def _difference(first: Any, second: Any) -> str:
    """Relative to the larger of the two, as vectors."""
    if first is None or second is None or np.shape(first) != np.shape(second):
        return ""
    a, b = np.atleast_1d(np.asarray(first, dtype=np.float64)), np.atleast_1d(np.asarray(second, dtype=np.float64))
    size = max(float(np.linalg.norm(a)), float(np.linalg.norm(b)))
    if not size > 0:
        return ""
    share = float(np.linalg.norm(a - b)) / size
    return "equal" if share == 0 else f"{share:.1e}" if math.isfinite(share) else ""


def _zones(name: str, zones: list[Any]) -> list[str]:
    """One row for each run of the nodes that either has."""
    runs = [zone or [] for zone in zones]

    def shown(run: list[list[float]]) -> str:
        return " to ".join(_shown([round(float(c), 9) + 0.0 for c in point]) for point in run)

    rows = itertools.zip_longest(*(map(shown, run) for run in runs), fillvalue="-")
    return [_row("" if k else name, first, second) for k, (first, second) in enumerate(rows)]


def _boundaries(first: Table, second: Table) -> list[str]:
    """How far pressure, shear and states agree, boundary by boundary."""
    lines = []
    for name in dict.fromkeys(first["boundary"].tolist()):
        first_rows, second_rows = first["boundary"] == name, second["boundary"] == name
        if not second_rows.any():
            lines.append(f"boundary {name}: only in the first")
            continue
        x, y = _positions(first)[first_rows], _positions(second)[second_rows]
        if x.shape[1] != y.shape[1]:
            lines.append(f"boundary {name}: one is in 2D, the other in 3D")
            continue
        take = _interpolation(first, first_rows, second, second_rows)
        weight = first["weight"][first_rows]
        parts = []
        size = float(np.ptp(x, axis=0).max() or 1.0)
        for quantity in ("pressure", "shear"):
            a, b = first[quantity][first_rows], take(second[quantity][second_rows])
            gap = np.abs(a - b)
            norm = math.sqrt(float(weight @ a**2)) or math.sqrt(float(weight @ b**2))
            share = math.sqrt(float(weight @ gap**2)) / norm if norm > 0 else 0.0
            worst = int(gap.argmax())
            at = f", at most {gap[worst]:.3g} at {_shown(clean(x[worst].tolist(), size))}" if gap[worst] > 0 else ""
            parts.append(f"{quantity} {share:.1e} of its norm{at}")
        if len(x) == len(y) and np.allclose(x, y, rtol=0, atol=1e-9 * size):
            count = int((first["state"][first_rows] != second["state"][second_rows]).sum())
            parts.append(f"{count} of {len(x)} nodes in another state")
        lines.append(f"boundary {name}: {'; '.join(parts)}")
    lines += [
        f"boundary {name}: only in the second"
        for name in dict.fromkeys(second["boundary"].tolist())
        if name not in set(first["boundary"].tolist())
    ]
    return lines


def _positions(table: Table) -> Floats:
    return np.column_stack([table[axis] for axis in ("x", "y", "z") if axis in table])


def _interpolation(
    target: Table, target_rows: npt.NDArray[np.bool_], source: Table, source_rows: npt.NDArray[np.bool_]
) -> Callable[[Floats], Floats]:
    """From values at the nodes of the second to those of the first, on one boundary.

    In 2D a place lies on one of the two sides that meet at the nearest node; a boundary may have several pieces,
    and the arc length begins at zero on each of them.
    """
    from scipy.spatial import cKDTree

    x, y = _positions(target)[target_rows], _positions(source)[source_rows]
    nearest = cKDTree(y).query(x)[1]
    if "s" not in source:
        return lambda values: np.asarray(values[nearest])
    goes_on = np.append(np.diff(source["s"][source_rows]) > 0, False)
    begin = np.stack((np.maximum(nearest - 1, 0), nearest))
    end = np.where(goes_on[begin], begin + 1, begin)
    side, to = y[end] - y[begin], x - y[begin]
    share = (side * to).sum(axis=2) / np.maximum((side**2).sum(axis=2), np.finfo(float).tiny)
    share = np.clip(share, 0.0, 1.0)
    away = np.linalg.norm(to - share[:, :, None] * side, axis=2)
    chosen = away.argmin(axis=0), np.arange(len(x))
    first, second, share = begin[chosen], end[chosen], share[chosen]
    return lambda values: np.asarray((1.0 - share) * values[first] + share * values[second])
