"""The limit of a ramp: the loads of its last load step with a solution, and why it ended there."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor

import numpy as np

from signorini_fx.arrays import Array
from signorini_fx.machine import parallel
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import ForceDensity
from signorini_fx.quantities.summary import LimitOfRamp
from signorini_fx.records import Finding, Status
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.tuned import NEGLIGIBLE

# Outcomes of methods that have found no solution, which does not mean that there is none.
UNDECIDED = (
    Status.CYCLING,
    Status.MAX_ITERATIONS,
    Status.OUTER_MAX_ITERATIONS,
    Status.SLIDES_AT_PRESSURES,
)
_WAYS = {Status.SLIDES: "slides", Status.TIPS: "tips over", Status.OPEN: "lifts off"}


def growing_force(model: Model, place: float) -> tuple[Array, Array]:
    """Return the resultant of the growing forces at a position on the path and at the next factor,
    shape (d,) each.  Collective.

    In 2D forces are per thickness; of axisymmetric bodies only the axial component is returned.  It
    is zero if no force grows.
    """
    places = (place, floor(place) + 1.0)
    along = slice(None) if model.kinematics.uniform else [1]
    total = np.zeros((2, model.dimension))[:, along]
    loads = model.statement.of(ForceDensity)
    for load in loads:
        at_nodes = [NodalForces.on(model).external(at, [load]) for at in places]
        rows = np.array([forces.sum(axis=0)[along] for forces in at_nodes])
        pair = parallel.global_sum(model.comm, rows)
        if np.linalg.norm(pair[1] - pair[0]) > NEGLIGIBLE * np.linalg.norm(pair[1]):
            total += pair
    return total[0], total[1]


def motion_in_words(
    status: Status | None, moving: Sequence[str] = ("the body",), at_rest: Sequence[str] = ()
) -> str:
    """Return how bodies leave their equilibrium, such as: upper slides on lower; "" if the status
    is no motion.
    """
    if status not in _WAYS:
        return ""
    on = f" on {' and '.join(at_rest)}" if at_rest and status is not Status.OPEN else ""
    return f"{' and '.join(moving)} {_WAYS[status]}{on}"


def ended_by(status: Status, told: Sequence[Finding]) -> str:
    """Return in a few words how a ramp has ended.

    Args:
        status: status of the load step without a solution.
        told: findings about that step.
    """
    ended = next((found.ended for found in told if found.ended), "") or motion_in_words(status)
    return ended or f"{'most likely, ' * (status in UNDECIDED)}{status.value}"


def limit_of_ramp(model: Model, time: float, place: float, loads: str, reason: str) -> LimitOfRamp:
    """Return the limit of a ramp at its last solution.  Collective.

    Args:
        model: the body on its mesh.
        time: time of the last solution.
        place: its position in the lists of load factors.
        loads: the loads that the body carries there, in words.
        reason: how the ramp has ended, see ``ended_by``.
    """
    held, full = map(np.linalg.norm, growing_force(model, place)) if loads else (0.0, 0.0)
    force = {"force": float(held), "full_force": float(full)} if full > 0.0 else {}
    return LimitOfRamp(time=time, loads=loads, reason=reason, **force)
