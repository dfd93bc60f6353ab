"""The result of ``check`` as text for a terminal."""

from __future__ import annotations

import textwrap

from signorini_fx.check.checks import Check
from signorini_fx.check.cost import Cost
from signorini_fx.display import duration, storage


def render(check: Check) -> str:
    """The result of a check as text."""
    rows = [("effect", "", "why", "form", "unknowns", "linear solves")]
    for effect in check.effects:
        unknowns = f"{effect.unknowns:+d}" if effect.unknowns else ""
        low, high = effect.solves
        solves = "" if effect.solves == (0, 0) else f"{low:+d}" if low == high else f"{low:+d} to {high:+d}"
        rows.append((effect.name, "on" if effect.on else "-", effect.why, ", ".join(effect.forms), unknowns, solves))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    count = len(check.warnings)
    verdict = "fine" if count == 0 else f"{count} warning{'s' * (count > 1)}"
    lines = [f"{check.title or 'scene'}: {verdict}", *(f"  {line}" for line in lines), *_wrapped(_estimate(check.cost))]
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
        f"altogether {' to '.join(dict.fromkeys(map(duration, cost.seconds)))} and {storage(cost.memory_bytes)}"
    )
