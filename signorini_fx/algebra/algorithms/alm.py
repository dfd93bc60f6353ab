"""Algorithm (ALM), section 5: the first-order augmented Lagrangian method, for any friction law."""

from __future__ import annotations

from functools import partial

from signorini_fx.algebra.algorithms.augmentation import Augmentation
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.records import Status


def augmented_lagrangian(
    augmentation: Augmentation,
    data: RegularisedData,
    first_sets: ActiveSets | None,
    *,
    max_outer: int,
    first_iteration: int = 1,
    inner_iterations: int | None = None,
    gamma_factor: float = 1.0,
) -> Status:
    """Iterate lambda_hat <- lambda, mu_hat <- mu until both have settled, see ``augmentation``, each problem from the
    variables of the previous one (section 7.1); ``inner_iterations``: linear solves allowed for one problem (inexact
    ALM), None: until its sets repeat; ``gamma_factor``: growth of both gammas from one problem to the next.
    """
    newton = augmentation.newton
    for step in range(max_outer):
        status = newton.solve(
            data,
            first_sets,
            first_iteration=first_iteration,
            max_iterations=inner_iterations,
            measure=partial(_change, augmentation, data, first=step == 0),
        )
        inexact = inner_iterations is not None and status is Status.MAX_ITERATIONS
        if status is not Status.CONVERGED and not inexact:
            return status
        if step > 0 and augmentation.settled and not inexact:
            return Status.CONVERGED
        # A problem that was cut off continues with its last sets, a solved one with those of the new data.
        cut_off = newton.continued_sets(data) if inexact else None
        data = augmentation.next(data, gamma_factor)
        # At the old iterate the new shift counts every pressure twice, and a bound that depends on it.
        following = newton.problem.sets if data.follows is not None else newton.continued_sets(data)
        first_sets, first_iteration = cut_off or following, 1
    return Status.OUTER_MAX_ITERATIONS


def _change(augmentation: Augmentation, data: RegularisedData, *, first: bool) -> float | None:
    """How much lambda and mu differ from the previous ones, relative to their own norms."""
    change = augmentation.measure(data)
    return None if first else change
