"""Coulomb friction: the start, the monolithic method, what statics proves, and augmentation as a
fall-back.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData, slip_of
from signorini_fx.algebra.contact.friction import PointFriction, as_given
from signorini_fx.algebra.contact.statics import largest_multiple, no_balance, reactions
from signorini_fx.algebra.regularised import RegularisedProblem
from signorini_fx.arrays import Flags, unit
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.tuned import AUTOMATIC_GAMMA, CERTIFICATE_TOLERANCE, CONTINUATION_SHARE

if TYPE_CHECKING:
    from signorini_fx.algebra.algorithms.alm import Augmentation


def coulomb_start(task: Task, data: RegularisedData) -> RegularisedData:
    """Section 7: the pure contact problem, g = 0; but a body that cannot do without friction starts
    from stick.

    It sticks everywhere, unless that would hold it without any contact, as a ring with clearance
    around a pin: then only where it touches at its reference motion.
    """
    motions = task.motions
    everywhere = task.motions.points.everywhere

    def possible(stick: Flags) -> bool:
        """Return whether contact can hold the body and balance its load if these nodes stick, and
        no other ones rub.
        """
        held = motions.held_by(everywhere, stick)
        law = as_given(np.where(stick, np.inf, 0.0))
        return held and no_balance(law, data.bilateral, motions, task.system.resultant) is None

    if possible(~everywhere):
        return replace(data, bound=None)
    stick = everywhere
    if motions.held_by(~everywhere, everywhere):
        # On a straight side that lies on a straight foundation all gaps are round-off, which
        # chooses no nodes.
        gap = np.abs(data.gap)
        largest = parallel.largest(task.motions.points.comm, gap)
        touching = gap <= max(task.coordinate_error, CERTIFICATE_TOLERANCE * largest)
        stick = touching if possible(touching) else everywhere
    return replace(data, bound=np.where(stick, np.inf, 0.0))


def proved(task: Task, problem: RegularisedProblem, law: PointFriction, status: Status) -> Status:
    """Return an outcome of Coulomb friction: that a body moves away with the bound of one Tresca
    problem proves nothing else.

    The bound of such a problem is that of the previous pressure.  If the law itself allows for an
    equilibrium, as it always does where the pressure is statically indeterminate, the fixed-point
    iteration has failed, and another method may find it.
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
    assert data.bound is not None  # the law has one
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
    """Solve the Coulomb problem in one semi-smooth Newton iteration of an inner method with an
    unsymmetric solver, from its iterate (the pure contact problem), or in one for each update; not
    in the paper.

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
    """Return the sets of a cycle, in which the points that change begin in slip: where friction is
    large a point that closes enters the foundation if it is open, is pulled if it sticks, and slips
    in the solution.
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
    """Return the last fall-back for Coulomb friction, which leaves no regularisation error, nor the
    elastic slip of earlier load steps; it begins with the multipliers of the load step before, or
    with the start of Coulomb friction.

    ``begun``: the outcome with the problem of the method that has failed.
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
    """Return the update of augmented Lagrangian methods on the problems of an inner method of the
    task.
    """
    from signorini_fx.algebra.algorithms.alm import Augmentation

    return Augmentation(newton, automatic_gamma(task), task.settings.tolerance)


def automatic_gamma(task: Task) -> float:
    """Return the gamma of a scene that gives none."""
    return AUTOMATIC_GAMMA * task.natural_gamma
