"""How solves of nonlinear bodies end: which outcomes mean what, in words, and what a failure takes back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.algorithms.task import Outcome
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.records import Status
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.step_frames import LastSolution

# What the statics of linear bodies prove.
OF_LINEAR_BODIES = (
    Status.OPEN,
    Status.TIPS,
    Status.SLIDES,
    Status.SLIDES_AT_PRESSURES,
    Status.TOO_LARGE,
    Status.SINGULAR,
)
# How a solve ends that says nothing of the stiffness.
NOT_BY_STIFFNESS = (
    Status.PASSED,
    Status.FOLDED,
    Status.AT_END,
    Status.INSIDE,
    Status.TOO_LARGE,
    Status.NO_DIGIT,
    Status.NOT_CERTIFIED,
    Status.NO_MEMORY,
    Status.NOT_HELD,
    Status.OPEN,
)
# What smaller steps do not change.
FINAL = (Status.STABILITY_UNKNOWN, Status.NO_DIGIT, Status.NO_MEMORY, Status.NOT_HELD, Status.OPEN)


def failure(status: Status, certificate: Certificate | None, says_no: str, detail: str) -> str:
    """How a solve ends that has no solution, in words; ``certificate``: of its last iterate; ``says_no``: why there may
    be no solution; ``detail``: what is wrong, or where; empty: nothing is known.
    """
    reason = says_no or detail
    if not reason and certificate is not None and status in (Status.NOT_CERTIFIED, Status.MAX_ITERATIONS):
        reason = f"{certificate.worst_name} {certificate.worst:.1e}"
    ended = "deformation too large for small strains" if status is Status.TOO_LARGE else status.value
    return ended + (f" ({reason})" if reason else "")


def advice_on(status: Status) -> str:
    """What to do about the outcome of a solve; iterations are those of Newton's method."""
    return (Status.NOT_SOLVED if status is Status.MAX_ITERATIONS else status).advice


@dataclass(frozen=True)
class State:
    """A solution, or what there is before the first one.

    Attributes:
        displacement: values of ``u``, ghosts included.
        contact: the contact points; None: there is no solution.
        outcome: of the contact problem of the last iteration; None: there is none.
        guess: where the next solve may begin; None: as the load step does.
        certificate: of the solution; None: there is none.
        iterations: of Newton's method.
        shapes: of the foundations, where they were placed, by their numbers.
        tools: coordinates of those that forces move, lengths, shape (t, m), see ``MovingTools``.
    """

    displacement: npt.NDArray[np.float64]
    contact: ContactState | None
    outcome: Outcome | None
    guess: LastSolution | None
    certificate: Certificate | None
    iterations: int
    shapes: dict[int, Any]
    tools: npt.NDArray[np.float64]
