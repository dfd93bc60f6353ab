"""What to try, in which order, if a regularised problem is not solved by full steps.

One fall-back after the other is tried, each recorded in the history, until one of them ends with a solution of the
original problem:

1. *through stick*: with a finite sigma, the same iteration with an infinite one, which lets no node jump from one slip
   set to the other;
2. *contact where the body rests*: for a body that only contact holds, the same from the nodes that touch when the load
   has moved the rigid body to its resting place (``resting``);
3. *smaller gamma*: continuation from a gamma at which there are hardly any constraints up to the given one, each
problem
   started from the previous one;
4. *descent*: Newton steps whose length minimises the energy; they cannot cycle;
5. both: the continuation of 3., with the steps of 4. for every stage that cycles.

The friction bound of the problem must be given.  Further fall-backs (augmentation, other outer iterations, coarser
meshes) do not concern a single regularised problem and are in ``strategy`` and ``solver``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from signorini_fx import parallel
from signorini_fx.algorithms.descent import energy_descent
from signorini_fx.algorithms.ssn import SemismoothNewton
from signorini_fx.contact.laws import ActiveSets, RegularisedData
from signorini_fx.records import Status
from signorini_fx.tuned import FALL_BACK_FIRST_SHARE, FALL_BACK_GROWTH

# A gap below this share of the largest one is closed.
_CLOSED = 1e-6

FallBack = tuple[str, Callable[[], Status]]


def try_fall_backs(
    newton: SemismoothNewton,
    data: RegularisedData,
    first_sets: ActiveSets | None,
    failed: Status,
    measure: Callable[[], float | None],
) -> Status:
    """Try the fall-backs in order; the status of the first that solves the problem, else the original one."""
    start = newton.checkpoint()
    reason = failed
    for name, fall_back in _in_order(newton, data, first_sets, measure):
        newton.history.add(f"{reason.value}: {name}")
        status = fall_back()
        if status is Status.CONVERGED:
            return status
        reason = status
    newton.problem.set_data(data)  # not those of the last fall-back
    newton.restore(start)
    return failed


def _in_order(
    newton: SemismoothNewton,
    data: RegularisedData,
    first_sets: ActiveSets | None,
    measure: Callable[[], float | None],
) -> Iterator[FallBack]:
    if np.isinf(data.gamma_n):  # elimination has no penalty to reduce, and no energy for a descent
        return
    through = replace(data, sigma=np.inf)
    if np.isfinite(data.sigma):
        yield "through stick", lambda: newton.solve_once(through, first_sets, measure)
    touching = _touching(newton, data)
    if touching is not None:
        yield "contact where the body rests", lambda: newton.solve_once(through, touching, measure)
    yield "smaller gamma", lambda: _path(newton, through, first_sets, measure, descend=False)
    yield "descent", lambda: energy_descent(newton, through, measure)
    yield "smaller gamma with descent", lambda: _path(newton, through, first_sets, measure, descend=True)


def _touching(newton: SemismoothNewton, data: RegularisedData) -> ActiveSets | None:
    """Contact and stick at the nodes without a gap, if these hold a body that supports do not; collective."""
    comm, gap = newton.problem.system.comm, np.abs(data.gap)
    closed = gap <= _CLOSED * parallel.global_max(comm, parallel.local_max(gap))
    sets = ActiveSets.of(closed, np.zeros_like(data.mu_hat))
    nothing = replace(sets, contact=np.zeros_like(closed), slip=np.ones_like(closed))
    loose = not newton.problem.holds(nothing, data)
    return sets if loose and newton.problem.holds(sets, data) else None


def _path(
    newton: SemismoothNewton,
    data: RegularisedData,
    first_sets: ActiveSets | None,
    measure: Callable[[], float | None],
    *,
    descend: bool,
) -> Status:
    """From a small gamma to the given one; a stage that fails leaves its iterate to the next fall-back, or descends."""
    share = FALL_BACK_FIRST_SHARE
    while True:
        share = min(share, 1.0)
        stage = replace(data, gamma_n=share * data.gamma_n, gamma_t=share * data.gamma_t)
        status = newton.solve_once(stage, first_sets, measure)
        if status is Status.CYCLING and descend:
            status = energy_descent(newton, stage, measure)
        if status is not Status.CONVERGED or share == 1.0:
            return status
        share *= FALL_BACK_GROWTH
        first_sets = newton.continued_sets(replace(data, gamma_n=share * data.gamma_n, gamma_t=share * data.gamma_t))
