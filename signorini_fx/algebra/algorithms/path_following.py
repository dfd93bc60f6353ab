"""Automatic path-following in gamma (suggested in section 8): the smallest gamma for the required
accuracy.

For fixed sets the solution of (3.3) is a rational function of gamma.  Its first two derivatives
with respect to gamma cost a back substitution each, with the factor of the last linear solve:

    J y' = -C (y - d),   J y'' = -2 C y',   J = A + gamma C,

with C the contact blocks of the sets at gamma = 1.  A function with one pole, y(gamma) = y_inf - c
/ (E + gamma), is fitted to them.  It gives both the distance of y from the unregularised solution,
|y_inf - y| = (E + gamma) |y'|, and the gamma at which that distance has the required value. There
are no parameters to tune: the start is determined by the body, the goal by the scene.

The model is valid for the present sets only.  Where contact on another boundary moves a sticking
node, its slip does not decrease along the path: the shear grows with gamma until the node slips. If
that moves the body farther than the model predicts, the path continues.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.contact.active_sets import ActiveSets, tangent
from signorini_fx.algebra.contact.complementarity import RegularisedData, slip_of
from signorini_fx.algebra.linalg import petsc_calls
from signorini_fx.arrays import Array, length, matvec
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.tuned import GAMMA_GROWTH, NEGLIGIBLE, NOTABLE


@dataclass(frozen=True)
class PathModel:
    """The local model of the path gamma -> y(gamma) at gamma_1 = gamma.

    Attributes:
        reach: E + gamma > 0 with the pole at -E, stress per length.
        distance: energy norm of y_inf - y(gamma).
        pressure_distance: norm of lambda_inf - lambda(gamma) in L2(Gamma_c).
        left_slip: energy norm of the slip that y_inf still has at stick nodes, which the law
            excludes.
    """

    reach: float
    distance: float
    pressure_distance: float
    left_slip: float


def path_model(newton: SemismoothNewton, data: RegularisedData) -> PathModel:
    """Fit the model at the solution of ``newton`` by one or two back substitutions; collective."""
    problem = newton.problem
    points = problem.points
    system = problem.system
    sets = problem.sets
    # D / gamma_1.  Applied to (y - d) it gives the derivative of the tractions at fixed y with
    # respect to gamma_1, also where shifts keep the slip from being parallel to the shear; without
    # shifts the part that turns the shear is missing.
    blocks = tangent(sets, data) / data.gamma_n
    if (
        data.share is not None
    ):  # where the contact itself is soft a larger gamma_1 changes no pressure
        blocks[data.share != 1.0, :, 0] = 0.0

    def contact_force(vector: PETSc.Vec, gap: Array, origin: Array) -> PETSc.Vec:
        """Return C (vector - (gap, origin)), the contact force per gamma_1."""
        force = vector.duplicate()
        force.set(0.0)
        u_n, u_t = system.contact.traces(vector)
        traction = matvec(blocks, np.column_stack((u_n - gap, u_t - origin)))
        system.contact.add_forces(traction[:, 0], traction[:, 1:], force)
        return force

    first = solved_again(newton, -contact_force(newton.x, data.gap, data.slip_origin))
    stretched = system.matrix * first
    energy = stretched.dot(first)
    # The pole is a mean stiffness at the contact nodes, below the largest one, and often negligible
    # relative to gamma.
    reach = data.gamma_n
    stiffness = system.contact.stiffness(system.matrix.getDiagonal())
    if parallel.largest(system.comm, stiffness) > NOTABLE * data.gamma_n:
        second = solved_again(
            newton, -2.0 * contact_force(first, np.zeros_like(data.gap), np.zeros_like(data.mu_hat))
        )
        curvature = -stretched.dot(second)
        reach = 2.0 * energy / curvature if curvature > 0 else data.gamma_n
    # lambda = gamma_1 (tau_N y - d) on A_c along the path.
    u_n, u_t = system.contact.traces(newton.x)
    slope_n, slope_t = system.contact.traces(first)
    pressure_slope = points.norm(blocks[:, 0, 0] * (u_n - data.gap + data.gamma_n * slope_n))
    distance = float(np.sqrt(max(energy, 0.0)))
    # At a node that is stiffer than the pole the model leaves some slip too, but less than half.
    slip = slip_of(u_t, data)
    ahead = points.felt(slip + reach * slope_t)
    stays = ~sets.slip & (ahead > length(slip) / 2)
    may_slip = np.zeros_like(stays) if data.bound is None else np.isfinite(data.bound)
    left_slip = points.norm(np.sqrt(stiffness) * ahead * (stays & may_slip))
    return PathModel(reach, reach * distance, reach * pressure_slope, left_slip)


def solved_again(newton: SemismoothNewton, force: PETSc.Vec) -> PETSc.Vec:
    """Solve for another force with the matrix of the last linear solve; collective."""
    ksp = newton.snes.getKSP()
    x = newton.x.duplicate()
    # The tolerance of a Krylov method is relative to the forces of the problem; this right-hand
    # side has another size.
    tolerances = ksp.getTolerances()
    ksp.setTolerances(rtol=NEGLIGIBLE, atol=0.0)
    petsc_calls.solve(ksp.solve, force, x)
    ksp.setTolerances(*tolerances)
    return x


def path_following(
    newton: SemismoothNewton,
    data: RegularisedData,
    first_sets: ActiveSets | None,
    *,
    first_iteration: int,
    goal: Callable[[], float],
    largest: float,
    max_outer: int,
) -> tuple[Status, RegularisedData, float]:
    """Increase gamma until the regularisation error in the energy norm is at most ``goal``.

    The ratio gamma_2 / gamma_1 is kept.

    Args:
        newton: the inner method.
        data: the first problem.
        first_sets: active sets of the first linear solve; None: from the iterate.
        first_iteration: number of the first linear solve.
        goal: returns the allowed error; evaluated at each solution.
        largest: largest gamma_1, above which round-off dominates; the path ends there.
        max_outer: problems allowed.

    Returns:
        The status, the last problem, and the remaining error.
    """
    error = np.inf
    for _ in range(max_outer):
        status = newton.solve(data, first_sets, first_iteration=first_iteration)
        if status is not Status.CONVERGED:
            return status, data, error
        model = path_model(newton, data)
        allowed = goal()
        error = max(model.distance, model.left_slip)
        doubtful = model.left_slip > model.distance
        if (error <= allowed and not doubtful) or data.gamma_n >= largest:
            return Status.CONVERGED, data, error
        gamma = largest
        if allowed > 0:
            # Half of the allowed error; otherwise the path would approach the goal slowly from
            # above.
            wanted = model.reach * (model.distance / (allowed / 2) - 1) + data.gamma_n
            gamma = min(max(wanted, GAMMA_GROWTH * data.gamma_n if doubtful else 0.0), largest)
        data = replace(data, gamma_n=gamma, gamma_t=gamma * data.gamma_t / data.gamma_n)
        first_sets = newton.continued_sets(data)
        first_iteration = 1
    return Status.OUTER_MAX_ITERATIONS, data, error
