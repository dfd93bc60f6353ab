"""All that a solve of a nonlinear body changes, at the end of the last one with a solution: a failure takes it back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.algorithms.task import Outcome
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.step_frames import LastSolution


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
