"""A case, its finding and its verdict: plain data without dolfinx."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

CONVERGED = "converged"
# Outcomes that only the runner assigns.
TOO_LONG, CRASHED, RAISED = "time limit passed", "process died", "unexpected error"
# Verdicts, best first.
GOOD, REPORTED, RED = "as expected", "failure reported", "RED"


@dataclass(frozen=True)
class Finding:
    """The finding of a case.

    Attributes:
        outcome: how it ended: the text of a ``Status``, or the name of an error.
        solves: linear solves.
        certificate: largest figure of the certificate that is judged, relative; None where there is none.
        error: largest error against the reference of the case, relative; None without a reference.
        note: a remark for the table.
    """

    outcome: str
    solves: int = 0
    certificate: float | None = None
    error: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Case:
    """A problem for the solver.

    Attributes:
        name: unique in its group.
        run: solves it; called in a separate process, on every rank where there are several.
        wanted: the outcomes that are right.
        allowed: outcomes that report a failure although there is a solution; the note says why.
        target: largest error allowed where it converges.
        reference: what the error is measured against.
        seconds: time limit.
        ranks: on how many ranks it runs.
        note: why it may end as ``allowed`` says, and what to do then.
    """

    name: str
    run: Callable[[], Finding]
    wanted: tuple[str, ...] = (CONVERGED,)
    allowed: tuple[str, ...] = ()
    target: float | None = None
    reference: str = ""
    seconds: float = 120.0
    ranks: int = 1
    note: str = ""


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    group: str
    case: str
    outcome: str
    solves: int
    certificate: float | None
    error: float | None
    target: float | None
    reference: str
    ranks: int
    seconds: float
    verdict: str
    note: str

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Row:
        """A row from the message of a worker."""
        return cls(**data)


def judge(group: str, case: Case, found: Finding, seconds: float) -> Row:
    """The verdict: a wrong answer is red whatever its outcome; other outcomes must be wanted or allowed."""
    verdict, notes = GOOD, [found.note]
    wrong = case.target is not None and (found.error is None or not found.error <= case.target)
    if found.outcome == CONVERGED and found.certificate is not None and not found.certificate <= 1e-6:
        verdict = RED
        notes.append("converged without a certificate")
    elif found.outcome in case.wanted:
        if wrong and found.outcome == CONVERGED:
            verdict = RED
    elif found.outcome in case.allowed:
        verdict = REPORTED
        notes.append(case.note)
    else:
        verdict = RED
        notes.append(f"wanted: {' or '.join(case.wanted)}")
    return Row(
        group=group,
        case=case.name,
        outcome=found.outcome,
        solves=found.solves,
        certificate=_number(found.certificate),
        error=_number(found.error),
        target=case.target,
        reference=case.reference,
        ranks=case.ranks,
        seconds=seconds,
        verdict=verdict,
        note="; ".join(note for note in notes if note),
    )


def _number(value: float | None) -> float | None:
    """JSON and CSV have no NaN: it counts as infinite."""
    return None if value is None else float(value) if math.isfinite(value) else 1e300
