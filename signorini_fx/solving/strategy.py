"""Which algorithms a scene runs, in which order: the only module that knows all of them.

Two independent choices make a method.  ``algorithm`` says how the regularisation is treated: ``ssn`` (gamma fixed),
``continuation``, ``path-following``, ``alm``, ``exact``.  ``coulomb`` says how the friction bound is coupled to the
pressure: ``fp`` (fixed-point iteration of Tresca problems) or ``newton`` (monolithic).  (FP) of the paper is ssn with
    fp,
(ALM-FP) alm with fp.  Load steps repeat the method, each from the state at the end of the previous one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.algorithms.alm import augmented_lagrangian
from signorini_fx.algorithms.augmentation import Augmentation, with_enough_digits
from signorini_fx.algorithms.continuation import continuation
from signorini_fx.algorithms.coulomb_newton import coulomb_newton
from signorini_fx.algorithms.fall_backs import touching_nodes
from signorini_fx.algorithms.fp import fixed_point
from signorini_fx.algorithms.path_following import path_following
from signorini_fx.attempts import (
    AUGMENTED,
    DAMPED,
    FIXED_POINT,
    METHOD,
    MONOLITHIC,
    Attempt,
    for_coulomb,
    step_limit,
    tried,
)
from signorini_fx.contact.laws import ActiveSets, FrictionLaw, Nodal, RegularisedData
from signorini_fx.contact.statics import no_balance
from signorini_fx.records import OuterRecord, Status
from signorini_fx.solving.task import Outcome, Start, Task
from signorini_fx.tuned import (
    AUGMENTED_SHARE,
    AUTOMATIC_GAMMA,
    CONTINUATION_SHARE,
    LARGEST_GAMMA,
    LARGEST_GAMMA_RATIO,
    START_GAMMA,
)


def run(task: Task, start: Start, most: int | None = None) -> Outcome:
    """Solve a load step; the iterates stay in ``task.iterate``.

    Args:
        task: the inputs.
        start: where the load step starts.
        most: linear solves allowed; None: those of ``step_limit``.
    """
    task.iterate.begin_step(start)
    if task.settings.algorithm == "alm":
        data = start.data
        enough = with_enough_digits(data, _natural(task))
        if (enough.gamma_n, enough.gamma_t) != (data.gamma_n, data.gamma_t):
            task.history.add(
                f"gamma lowered to {enough.gamma_n:.3g} and {enough.gamma_t:.3g}: augmentation needs no more"
            )
        start = replace(start, data=enough)
    if _nothing_acts(task, start):
        return _stay(task, start)
    lost = no_balance(start.law, start.data.bilateral, task.motions, task.system.resultant)
    if lost is not None:
        return _without_contact(task, start.data, lost.status)
    with task.history.at_most(step_limit(task.settings.max_iterations) if most is None else most):
        outcome = _solve(task, start)
        if outcome.status is not Status.CONVERGED and task.history.linear_solves >= task.history.limit:
            task.history.add("all methods together have taken as many linear solves as they may")
    return outcome


def _solve(task: Task, start: Start) -> Outcome:
    """The method of the scene, and augmentation if it fails."""

    def attempts() -> Iterator[tuple[object, Callable[[], Outcome]]]:
        first: Outcome

        def method() -> Outcome:
            nonlocal first
            first = _by_method(task, start)
            return first

        yield METHOD, method
        if not task.has_coulomb and _may_augment(task, start):
            data = _softened(task, start, first)
            yield f"{AUGMENTED} with gamma_n = {data.gamma_n:.3g}", lambda: _augmented(task, start, first, data)

    outcomes = tried(
        attempts(),
        history=task.history,
        settled=lambda outcome: not task.gave_up(outcome.status),
        told=lambda outcome: outcome.status.value,
    )
    last = outcomes[-1]
    return last if len(outcomes) == 1 or last.status is Status.CONVERGED else replace(last, status=outcomes[0].status)


def _may_augment(task: Task, start: Start) -> bool:
    """Whether augmentation is a fall-back of the scene here."""
    return task.settings.fallbacks and task.settings.algorithm != "alm" and not start.without_fall_backs


def _by_method(task: Task, start: Start) -> Outcome:
    """The method of the scene, and the unregularised limit if it is to follow."""
    coulomb = start.law if task.has_coulomb else None
    outcome = _given_friction(task, start, start.data) if coulomb is None else _coulomb(task, start, coulomb)
    exact = task.settings.algorithm == "exact" and outcome.status is Status.CONVERGED and not outcome.augmented
    return _exact(task, start, outcome) if exact else outcome


def _softened(task: Task, start: Start, failed: Outcome) -> RegularisedData:
    """The first problem of augmentation, whose limit is the same for every gamma: a small one makes the problems
    easiest.  Where the problem with gamma was solved and only its limit was not, gamma stays.
    """
    given = replace(failed.data, slip_origin=_without_elastic_slip(start, failed.data))
    solved = task.settings.algorithm == "exact" and failed.newton is not task.iterate.newton
    share = 1.0 if solved else max(AUGMENTED_SHARE, min(1.0, START_GAMMA * task.natural_gamma / given.gamma_n))
    return replace(given, gamma_n=share * given.gamma_n, gamma_t=share * given.gamma_t)


def _without_elastic_slip(start: Start, data: RegularisedData) -> Nodal | None:
    """Where slip counts from without the part of it in earlier load steps that is due to the regularisation."""
    if start.elastic_slip is None or data.slip_origin is None:
        return data.slip_origin
    return data.slip_origin - start.elastic_slip


def _augmented(task: Task, start: Start, failed: Outcome, data: RegularisedData) -> Outcome:
    """The last fall-back on one mesh, which leaves no regularisation error, nor the elastic slip of earlier steps.

    Args:
        task: the inputs.
        start: where the load step starts.
        failed: the outcome of the method of the scene.
        data: the problem to begin with.
    """
    s, newton = task.settings, task.iterate.newton
    given = replace(data, gamma_n=failed.data.gamma_n, gamma_t=failed.data.gamma_t)
    everywhere = ActiveSets.all_in_contact(*given.mu_hat.shape)
    if start.law is None or not task.has_coulomb:
        status = augmented_lagrangian(
            newton,
            data,
            everywhere,
            natural=_natural(task),
            first_iteration=1,
            tolerance=s.tolerance,
            max_outer=s.max_outer_iterations,
        )
    else:
        contact = _coulomb_start(task, given)
        status = newton.solve(replace(contact, gamma_n=data.gamma_n, gamma_t=data.gamma_t), everywhere)
        if status is Status.CONVERGED:
            status = fixed_point(
                newton,
                data,
                start.law,
                newton.multipliers(),
                None,
                tolerance=s.tolerance,
                max_outer=s.max_outer_iterations,
                augmentation=Augmentation(newton, _natural(task), s.tolerance),
            )
        status = _proved(task, data, start.law, status)
    if status is not Status.CONVERGED:
        return replace(failed, status=status, newton=newton, monolithic=False)
    return Outcome(status, newton, given, augmented=True)  # no regularisation error of path-following remains


def _natural(task: Task) -> float:
    """The gamma of a scene that gives none."""
    return AUTOMATIC_GAMMA * task.natural_gamma


def _nothing_acts(task: Task, start: Start) -> bool:
    """Whether the body stays where it is: held, no load, nothing prescribed, no penetration; collective."""
    data = start.data
    if start.step > 0 or task.motions.count > 0:
        return False
    if task.system.load.norm() > 0 or task.system.start.norm() > 0:
        return False
    pushed = data.gap < 0
    if data.bilateral is not None:
        pushed = pushed | (data.bilateral & (data.gap != 0))
    return not parallel.any_rank(task.system.comm, bool(pushed.any()))


def _stay(task: Task, start: Start) -> Outcome:
    """Zero is the solution; no linear system is solved."""
    task.iterate.x.set(0.0)
    task.history.add("nothing loads the body: it stays where it is")
    history = task.history
    history.add(OuterRecord(history.step, len(history.outer), 0, start.data.gamma_n, None, Status.CONVERGED.value))
    return _without_contact(task, start.data, Status.CONVERGED)


def _without_contact(task: Task, data: RegularisedData, status: Status) -> Outcome:
    """The outcome of a problem without any linear solve: no contact, hence no traction."""
    newton = task.iterate.newton
    newton.pose(data, ActiveSets.of(~task.motions.points.everywhere, np.zeros_like(data.mu_hat)))
    return Outcome(status, newton, data)


def _given_friction(task: Task, start: Start, data: RegularisedData) -> Outcome:
    """Frictionless or Tresca contact by the algorithm of the scene.

    Args:
        task: the inputs.
        start: where the load step starts.
        data: its problem, or the contact problem that starts Coulomb friction.
    """
    s, newton = task.settings, task.iterate.newton
    error = start.regularisation_error
    match s.algorithm:
        case "continuation":
            share = CONTINUATION_SHARE if s.gamma_first == "auto" else s.gamma_first / data.gamma_n
            gammas = [(data.gamma_n * factor, data.gamma_t * factor) for factor in (share, 1.0)]
            status = continuation(newton, data, start.sets, gammas, first_iteration=start.iteration)
        case "path-following":
            # A later load step begins with the gamma that the previous one has found; without a load there was no path.
            first = START_GAMMA * task.natural_gamma if start.regularisation_error is None else data.gamma_n
            ratio = float(np.clip(data.gamma_t / data.gamma_n, 1 / LARGEST_GAMMA_RATIO, LARGEST_GAMMA_RATIO))
            status, last, error = path_following(
                newton,
                replace(data, gamma_n=first, gamma_t=ratio * first),
                start.sets,
                first_iteration=start.iteration,
                goal=lambda: task.goal(newton.x),
                largest=LARGEST_GAMMA * task.natural_gamma,
                max_outer=s.max_outer_iterations,
            )
            found = replace(start.data, gamma_n=last.gamma_n, gamma_t=last.gamma_t)
            return Outcome(status, newton, found, regularisation_error=error)
        case "alm":
            status = augmented_lagrangian(
                newton,
                data,
                start.sets,
                natural=_natural(task),
                first_iteration=start.iteration,
                tolerance=s.tolerance,
                max_outer=s.max_outer_iterations,
                inner_iterations=None if s.inner_iterations == "auto" else s.inner_iterations,
                gamma_factor=s.gamma_factor,
            )
        case _:
            status = newton.solve(data, start.sets, first_iteration=start.iteration)
    return Outcome(status, newton, start.data, regularisation_error=error)


def _coulomb(task: Task, start: Start, law: FrictionLaw) -> Outcome:
    """Coulomb friction, started from a coarser mesh or an earlier load step, else from the pure contact problem."""
    s, newton = task.settings, task.iterate.newton
    first_sets, multipliers = start.sets, start.multipliers
    # These algorithms find their gamma, or use several, on the pure contact problem of every mesh.
    finds_gamma = (s.algorithm == "continuation" and start.step == 0) or (
        s.algorithm == "path-following" and start.regularisation_error is None
    )
    before = Outcome(Status.CONVERGED, newton, start.data, regularisation_error=start.regularisation_error)
    if multipliers is None or finds_gamma:
        data = _coulomb_start(task, start.data)
        if s.algorithm == "alm":  # (ALM-FP) updates the shifts together with the bound, but not in the start
            before = replace(before, status=newton.solve(data, first_sets, first_iteration=start.iteration))
        else:
            before = _given_friction(task, start, data)
        if before.status is not Status.CONVERGED:
            return before
        multipliers, first_sets = newton.multipliers(), None
        if data.bound is None:  # this start has no slip: mu = xi = 0, hence stick everywhere
            first_sets = ActiveSets.of(newton.problem.next.sets.contact, np.zeros_like(data.mu_hat))
    data = replace(before.data, bound=law.given)

    def fixed(damping: float) -> Status:
        return fixed_point(
            newton,
            data,
            law,
            multipliers,
            first_sets,
            tolerance=s.tolerance,
            max_outer=s.max_outer_iterations,
            augmentation=Augmentation(newton, _natural(task), s.tolerance) if s.algorithm == "alm" else None,
            damping=damping,
        )

    def monolithic() -> Status:
        if s.algorithm != "alm":
            return coulomb_newton(task.iterate.unsymmetric_newton, data, law, first_sets)
        return augmented_lagrangian(
            task.iterate.unsymmetric_newton,
            replace(data, bound=law.given, coupling=law.coefficient),
            first_sets,
            natural=_natural(task),
            first_iteration=1,
            tolerance=s.tolerance,
            max_outer=s.max_outer_iterations,
        )

    started = s.coulomb == "auto" and start.multipliers is not None and start.step == 0 and s.algorithm != "alm"
    first = s.coulomb == "newton" or started
    return _either_way(task, start, law, before, fixed, monolithic, monolithic_first=first)


def _either_way(
    task: Task,
    start: Start,
    law: FrictionLaw,
    begun: Outcome,
    fixed: Callable[[float], Status],
    monolithic: Callable[[], Status],
    *,
    monolithic_first: bool,
) -> Outcome:
    """The fixed-point iteration or the monolithic Newton method; if it fails the other one, then augmentation, then
    damped ones.

    Args:
        task: the contact problem.
        start: where the load step starts.
        law: its friction law.
        begun: the outcome so far; its inner method holds the start of all of them.
        fixed: the fixed-point iteration with a given damping.
        monolithic: the monolithic Newton method.
        monolithic_first: whether Newton's method comes first.
    """
    s, newton = task.settings, begun.newton
    checkpoint = newton.checkpoint()
    ways: dict[Attempt, Callable[[], Status]] = {
        FIXED_POINT: partial(fixed, 1.0),
        MONOLITHIC: monolithic,
        **{attempt: partial(fixed, damping) for damping, attempt in DAMPED.items()},
    }
    names = for_coulomb(
        # The monolithic method allows neither for a cap nor for a pressure of either sign.
        monolithic=law.cap is None and begun.data.bilateral is None,
        first=monolithic_first,
        fallbacks=s.fallbacks,
        augmented=_may_augment(task, start),
        damped=not start.without_fall_backs,
    )

    def ended(name: Attempt) -> Outcome:
        if name is AUGMENTED:
            return _augmented(task, start, begun, _softened(task, start, begun))
        status = _proved(task, begun.data, law, ways[name]())
        return replace(begun, status=status, monolithic=name is MONOLITHIC)

    def settled(outcome: Outcome) -> bool:
        if outcome.monolithic and monolithic_first:  # the fixed point is its documented fall-back
            return outcome.status in (Status.CONVERGED, Status.SINGULAR, Status.NOT_FINITE)
        return not task.gave_up(outcome.status)

    return tried(
        ((name if name is AUGMENTED else f"{name} from the same start", partial(ended, name)) for name in names),
        history=task.history,
        settled=settled,
        restore=lambda: newton.restore(checkpoint),
        told=lambda outcome: outcome.status.value,
    )[-1]


def _proved(task: Task, data: RegularisedData, law: FrictionLaw, status: Status) -> Status:
    """An outcome of Coulomb friction: that a body moves away with the bound of one Tresca problem proves nothing.

    The bound of such a problem is that of the previous pressure.  If the law itself allows for an equilibrium, the
    fixed-point iteration has failed, and another method may find it.
    """
    if status not in (Status.SLIDES, Status.TIPS, Status.OPEN, Status.NOT_HELD):
        return status
    everywhere = task.motions.points.everywhere
    rough = law.given + law.coefficient > 0
    if status is Status.NOT_HELD and not task.motions.held_by(everywhere, rough):
        return status
    lost = no_balance(law, data.bilateral, task.motions, task.system.resultant, data.gap)
    if lost is not None:
        return lost.status
    task.history.add(f"{status.value}: with the friction bound of the pressure before, not by the law itself")
    return Status.OUTER_MAX_ITERATIONS


def _coulomb_start(task: Task, data: RegularisedData) -> RegularisedData:
    """Section 7: the pure contact problem, g = 0; but a body that cannot do without friction starts from stick.

    It sticks everywhere, unless that would hold it without any contact, as a ring with clearance around a pin: then
    only where it touches at its resting place.
    """
    motions, everywhere = task.motions, task.motions.points.everywhere

    def possible(stick: npt.NDArray[np.bool_]) -> bool:
        """Whether contact can hold the body and balance its load if these nodes stick, and no other ones rub."""
        law = FrictionLaw(np.where(stick, np.inf, 0.0), np.zeros(everywhere.size))
        held = motions.held_by(everywhere, stick)
        return held and no_balance(law, data.bilateral, motions, task.system.resultant, data.gap) is None

    if possible(~everywhere):
        return replace(data, bound=None)
    stick = everywhere
    if motions.held_by(~everywhere, everywhere):
        touching = touching_nodes(motions.points.comm, data)
        stick = touching if possible(touching) else everywhere
    return replace(data, bound=np.where(stick, np.inf, 0.0))


def _exact(task: Task, start: Start, regularised: Outcome) -> Outcome:
    """The unregularised limit, from the sets of the regularised solution; Coulomb friction as it was solved there."""
    s, law, sets = task.settings, start.law, regularised.problem.sets
    pressure, _ = regularised.newton.multipliers()
    newton = task.iterate.exact_newton
    newton.begin_at(newton.problem.system.start)
    begun = replace(regularised, newton=newton)
    limit = replace(regularised.data, gamma_n=np.inf, gamma_t=np.inf)
    if law is None or not task.has_coulomb:
        problem = replace(limit, bound=None if law is None else law.bound(pressure))
        return replace(begun, status=newton.solve(problem, sets))

    def fixed(damping: float) -> Status:
        data = replace(limit, bound=law.bound(pressure))
        status = newton.solve(data, sets)
        if status is not Status.CONVERGED:
            return status
        first, most = newton.multipliers(), s.max_outer_iterations
        return fixed_point(newton, data, law, first, None, tolerance=s.tolerance, max_outer=most, damping=damping)

    def monolithic() -> Status:
        return coulomb_newton(task.iterate.exact_unsymmetric_newton, limit, law, sets)

    return _either_way(task, start, law, begun, fixed, monolithic, monolithic_first=regularised.monolithic)
