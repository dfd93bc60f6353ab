"""How figures and tables are shown, in a notebook, on a page and on a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from signorini_fx.records import Status


def html_table(columns: Sequence[str], rows: Iterable[Sequence[Any]], caption: str = "") -> str:
    """A table in HTML; numbers with six digits."""

    def cell(value: Any) -> str:
        return escape(f"{value:.6g}" if isinstance(value, float) else str(value))

    head = "".join(f"<th>{escape(name)}</th>" for name in columns)
    body = "".join(f"<tr>{''.join(f'<td>{cell(value)}</td>' for value in row)}</tr>" for row in rows)
    return f"<table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def clean(value: Any, scale: float) -> Any:
    """Components of a vector that are round-off beside the scale are zero; a single number stays."""
    return [0.0 if abs(c) <= 1e-9 * scale else c for c in value] if isinstance(value, list) else value


def duration(seconds: float) -> str:
    """A time that is only known roughly."""
    if seconds < 10:
        return "below 0.01 s" if seconds < 0.01 else f"{seconds:.1g} s"
    if seconds < 600:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def storage(size: float) -> str:
    """A number of bytes that is only known roughly."""
    if size < 1e6:
        return "below 1 MB"
    return f"{size / 1e6:.0f} MB" if size < 1e9 else f"{size / 1e9:.1f} GB"


def results_of(summary: dict[str, Any]) -> str:
    """The load step that the results are of."""
    of, count = summary["results_of"], len(summary["steps"])
    if of["status"] != Status.CONVERGED.value:
        which = "the last iterate of "
    else:
        which = "" if summary["converged"] else "the last one with a solution, "
    named = f"{of['name']}, " if of["name"] else ""
    failed = "" if summary["converged"] or of["step"] == count else f"; load step {count} has none"
    until = f" at time {summary['steps'][-1]['time']:.6g}" if failed else ""
    return f"{which}load step {of['step']} ({named}time {of['time']:.6g}){failed}{until}"


def safety_in_words(safety: dict[str, Any]) -> str:
    """The safety factor of a summary, what it is worth, and the motion beyond it."""
    factor, statics, present = (safety[name] for name in ("factor", "statics", "present"))
    if factor is None:
        return "statics sets no limit to the live loads"
    worth = "the limit of the live loads"
    if not safety["exact"]:
        worth = "times the live loads by statics, at most: friction may give way before"
        if statics is None or (present is not None and present < 0.999 * statics):
            bound = "sets no limit" if statics is None else f"allows {statics:.4g} at most"
            worth = f"times the live loads with the friction bounds as they are; statics alone {bound}"
    return f"{factor:.4g}, {worth}; beyond, {safety['motion']}"
