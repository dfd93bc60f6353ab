"""How figures and tables are shown, in a notebook, on a page and on a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from signorini_fx.errors import MissingPackageError
from signorini_fx.machine.terminal import printable
from signorini_fx.records import Status, StepRecord


def html_table(columns: Sequence[str], rows: Iterable[Sequence[Any]], caption: str = "") -> str:
    """A table in HTML; numbers with six digits."""

    def safe(text: str) -> str:
        return escape(printable(text))

    def cell(value: Any) -> str:
        return safe(f"{value:.6g}" if isinstance(value, float) else str(value))

    head = "".join(f"<th>{safe(name)}</th>" for name in columns)
    body = "".join(
        f"<tr>{''.join(f'<td>{cell(value)}</td>' for value in row)}</tr>" for row in rows
    )
    rows_of_names = f"<caption>{safe(caption)}</caption><thead><tr>{head}</tr></thead>"
    return f"<table>{rows_of_names}<tbody>{body}</tbody></table>"


def dataframe(columns: Any) -> Any:
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
    """Components of a vector that are round-off beside the scale are zero; a single number
    stays.
    """
    return (
        [0.0 if abs(c) <= 1e-9 * scale else c for c in value] if isinstance(value, list) else value
    )


def duration(seconds: float) -> str:
    """A time that is only known roughly."""
    if seconds < 9.5:
        return "below 0.01 s" if seconds < 0.01 else f"{seconds:.1g} s"
    if seconds < 600:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def storage(size: float) -> str:
    """A number of bytes that is only known roughly."""
    if size < 1e6:
        return "below 1 MB"
    return f"{size / 1e6:.0f} MB" if size < 1e9 else f"{size / 1e9:.1f} GB"


def status_in_words(summary: dict[str, Any]) -> str:
    """Return the outcome of a solve in words, and whether its scene is incomplete."""
    return str(summary["status"]) + (", incomplete" if summary.get("incomplete") else "")


def touch_each_other(summary: dict[str, Any]) -> bool:
    """Whether bodies touch each other, or a rigid one several boundaries: then the contact force of
    a boundary acts on the body that it is of, and the sum of all says nothing.
    """
    contacts = (summary.get("scene") or {}).get("contact", ())
    named = [(effect.get("foundation") or {}).get("rigid") for effect in contacts]
    rigid = [name for name in named if name]
    return any(effect.get("against") for effect in contacts) or len(set(rigid)) < len(rigid)


def on_several_bodies(summary: dict[str, Any]) -> bool:
    """Whether the contact forces have no resultant that acts on one body: they are those of several
    such boundaries.
    """
    return touch_each_other(summary) and len(summary.get("contact_boundaries", ())) > 1


def load_step(row: dict[str, Any]) -> str:
    """A load step by its number, name and time."""
    return str(StepRecord(row["step"], row["name"], row["time"]))


def results_of(summary: dict[str, Any]) -> str:
    """The load step that the results are of."""
    of = summary["results_of"]
    last = summary["steps"][-1]
    if of["status"] != Status.CONVERGED.value:
        return f"the last iterate of {load_step(of)}"
    if of["step"] == last["step"]:
        return load_step(of)
    return f"{load_step(of)}; no solution of load step {last['step']}, time {last['time']:.6g}"


def effort_in_words(summary: dict[str, Any]) -> str:
    """Return the numbers of linear solves and factorisations of a solve, in words."""
    counts = (
        (summary["linear_solves"], "linear solve"),
        (summary["factorisations"], "factorisation"),
    )
    return ", ".join(f"{count} {noun}{'s' * (count != 1)}" for count, noun in counts)
