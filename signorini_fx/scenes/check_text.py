"""The result of ``check`` as text for a terminal."""

from __future__ import annotations

from signorini_fx.machine.display import storage
from signorini_fx.machine.terminal import COLUMNS, clauses
from signorini_fx.results.accuracy.next_accuracy import between
from signorini_fx.scenes.checks import Check
from signorini_fx.solving.check.cost import Cost

# Lines of the short text, of what acts in it, of the cost, and of one finding.
_MOST_LINES, _ACTS, _COST, _FINDING = 15, 5, 3, 3
_LABEL = 12


def text_of(check: Check, *, verbose: bool) -> str:
    """What acts, what it will cost, and what the scene lacks, in 80 columns; with ``verbose`` all of it and the methods
    that will be tried, else at most fifteen lines.
    """
    cost, (low, high) = check.cost, check.cost.linear_solves
    solves = f"{low}" if low == high else f"{low} to {high}"
    estimate = (
        f"{cost.unknowns} unknowns, {solves} solves, {between(cost.seconds)} of linear algebra, "
        f"{storage(cost.memory_bytes)}, estimated; {next_accuracy(cost)}"
    )
    lines = _paragraph("acts", "; ".join(check.acts), None if verbose else _ACTS)
    lines += _paragraph("cost", estimate, None if verbose else _COST)
    if verbose:
        lines += _paragraph("solver", cost.linear_algebra, None)
        for purpose, attempts, limit in check.plan:
            lines += _paragraph(
                "tried", f"for {purpose}, until one has a solution: {'; '.join(attempts)} ({limit})", None
            )
    findings = sorted(check.findings, key=lambda finding: finding.level != "warning")
    for k, finding in enumerate(findings):
        told = _paragraph(finding.level, f"{finding.path}: {finding.message}", None if verbose else _FINDING)
        if not verbose and len(lines) + len(told) + 2 > _MOST_LINES:
            more = len(findings) - k
            lines += _paragraph("", f"{more} more finding{'s' * (more > 1)}: --verbose", 1)
            break
        lines += told
    count = len(check.warnings)
    verdict = "fine" if count == 0 else f"{count} warning{'s' * (count > 1)}"
    heading = f"{check.title or 'scene'}: {verdict}"
    return "\n".join([heading if len(heading) <= COLUMNS else f"{heading[: COLUMNS - 3]}...", *lines])


def _paragraph(label: str, text: str, most: int | None) -> list[str]:
    """A labelled text; what does not fit in so many lines is left out, see ``clauses``."""
    lines = clauses(text, COLUMNS - _LABEL, most)
    return [f"  {label if k == 0 else '':{_LABEL - 2}s}{line}" for k, line in enumerate(lines)]


def next_accuracy(cost: Cost) -> str:
    """What the next accuracy would take, before anything is known of the solution."""
    share = {0.1: "a tenth of", 0.5: "half"}.get(cost.next_error, f"{cost.next_error:.2g} of")
    how = "with --accuracy" if cost.next_local else "with all cells smaller"
    return f"{share} the error: {between(cost.next_seconds)} {how}"
