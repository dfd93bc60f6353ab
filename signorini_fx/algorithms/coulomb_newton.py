"""Monolithic Coulomb friction (not in the paper): the bound F lambda(y) is differentiated too.

The map mu - clip(mu_hat + gamma_2 tau_T y, -F lambda(y), F lambda(y)) with lambda(y) of (3.3b) is as semi-smooth as
(3.4); its generalised derivative has d mu / d tau_N y = +-F gamma_1 at slip nodes in contact, so the tangent is
unsymmetric.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from signorini_fx.algorithms.ssn import SemismoothNewton
from signorini_fx.complementarity import ActiveSets, FrictionLaw, RegularisedData
from signorini_fx.results import Status


def coulomb_newton(
    newton: SemismoothNewton,
    data: RegularisedData,
    law: FrictionLaw,
    first_sets: ActiveSets | None,
    fall_back: Callable[[], Status],
) -> Status:
    """Solve the Coulomb problem in one semi-smooth Newton iteration.

    Newton's method is local: from a poor start its sets may cycle.  Then the start is restored and the fixed point,
    whose inner problems have one solution each, takes over.

    Args:
        newton: the inner method with an unsymmetric solver; its iterate is the start (the pure contact problem).
        data: gamma and the shifts.
        law: the friction law.
        first_sets: sets of the first linear solve; None: from the iterate.
        fall_back: the fixed point iteration from the same start.
    """
    problem = newton.problem
    start, start_sets = newton.x.copy(), problem.sets
    status = newton.solve(replace(data, bound=law.given, coupling=law.coefficient), first_sets)
    if status in (Status.CONVERGED, Status.SINGULAR):
        return status
    newton.history.add(f"monolithic Newton ended with '{status.value}': fixed point from the same start")
    start.copy(newton.x)
    problem.sets = start_sets
    return fall_back()
