"""Algorithms (FP) and (ALM-FP), section 6.3: Coulomb friction by a fixed-point iteration of Tresca
problems.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData, slip_of
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.arrays import Array, length, quotient
from signorini_fx.records import Status
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, NEGLIGIBLE

if TYPE_CHECKING:
    from signorini_fx.algebra.algorithms.alm import Augmentation


def fixed_point(
    newton: SemismoothNewton,
    data: RegularisedData,
    law: PointFriction,
    start: tuple[Array, Array],
    first_sets: ActiveSets | None,
    *,
    tolerance: float,
    max_outer: int,
    augmentation: Augmentation | None = None,
) -> Status:
    """Iterate g <- lambda until g changes by no more than ``tolerance``; with augmentation, until
    mu has converged too.

    The norm of section 7 is a mean over the contact boundary, to which a single point of small
    weight hardly contributes.  So the friction bound must agree with the law at each point as well.
    Each group of points has its own norms, so that a body with large tractions does not hide the
    error of another one.

    Args:
        newton: the inner method.
        data: the regularised problem.
        law: the friction law.
        start: (lambda, mu) of the pure contact problem, g = 0 (section 7).
        first_sets: active sets of the first linear solve; None: from the iterate of ``newton``.
        tolerance: for d_g = |g^m - g^(m-1)| / |g^m| in the norm of L2(Gamma_c) (section 7).
        max_outer: Tresca problems allowed.
        augmentation: also iterates lambda_hat <- lambda and mu_hat <- mu, which is Algorithm
            (ALM-FP): its limit is the unregularised solution; None: (FP).
    """
    g = start[0]
    norms = newton.problem.groups.norms
    previous: Array | None = None
    if augmentation is not None:
        data = replace(data, lambda_hat=start[0], mu_hat=start[1])
    for _ in range(max_outer):
        data = replace(data, bound=law.evaluate(g, 0.0)[0])
        if law.follows_slip:  # only the pressure is fixed, the slip is that of the iterate
            data = replace(data, follows=replace(law, pressure=np.abs(g)))
        status = newton.solve(
            data, first_sets, measure=partial(_change, newton, data, g, augmentation)
        )
        if status is not Status.CONVERGED:
            return status
        first_sets = None
        change = newton.history.outer[-1].change
        pressure, _ = newton.multipliers()
        settled = (
            change is not None
            and change <= tolerance
            and (augmentation is None or augmentation.settled)
        )
        if settled and _missed(newton, data, law) <= max(tolerance, CERTIFICATE_TOLERANCE):
            return Status.CONVERGED
        # The Tresca problem with a given bound has a unique pressure, so a pressure that recurs
        # after two steps recurs for ever.
        if augmentation is None and previous is not None:
            back = norms(pressure - previous) <= NEGLIGIBLE * norms(pressure - g)
            measured = change is not None and newton.problem.groups.count == 1
            left = (np.array([change]) if measured else _changes(newton, g)) > tolerance
            if np.any(back & left) if left.any() else back.all():
                newton.history.add("the fixed point alternates between two friction bounds")
                return Status.OUTER_MAX_ITERATIONS
        previous, g = g, pressure
        if augmentation is not None:
            data = augmentation.next(data)
    return Status.OUTER_MAX_ITERATIONS


def _change(
    newton: SemismoothNewton, data: RegularisedData, g: Array, augmentation: Augmentation | None
) -> float:
    """Return the largest d_g of all groups of points; with augmentation, at least the change of the
    multipliers.
    """
    change = float(_changes(newton, g).max())
    return change if augmentation is None else max(change, augmentation.measure(data))


def _changes(newton: SemismoothNewton, g: Array) -> Array:
    """Return d_g of section 7 for each group of points, shape (groups,); collective.

    The new g is the pressure that was found with the old ``g``.
    """
    following, shear = newton.multipliers()
    problem = newton.problem
    points = newton.problem.points
    groups = newton.problem.groups
    # The relative change of a pressure that vanishes is 1.
    size = groups.norms(points.felt(following, shear))
    if not size.all():
        size = np.where(size > 0, size, groups.norms(points.felt(g)))
    return quotient(groups.norms(following - g), problem.scales(size, newton.x))


def _missed(newton: SemismoothNewton, data: RegularisedData, law: PointFriction) -> float:
    """Return the largest difference between the friction bound used and that of the law at the
    pressure found, relative to the largest traction of its group; collective.
    """
    pressure, shear = newton.multipliers()
    points = newton.problem.points
    groups = newton.problem.groups
    u_n, u_t = newton.problem.system.contact.traces(newton.x)
    data = data.at((u_n, u_t))
    following = data.acting(law.evaluate(pressure, length(slip_of(u_t, data)))[0])
    bound = data.friction_bound(pressure, u_t)
    # The bound of a bond is infinite.
    away = np.abs(
        np.subtract(following, bound, out=np.zeros_like(bound), where=np.isfinite(following))
    )
    felt = np.maximum(points.felt(pressure, shear), points.felt(shear, pressure))
    largest, size, any_size = map(groups.largest, (away, felt, np.abs(pressure)))
    return float(
        quotient(largest, newton.problem.scales(np.where(size > 0, size, any_size), newton.x)).max()
    )
