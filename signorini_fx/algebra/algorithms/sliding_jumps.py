"""Check of uniqueness for a load step in which friction decreases with the speed of slip.

For fixed sets and pressures let S be the stiffness at the sliding points, and C the decrease of
their friction with the speed, the diagonal of w lambda |F'|.  The slip of a step of duration dt is
unique if S - C / dt is positive definite, that is, if dt exceeds the largest eigenvalue of S^-1 C.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.algorithms.task import Outcome
from signorini_fx.algebra.contact.active_sets import tangent
from signorini_fx.algebra.contact.complementarity import slip_of
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.linalg import finite, petsc_calls, petsc_options
from signorini_fx.algebra.linalg.petsc_calls import unprinted
from signorini_fx.arrays import Array, inner, length, unit
from signorini_fx.machine import parallel
from signorini_fx.records import MAY_JUMP, TOO_SHORT, Status
from signorini_fx.tuned import NO_FORCE, SLOW_STEPS, SLOWEST_STEPS, WRONG_SLOPE


def unless_sliding_jumps(newton: SemismoothNewton, outcome: Outcome, law: PointFriction) -> Outcome:
    """Return the outcome of a load step, with status JUMPS if the step is too short for a unique
    slip.

    A warning is added to the history if only lower speeds may jump.  Collective.

    Args:
        newton: a method with a symmetric tangent on the same problem.
        outcome: how the load step has ended.
        law: the friction law.
    """
    converged = outcome.status is Status.CONVERGED
    if outcome.status not in (Status.CONVERGED, Status.CYCLING, Status.MAX_ITERATIONS):
        return outcome
    here, below = least_durations(newton, law, sliding=converged)
    least = here if converged else below
    if law.dt <= least:
        cure = f"one of more than {least:.3g} has one solution, this one lasts {law.dt:.3g}"
        if not np.isfinite(least):
            cure = "only friction holds the sliding points, so no duration is long enough"
        newton.history.add(f"{TOO_SHORT}{cure}")
        return replace(outcome, status=Status.JUMPS)
    if law.dt <= below and not any(event.startswith(MAY_JUMP) for event in newton.history.events):
        _, below = least_durations(newton, law, sliding=False)
        newton.history.add(f"{MAY_JUMP}load steps of more than {below:.3g} have one solution")
    return outcome


def least_durations(
    newton: SemismoothNewton, law: PointFriction, *, sliding: bool
) -> tuple[float, float]:
    """Return the durations above which the slip in a load step is unique: near the present speeds,
    and at all lower speeds too.

    Args:
        newton: the inner method at the iterate of the load step.
        law: the friction law.
        sliding: whether the present sliding points are used; False: all points in contact that
            carry shear, at speeds of all sizes.

    Returns:
        Two times; 0: any duration is long enough; infinite: none is.
    """
    problem = newton.problem
    data = problem.data
    comm = problem.points.comm
    sets = problem.sets
    _, u_t = problem.system.contact.traces(newton.x)
    pressure, shear = newton.multipliers()
    pressure = np.maximum(pressure, 0.0)
    slip = length(slip_of(u_t, data))
    if not sliding:
        sets = replace(sets, direction=unit(shear), slip=length(shear) > 0)
    slides = sets.slip & sets.contact
    largest = parallel.largest(comm, slip)
    octaves = np.arange(-SLOWEST_STEPS, 0 if sliding else SLOWEST_STEPS, 1 / SLOW_STEPS)
    speeds = [*largest * 2.0**octaves, largest]
    slopes = law.evaluate(pressure, slip)[2]
    steepest = np.min([law.evaluate(pressure, each)[2] for each in speeds], axis=0)
    none = np.zeros_like(slip)
    blocks = tangent(replace(sets, line=(none, none, none)), data)
    durations = []
    for slope in (slopes, np.minimum(slopes, steepest)):
        falls = np.where(slides, np.maximum(-slope, 0.0) * law.dt, 0.0)
        falling = parallel.any_rank(comm, falls > 0)
        longest = (
            _largest_eigenvalue(newton, blocks, sets.direction, falls, law.dt) if falling else 0.0
        )
        durations.append(longest)
    return durations[0], durations[1]


def _largest_eigenvalue(
    newton: SemismoothNewton, blocks: Array, direction: Array, falls: Array, dt: float
) -> float:
    """Return the largest eigenvalue of S^-1 C by power iteration, time.

    The result is infinite if S is singular or not positive, or if the eigenvalue is far above
    ``dt``.

    Args:
        newton: the inner method whose matrix and linear solver are used.
        blocks: contact tangent D in S, stress per length, shape (n, d, d).
        direction: unit direction of slip, shape (n, d - 1).
        falls: lambda |F'| of C, stress times time per length, shape (n,).
        dt: duration of the load step.
    """
    problem = newton.problem
    contact = newton.problem.system.contact
    comm = problem.points.comm
    jacobian = newton.snes.getJacobian()[0]
    ksp = newton.snes.getKSP()
    forces = newton.x.duplicate()
    moved = newton.x.duplicate()
    weight = problem.points.weight * falls
    problem.insert(jacobian, blocks)
    slips = np.where(falls > 0, 1.0, 0.0)
    size = 0.0
    last = 0.0
    for _ in range(SLOWEST_STEPS):
        forces.set(0.0)
        contact.add_forces(0.0 * slips, (falls * slips)[:, None] * direction, forces)
        problem.system.keep_factor(ksp, False, forces.norm(), exact=True)
        ksp.getPC().setReusePreconditioner(False)
        moved.set(0.0)
        with petsc_options.defaults(), unprinted():
            petsc_calls.solve(ksp.solve, forces, moved)
        problem.factorised(jacobian)
        if ksp.getConvergedReason() < 0 or not finite(moved):
            return np.inf
        following = inner(contact.traces(moved)[1], direction)
        products = np.array([weight @ (slips * following), weight @ (slips * slips)])
        product, square = parallel.global_sum(comm, products)
        last = size
        size = float(product / square)
        if size < 0 or NO_FORCE * size > dt:
            return np.inf
        if abs(size - last) <= WRONG_SLOPE**2 * size:
            break
        slips = following / parallel.largest(comm, np.abs(following))
    return size
