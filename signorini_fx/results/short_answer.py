"""What ``solve`` prints: ten lines of 80 columns, more only where what to do takes them; the rest is in the files and
behind ``--verbose``.
"""

from __future__ import annotations

import re
from pathlib import Path
from textwrap import shorten
from typing import Any

from signorini_fx.machine.display import clean, effort_in_words, results_of, status_in_words, touch_each_other
from signorini_fx.machine.terminal import COLUMNS, TerminalLine, clauses, printable
from signorini_fx.quantities.answers import error_in_words
from signorini_fx.quantities.digits import between, figure, figure_or_error, percent
from signorini_fx.quantities.shown import error_of, shown_lines, table
from signorini_fx.quantities.text import (
    boundaries_touched_by,
    cost_in_words,
    has_friction,
    kinematics_of,
    largest_von_mises,
    named_components,
    point_in_words,
    share_in_words,
)
from signorini_fx.quantities.validity import Validity, validity_of
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, UNRESOLVED_NODES

# Lines of the whole answer, unless what to do takes more of them.
MOST_LINES = 10
# How many lines of figures stay whatever has to be said beside them, by what they are of.
_KEPT_LINES = {Validity.SOLUTION: 6, Validity.LESS_ACCURATE: 5, Validity.EARLIER_STEP: 4, Validity.NO_SOLUTION: 0}
_EFFORT = 9  # the rank of what goes first, and of what another line says too
_LABEL = 14


def short_answer(summary: dict[str, Any], folder: Path) -> list[TerminalLine]:
    """The outcome, what to do unless it is a solution, the forces, the contact, the largest stress, what is left until
    the body moves, how wrong it is, what that took and the next accuracy would take, whether the certificate holds, and
    where the results are.

    Without a solution there are no figures; those of an earlier load step are as many as there is room for.
    """
    validity = validity_of(summary)
    heading = _heading(summary)
    of = _words("results of", results_of(summary), None) if "results_of" in summary and not summary["converged"] else []
    figures = _figures(summary) if validity.solved else []
    # What to do is whole; warnings have as many lines as they need, but not those of the most important figures.
    advice = [] if summary["converged"] else _words("what to do", summary["advice"], None, "advice")
    warned = _warned(summary)
    pressed = bool(warned) and validity in (Validity.LESS_ACCURATE, Validity.EARLIER_STEP)
    kept_lines = min(sum(len(lines) for _, lines in figures), _KEPT_LINES[validity] - pressed)
    room = MOST_LINES - len([heading, *of, *advice]) - 1 - kept_lines
    warnings = _words("warning", warned, max(room, 1), "warning") if warned else []
    first = [heading, *warnings, *of, *advice]
    shown, left_out = _most_important(figures, max(MOST_LINES - len(first) - 1, kept_lines))
    hint = f" ({left_out} more line{'s' * (left_out > 1)}: --verbose)" if left_out else ""
    return [*first, *shown, _row("results", f"{folder}/{hint}")]


def _figures(summary: dict[str, Any]) -> list[tuple[int, list[TerminalLine]]]:
    """All figures, each with its rank and lines: where there is no room for all, those of the last ranks go."""
    forces, asked = _forces(summary), _asked(summary)
    return [
        *((7 if k else 4, lines) for k, lines in enumerate(forces)),
        *((8 if k else 6, lines) for k, lines in enumerate(asked)),
        (5, _contact(summary)),
        (1, _stress(summary)),
        (2, _friction(summary)),
        (_EFFORT if _in_cost(summary) else 3, _line("error", error_in_words(summary)[0])),
        (2 if validity_of(summary) is Validity.LESS_ACCURATE else 3, _cost(summary)),
        (0, _certificate(summary)),
        (_EFFORT, _effort(summary)),
    ]


def _most_important(figures: list[tuple[int, list[TerminalLine]]], room: int) -> tuple[list[TerminalLine], int]:
    """As many figures as there is room for, in their order, and how many lines there are beside that of the effort."""
    shown, left_out = list[int](), 0
    for k in sorted(range(len(figures)), key=lambda k: figures[k][0]):
        rank, lines = figures[k]
        if len(lines) <= room:
            shown.append(k)
            room -= len(lines)
        else:
            room = 0  # no figure of a later rank takes the place of this one
            left_out += len(lines) * (rank != _EFFORT)
    return [line for k in sorted(shown) for line in figures[k][1]], left_out


def _is_forecast(summary: dict[str, Any]) -> bool:
    return (summary.get("cost") or {}).get("error") is not None


def _in_cost(summary: dict[str, Any]) -> bool:
    """Whether the line of the cost says the error, too."""
    guaranteed = (summary.get("error_bound") or {}).get("relative_error") is not None
    return _is_forecast(summary) and "convergence_table" not in summary and not guaranteed


def _cost(summary: dict[str, Any]) -> list[TerminalLine]:
    """What the error took, and what a smaller one would take; or why that is not known."""
    if not (statement := cost_in_words(summary)):
        return []
    if len(statement) > COLUMNS - _LABEL:
        statement = re.sub(r" error of the [a-z ]+ took ", " error took ", statement)
    return _words("cost", statement, 2)


def _begin(label: str) -> str:
    """A label in its column; a longer one, as that of a quantity of another package may be, ends with a colon."""
    return f"  {label:{_LABEL - 2}s}" if len(label) < _LABEL - 2 else f"  {label}: "


def _row(label: str, text: str, kind: str = "") -> TerminalLine:
    """A line of the answer."""
    return TerminalLine(_begin(label), printable(text), kind)


