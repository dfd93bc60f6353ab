"""Numbers and tables as text, for notebooks, pages and terminals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from signorini_fx.errors import MissingPackageError
from signorini_fx.machine.terminal import printable
from signorini_fx.records import Status, StepRecord

if TYPE_CHECKING:
    from pandas import DataFrame

    from signorini_fx.arrays import Plain


def html_table(columns: Sequence[str], rows: Iterable[Sequence[Plain]], caption: str = "") -> str:
    """Return a table in HTML: numbers with six digits, words from the left."""

    def safe(text: str) -> str:
        return escape(printable(text))

    def cell(value: Plain) -> str:
        if isinstance(value, str):
            return f'<td style="text-align: left">{safe(value)}</td>'
        return f"<td>{safe(f'{value:.6g}' if isinstance(value, float) else str(value))}</td>"

    head = "".join(f"<th>{safe(name)}</th>" for name in columns)
    body = "".join(f"<tr>{''.join(map(cell, row))}</tr>" for row in rows)
    rows_of_names = f"<caption>{safe(caption)}</caption><thead><tr>{head}</tr></thead>"
    return f"<table>{rows_of_names}<tbody>{body}</tbody></table>"


def dataframe(columns: Any) -> DataFrame:
    """Return columns by their names, or rows, as a ``pandas.DataFrame``.

    Raises:
        InstallationError: pandas is not installed.
    """
    try:
        from pandas import DataFrame
    except ModuleNotFoundError:
        message = "a DataFrame needs pandas, which is not installed: pip install pandas"
        raise MissingPackageError(message) from None
    return DataFrame(columns)


def clean(value: Any, scale: float) -> Any:
    """Return a vector with components that are round-off relative to ``scale`` set to zero; a
    single number is returned as it is.
    """
    return (
        [0.0 if abs(c) <= 1e-9 * scale else c for c in value] if isinstance(value, list) else value
    )


def point_in_words(point: Iterable[float]) -> str:
    """Return the coordinates of a point, without round-off."""
    return "(" + ", ".join(f"{round(x, 9) + 0.0:.6g}" for x in point) + ")"


def with_error(value: Any, error: float | None) -> str:
    """Return a number, or a vector in brackets, rounded to the digits of its error, with the error.

    An error of None (unknown) gives two digits, a negligible one six, both without the error.
    """
    vector = isinstance(value, list | tuple)
    parts = [float(part) for part in (value if vector else [value])]
    size = math.hypot(*parts)
    if error is None or error <= 1e-6 * size or not math.isfinite(size + error):
        digits = 2 if error is None else 6
        texts = [f"{float(f'{part:.{digits}g}'):g}" for part in clean(parts, size)]
        return f"({', '.join(texts)})" if vector else texts[0]
    # One digit of the error, two if it begins with 1, which is rounded up.
    last = math.floor(math.log10(error))
    last -= error < 1.9 * 10.0**last
    largest = math.floor(math.log10(max(size, error)))
    power = 0 if -4 < largest < 6 else largest
    decimals = max(power - last, 0)
    up = math.ceil(error / 10.0**last * (1 - 1e-9)) * 10.0 ** (last - power)
    texts = [
        f"{round(part, -last) / 10.0**power:.{decimals}f}" if round(part, -last) else "0"
        for part in parts
    ]
    text = f"({', '.join(texts)})" if vector else texts[0]
    text = f"{text} +- {up:.{decimals}f}"
    return f"({text})e{power:+03d}" if power else text


def duration(seconds: float) -> str:
    """Return a time as text with few digits, for times that are only known roughly."""
    if seconds < 9.5:
        return "below 0.01 s" if seconds < 0.01 else f"{seconds:.1g} s"
    if seconds < 600:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def storage(size: float) -> str:
    """Return a number of bytes as text with few digits."""
    if size < 1e6:
        return "below 1 MB"
    return f"{size / 1e6:.0f} MB" if size < 1e9 else f"{size / 1e9:.1f} GB"


def status_in_words(summary: dict[str, Plain]) -> str:
    """Return the outcome of a solve as text, with a note if its scene is incomplete."""
    return str(summary["status"]) + (", incomplete" if summary.get("incomplete") else "")


def touch_each_other(summary: dict[str, Any]) -> bool:
    """Return whether bodies touch each other, or several boundaries touch one rigid body.

    Then the contact force of a boundary acts on its own body only, and the sum over all boundaries
    has no meaning.
    """
    contacts = (summary.get("scene") or {}).get("contact", ())
    named = [(effect.get("foundation") or {}).get("rigid") for effect in contacts]
    rigid = [name for name in named if name]
    return any(effect.get("against") for effect in contacts) or len(set(rigid)) < len(rigid)


def on_several_bodies(summary: dict[str, Any]) -> bool:
    """Return whether the contact forces have no common resultant, as they act on several bodies."""
    return touch_each_other(summary) and len(summary.get("contact_boundaries", ())) > 1


def load_step(row: dict[str, Any]) -> str:
    """Return the number, name and time of a load step as text."""
    return str(StepRecord(row["step"], row["name"], row["time"]))


def results_of(summary: dict[str, Any]) -> str:
    """Return which load step the results belong to, as text."""
    of = summary["results_of"]
    last = summary["steps"][-1]
    if of["status"] != Status.CONVERGED.value:
        return f"the last iterate of {load_step(of)}"
    if of["step"] == last["step"]:
        return load_step(of)
    return f"{load_step(of)}; no solution of load step {last['step']}, time {last['time']:.6g}"


def effort_in_words(summary: dict[str, Plain]) -> str:
    """Return the numbers of linear solves and factorisations of a solve as text."""
    counts = (
        (summary["linear_solves"], "linear solve"),
        (summary["factorisations"], "factorisation"),
    )
    return ", ".join(f"{count} {noun}{'s' * (count != 1)}" for count, noun in counts)
