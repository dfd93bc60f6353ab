"""Which algorithms a scene runs, in which order: the only place that knows them all.

Two independent choices make a method.  ``algorithm`` says how the regularisation is treated: ``ssn`` (gamma fixed),
``continuation``, ``path-following``, ``alm``, ``exact``.  ``coulomb`` says how the friction bound meets the pressure:
``fp`` (fixed point of Tresca problems) or ``newton`` (monolithic).  (FP) of the paper is ssn with fp, (ALM-FP) alm with
fp.  Load steps repeat the method, each from the state that the one before has left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.algorithms.alm import augmented_lagrangian
from signorini_fx.algorithms.augmentation import Augmentation, with_enough_digits
from signorini_fx.algorithms.continuation import continuation
from signorini_fx.algorithms.coulomb_newton import coulomb_newton
from signorini_fx.algorithms.fp import fixed_point
from signorini_fx.algorithms.path_following import path_following
from signorini_fx.algorithms.ssn import SemismoothNewton
from signorini_fx.contact.data import AUTOMATIC_GAMMA
from signorini_fx.contact.laws import ActiveSets, FrictionLaw, RegularisedData
from signorini_fx.contact.statics import balance_exists
from signorini_fx.records import OuterRecord, Status
from signorini_fx.solving.task import Task

# gamma above this times E / size of the body loses the last digits that double precision has for contact pressures.
LARGEST_GAMMA = 1e9
# Path-following begins where the penetration is about a hundredth of the displacements.
START_GAMMA = 100.0
# Continuation begins where Table 4 does: at this share of the last gamma.
CONTINUATION_SHARE = 1e-4
# Fixed points that do not contract are damped, more and more.
_DAMPING = (0.5, 0.2)
# A load step ends without a solution when all its problems and fall-backs together have taken as many linear solves as
# so many problems that run to their last iteration.  A fixed point with its most problems takes a fifth of them.
PROBLEMS = 20
# The model of the path has one pole: it is of no use where the two gammas are farther apart than this.
_MOST_APART = 10.0
# The augmented Lagrangian method takes over with a gamma that much smaller, though none below that of a path's start.
_AUGMENTED_SHARE = 1e-3


def run(task: Task) -> Status:
    """Solve the current load step; the iterate, the sets and the data stay in the task."""
    task.augmented = False
    if task.settings.algorithm == "alm":
        enough = with_enough_digits(task.data, _natural(task))
        if (enough.gamma_n, enough.gamma_t) != (task.data.gamma_n, task.data.gamma_t):
            task.history.add(
                f"gamma lowered to {enough.gamma_n:.3g} and {enough.gamma_t:.3g}: augmentation needs no more"
            )
        task.data = enough
    if _nothing_acts(task):
        return _stay(task)
    task.history.allow(PROBLEMS * task.settings.max_iterations)
    status = _solve(task)
    if status is not Status.CONVERGED and task.history.linear_solves >= task.history.limit:
        task.history.add("all methods together have taken as many linear solves as they may")
    return status


def _solve(task: Task) -> Status:
    """The method of the scene, and what takes over where it fails."""
    coulomb = task.law if task.has_coulomb else None
    status = _given_friction(task, task.data) if coulomb is None else _coulomb(task, coulomb)
    if task.settings.fallbacks and task.gave_up(status) and task.settings.algorithm != "alm":
        status = _augmented(task, coulomb, status)
    elif task.settings.algorithm == "exact" and status is Status.CONVERGED:
        status = _exact(task)
        if task.settings.fallbacks and task.gave_up(status):  # but the problem with gamma was solved
            status = _augmented(task, coulomb, status, share=1.0)
    return status


def _augmented(task: Task, coulomb: FrictionLaw | None, failed: Status, share: float = _AUGMENTED_SHARE) -> Status:
    """The last resort on one mesh: augmentation, whose small gamma makes the easiest problems; the limit is the same
    for every gamma, and leaves no regularisation error.
    """
    s, newton = task.settings, task.newton
    task.problem = newton.problem
    share = max(share, min(1.0, START_GAMMA * task.natural_gamma / task.data.gamma_n))
    data = replace(task.data, gamma_n=share * task.data.gamma_n, gamma_t=share * task.data.gamma_t)
    task.history.add(f"{failed.value}: augmented Lagrangian with gamma_n = {data.gamma_n:.3g}")
    task.monolithic = False
    everywhere = ActiveSets.all_in_contact(*task.data.mu_hat.shape)
    if coulomb is None:
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
        start = _coulomb_start(task)
        status = newton.solve(replace(start, gamma_n=data.gamma_n, gamma_t=data.gamma_t), everywhere)
        if status is Status.CONVERGED:
            status = fixed_point(
                newton,
                data,
                coulomb,
                newton.multipliers(),
                None,
                tolerance=s.tolerance,
                max_outer=s.max_outer_iterations,
                augmentation=Augmentation(newton, _natural(task), s.tolerance),
            )
    if status is not Status.CONVERGED:
        return failed
    task.augmented, task.regularisation_error = True, None  # what path-following left is not left here
    return status


def _natural(task: Task) -> float:
    """The gamma that a scene has where it names none."""
    return AUTOMATIC_GAMMA * task.natural_gamma


def _nothing_acts(task: Task) -> bool:
    """Whether the body stays where it is: held, no load, nothing prescribed, no penetration; collective."""
    data = task.data
    if task.step > 0 or task.motions.free.shape[1] > 0:
        return False
    if task.system.load.norm() > 0 or task.system.start.norm() > 0:
        return False
    pushed = data.gap < 0
    if data.bilateral is not None:
        pushed = pushed | (data.bilateral & (data.gap != 0))
    return not parallel.any_rank(task.system.comm, bool(pushed.any()))


def _stay(task: Task) -> Status:
    """Zero is the solution; nothing is solved for."""
    task.x.set(0.0)
    _touch_nothing(task)
    task.history.add("nothing loads the body: it stays where it is")
    task.history.add(OuterRecord(len(task.history.outer), 0, task.data.gamma_n, None, Status.CONVERGED.value))
    return Status.CONVERGED


def _touch_nothing(task: Task) -> None:
    """The sets of a body that nothing was solved for: no contact, hence no traction."""
    none = np.zeros(task.boundary.size, dtype=bool)
    task.problem.set_data(task.data, ActiveSets.of(none, np.zeros_like(task.data.mu_hat)))
    task.problem.sets = task.problem.next.sets


def _given_friction(task: Task, data: RegularisedData) -> Status:
    """Frictionless or Tresca contact by the algorithm of the scene."""
    s, newton = task.settings, task.newton
    match s.algorithm:
        case "continuation":
            share = CONTINUATION_SHARE if s.gamma_first == "auto" else s.gamma_first / data.gamma_n
            gammas = [(data.gamma_n * factor, data.gamma_t * factor) for factor in (share, 1.0)]
            return continuation(newton, data, task.first_sets, gammas, first_iteration=task.first_iteration)
        case "path-following":
            # A later load step begins with the gamma that the one before has found.
            first = START_GAMMA * task.natural_gamma if task.step == 0 else data.gamma_n
            ratio = float(np.clip(data.gamma_t / data.gamma_n, 1 / _MOST_APART, _MOST_APART))
            status, last, task.regularisation_error = path_following(
                newton,
                replace(data, gamma_n=first, gamma_t=ratio * first),
                task.first_sets,
                first_iteration=task.first_iteration,
                goal=lambda: task.goal(task.x),
                largest=LARGEST_GAMMA * task.natural_gamma,
                max_outer=s.max_outer_iterations,
            )
            task.data = replace(task.data, gamma_n=last.gamma_n, gamma_t=last.gamma_t)
            return status
        case "alm":
            return augmented_lagrangian(
                newton,
                data,
                task.first_sets,
                natural=_natural(task),
                first_iteration=task.first_iteration,
                tolerance=s.tolerance,
                max_outer=s.max_outer_iterations,
                inner_iterations=None if s.inner_iterations == "auto" else s.inner_iterations,
                gamma_factor=s.gamma_factor,
            )
    return newton.solve(data, task.first_sets, first_iteration=task.first_iteration)


def _coulomb(task: Task, law: FrictionLaw) -> Status:
    """Coulomb friction, from what a coarser mesh or a load step has left, else from the pure contact problem."""
    s, newton = task.settings, task.newton
    first_sets, start = task.first_sets, task.start
    task.monolithic = False  # an earlier load step may have been
    # These find their gamma, or go through several, on the pure contact problem of every mesh.
    finds_gamma = task.step == 0 and s.algorithm in ("path-following", "continuation")
    if start is None or finds_gamma:
        data = _coulomb_start(task)
        lost = _no_balance(task, law) if data.bound is not None else None
        if lost is not None:
            _touch_nothing(task)
            return lost
        if s.algorithm == "alm":  # (ALM-FP) shifts together with the bound, the start not at all
            status = newton.solve(data, first_sets, first_iteration=task.first_iteration)
        else:
            status = _given_friction(task, data)
        if status is not Status.CONVERGED:
            return status
        start, first_sets = newton.multipliers(), None
        if data.bound is None:  # this start knows no slip: mu = xi = 0, hence stick everywhere
            first_sets = ActiveSets.of(task.problem.next.sets.contact, np.zeros_like(task.data.mu_hat))
    data = replace(task.data, bound=law.given)

    def fixed(damping: float) -> Status:
        return fixed_point(
            newton,
            data,
            law,
            start,
            first_sets,
            tolerance=s.tolerance,
            max_outer=s.max_outer_iterations,
            augmentation=Augmentation(newton, _natural(task), s.tolerance) if s.algorithm == "alm" else None,
            damping=damping,
        )

    def monolithic() -> Status:
        if s.algorithm != "alm":
            return coulomb_newton(task.unsymmetric_newton, data, law, first_sets)
        return augmented_lagrangian(
            task.unsymmetric_newton,
            replace(data, bound=law.given, coupling=law.coefficient),
            first_sets,
            natural=_natural(task),
            first_iteration=1,
            tolerance=s.tolerance,
            max_outer=s.max_outer_iterations,
        )

    started = s.coulomb == "auto" and task.start is not None and task.step == 0 and s.algorithm != "alm"
    return _either_way(task, newton, fixed, monolithic, monolithic_first=s.coulomb == "newton" or started)


def _either_way(
    task: Task,
    newton: SemismoothNewton,
    fixed: Callable[[float], Status],
    monolithic: Callable[[], Status],
    *,
    monolithic_first: bool,
) -> Status:
    """The fixed point or the monolithic Newton method; where it fails the other, then damped, from the same start.

    Args:
        task: the contact problem.
        newton: the inner method that holds the start.
        fixed: the fixed point with a damping.
        monolithic: Newton's method.
        monolithic_first: which comes first.
    """
    s, law, problem = task.settings, task.law, newton.problem
    state, sets = newton.x.copy(), problem.sets

    def unsymmetric() -> Status:
        task.monolithic = True
        return monolithic()

    ways: list[tuple[str, Callable[[], Status]]] = [("fixed point", lambda: fixed(1.0))]
    # The monolithic tangent is unsymmetric, and knows neither a cap nor a pressure of either sign.
    if law is not None and law.cap is None and task.data.bilateral is None and task.system.unsymmetric:
        ways.insert(0 if monolithic_first else 1, ("monolithic Newton", unsymmetric))
    ways += [(f"fixed point damped by {damping:g}", partial(fixed, damping)) for damping in _DAMPING]
    # A fixed point is the fall-back of Newton's method anyway: that is what the setting says.
    needed = ways[0][1] is unsymmetric
    task.monolithic = False
    status = _proved(task, ways[0][1]())
    for place, (name, way) in enumerate(ways[1:], start=1):
        settled = status in (Status.CONVERGED, Status.SINGULAR)
        if settled or (place > needed and not (s.fallbacks and task.gave_up(status))):
            break
        task.history.add(f"{status.value}: {name} from the same start")
        state.copy(newton.x)
        problem.sets = sets
        task.monolithic = False
        status = _proved(task, way())
    return status


def _proved(task: Task, status: Status) -> Status:
    """An outcome of Coulomb friction: that a body slides under the bound of one Tresca problem proves nothing.

    The bound of such a problem is that of the pressure before.  Where the law itself allows for an equilibrium the
    fixed point has failed, and another method may find it.
    """
    law = task.law
    if status not in (Status.SLIDES, Status.OPEN) or law is None or task.data.bilateral is not None:
        return status
    if _no_balance(task, law) is not None:
        return status
    task.history.add(f"{status.value}: with the friction bound of the pressure before, not by the law itself")
    return Status.OUTER_MAX_ITERATIONS


def _no_balance(task: Task, law: FrictionLaw) -> Status | None:
    """How a body that needs friction gets away, whatever friction the law may allow for; None: it does not."""
    everywhere: npt.NDArray[np.bool_] = np.ones(task.boundary.size, dtype=bool)
    held = task.motions.held_by(task.boundary, everywhere, everywhere)
    if task.data.bilateral is not None or task.motions.free.shape[1] == 0 or not held:
        return None  # what is not held at all has a name of its own, given by the iteration

    def balanced(data: RegularisedData) -> bool:
        return balance_exists(data, task.boundary, task.motions, task.system.resultant)

    if balanced(replace(task.data, bound=law.given, coupling=law.coefficient)):
        return None
    rough = replace(task.data, bound=np.full(task.boundary.size, np.inf))
    return Status.SLIDES if balanced(rough) else Status.OPEN


def _coulomb_start(task: Task) -> RegularisedData:
    """Section 7: the pure contact problem, g = 0; but a body that cannot do without friction starts from stick."""
    boundary = task.boundary
    everywhere: npt.NDArray[np.bool_] = np.ones(boundary.size, dtype=bool)
    frictionless = replace(task.data, bound=None)
    held = task.motions.held_by(boundary, everywhere, ~everywhere)
    if held and (
        task.motions.free.shape[1] == 0 or balance_exists(frictionless, boundary, task.motions, task.system.resultant)
    ):
        return frictionless
    return replace(task.data, bound=np.full(boundary.size, np.inf))


def _exact(task: Task) -> Status:
    """The unregularised limit, from the sets of the regularised solution; Coulomb friction as it was solved there."""
    s, law, sets = task.settings, task.law, task.problem.sets
    pressure, _ = task.newton.multipliers()
    newton = task.exact_newton
    task.problem = newton.problem
    newton.x.getArray()[:] = newton.problem.system.start.getArray(readonly=True)
    limit = replace(task.data, gamma_n=np.inf, gamma_t=np.inf)
    if law is None or not task.has_coulomb:
        return newton.solve(replace(limit, bound=None if law is None else law.bound(pressure)), sets)

    def fixed(damping: float) -> Status:
        data = replace(limit, bound=law.bound(pressure))
        status = newton.solve(data, sets)
        if status is not Status.CONVERGED:
            return status
        start, most = newton.multipliers(), s.max_outer_iterations
        return fixed_point(newton, data, law, start, None, tolerance=s.tolerance, max_outer=most, damping=damping)

    def monolithic() -> Status:
        return coulomb_newton(task.exact_unsymmetric_newton, limit, law, sets)

    return _either_way(task, newton, fixed, monolithic, monolithic_first=task.monolithic)