def _line(label: str, text: str, kind: str = "") -> list[TerminalLine]:
    """A text on one line; its first statement is whole, on as many lines as that takes."""
    return _words(label, text, 1, kind)


def _heading(summary: dict[str, Any]) -> TerminalLine:
    ended = status_in_words(summary)
    if "results_of" in summary and summary["converged"]:
        ended += f", {results_of(summary)}"
    room = max(COLUMNS - len(ended) - 2, 5)
    good = summary["converged"] and not summary["incomplete"]
    title = shorten(printable(summary["title"]) or "scene", room, placeholder="...")
    return TerminalLine(shorten(f"{title}: {ended}", COLUMNS, placeholder="..."), kind="good" if good else "")


def _warned(summary: dict[str, Any]) -> str:
    """The first warning, and how many there are; "": there is none."""
    texts = [
        f"{finding['path']}: {finding['message']}"
        for finding in summary["findings"]
        if finding["level"] == "warning" and finding["message"] not in summary["advice"]
    ]
    return "" if not texts else texts[0] if len(texts) == 1 else f"(1 of {len(texts)}) {texts[0]}"


def _words(label: str, text: str, most: int | None, kind: str = "") -> list[TerminalLine]:
    """A text on several lines; one that is too long ends where one of its statements does."""
    lines = clauses(text, COLUMNS - len(_begin(label)), most)
    return [_row(label if k == 0 else "", line, kind if k == 0 else "") for k, line in enumerate(lines)]


def _forces(summary: dict[str, Any]) -> list[list[TerminalLine]]:
    """The normal and the tangential force on the body; where bodies touch each other those of each boundary."""
    if "contact_force" not in summary:
        return []
    rows = [{**row, "name": f" on {row['boundary']}"} for row in summary.get("contact_boundaries", ())]
    if not (touch_each_other(summary) and rows):
        rows = [{**summary, "name": ""}]
    size = max(abs(part) for row in rows for key in ("contact_force", "friction_force") for part in row[key])

    kinematics = kinematics_of(summary)

    def of(row: dict[str, Any], key: str) -> str:
        force = clean(row[key], size)
        names = named_components(kinematics, len(force))
        shown = force if len(names) == len(force) else force[next(iter(names))]
        return figure_or_error(shown, error_of(summary, key))

    slides = has_friction(summary)
    texts = []
    for row in rows:
        friction = f", friction {of(row, 'friction_force')}" if slides else ""
        along = "" if kinematics.uniform else " along the axis"
        texts.append(f"{of(row, 'contact_force')}{friction}{along}{row['name']}")
    return [_line("" if k else "force", text) for k, text in enumerate(texts)]


def _contact(summary: dict[str, Any]) -> list[TerminalLine]:
    if "touching_nodes" not in summary:
        return []
    touching = summary["touching_nodes"]
    peak = figure_or_error(summary["max_pressure"], error_of(summary, "max_pressure"))
    coarse = boundaries_touched_by(range(1, UNRESOLVED_NODES + 1), summary)
    pressed = f", largest pressure {peak}" if touching else ""
    text = f"at {touching} of {summary['contact_nodes']} nodes{pressed}"
    if coarse:
        texts = [f"{text}; too few on {names}" for names in (", ".join(coarse), f"{len(coarse)} sides")]
        text = next((text for text in texts if len(text) <= COLUMNS - _LABEL), texts[-1])
    return _line("contact", text)


def _friction(summary: dict[str, Any]) -> list[TerminalLine]:
    """How much of its friction the body uses; beyond the load step of the figures there is a limit, which is told."""
    used = summary.get("friction_used")
    if used is None or validity_of(summary) is Validity.EARLIER_STEP:
        return []
    return _line("friction", f"{percent(used)} used" if used else "the loads need none")


def _stress(summary: dict[str, Any]) -> list[TerminalLine]:
    """The larger one of the raw and the recovered von Mises stress, how much of the yield stress it uses, and where."""
    largest = largest_von_mises(summary)
    if largest is None:
        return []
    limit = " (no limit there)" if largest.get("no_limit") else ""
    share = (summary.get("utilisation") or {}).get("value")
    used = "" if share is None else f", {share_in_words(summary, 'yield')}"
    kind = "" if share is None or share <= 1 else "warning"
    value = figure(largest["value"], between(summary["stress"]))
    return _line("stress", f"von Mises {value}{limit}{used}, at {point_in_words(largest['place'])}", kind)


def _certificate(summary: dict[str, Any]) -> list[TerminalLine]:
    figures = summary["certificate"]
    law = figures["law"].partition(",")[0]
    if figures["holds"]:
        return _line("certificate", f"holds for {law}, each condition to {CERTIFICATE_TOLERANCE:.0e}")
    return _line("certificate", f"DOES NOT HOLD for {law}: --verbose says which condition", "error")


def _effort(summary: dict[str, Any]) -> list[TerminalLine]:
    ranks = f" on {summary['ranks']} ranks" if summary["ranks"] > 1 else ""
    meshes = [price["seconds"] for price in summary.get("convergence_table", ()) if not price["predicted"]]
    seconds = sum(value or 0.0 for value in (meshes or summary["timings"].values()))
    return _line("effort", f"{effort_in_words(summary)}, {summary['dofs']} unknowns{ranks}, {seconds:.1f} s")


def _asked(summary: dict[str, Any]) -> list[list[TerminalLine]]:
    """What only some scenes have: rigid bodies, tightened sections, and the quantities of other packages."""
    lines = [line for shown in table() if shown.brief for line in shown_lines(shown, summary)]
    return [_words(line.begin.strip(), line.text, None, line.kind) for line in lines]
