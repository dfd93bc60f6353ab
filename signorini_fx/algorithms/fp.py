"""Algorithms (FP) and (ALM-FP), section 6.3: Coulomb friction as a fixed point of Tresca problems."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from signorini_fx.algorithms.ssn import SemismoothNewton
from signorini_fx.complementarity import ActiveSets, FrictionLaw, Nodal, RegularisedData
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
    for _ in range(max_outer):
        data = replace(data, bound=law.bound(g))
        if shift:
            data = replace(data, lambda_hat=g, mu_hat=shear)
        status = newton.solve(data, first_sets, measure=partial(_change, newton, g))
        if status is not Status.CONVERGED:
            return status
        first_sets = None
        change = newton.history.outer[-1].change
        g, shear = newton.multipliers()
        if change is not None and change <= tolerance:
            return Status.CONVERGED
    return Status.OUTER_MAX_ITERATIONS


def _change(newton: SemismoothNewton, g: Nodal) -> float:
    """d_g of section 7: the new g is the pressure that the old one led to."""
    following, _ = newton.multipliers()
    norm = newton.problem.boundary.norm
    size = norm(following)
    return norm(following - g) / size if size > 0 else 0.0
