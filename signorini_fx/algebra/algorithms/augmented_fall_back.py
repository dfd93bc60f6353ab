"""Augmentation as a fall-back for Coulomb friction."""

from __future__ import annotations

from dataclasses import replace

from signorini_fx.algebra.algorithms.alm import augmented_lagrangian
from signorini_fx.algebra.algorithms.augmentation import Augmentation
from signorini_fx.algebra.algorithms.coulomb_statics import coulomb_start, proved
from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.records import Status
from signorini_fx.tuned import AUTOMATIC_GAMMA, CONTINUATION_SHARE


def softened(start: Start, data: RegularisedData) -> RegularisedData:
    """The first problem of augmentation, whose limit is the same for every gamma: a small one makes the problems
    easiest.  Slip counts without the part of it in earlier load steps that is due to the regularisation.
    """
    slip_origin = data.slip_origin - start.elastic_slip
    gammas = CONTINUATION_SHARE * data.gamma_n, CONTINUATION_SHARE * data.gamma_t
    return replace(data, slip_origin=slip_origin, gamma_n=gammas[0], gamma_t=gammas[1])


def by_augmentation(task: Task, start: Start, law: PointFriction, begun: Outcome) -> Outcome:
    """The last fall-back for Coulomb friction, which leaves no regularisation error, nor the elastic slip of earlier
    load steps; it begins with the multipliers of the load step before, or with the start of Coulomb friction;
    ``begun``: the outcome with the problem of the method that has failed.
    """
    s, newton, multipliers, data = task.settings, task.iterate.newton, start.multipliers, softened(start, begun.data)
    failed = replace(begun, newton=newton, monolithic=False)
    if multipliers is None:
        status = newton.solve(coulomb_start(task, data), ActiveSets.all_in_contact(*data.mu_hat.shape))
        if status is not Status.CONVERGED:
            return replace(failed, status=proved(task, newton.problem, law, status))
        multipliers = newton.multipliers()
    coupled = replace(data, bound=law.given, follows=law, lambda_hat=multipliers[0], mu_hat=multipliers[1])
    augmentation = augmentation_on(task, task.iterate.unsymmetric_newton)
    status = augmented_lagrangian(augmentation, coupled, newton.problem.sets, max_outer=s.max_outer_iterations)
    if status is not Status.CONVERGED:
        return replace(failed, status=proved(task, newton.problem, law, status))
    scene_data = replace(data, gamma_n=begun.data.gamma_n, gamma_t=begun.data.gamma_t)
    return Outcome(status, newton, scene_data, augmented=True)  # no regularisation error of path-following remains


def augmentation_on(task: Task, newton: SemismoothNewton) -> Augmentation:
    """The update of augmented Lagrangian methods on the problems of an inner method of the task."""
    return Augmentation(newton, automatic_gamma(task), task.settings.tolerance)


def automatic_gamma(task: Task) -> float:
    """The gamma of a scene that gives none."""
    return AUTOMATIC_GAMMA * task.natural_gamma
