"""What follows from the table of a study: the cheapest method for each accuracy, and the advice in words."""

from __future__ import annotations

from collections.abc import Sequence

from signorini_fx.addons.studies.work_precision import QUANTITIES, Row, Study
from signorini_fx.tuned import COMPARED_ERRORS, EQUAL_ERRORS, NO_ERROR, TIED_TIMES

_LABELS = {
    "energy": "displacement in the energy norm",
    "pressure": "contact pressure",
    "peak": "largest pressure",
    "zone": "ends of the contact zone",
    "force": "contact force",
}


def lasting_errors(rows: Sequence[Row], quantity: str) -> list[float | None]:
    """The lasting errors: for each run the largest on its mesh and the finer ones by the same method.

    An error that changes its sign is small on one mesh by chance.
    """
    result: list[float | None] = []
    for row in rows:
        family = [r for r in rows if r["method"] == row["method"] and coarseness(r) <= coarseness(row)]
        errors = [r[quantity] for r in family if r[quantity] is not None]
        result.append(max(errors) if row[quantity] is not None else None)
    return result


def coarseness(row: Row) -> float:
    """The size of the cells, or the requested accuracy: the quantity that decreases from run to run of a method."""
    return float(row["size_of_cells"] or row["asked"])


def cheapest_front(rows: Sequence[Row], quantity: str, floor: float | None = None) -> list[tuple[Row, float]]:
    """The runs that are more accurate than all cheaper ones, cheapest first, each with its lasting error.

    Each step reduces the error by a fifth at least; of several nearly equal runs the first of the list is taken.
    Errors below that of the reference, ``floor``, cannot be distinguished.
    """
    errors = [None if e is None else max(e, floor or 0.0) for e in lasting_errors(rows, quantity)]
    measured = [(row, e) for row, e in zip(rows, errors, strict=True) if e is not None and row["seconds"]]
    front: list[tuple[Row, float]] = []
    for row, error in sorted(measured, key=lambda pair: (pair[0]["seconds"], pair[1])):
        if not front or error < EQUAL_ERRORS * front[-1][1]:
            front.append(next(pair for pair in measured if _as_good(pair, (row, error))))
    return [pair for k, pair in enumerate(front) if not any(_beats(later, pair) for later in front[k + 1 :])]


def _beats(first: tuple[Row, float], second: tuple[Row, float]) -> bool:
    return bool(first[0]["seconds"] <= second[0]["seconds"] and first[1] <= second[1])


def _as_good(first: tuple[Row, float], second: tuple[Row, float]) -> bool:
    """Whether the first is as good as the second, ties included."""
    return bool(first[0]["seconds"] <= TIED_TIMES * second[0]["seconds"] and EQUAL_ERRORS * first[1] <= second[1])


def choice(rows: Sequence[Row], quantity: str, target: float) -> Row | None:
    """The cheapest run that meets a target; among ties the first of the list.  None: no run does."""
    errors = lasting_errors(rows, quantity)
    enough = [row for row, e in zip(rows, errors, strict=True) if e is not None and e <= target and row["seconds"]]
    least = min((row["seconds"] for row in enough), default=0.0)
    return next((row for row in enough if row["seconds"] <= TIED_TIMES * least), None)


def advice(study: Study) -> str:
    """A line for each quantity: which method for which accuracy, from the data alone."""
    rows = study.rows
    parts = [f"{study.title or 'The problem'}: errors relative to {study.reference}, times of whole solves."]
    for quantity in quantities_with_errors(study):
        best: list[tuple[str, float, Row]] = []
        for target in COMPARED_ERRORS:
            row = choice(rows, quantity, target) if target > 2 * (study.floor[quantity] or 0.0) else None
            if row is not None and best and best[-1][2]["method"] == row["method"]:
                best[-1] = (best[-1][0], target, row)
            elif row is not None:
                best.append((_percent(target), target, row))
        choices = [
            f"{row['method']} ({first}{'' if _percent(last) == first else ' down to ' + _percent(last)}, "
            f"there {row['seconds']:.2g} s and {row['dofs']} unknowns)"
            for first, last, row in best
        ]
        label = _LABELS[quantity]
        parts.append(
            f"For the {label} take " + ", then ".join(choices) + "."
            if choices
            else _not_accurate_enough(study, quantity)
        )
    parts += [text for text in (_on_gamma(rows), _on_time(rows), _on_failures(rows)) if text]
    return "\n- ".join(parts)


