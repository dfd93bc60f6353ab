"""Augmentation as a fall-back on one mesh, and where a load step begins with it."""

from __future__ import annotations

from dataclasses import replace

from signorini_fx.algebra.algorithms.alm import augmented_lagrangian
from signorini_fx.algebra.algorithms.augmentation import Augmentation
from signorini_fx.algebra.algorithms.coulomb_statics import coulomb_start, proved
from signorini_fx.algebra.algorithms.fp import fixed_point
from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.records import Status
from signorini_fx.tuned import AUGMENTED_NEWTON_SHARE, AUGMENTED_SHARE, AUTOMATIC_GAMMA, START_GAMMA


def softened(task: Task, start: Start, failed: Outcome) -> RegularisedData:
    """The first problem of augmentation, whose limit is the same for every gamma: a small one makes the problems
    easiest.  Slip counts without the part of it in earlier load steps that is due to the regularisation.
    """
    scene_data = replace(failed.data, slip_origin=failed.data.slip_origin - start.elastic_slip)
    share = max(AUGMENTED_SHARE, min(1.0, START_GAMMA * task.natural_gamma / scene_data.gamma_n))
    return replace(scene_data, gamma_n=share * scene_data.gamma_n, gamma_t=share * scene_data.gamma_t)


def by_augmentation(
    task: Task, start: Start, failed: Outcome, data: RegularisedData, *, monolithic: bool = False
) -> Outcome:
    """The last fall-back on one mesh, which leaves no regularisation error, nor the elastic slip of earlier steps.

    Args:
        task: the inputs.
        start: where the load step starts.
        failed: the outcome of the method of the scene.
        data: the problem to begin with.
        monolithic: whether Coulomb friction is solved without a fixed point.
    """
    s, newton = task.settings, task.iterate.newton
    scene_data = replace(data, gamma_n=failed.data.gamma_n, gamma_t=failed.data.gamma_t)
    if start.law is None or not task.has_coulomb:
        sets = ActiveSets.all_in_contact(*scene_data.mu_hat.shape)
        status = augmented_lagrangian(augmentation_on(task, newton), data, sets, max_outer=s.max_outer_iterations)
    else:
        status = _augmented_coulomb(task, start, start.law, scene_data, data, monolithic=monolithic)
    if status is not Status.CONVERGED:
        return replace(failed, status=status, newton=newton, monolithic=False)
    return Outcome(status, newton, scene_data, augmented=True)  # no regularisation error of path-following remains


def _augmented_coulomb(
    task: Task,
    start: Start,
    law: PointFriction,
    scene_data: RegularisedData,
    data: RegularisedData,
    *,
    monolithic: bool,
) -> Status:
    """Augmentation from the multipliers of the load step before, or from the start of Coulomb friction.

    Args:
        task: the inputs.
        start: where the load step starts.
        law: its friction law.
        scene_data: the problem with the gamma of the scene.
        data: the problem to begin with.
        monolithic: whether the bound of its problems follows the pressure; otherwise they are those of a fixed point.
    """
    s, newton, multipliers = task.settings, task.iterate.newton, start.multipliers
    if multipliers is None:
        contact = replace(coulomb_start(task, scene_data), gamma_n=data.gamma_n, gamma_t=data.gamma_t)
        status = newton.solve(contact, ActiveSets.all_in_contact(*scene_data.mu_hat.shape))
        if status is not Status.CONVERGED:
            return proved(task, newton.problem, law, status)
        multipliers = newton.multipliers()
    if monolithic:
        status = augmented_lagrangian(
            augmentation_on(task, task.iterate.unsymmetric_newton),
            replace(
                data,
                gamma_n=AUGMENTED_NEWTON_SHARE * data.gamma_n,
                gamma_t=AUGMENTED_NEWTON_SHARE * data.gamma_t,
                lambda_hat=multipliers[0],
                mu_hat=multipliers[1],
                bound=law.given,
                follows=law,
            ),
            newton.problem.sets,
            max_outer=s.max_outer_iterations,
        )
    else:
        status = fixed_point(
            newton,
            data,
            law,
            multipliers,
            None,
            tolerance=s.tolerance,
            max_outer=s.max_outer_iterations,
            augmentation=augmentation_on(task, newton),
        )
    return proved(task, newton.problem, law, status)


def augmentation_on(task: Task, newton: SemismoothNewton) -> Augmentation:
    """The update of augmented Lagrangian methods on the problems of an inner method of the task."""
    return Augmentation(newton, automatic_gamma(task), task.settings.tolerance)


def automatic_gamma(task: Task) -> float:
    """The gamma of a scene that gives none."""
    return AUTOMATIC_GAMMA * task.natural_gamma
