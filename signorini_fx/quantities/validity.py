"""What the figures of a summary are worth: of which solution they are, or of none."""

from __future__ import annotations

from enum import Enum
from typing import Any

from signorini_fx.records import SHORT_OF_ACCURACY, Status


class Validity(Enum):
    """Of what the figures of a summary are."""

    SOLUTION = "the solution of the scene"
    LESS_ACCURATE = "a certified solution that is less accurate than required"
    EARLIER_STEP = "the last load step with a solution, before the one that failed"
    NO_SOLUTION = "the last iterate, which is no result"

    @property
    def solved(self) -> bool:
        """Whether the figures are those of a solution, be it of an earlier load step."""
        return self is not Validity.NO_SOLUTION


def validity_of(summary: dict[str, Any]) -> Validity:
    """What the figures of a summary are of."""
    status = Status(summary["status"])
    if status is Status.CONVERGED:
        return Validity.SOLUTION
    if status in SHORT_OF_ACCURACY:
        return Validity.LESS_ACCURATE
    if summary.get("results_of", {}).get("status") == Status.CONVERGED.value:
        return Validity.EARLIER_STEP
    return Validity.NO_SOLUTION


def was_solved(summary: dict[str, Any]) -> bool:
    """Whether there are figures, be they of an iterate: what statics excludes is not solved."""
    return validity_of(summary).solved or summary["linear_solves"] > 0