def _not_accurate_enough(study: Study, quantity: str) -> str:
    """The text for a quantity that no run has computed accurately enough."""
    best = min((e for e in lasting_errors(study.rows, quantity) if e is not None), default=None)
    floor = study.floor[quantity]
    text = f"No run has the {_LABELS[quantity]} within {_percent(COMPARED_ERRORS[0])} beyond doubt"
    text += f": the best is wrong by {100 * best:.2g} %" if best is not None else ""
    return text + (f", the reference itself perhaps by {100 * floor:.2g} %." if floor else ".")


def _percent(target: float) -> str:
    return f"{100 * target:g} %"


def quantities_with_errors(study: Study) -> list[str]:
    """Quantities that have errors."""
    return [name for name in QUANTITIES if any((row[name] or 0.0) > NO_ERROR for row in study.rows)]


def _finest(rows: Sequence[Row], name: str) -> Row | None:
    """The run of a method on its finest mesh, if it has a solution there."""
    runs = [row for row in rows if row["method"] == name]
    last = min(runs, key=coarseness, default=None)
    return last if last is not None and last["seconds"] and last["pressure"] is not None else None


def _on_gamma(rows: Sequence[Row]) -> str:
    """The regularisation error on the finest mesh."""
    base = _finest(rows, rows[0]["method"])
    fixed = [row for name in dict.fromkeys(r["method"] for r in rows) if (row := _finest(rows, name)) is not None]
    fixed = [row for row in fixed if row["gamma"] != "auto" and row["algorithm"] == "auto"]
    if base is None or not base["pressure"] or not fixed:
        return ""
    ratios = {row["gamma"]: row["pressure"] / base["pressure"] for row in fixed}
    enough = [gamma for gamma, ratio in ratios.items() if 0.9 <= ratio <= 1.1]
    low = {gamma: ratio for gamma, ratio in ratios.items() if ratio > 1.1}
    ratio_text = ", ".join(f"{gamma:.0e} leaves {ratio:.2g} times that" for gamma, ratio in low.items())
    text = f"On the finest Q1 mesh the pressure is wrong by {base['pressure']:.1e} without regularisation"
    if enough:
        spread = f"{min(enough):.0e}" + (f" to {max(enough):.0e}" if len(enough) > 1 else "")
        text += f", and by as much with a fixed gamma of {spread} E/size"
    return text + (f"; {ratio_text}." if ratio_text else ".")


def _on_time(rows: Sequence[Row]) -> str:
    """Times on the finest mesh relative to the base."""
    base = _finest(rows, rows[0]["method"])
    if base is None:
        return ""
    comparisons = []
    for name in dict.fromkeys(row["method"] for row in rows):
        row = _finest(rows, name)
        alike = row is not None and row["gamma"] == "auto" and row["element"] == base["element"]
        if row is not None and alike and name != base["method"]:
            comparisons.append(f"{name} {row['seconds'] / base['seconds']:.2g} ({row['linear_solves']} solves)")
    base_text = f"{base['seconds']:.2g} s, {base['linear_solves']} solves"
    return (
        f"There, in multiples of the time of {base['method']} ({base_text}): {', '.join(comparisons)}."
        if comparisons
        else ""
    )


def _on_failures(rows: Sequence[Row]) -> str:
    """Which runs have no solution."""
    failed = [row for row in rows if row["status"] != "converged"]
    if not failed:
        return f"All {len(rows)} runs have a solution."
    by_status: dict[str, list[str]] = {}
    for row in failed:
        mesh = f"cells x {row['size_of_cells']:g}" if row["size_of_cells"] else f"asked for {row['asked']:g}"
        by_status.setdefault(row["status"], []).append(f"{row['method']} ({mesh})")
    return (
        f"{len(failed)} of {len(rows)} runs have no solution: "
        + "; ".join(f"{', '.join(names)}: {status}" for status, names in by_status.items())
        + "."
    )
