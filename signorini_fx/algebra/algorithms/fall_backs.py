"""What is tried if a regularised problem with a given friction bound is not solved by full steps, see ``attempts``.

Each attempt goes on from where the one before has ended.  If all of them have failed, the problem is most likely one
that has no solution, such as one of a fixed-point iteration beyond a limit load.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.algebra.algorithms.interior_point import interior_point
from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.attempts import (
    AT_REST,
    CONVEX,
    FULL_STEPS,
    SMALLER_GAMMA,
    THROUGH_STICK,
    Attempt,
    for_problem,
    tried,
)
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.tuned import CLOSED_GAP, FALL_BACK_FIRST_SHARE, FALL_BACK_GROWTH


class FallBacks:
    """The fall-backs for the problems of a load step.

    Args:
        coordinate_error: what gaps are uncertain by, length.

    Attributes:
        exhausted: whether all of them have failed for one of its problems; then none is tried for the others.
        needless: asked before the first of them whether another solution ends the iteration, so that none is tried.
    """

    def __init__(self, coordinate_error: float = 0.0) -> None:
        self._coordinate_error = coordinate_error
        self.exhausted = False
        self.needless: Callable[[], bool] = lambda: False

    def __call__(
        self,
        newton: SemismoothNewton,
        data: RegularisedData,
        first_sets: ActiveSets | None,
        failed: Status,
        measure: Callable[[], float | None],
    ) -> Status:
        """The status of the first that solves the problem, else the original one, with the iterate that it left."""
        if self.exhausted or self.needless():
            return failed
        start = newton.checkpoint()
        ways = _ways(newton, data, first_sets, failed, measure)
        if (touching := _touching(newton, data, self._coordinate_error)) is not None:
            through = replace(data, sigma=np.inf)
            ways[AT_REST] = lambda: newton.solve_once(through, touching, measure)
        names = for_problem(finite_sigma=bool(np.isfinite(data.sigma)))
        statuses = tried(
            ((name, ways[name]) for name in names if name in ways),
            history=newton.history,
            settled=lambda status: status is Status.CONVERGED,
            told=lambda status: status.value,
        )
        if statuses[-1] is Status.CONVERGED:
            return Status.CONVERGED
        self.exhausted = len(statuses) > 1
        newton.restore(start)
        return failed


def _ways(
    newton: SemismoothNewton,
    data: RegularisedData,
    first_sets: ActiveSets | None,
    failed: Status,
    measure: Callable[[], float | None],
) -> dict[Attempt, Callable[[], Status]]:
    """What each attempt does, but for contact where the body rests, which may not hold it."""
    through = replace(data, sigma=np.inf)
    return {
        FULL_STEPS: lambda: failed,
        THROUGH_STICK: lambda: newton.solve_once(through, first_sets, measure),
        SMALLER_GAMMA: lambda: _path(newton, through, first_sets, measure),
        CONVEX: lambda: interior_point(newton, through, measure),
    }


def _touching(newton: SemismoothNewton, data: RegularisedData, coordinate_error: float) -> ActiveSets | None:
    """Contact and stick at the nodes without a gap, if these hold a body that supports do not; collective."""
    closed = touching_nodes(newton.problem.points.comm, data, coordinate_error)
    sets = ActiveSets.of(closed, np.zeros_like(data.mu_hat))
    nothing = replace(sets, contact=np.zeros_like(closed), slip=np.ones_like(closed))
    loose = not newton.problem.holds(nothing, data)
    return sets if loose and newton.problem.holds(sets, data) else None


def touching_nodes(comm: PETSc.Comm, data: RegularisedData, coordinate_error: float) -> npt.NDArray[np.bool_]:
    """The nodes without a gap where displacements are counted from, shape (n,); collective.

    On a straight side that lies on a straight foundation all gaps are round-off, which chooses no nodes.
    """
    gap = np.abs(data.gap)
    closed: npt.NDArray[np.bool_] = gap <= max(coordinate_error, CLOSED_GAP * parallel.largest(comm, gap))
    return closed


def _path(
    newton: SemismoothNewton,
    data: RegularisedData,
    first_sets: ActiveSets | None,
    measure: Callable[[], float | None],
) -> Status:
    """From a small gamma to the given one; a stage that fails leaves its iterate to the next fall-back."""
    share = FALL_BACK_FIRST_SHARE
    while True:
        share = min(share, 1.0)
        stage = replace(data, gamma_n=share * data.gamma_n, gamma_t=share * data.gamma_t)
        status = newton.solve_once(stage, first_sets, measure)
        if status is not Status.CONVERGED or share == 1.0:
            return status
        share *= FALL_BACK_GROWTH
        first_sets = newton.continued_sets(replace(data, gamma_n=share * data.gamma_n, gamma_t=share * data.gamma_t))
