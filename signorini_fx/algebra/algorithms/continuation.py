"""Continuation in gamma (section 7.1, Table 4): regularised problems in turn, each started from the previous one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.records import Status


def continuation(
    newton: SemismoothNewton,
    data: RegularisedData,
    first_sets: ActiveSets | None,
    gammas: Sequence[tuple[float, float]],
    *,
    first_iteration: int,
) -> Status:
    """Solve for each (gamma_1, gamma_2) in turn, smallest first; ``first_sets`` and ``first_iteration``: of the very
    first linear solve.
    """
    status = Status.CONVERGED
    for step, (gamma_n, gamma_t) in enumerate(gammas):
        data = replace(data, gamma_n=gamma_n, gamma_t=gamma_t)
        if step > 0:
            first_sets, first_iteration = newton.continued_sets(data), 1
        status = newton.solve(data, first_sets, first_iteration=first_iteration)
        if status is not Status.CONVERGED:
            break
    return status
