"""The choice of algorithms for a scene and their order; the only module that imports all of them.

Two independent choices make a method.  ``algorithm`` states how the regularisation is treated:
``ssn`` (gamma fixed), ``continuation``, ``path-following`` or ``alm``.  ``coulomb`` states how the
friction bound is coupled to the pressure: ``fp`` (fixed-point iteration of Tresca problems) or
``newton`` (monolithic).  (FP) of the paper is ssn with fp, (ALM-FP) is alm with fp.  Every load
step uses the same method, starting from the state at the end of the previous one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra import step_limit
from signorini_fx.algebra.algorithms.coulomb import (
    augmentation_on,
    automatic_gamma,
    by_augmentation,
    coulomb_newton,
    coulomb_start,
    fixed_point,
    proved,
)
from signorini_fx.algebra.algorithms.ssn import Checkpoint
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.statics import no_balance
from signorini_fx.arrays import length
from signorini_fx.machine import parallel
from signorini_fx.records import OuterRecord, Status
from signorini_fx.tuned import (
    CONTINUATION_SHARE,
    GAMMA_GROWTH,
    LARGEST_GAMMA,
    NO_FORCE,
    START_GAMMA,
)

# Names of the methods for Coulomb friction in the history.
FIXED_POINT = "fixed point"
MONOLITHIC = "monolithic Newton"
AUGMENTED = "augmented Lagrangian"

# Other outcomes do not explain why there is no solution; the reason may be a loose body.
_EXPLAINED = (
    Status.CONVERGED,
    Status.NOT_HELD,
    Status.TIPS,
    Status.SLIDES,
    Status.NOT_FINITE,
    Status.NO_MEMORY,
)


def solve_task(task: Task, start: Start, solve_budget: int | None = None) -> Outcome:
    """Solve a load step; the iterate stays in ``task.newton``.

    Args:
        task: the contact problem.
        start: the initial state of the load step.
        solve_budget: linear solves allowed; None: ``step_limit`` of the settings.
    """
    task.begin_step(start)
    if task.newton.linear:
        status = (
            Status.NOT_HELD
            if task.motions.count
            else task.newton.solve(start.data, start.sets, first_iteration=0)
        )
        return _without_contact(task, start.data, status)
    if task.settings.algorithm == "alm":
        gammas = (start.data.gamma_n, start.data.gamma_t)
        largest = GAMMA_GROWTH * automatic_gamma(task)
        if max(gammas) > largest:  # its round-off would hide the limit
            gamma_n, gamma_t = (min(gamma, largest) for gamma in gammas)
            task.history.add(
                f"gamma lowered to {gamma_n:.3g} and {gamma_t:.3g}, which suffices for alm"
            )
            start = replace(start, data=replace(start.data, gamma_n=gamma_n, gamma_t=gamma_t))
    if _nothing_acts(task, start):
        task.newton.x.set(0.0)  # it is the solution; no linear system is solved
        history = task.history
        history.add("no load acts: the body stays in its position")
        history.add(
            OuterRecord(
                history.step,
                len(history.outer),
                0,
                start.data.gamma_n,
                None,
                Status.CONVERGED.value,
            )
        )
        return _without_contact(task, start.data, Status.CONVERGED)
    start = _first_loaded(task, start)
    if start.data.bond is not None:
        task = task.held_by(start.data.bond.damage < 1.0)
    begin = task.newton.checkpoint()
    waits = start.several or start.step > 0
    lost = no_balance(start.law, start.data.bilateral, task.motions, task.system.resultant)
    if lost is not None:
        idle = lost.status is Status.OPEN and lost.assembly in task.idle  # no load lifts it off
        outcome = _without_contact(task, start.data, Status.NOT_HELD if idle else lost.status)
        return _left_loose(task, start, begin, outcome, waits=True) if waits and idle else outcome
    with task.history.at_most(
        step_limit(task.settings.max_iterations) if solve_budget is None else solve_budget
    ):
        outcome = _solve(task, start)
        if (
            outcome.status is not Status.CONVERGED
            and task.history.linear_solves >= task.history.limit
        ):
            task.history.add("the limit of linear solves of all methods is reached")
    loose = outcome.status not in _EXPLAINED and task.idle
    return _left_loose(task, start, begin, outcome, waits=waits) if loose else outcome


def _left_loose(
    task: Task, start: Start, begin: Checkpoint, failed: Outcome, *, waits: bool
) -> Outcome:
    """Return the solution nearest to the iterate ``begin`` where bodies lie loose; if there is
    none, the outcome ``failed``.

    Args:
        task: the contact problem.
        start: the initial state of the load step.
        begin: the iterate at the start of the load step.
        failed: the outcome of the methods tried so far.
        waits: whether a body without load may stay where it is for a later step; if not, a solution
            in which nothing presses on a loose body has the status NOT_HELD.
    """
    newton = task.newton
    ended = newton.checkpoint()
    newton.restore(begin)
    with task.history.at_most(step_limit(task.settings.max_iterations)):
        loose = _near_the_last_place(task, start)
    if loose is None:
        newton.restore(ended)
        driven = failed.status is not Status.OPEN or len(task.idle) < len(task.motions.assemblies)
        return failed if driven else replace(failed, status=Status.NOT_HELD)
    if waits or newton.multipliers()[0].any():
        return loose
    task.history.add(
        f"{failed.status.value}: nothing presses on a body, which can move without touching "
        "anything"
    )
    return replace(loose, status=Status.NOT_HELD)


def _near_the_last_place(task: Task, start: Start) -> Outcome | None:
    """Return the solution nearest to the iterate of the task, without tractions on loose bodies;
    None if none is found.
    """
    # The loads on loose bodies balance each other, and contact need not press on them: they are in
    # equilibrium without traction at many positions, so that no method converges to one.  Springs
    # at the contact points, far softer than the body, lead from the last position to the nearest
    # equilibrium, where they carry nothing: each solve is one step of the proximal point method (R.
    # T. Rockafellar, SIAM J. Control Optim. 14 (1976) 877-898).
    motions = task.motions
    newton = task.newton
    comm = task.motions.points.comm
    numbers = task.idle
    law = start.law
    without_load = np.isin(motions.of_point, numbers)
    if law is not None:
        law = law.without_pressure(without_load)
        start = replace(start, law=law, data=replace(start.data, bound=law.given))
    held = replace(
        task,
        motions=motions.none,
        has_coulomb=law is not None and parallel.any_rank(comm, law.follows_pressure),
        settings=replace(task.settings, algorithm="ssn"),
    )
    start = replace(start, factors=None)
    problem = held.newton.problem
    held.newton.begin_at(newton.x)
    position = np.column_stack(problem.system.contact.traces(newton.x))
    farthest = parallel.largest(comm, np.abs(position), 0.0)
    moved = np.inf
    while True:
        problem.springs = NO_FORCE * task.natural_gamma, position
        outcome = _solve(held, start)
        last_position = position
        if outcome.status not in (
            Status.CONVERGED,
            Status.ROUND_OFF,
        ):  # the springs may carry no more than that
            return None
        position = np.column_stack(problem.system.contact.traces(outcome.newton.x))
        size = parallel.largest(comm, np.abs(position), 0.0)
        farthest = max(farthest, size)
        last_moved = moved
        moved = parallel.largest(comm, np.abs(position - last_position), 0.0)
        if moved <= NO_FORCE * size:
            break
        if (
            2 * moved > last_moved
        ):  # a load moves a body, or round-off of lengths magnified by the soft springs does
            if moved > task.coordinate_error / NO_FORCE:
                return None
            break
        start = start.begin_from(outcome.problem.sets, outcome.newton.multipliers())
    x, sets, data = outcome.newton.checkpoint()
    tractions = np.column_stack(outcome.newton.multipliers())
    pressed = np.abs(tractions).max(axis=1) > NO_FORCE * task.natural_gamma * farthest
    loose = np.isin(motions.of_point, motions.untouched(numbers, pressed))
    if task.has_coulomb and parallel.any_rank(comm, without_load & ~loose):
        return None
    system = problem.system
    reached = x.norm(PETSc.NormType.NORM_INFINITY)
    if (
        system.load.norm() == system.start.norm() == 0.0 and reached <= NO_FORCE * farthest
    ):  # round-off of the way back
        x.set(0.0)
    newton.restore((x, replace(sets, contact=sets.contact & ~(loose & ~data.bilateral)), data))
    # Without tractions the law without regularisation holds, too.
    exact = task.settings.algorithm == "alm"
    exact = exact and not parallel.any_rank(comm, pressed & ~loose)
    return replace(outcome, status=Status.CONVERGED, newton=newton, augmented=exact)


def _solve(task: Task, start: Start) -> Outcome:
    """Solve by the method of the scene, with its fall-backs, and return the outcome."""
    augments = task.settings.algorithm == "alm"
    if augments:
        slip_origin = start.data.slip_origin - start.elastic_slip
        start = replace(
            start,
            data=replace(start.data, slip_origin=slip_origin),
            elastic_slip=0 * start.elastic_slip,
        )
    if start.law is None or not task.has_coulomb:
        outcome = _given_friction(task, start, start.data)
    else:
        outcome = _coulomb(task, start, start.law)
    return replace(outcome, augmented=outcome.augmented or augments)


def _nothing_acts(task: Task, start: Start) -> bool:
    """Return whether nothing acts on the body, so that it stays where it is; collective."""
    # A body that nothing holds stays only in one of several load steps: a single problem without
    # any load is not determined.
    data = start.data
    loose = task.motions.count > 0
    if loose and not start.several:
        return False
    if start.step > 0 and not (loose and task.newton.x.norm() == 0):
        return False
    if task.system.load.norm() > 0 or task.system.start.norm() > 0:
        return False
    pushed = data.gap < -task.coordinate_error
    pushed = pushed | (data.bilateral & (np.abs(data.gap) > task.coordinate_error))
    if data.bound is not None:
        pushed = pushed | ((data.bound > 0) & (length(data.slip_origin) > task.coordinate_error))
    return not parallel.any_rank(task.system.comm, pushed)


def _first_loaded(task: Task, start: Start) -> Start:
    """Return the start of a load step, with contact everywhere where a body is loaded for the first
    time.

    This is so if the previous step ended without any traction, and bodies that only contact can
    hold are loaded now.
    """
    # With the active sets and friction bounds of the unloaded state, nothing would hold these
    # bodies.
    unloaded = len(task.idle) == len(task.motions.assemblies)
    if start.step == 0 or unloaded or start.multipliers is None:
        return start
    if parallel.any_rank(task.system.comm, any(tractions.any() for tractions in start.multipliers)):
        return start
    return replace(
        start, multipliers=None, sets=ActiveSets.all_in_contact(*start.data.mu_hat.shape)
    )


def _without_contact(task: Task, data: RegularisedData, status: Status) -> Outcome:
    """Return an outcome without contact, hence without tractions, at the present iterate."""
    newton = task.newton
    newton.pose(data, ActiveSets.of(~task.motions.points.everywhere, np.zeros_like(data.mu_hat)))
    return Outcome(status, newton, data, augmented=task.settings.algorithm == "alm")


def _released(task: Task, failed: Outcome, law: PointFriction, moved: float) -> Outcome | None:
    """Return the solution without contact if a failed iteration has converged to it.

    This occurs if round-off decides which points touch.  Returns None if the solution without
    contact is another one, or if bilateral contact, friction without pressure or free motions
    exclude it.

    Args:
        task: the contact problem.
        failed: the outcome of the iteration.
        law: the friction law.
        moved: largest displacement at the start of the step, the scale of round-off.
    """
    newton = failed.newton
    points = task.motions.points
    history = task.history
    nothing = np.zeros(points.size)
    kept = failed.data.bilateral | (law.evaluate(nothing, 0.0)[0] != 0)
    if parallel.any_rank(points.comm, kept) or task.motions.count:
        return None
    if history.exhausted:
        return None
    reached = newton.checkpoint()
    opened = ActiveSets.of(~points.everywhere, np.zeros_like(failed.data.mu_hat))
    system = newton.problem.system
    data = replace(failed.data, bound=nothing)
    newton.begin_at(system.start)
    # The second solve removes the round-off of the earlier tractions.
    status = newton.attempt(data, opened, max_iterations=2)
    change = newton.x.copy()
    largest = max(moved, newton.x.norm(PETSc.NormType.NORM_INFINITY))
    change.axpy(-1.0, reached[0])
    entered = parallel.largest(points.comm, system.contact.traces(newton.x)[0] - data.gap)
    if (
        status not in (Status.CONVERGED, Status.CYCLING, Status.MAX_ITERATIONS)
        or change.norm(PETSc.NormType.NORM_INFINITY) > NO_FORCE * largest
        or entered > task.coordinate_error
    ):
        newton.restore(reached)
        return None
    newton.pose(data, opened)
    history.add(
        "nothing presses the body onto its foundation: the solution is that without contact"
    )
    return replace(failed, status=Status.CONVERGED, data=data, monolithic=False)


def _given_friction(task: Task, start: Start, data: RegularisedData) -> Outcome:
    """Solve frictionless or Tresca contact, or the problem that starts Coulomb friction, by the
    algorithm of the scene.
    """
    s = task.settings
    newton = task.newton
    error = start.regularisation_error
    match s.algorithm:
        case "continuation":
            # Section 7.1, Table 4: regularised problems in turn, each started from the previous
            # one.
            share = CONTINUATION_SHARE if s.gamma_first == "auto" else s.gamma_first / data.gamma_n
            softer = replace(data, gamma_n=data.gamma_n * share, gamma_t=data.gamma_t * share)
            status = newton.solve(softer, start.sets, first_iteration=start.iteration)
            if status is Status.CONVERGED:
                status = newton.solve(data, newton.continued_sets(data))
        case "path-following":
            from signorini_fx.algebra.algorithms.path_following import path_following

            # A later load step starts with the gamma that the previous one has found; a step
            # without loads has found none.
            first = (
                START_GAMMA * task.natural_gamma
                if start.regularisation_error is None
                else data.gamma_n
            )
            ratio = float(np.clip(data.gamma_t / data.gamma_n, 1 / GAMMA_GROWTH, GAMMA_GROWTH))
            status, last, error = path_following(
                newton,
                replace(data, gamma_n=first, gamma_t=ratio * first),
                start.sets,
                first_iteration=start.iteration,
                goal=lambda: task.goal(newton.x),
                largest=LARGEST_GAMMA * task.natural_gamma,
                max_outer=s.max_outer_iterations,
            )
            final_data = replace(start.data, gamma_n=last.gamma_n, gamma_t=last.gamma_t)
            return Outcome(status, newton, final_data, regularisation_error=error)
        case "alm":
            from signorini_fx.algebra.algorithms.alm import augmented_lagrangian

            status = augmented_lagrangian(
                augmentation_on(task, newton),
                data,
                start.sets,
                max_outer=s.max_outer_iterations,
                first_iteration=start.iteration,
                inner_iterations=None if s.inner_iterations == "auto" else s.inner_iterations,
                gamma_factor=s.gamma_factor,
            )
        case _:
            status = newton.solve(data, start.sets, first_iteration=start.iteration)
    return Outcome(status, newton, start.data, regularisation_error=error)


def _coulomb(task: Task, start: Start, law: PointFriction) -> Outcome:
    """Solve with Coulomb friction, starting from a coarser mesh or an earlier load step if
    possible, otherwise from the pure contact problem.
    """
    s = task.settings
    newton = task.newton
    first_sets = start.sets
    multipliers = start.multipliers
    # These algorithms find their gamma, or use several, on the pure contact problem of every mesh.
    finds_gamma = (s.algorithm == "continuation" and start.step == 0) or (
        s.algorithm == "path-following" and start.regularisation_error is None
    )
    first_outcome = Outcome(
        Status.CONVERGED, newton, start.data, regularisation_error=start.regularisation_error
    )
    if multipliers is None or finds_gamma:
        data = coulomb_start(task, start.data)
        if (
            s.algorithm == "alm"
        ):  # (ALM-FP) updates the shifts together with the bound, but not in the start
            status = newton.solve(data, first_sets, first_iteration=start.iteration)
            first_outcome = replace(first_outcome, status=status)
        else:
            first_outcome = _given_friction(task, start, data)
        if first_outcome.status is not Status.CONVERGED:
            return first_outcome
        multipliers = newton.multipliers()
        first_sets = None
        if data.bound is None:  # this start has no slip: mu = xi = 0, hence stick everywhere
            first_sets = ActiveSets.of(newton.problem.next.sets.contact, np.zeros_like(data.mu_hat))
    data = replace(first_outcome.data, bound=law.given)

    def fixed() -> Status:
        return fixed_point(
            # Where friction falls with the slip the tangent may be indefinite.
            task.unsymmetric_newton if law.follows_slip else newton,
            data,
            law,
            multipliers,
            first_sets,
            tolerance=s.tolerance,
            max_outer=s.max_outer_iterations,
            augmentation=augmentation_on(task, newton) if s.algorithm == "alm" else None,
        )

    def monolithic() -> Status:
        return coulomb_newton(task, data, law, first_sets, augmented=s.algorithm == "alm")

    # The monolithic method goes first if the start is near: from a coarser mesh, an earlier load
    # step or another load.  It also does if friction depends on the slip, as speeds change more
    # from one pressure to the next than pressures do.
    near = start.multipliers is not None or law.follows_slip
    first = s.coulomb == "newton" or (s.coulomb == "auto" and near and s.algorithm != "alm")
    return _either_way(task, start, law, first_outcome, fixed, monolithic, monolithic_first=first)


def _either_way(
    task: Task,
    start: Start,
    law: PointFriction,
    begun: Outcome,
    fixed: Callable[[], Status],
    monolithic: Callable[[], Status],
    *,
    monolithic_first: bool,
) -> Outcome:
    """Solve by the fixed point or by monolithic Newton, then by the other one if that fails, then
    by augmentation; each starts from ``begun``.

    Args:
        task: the contact problem.
        start: the initial state of the load step.
        law: the friction law.
        begun: the outcome of the start, with its problem.
        fixed: runs the fixed-point iteration.
        monolithic: runs the monolithic method.
        monolithic_first: whether the monolithic method is tried first.
    """
    s = task.settings
    newton = begun.newton
    checkpoint = newton.checkpoint()

    ways = {FIXED_POINT: fixed, MONOLITHIC: monolithic}
    names = [MONOLITHIC, FIXED_POINT] if monolithic_first else [FIXED_POINT, MONOLITHIC]
    capped = law.cap is not None and not law.laws and s.coulomb != "newton"
    if capped or law.ends_open is not None:
        names = [FIXED_POINT]  # it treats a cap unless Newton's method is requested
        if s.coulomb == "newton":
            reason = "a cohesion ends with a jump where contact opens, which has no derivative"
            task.history.add(f"{reason}: {FIXED_POINT} in place of {MONOLITHIC}")
    elif not s.fallbacks:
        names = (
            names if monolithic_first else names[:1]
        )  # the fixed point is the documented fall-back of the other
    elif start.data.share is None:  # augmentation would make soft contact hard
        names.append(AUGMENTED)
    slid = False  # whether the last fixed point ended with SLIDES_AT_PRESSURES

    def ended(name: str) -> Outcome:
        if name is AUGMENTED:
            return by_augmentation(task, start, law, begun)
        nonlocal slid
        status = proved(task, newton.problem, law, ways[name]())
        slid = slid if name is MONOLITHIC else status is Status.SLIDES_AT_PRESSURES
        outcome = replace(begun, status=status, monolithic=name is MONOLITHIC)
        if status is Status.CONVERGED or slid:
            return outcome
        return (
            _released(task, outcome, law, checkpoint[0].norm(PETSc.NormType.NORM_INFINITY))
            or outcome
        )

    def settled(outcome: Outcome) -> bool:
        status = outcome.status
        if outcome.monolithic and monolithic_first:
            return status in (Status.CONVERGED, Status.SINGULAR, Status.NOT_FINITE)
        if status is Status.MAX_ITERATIONS:  # a limit that the user has set is no failure
            return s.limited("max_iterations")
        if status is Status.OUTER_MAX_ITERATIONS:
            return s.limited("max_outer_iterations")
        return status not in (Status.CYCLING, Status.ROUND_OFF, Status.SLIDES_AT_PRESSURES)

    last = ended(names[0])
    for name in names[1:]:
        if settled(last) or task.history.exhausted:
            break
        start_of_it = "" if name is AUGMENTED else " from the same start"
        task.history.add(f"{last.status.value}: {name}{start_of_it}")
        newton.restore(checkpoint)
        last = ended(name)
    if law.follows_slip:
        from signorini_fx.algebra.algorithms.sliding_jumps import unless_sliding_jumps

        return unless_sliding_jumps(task.newton, last, law)
    return replace(last, status=Status.SLIDES_AT_PRESSURES) if slid and not settled(last) else last
