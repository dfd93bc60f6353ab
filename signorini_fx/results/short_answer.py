"""What ``solve`` prints: at most ten lines of 80 columns; the rest is in the files and behind ``--verbose``."""

from __future__ import annotations

from pathlib import Path
from textwrap import shorten
from typing import Any

from signorini_fx.display import clean, effort_in_words, results_of, status_in_words, touch_each_other
from signorini_fx.machine.terminal import COLUMNS, TerminalLine, clauses, printable
from signorini_fx.quantities.answers import error_in_words, largest_von_mises
from signorini_fx.quantities.digits import between, figure
from signorini_fx.quantities.families.stress import share_in_words
from signorini_fx.quantities.registry import error_of, of_package, quantities, shown_lines
from signorini_fx.quantities.text import point_in_words
from signorini_fx.records import CERTIFICATE_TOLERANCE

# Lines of the whole answer.
MOST_LINES = 10
_LABEL = 14


def short_answer(summary: dict[str, Any], folder: Path) -> list[TerminalLine]:
    """The outcome, the forces, the contact, what is left until the body moves, the largest stress, how wrong it is,
    what that took and the next digit would take, whether the certificate holds, and where the results are.

    Args:
        summary: what ``summarise`` returns.
        folder: of the results.
    """
    first = [_heading(summary), *_warnings(summary)]
    last = _row("results", f"{folder}/")
    if not summary["converged"]:
        first += [_row("results of", results_of(summary))] if "results_of" in summary else []
        known = [_row("error", error_in_words(summary)[0]), *_cost(summary)] if _is_forecast(summary) else []
        first += _advice(summary["advice"], MOST_LINES - len(first) - len(known) - 1)
        return [*first, *known, last]
    room = MOST_LINES - 2 - len(first)
    fixed = next((lines for merged in range(3) if len(lines := _fixed(summary, merged)) <= room), _fixed(summary, 2))
    forces, others = _forces(summary), _asked(summary)
    room = MOST_LINES - len(first) - len(fixed) - 1
    effort = [_effort(summary)] if room > 1 else []
    room -= len(effort)
    shown = _beginning(forces, max(room - len(others), 1))
    return [*first, *shown, *_beginning(others, room - len(shown)), *fixed, *effort, last]


def _fixed(summary: dict[str, Any], merged: int) -> list[TerminalLine]:
    """What is never left out.

    Args:
        summary: of the solve.
        merged: 0: each has its line; from 1 on the line of the cost has the error, if it is about no other one; from 2
            on the certificate stands behind the contact.
    """
    contact, error, certificate = (
        _contact(summary),
        [_row("error", error_in_words(summary)[0])],
        [_certificate(summary)],
    )
    alike = "price_list" not in summary and (summary.get("error_bound") or {}).get("relative_error") is None
    if merged > 0 and alike and _is_forecast(summary):
        error = []
    if merged > 1 and contact:
        holds, law = summary["certificate"]["holds"], summary["certificate"]["law"].partition(",")[0]
        verdicts = [f"certificate holds for {law}", "certificate holds", "certified"]
        failures = [f"certificate DOES NOT HOLD for {law}", "certificate DOES NOT HOLD", "NOT certified"]
        texts = [f"{contact[0].text}; {verdict}" for verdict in (verdicts if holds else failures)]
        text = next((text for text in texts if len(text) <= COLUMNS - _LABEL), texts[-1])
        contact, certificate = [_row("contact", text, "" if holds else "error")], []
    return [*contact, *_safety(summary), *_stress(summary), *error, *_cost(summary), *certificate]


def _is_forecast(summary: dict[str, Any]) -> bool:
    return (summary.get("cost") or {}).get("error") is not None


def _cost(summary: dict[str, Any]) -> list[TerminalLine]:
    """What the error took, and what a smaller one would take; or why that is not known."""
    if "cost" not in summary:
        return []
    statement = summary["cost"]["statement"]
    return [_row("cost", statement if _is_forecast(summary) else f"no forecast: {statement}")]


def _row(label: str, text: str, kind: str = "") -> TerminalLine:
    """A line of the answer; what does not fit in it ends in dots."""
    return TerminalLine(
        f"  {label:{_LABEL - 2}s}", shorten(printable(text), COLUMNS - _LABEL, placeholder=" ..."), kind
    )


def _beginning(lines: list[TerminalLine], room: int) -> list[TerminalLine]:
    """The first lines of a list, and how many more there are."""
    if len(lines) <= room or room <= 0:
        return lines[: max(room, 0)]
    kept = lines[:room]
    more = f"; {len(lines) - room} more: --verbose"
    return [*kept[:-1], TerminalLine(kept[-1].begin, kept[-1].text[: COLUMNS - _LABEL - len(more)] + more)]


def _heading(summary: dict[str, Any]) -> TerminalLine:
    ended = status_in_words(summary)
    if "results_of" in summary and summary["converged"]:
        ended += f", {results_of(summary)}"
    room = max(COLUMNS - len(ended) - 2, 5)
    good = summary["converged"] and not summary["incomplete"]
    title = shorten(printable(summary["title"]) or "scene", room, placeholder="...")
    return TerminalLine(shorten(f"{title}: {ended}", COLUMNS, placeholder="..."), kind="good" if good else "")


