"""The result of ``check`` as text for a terminal."""

from __future__ import annotations

import textwrap

from signorini_fx.machine.display import duration, storage
from signorini_fx.machine.terminal import COLUMNS, clauses
from signorini_fx.results.accuracy.next_accuracy import between
from signorini_fx.scenes.checks import Check
from signorini_fx.solving.check.cost import Cost

# Lines of the short text, of the effects in it, and of one finding.
_MOST_LINES, _EFFECTS, _FINDING = 15, 5, 3
_LABEL = 12
# Effects that are not to be understood without what is said of them.
_EXPLAINED = ("elasticity", "nonlinear body", "several materials", "contact", "friction", "load steps")


def short_text(check: Check) -> str:
    """What acts, what the scene lacks, and what it will cost: at most fifteen lines of 80 columns."""
    effects = [
        f"{effect.name} ({effect.why.removeprefix('always; ')})" if effect.name.startswith(_EXPLAINED) else effect.name
        for effect in check.effects
        if effect.on
    ]
    lines = _paragraph("acts", "; ".join(effects), _EFFECTS)
    low, high = check.cost.linear_solves
    solves = f"{low}" if low == high else f"{low} to {high}"
    seconds = f"{between(check.cost.seconds)} of linear algebra"
    cost = f"{check.cost.unknowns} unknowns, {solves} solves, {seconds}, {storage(check.cost.memory_bytes)}"
    lines += _paragraph("cost", f"{cost}, estimated; {next_accuracy(check.cost)}", 3)
    findings = sorted(check.findings, key=lambda finding: finding.level != "warning")
    for k, finding in enumerate(findings):
        told = _paragraph(finding.level, f"{finding.path}: {finding.message}", _FINDING)
        if len(lines) + len(told) + 2 > _MOST_LINES:
            more = len(findings) - k
            lines += _paragraph("", f"{more} more finding{'s' * (more > 1)}: --verbose", 1)
            break
        lines += told
    heading = _verdict(check)
    return "\n".join([heading if len(heading) <= COLUMNS else f"{heading[: COLUMNS - 3]}...", *lines])


def _paragraph(label: str, text: str, most: int) -> list[str]:
    """A labelled text; what does not fit in so many lines is left out, see ``clauses``."""
    lines = clauses(text, COLUMNS - _LABEL, most)
    return [f"  {label if k == 0 else '':{_LABEL - 2}s}{line}" for k, line in enumerate(lines)]


def _verdict(check: Check) -> str:
    count = len(check.warnings)
    verdict = "fine" if count == 0 else f"{count} warning{'s' * (count > 1)}"
    return f"{check.title or 'scene'}: {verdict}"


def render(check: Check) -> str:
    """The whole result of a check as text."""
    width = max(len(effect.name) for effect in check.effects)
    rows = (f"{effect.name:{width}}  {'on' if effect.on else '-':2}  {effect.why}" for effect in check.effects)
    lines = [_verdict(check), *(f"  {row}" for row in rows), *_wrapped(_estimate(check.cost))]
    for purpose, attempts, limit in check.plan:
        lines += _wrapped(f"tried for {purpose}, until one has a solution: {'; '.join(attempts)} ({limit})")
    for finding in check.findings:
        lines += _wrapped(f"{finding.level}: {finding.path}: {finding.message}")
    return "\n".join(lines)


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, width=110, initial_indent="  ", subsequent_indent="    ", break_long_words=False)


def _estimate(cost: Cost) -> str:
    low, high = cost.linear_solves
    solves = f"{low}" if low == high else f"{low} to {high}"
    multigrid = cost.linear_algebra.startswith("krylov")
    factorisation = "a sparse factorisation would take" if multigrid else "one sparse factorisation"
    return (
        f"estimate, good to a factor of about three: {cost.unknowns} unknowns, {cost.contact_nodes} contact nodes, "
        f"{solves} linear solves ({cost.linear_algebra}); "
        f"{factorisation} {duration(cost.factorisation_seconds)} and {storage(cost.factorisation_bytes)}; "
        f"altogether {between(cost.seconds)} of linear algebra and {storage(cost.memory_bytes)}; "
        f"{next_accuracy(cost)}"
    )


def next_accuracy(cost: Cost) -> str:
    """What the next accuracy would take, before anything is known of the solution."""
    share = {0.1: "a tenth of", 0.5: "half"}.get(cost.next_error, f"{cost.next_error:.2g} of")
    how = "with --accuracy" if cost.next_local else "with all cells smaller"
    return f"{share} the error: {between(cost.next_seconds)} {how}"
