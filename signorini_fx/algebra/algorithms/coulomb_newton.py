"""Monolithic Coulomb friction (not in the paper): the bound F lambda(y) is differentiated too.

The map mu - clip(mu_hat + gamma_2 tau_T y, -F lambda(y), F lambda(y)) with lambda(y) of (3.3b) is as semi-smooth as
(3.4); its generalised derivative has d mu / d tau_N y = +-F gamma_1 at slip nodes in contact, so the tangent is
unsymmetric.
"""

from __future__ import annotations

from dataclasses import replace

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.records import Status


def coulomb_newton(
    newton: SemismoothNewton,
    data: RegularisedData,
    law: PointFriction,
    first_sets: ActiveSets | None,
) -> Status:
    """Solve the Coulomb problem in one semi-smooth Newton iteration of an inner method with an unsymmetric solver, from
    its iterate (the pure contact problem). Newton's method converges locally: from a poor start its sets may cycle.
    Then the fixed-point iteration, whose inner problems have unique solutions, has to be used.
    """
    return newton.solve(replace(data, bound=law.given, follows=law), first_sets)
