"""Whether a load step with friction that falls as its slip grows has one solution.

For fixed sets and pressures let S be the stiffness of the points that slide, and C the fall of
their friction by the speed, the diagonal of w lambda |F'|.  The slip of a step of duration dt has
one solution if S - C / dt is positive definite, which means dt above the largest eigenvalue of
S^-1 C.
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
    """Return the outcome of a load step, or that its sliding jumps; collective.

    ``newton``: a method with a symmetric tangent on the same problem.
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
    """Return what a load step must last more than so that the slip of its points has one solution
    near their speeds, and one at all lower speeds, too.

    Args:
        newton: at the iterate of the load step.
        law: its friction.
        sliding: whether the points that slide now are known; else all in contact count, at speeds
            of all sizes.

    Returns:
        Times; 0: any; infinite: no duration would do.
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
    """Return the largest eigenvalue of S^-1 C by powers of it; infinite where S is singular.

    Args:
        newton: whose matrix has the tangent of contact.
        blocks: D of S, stress per length, shape (n, d, d).
        direction: of slip, shape (n, d - 1).
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
