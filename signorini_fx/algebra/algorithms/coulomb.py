"""Coulomb friction: start values, the fixed-point iteration of Tresca problems (FP) and (ALM-FP) of
section 6.3, the monolithic method, proofs by statics that no solution exists, and augmentation as
a fall-back.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData, slip_of
from signorini_fx.algebra.contact.friction import PointFriction, as_given
from signorini_fx.algebra.contact.statics import largest_multiple, no_balance, reactions
from signorini_fx.algebra.regularised import RegularisedProblem
from signorini_fx.arrays import Array, Flags, length, quotient, unit
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.tuned import (
    AUTOMATIC_GAMMA,
    CERTIFICATE_TOLERANCE,
    CONTINUATION_SHARE,
    NEGLIGIBLE,
)

if TYPE_CHECKING:
    from signorini_fx.algebra.algorithms.alm import Augmentation


def coulomb_start(task: Task, data: RegularisedData) -> RegularisedData:
    """Return the problem that starts Coulomb friction (section 7): pure contact without friction, g
    = 0.

    A body that cannot be held without friction starts from stick instead.  Its nodes stick
    everywhere, unless stick would hold it without any contact, as a ring with clearance around a
    pin: then only the nodes that touch at the reference motion stick.
    """
    motions = task.motions
    everywhere = task.motions.points.everywhere

    def possible(stick: Flags) -> bool:
        """Return whether contact can hold the body and balance its load if only these nodes have
        friction, and they stick.
        """
        held = motions.held_by(everywhere, stick)
        law = as_given(np.where(stick, np.inf, 0.0))
        return held and no_balance(law, data.bilateral, motions, task.system.resultant) is None

    if possible(~everywhere):
        return replace(data, bound=None)
    stick = everywhere
    if motions.held_by(~everywhere, everywhere):
        # On a straight side that lies on a straight foundation all gaps are round-off, which must
        # not select nodes; hence the tolerance.
        gap = np.abs(data.gap)
        largest = parallel.largest(task.motions.points.comm, gap)
        touching = gap <= max(task.coordinate_error, CERTIFICATE_TOLERANCE * largest)
        stick = touching if possible(touching) else everywhere
    return replace(data, bound=np.where(stick, np.inf, 0.0))


def proved(task: Task, problem: RegularisedProblem, law: PointFriction, status: Status) -> Status:
    """Return the outcome of a Coulomb problem after a method has ended with ``status``.

    If a body moves away under the friction bound of one Tresca problem, this proves nothing about
    the Coulomb law, as that bound comes from the previous pressure.  If statics shows that the law
    itself allows no equilibrium, that is the outcome.  Otherwise, as always where the pressure is
    statically indeterminate, only the fixed-point iteration has failed, and another method may find
    a solution: then the status is SLIDES_AT_PRESSURES, or OUTER_MAX_ITERATIONS if friction at the
    last bound could carry the loads.
    """
    if status not in (Status.SLIDES, Status.TIPS, Status.OPEN, Status.NOT_HELD):
        return status
    data = problem.data
    everywhere = task.motions.points.everywhere
    if status is Status.NOT_HELD and not task.motions.held_by(everywhere, law.acts):
        return status
    motions = task.motions
    resultant = task.system.resultant
    at_rest = task.system.load.norm() == task.system.start.norm() == 0.0
    lost = no_balance(law, data.bilateral, motions, resultant, data.gap if at_rest else None)
    if lost is not None:
        return lost.status
    task.history.add(
        f"{status.value}: with the friction bound of the previous pressure, not with the law"
    )
    # A multiple of the loads above which no pressures, and no shears up to the given bound, carry
    # them.
    assert data.bound is not None  # as the law has friction
    allowed = reactions(motions, as_given(data.bound), data.bilateral)
    loaded = [
        (number, columns) for number, columns in motions.assemblies if resultant[columns].any()
    ]
    share = min(
        (largest_multiple(allowed.of(number, at), resultant[at]) for number, at in loaded),
        default=np.inf,
    )
    if share >= 1.0:
        return Status.OUTER_MAX_ITERATIONS
    task.history.add(f"friction at this pressure carries at most {share:.5g} of the loads")
    return Status.SLIDES_AT_PRESSURES


def coulomb_newton(
    task: Task,
    data: RegularisedData,
    law: PointFriction,
    first_sets: ActiveSets | None,
    *,
    augmented: bool,
) -> Status:
    """Solve the Coulomb problem by semi-smooth Newton iterations with the friction bound coupled to
    the pressure, which makes the tangent unsymmetric; not in the paper.

    Without augmentation this is one iteration from the present iterate (the pure contact problem);
    ``augmented`` runs one for each update of the augmented Lagrangian method.

    The map mu - clip(mu_hat + gamma_2 tau_T y, -F lambda(y), F lambda(y)) with lambda(y) of (3.3b)
    is as semi-smooth as (3.4); its derivative has d mu / d tau_N y = +-F gamma_1 at slip nodes in
    contact.  It converges locally: from a poor start its sets may cycle.
    """
    without_pressure, _, _ = law.evaluate(np.zeros_like(data.gap), 0.0)
    coupled = replace(data, bound=without_pressure, follows=law)
    newton = task.unsymmetric_newton
    if not augmented:
        status = newton.solve(coupled, first_sets)
        return newton.solve(coupled, _slipping(newton)) if status is Status.CYCLING else status
    from signorini_fx.algebra.algorithms.alm import augmented_lagrangian

    max_outer = task.settings.max_outer_iterations
    return augmented_lagrangian(
        augmentation_on(task, newton), coupled, first_sets, max_outer=max_outer
    )


def _slipping(newton: SemismoothNewton) -> ActiveSets:
    """Return the sets of a cycle with all points that change set to contact and slip.

    Where friction is large, a point of the cycle penetrates if it is open and is pulled if it
    sticks; in the solution it slips.
    """
    problem = newton.problem
    sets, following = problem.sets, problem.next.sets
    changing = sets.changed(following)
    _, u_t = problem.system.contact.traces(newton.x)
    along = unit(slip_of(u_t, problem.data))
    for either in (sets, following):
        along = np.where(either.slip[:, None], either.direction, along)
    direction = np.where(changing[:, None], along, sets.direction)
    return ActiveSets.of(sets.contact | changing, direction)


def by_augmentation(task: Task, start: Start, law: PointFriction, begun: Outcome) -> Outcome:
    """Solve the Coulomb problem by the augmented Lagrangian method, the last fall-back.

    It leaves no regularisation error and removes the elastic slip of earlier load steps.  It starts
    from the multipliers of the previous load step if there are any, otherwise from
    ``coulomb_start``.

    Args:
        task: the contact problem.
        start: the initial state of the load step.
        law: the friction law.
        begun: the outcome with the problem of the method that has failed.
    """
    newton = task.newton
    multipliers = start.multipliers
    # The limit is the same for every gamma: a small one makes the problems easiest.
    gammas = CONTINUATION_SHARE * begun.data.gamma_n, CONTINUATION_SHARE * begun.data.gamma_t
    slip_origin = begun.data.slip_origin - start.elastic_slip
    data = replace(begun.data, slip_origin=slip_origin, gamma_n=gammas[0], gamma_t=gammas[1])
    failed = replace(begun, newton=newton, monolithic=False)
    if multipliers is None:
        status = newton.solve(
            coulomb_start(task, data), ActiveSets.all_in_contact(*data.mu_hat.shape)
        )
        if status is not Status.CONVERGED:
            return replace(failed, status=proved(task, newton.problem, law, status))
        multipliers = newton.multipliers()
    shifted = replace(data, lambda_hat=multipliers[0], mu_hat=multipliers[1])
    status = coulomb_newton(task, shifted, law, newton.problem.sets, augmented=True)
    if status is not Status.CONVERGED:
        return replace(failed, status=proved(task, newton.problem, law, status))
    scene_data = replace(data, gamma_n=begun.data.gamma_n, gamma_t=begun.data.gamma_t)
    return Outcome(
        status, newton, scene_data, augmented=True
    )  # no regularisation error of path-following remains


def augmentation_on(task: Task, newton: SemismoothNewton) -> Augmentation:
    """Return the augmented Lagrangian update for the problems of an inner method of the task."""
    from signorini_fx.algebra.algorithms.alm import Augmentation

    return Augmentation(newton, automatic_gamma(task), task.settings.tolerance)


def automatic_gamma(task: Task) -> float:
    """Return the default gamma, used where the scene gives none, stress per length."""
    return AUTOMATIC_GAMMA * task.natural_gamma


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