def _warnings(summary: dict[str, Any]) -> list[TerminalLine]:
    """The first warning, and how many there are."""
    texts = [
        f"{finding['path']}: {finding['message']}"
        for finding in summary["findings"]
        if finding["level"] == "warning" and finding["message"] != summary["advice"]
    ]
    if not texts:
        return []
    text = printable(texts[0] if len(texts) == 1 else f"(1 of {len(texts)}) {texts[0]}")
    lines = clauses(text, COLUMNS - _LABEL, 2)
    return [_row("warning" if k == 0 else "", line, "warning") for k, line in enumerate(lines)]


def _advice(text: str, most: int) -> list[TerminalLine]:
    lines = clauses(text, COLUMNS - _LABEL, most)
    return [_row("what to do" if k == 0 else "", line, "advice" if k == 0 else "") for k, line in enumerate(lines)]


def _forces(summary: dict[str, Any]) -> list[TerminalLine]:
    """The normal and the tangential force on the body; where bodies touch each other those of each boundary."""
    if "contact_force" not in summary:
        return []
    rows = [{**row, "name": f" on {row['boundary']}"} for row in summary.get("contact_boundaries", ())]
    if not (touch_each_other(summary) and rows):
        rows = [{**summary, "name": ""}]
    size = max(abs(part) for row in rows for key in ("contact_force", "friction_force") for part in row[key])

    def of(row: dict[str, Any], key: str) -> str:
        return figure(clean(row[key], size), error_of(summary, key))

    slides = any(entry.get("friction") for entry in (summary.get("scene") or {}).get("contact", ()))
    texts = []
    for row in rows:
        friction = f", friction {of(row, 'friction_force')}" if slides else ""
        texts.append(f"{of(row, 'contact_force')}{friction}{row['name']}")
    return [_row("force" if k == 0 else "", text) for k, text in enumerate(texts)]


def _contact(summary: dict[str, Any]) -> list[TerminalLine]:
    if "touching_nodes" not in summary:
        return []
    touching, peak = summary["touching_nodes"], figure(summary["max_pressure"], error_of(summary, "max_pressure"))
    pressed = f", largest pressure {peak}" if touching else ""
    return [_row("contact", f"at {touching} of {summary['contact_nodes']} nodes{pressed}")]


def _safety(summary: dict[str, Any]) -> list[TerminalLine]:
    """How many times the live loads until the body slides or tips, as statics proves it."""
    if summary.get("safety") is None:
        return []
    safety = summary["safety"]
    used = "" if safety["friction_used"] is None else f"; friction used: {100 * safety['friction_used']:.2g} %"
    if safety["factor"] is None:
        return [_row("safety", f"no limit by statics{used}")]
    most = "" if safety["exact"] else "at most "
    each = {name: safety[name] for name in ("sliding", "overturning") if name in safety}
    if not each:
        return [_row("safety", f"{most}{safety['factor']:.3g} times these loads{used}")]

    def limits(before: str, behind: str) -> list[str]:
        return [
            f"{name}: " + ("no limit" if multiple is None else f"{before}{multiple:.3g}{behind}")
            for name, multiple in each.items()
        ]

    texts = [
        "; ".join(limits(most, " times these loads")) + used,
        "; ".join(limits(most, " times")) + used,
        f"{most}{', '.join(limits('', ''))} times these loads",
    ]
    return [_row("safety", next((text for text in texts if len(text) <= COLUMNS - _LABEL), texts[-1]))]


def _stress(summary: dict[str, Any]) -> list[TerminalLine]:
    """The larger one of the raw and the recovered von Mises stress, how much of the yield stress it uses, and where."""
    largest = largest_von_mises(summary)
    if largest is None:
        return []
    limit = " (no limit there)" if largest.get("no_limit") else ""
    used = f", {share_in_words(summary)} of yield" if "utilisation" in summary else ""
    value = figure(largest["value"], between(summary["stress"]))
    return [_row("stress", f"von Mises {value}{limit}{used}, at {point_in_words(largest['place'])}")]


def _certificate(summary: dict[str, Any]) -> TerminalLine:
    figures = summary["certificate"]
    law = figures["law"].partition(",")[0]
    if figures["holds"]:
        return _row("certificate", f"holds for {law}, each condition to {CERTIFICATE_TOLERANCE:.0e}")
    return _row("certificate", f"DOES NOT HOLD for {law}: --verbose says which condition", "error")


def _effort(summary: dict[str, Any]) -> TerminalLine:
    ranks = f" on {summary['ranks']} ranks" if summary["ranks"] > 1 else ""
    meshes = [price["seconds"] for price in summary.get("price_list", ()) if not price["predicted"]]
    seconds = sum(value or 0.0 for value in (meshes or summary["timings"].values()))
    return _row("effort", f"{effort_in_words(summary)}, {summary['dofs']} unknowns{ranks}, {seconds:.1f} s")


def _asked(summary: dict[str, Any]) -> list[TerminalLine]:
    """What only some scenes have: rigid bodies, tightened sections, and the quantities of other packages."""
    ours = {quantity.key for quantity in of_package() if not quantity.brief}
    lines = [line for quantity in quantities() if quantity.key not in ours for line in shown_lines(quantity, summary)]
    return [_row(line.begin.strip(), line.text, line.kind) for line in lines]
