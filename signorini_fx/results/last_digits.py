"""What the last digits of a displacement leave of equilibrium, which no solver in double precision can do better than.

In cells that are flat or small beside the body, stiffness times displacement has digits that the forces do not have:
their ratio is that of the sides of cells.  Refining a linear solve, or another factorisation, changes nothing there.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from signorini_fx.machine import parallel
from signorini_fx.mechanics.model import Model
from signorini_fx.records import Finding, Status
from signorini_fx.results.certificate.certificate import balance_of
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.tuned import ROUNDINGS, UNITS_OF_PLACES


def status_by_digits(
    model: Model, displacement: fem.Function, missing: float, step: float
) -> tuple[Status, Finding | None]:
    """Whether a linear solve whose certificate misses by so much has lost digits that no solver has, and why; for the
    other arguments see ``left_by_last_digits``; collective.
    """
    share = left_by_last_digits(model, displacement, step)
    if not missing <= UNITS_OF_PLACES * share:
        return Status.NOT_CERTIFIED, None
    message = (
        f"cells are too flat or too small beside the body: the last digit of the displacement alone leaves {share:.1g} "
        f"of the loads, and the solution may be wrong by as much; make the smallest cells larger, and less flat"
    )
    return Status.ROUND_OFF, Finding("warning", "mesh", message)


def left_by_last_digits(model: Model, displacement: fem.Function, step: float) -> float:
    """The forces at free unknowns that one unit in the last place of each displacement makes, with random signs, as a
    share of the loads there; collective.
    """
    forces, comm, changed = NodalForces.on(model), model.comm, displacement.copy()
    balance = balance_of(forces, displacement, step)
    supports, loads = balance.supports, balance.supports.left(balance.external + balance.initial)
    rng, squares = np.random.default_rng(comm.rank), 0.0
    for _ in range(ROUNDINGS):
        signs = rng.choice(np.array([-1.0, 1.0]), displacement.x.array.size)
        changed.x.array[:] = np.finfo(float).eps * signs * displacement.x.array
        changed.x.scatter_forward()
        squares += float(np.sum(supports.left(forces.internal(changed)) ** 2)) / ROUNDINGS
    left, acting = np.sqrt(parallel.global_sum(comm, np.array([squares, np.sum(loads**2)])))
    return float(left / acting) if acting > 0 else 0.0
