"""Algorithm (ALM), section 5: the first-order augmented Lagrangian method, for any friction law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from signorini_fx.algorithms.ssn import SemismoothNewton
from signorini_fx.complementarity import ActiveSets, Nodal, RegularisedData
from signorini_fx.results import Status


def augmented_lagrangian(
    newton: SemismoothNewton,
    data: RegularisedData,
    first_sets: ActiveSets | None,
    *,
    first_iteration: int,
    tolerance: float,
    max_outer: int,
    inner_iterations: int | None = None,
    gamma_factor: float = 1.0,
    watch: Callable[[Nodal, Nodal], bool] | None = None,
) -> Status:
    """Iterate lambda_hat <- lambda, mu_hat <- mu until they change by no more than ``tolerance``.

    Each problem starts from the variables of the one before (section 7.1).

    Args:
        newton: the inner method.
        data: the first problem; its gamma stays, or grows.
        first_sets: sets of the very first linear solve.
        first_iteration: number of the very first linear solve.
        tolerance: for the change of lambda and of mu in the norm of L2(Gamma_c), relative to their own.
        max_outer: regularised problems allowed.
        inner_iterations: linear solves allowed for one problem (inexact ALM); None: until its sets repeat.
        gamma_factor: growth of gamma_1 and gamma_2 from one problem to the next.
        watch: called with (lambda, mu) after each problem; True ends the iteration as converged.
    """
    for step in range(max_outer):
        shifts = (data.lambda_hat, data.mu_hat) if step > 0 else None
        status = newton.solve(
            data,
            first_sets,
            first_iteration=first_iteration,
            max_iterations=inner_iterations,
            measure=partial(_change, newton, data, shifts),
        )
        inexact = inner_iterations is not None and status is Status.MAX_ITERATIONS
        if status is not Status.CONVERGED and not inexact:
            return status
        pressure, shear = newton.shifts(data)
        if watch is not None and watch(pressure, shear):
            return Status.CONVERGED
        change = newton.history.outer[-1].change
        if change is not None and change <= tolerance and not inexact:
            return Status.CONVERGED
        # A problem that was cut off goes on with the sets that it has come to, a solved one with those of the new data.
        cut_off = newton.continued_sets(data) if inexact else None
        data = replace(
            data,
            lambda_hat=pressure,
            mu_hat=shear,
            gamma_n=data.gamma_n * gamma_factor,
            gamma_t=data.gamma_t * gamma_factor,
        )
        # At the old iterate the new shift counts every pressure twice, and a bound that follows it.
        following = newton.problem.sets if data.coupling is not None else newton.continued_sets(data)
        first_sets, first_iteration = cut_off or following, 1
    return Status.OUTER_MAX_ITERATIONS


def _change(newton: SemismoothNewton, data: RegularisedData, before: tuple[Nodal, Nodal] | None) -> float | None:
    """How much lambda and mu differ from those before, relative to their own norms."""
    if before is None:
        return None
    pressure, shear = newton.shifts(data)
    norm = newton.problem.boundary.norm
    size = norm(pressure) + norm(shear) or norm(before[0]) + norm(before[1])
    return (norm(pressure - before[0]) + norm(shear - before[1])) / size if size > 0 else 0.0
