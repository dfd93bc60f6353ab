"""Algorithms (FP) and (ALM-FP), section 6.3: Coulomb friction as a fixed point of Tresca problems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signorini_fx.algorithms.ssn import SemismoothNewton
from signorini_fx.complementarity import ActiveSets, FrictionLaw, RegularisedData
from signorini_fx.results import Status


def fixed_point(
    newton: SemismoothNewton,
    data: RegularisedData,
    law: FrictionLaw,
    *,
    tolerance: float,
    max_outer: int,
    shift: bool = False,
) -> Status:
    """Iterate g <- lambda from the solution that ``newton`` holds, until g changes by no more than ``tolerance``.

    Args:
        newton: the inner method; holds the solution with the friction bound of the start (section 7: the pure contact
            problem, g = 0).
        data: gamma and the shifts; the bound is what this algorithm updates.
        law: gives the bound from the contact pressure.
        tolerance: for d_g = |g^m - g^(m-1)| / |g^m| in the norm of L2(Gamma_c), section 7.
        max_outer: Tresca problems allowed.
        shift: also lambda_hat <- lambda and mu_hat <- mu, which is Algorithm (ALM-FP): its limit is the unregularised
            solution.
    """
    problem = newton.problem
    g, shear = newton.multipliers()
    first_sets: ActiveSets | None = None
    if not problem.data.has_friction:
        # The start knows no slip: mu = xi = 0, hence stick everywhere.
        first_sets = ActiveSets(problem.following.contact, np.zeros_like(problem.following.slip))
    change = None
    for _ in range(max_outer):
        data = replace(data, bound=law.bound(g))
        if shift:
            data = replace(data, lambda_hat=g, mu_hat=shear)
        status = newton.solve(data, first_sets, change=change)
        if status is not Status.CONVERGED:
            return status
        first_sets = None
        previous = g
        g, shear = newton.multipliers()
        size = problem.boundary.norm(g)
        change = problem.boundary.norm(g - previous) / size if size > 0 else 0.0
        if change <= tolerance:
            return Status.CONVERGED
    return Status.OUTER_MAX_ITERATIONS
