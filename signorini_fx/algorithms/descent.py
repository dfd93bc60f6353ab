"""Semi-smooth Newton with exact line search on the energy: slower than full steps, but it cannot cycle.

With a given friction bound the regularised problem is the minimisation of the convex function J_gamma of section 3,
piecewise quadratic and once differentiable.  A linear solve with the sets of the iterate gives a direction in which
J_gamma decreases; along it the derivative is piecewise linear and increasing, so that the step is found as its zero.
The energy decreases with every step, no sets come back, and with the right sets the full step is the solution.

These sets are those of the derivative itself (a node may jump from one slip set to the other), not those of Algorithm
(SSN).  If they do not hold the body, a few other nodes are fixed in their position, for this step only; the step is
continued as long as the energy decreases, so that the body moves on until some node holds it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from petsc4py import PETSc
from scipy.optimize import brentq

from signorini_fx import parallel
from signorini_fx.algorithms.ssn import RESIDUAL_TOLERANCE, SemismoothNewton
from signorini_fx.contact.laws import (
    ActiveSets,
    Nodal,
    RegularisedData,
    at_bound,
    inner,
    length,
    natural_sets,
    onto_disc,
    trial_pressure,
    trial_shear,
)
from signorini_fx.records import Status

# The derivative at the end of a step is zero if it is this share of that at its beginning.
_FLAT = 1e-10
# A step of more than 2^60 times the direction would never end.
_DOUBLINGS = 60


def energy_descent(newton: SemismoothNewton, data: RegularisedData, measure: Callable[[], float | None]) -> Status:
    """Solve one problem from the iterate that ``newton`` holds; collective.

    Args:
        newton: the inner method, with a symmetric tangent.
        data: the problem, its friction bound given.
        measure: see ``SemismoothNewton.solve``.
    """
    problem = newton.problem
    before = newton.history.linear_solves
    for _ in range(newton.max_iterations):
        u_n, u_t = problem.traces(newton.x)
        sets, held = natural_sets(u_n, u_t, data), data
        problem.set_data(data)
        if problem.accept(newton.x, sets, RESIDUAL_TOLERANCE):
            status = Status.CONVERGED
            break
        if not problem.holds(sets, data):
            sets, held = _constrained(newton, sets, u_n, u_t, data)
        start = newton.x.copy()
        status = newton.attempt(held, sets, max_iterations=1)
        if status not in (Status.CONVERGED, Status.MAX_ITERATIONS, Status.CYCLING):
            break
        direction = newton.x.copy()
        direction.axpy(-1.0, start)
        step = _Line.of(newton, data, start, direction).lowest()
        if step is None:
            status = Status.CYCLING
            break
        start.copy(newton.x)
        newton.x.axpy(step, direction)
    else:
        status = Status.MAX_ITERATIONS
    problem.set_data(data)  # not that of a step with ties
    newton.close(data, status, before, measure)
    return status


def _constrained(
    newton: SemismoothNewton, sets: ActiveSets, u_n: Nodal, u_t: Nodal, data: RegularisedData
) -> tuple[ActiveSets, RegularisedData]:
    """A few more nodes in contact or stick, whose springs have no force in the current position; collective."""
    bound = np.zeros_like(u_n) if data.bound is None else data.bound
    excess = length(trial_shear(u_t, data)) - bound
    along, across = newton.problem.constraints(sets, -trial_pressure(u_n, data), np.where(bound > 0, excess, np.inf))
    constrained = replace(data, gap=np.where(along, u_n, data.gap), lambda_hat=np.where(along, 0.0, data.lambda_hat))
    if data.has_friction:
        origin = np.zeros_like(u_t) if data.slip_origin is None else data.slip_origin
        constrained = replace(
            constrained,
            mu_hat=np.where(across[:, None], at_bound(sets, bound), data.mu_hat),
            slip_origin=np.where(across[:, None], u_t, origin),
        )
    contact = replace(sets, contact=sets.contact | along)
    return contact.sticking(across), constrained


@dataclass(frozen=True)
class _Line:
    """J_gamma along x + t p: its derivative is force + t stiffness plus the contribution of the contact nodes.

    Attributes:
        data: the problem.
        weight: nodal weights.
        force: (A x - b) . p.
        stiffness: p . A p.
        at_start: (tau_N x, tau_T x).
        along: (tau_N p, tau_T p), zero in prescribed components.
        comm: the ranks.
    """

    data: RegularisedData
    weight: Nodal
    force: float
    stiffness: float
    at_start: tuple[Nodal, Nodal]
    along: tuple[Nodal, Nodal]
    comm: PETSc.Comm

    @classmethod
    def of(cls, newton: SemismoothNewton, data: RegularisedData, x: PETSc.Vec, p: PETSc.Vec) -> _Line:
        """The line through an iterate; collective."""
        problem = newton.problem
        matrix, work = problem.system.matrix, x.duplicate()
        matrix.mult(x, work)
        work.axpy(-1.0, problem.system.load)
        force = float(work.dot(p))
        matrix.mult(p, work)
        traces = problem.traces(x), problem.traces(p)
        return cls(data, problem.points.weight, force, float(work.dot(p)), *traces, problem.system.comm)

    def slope(self, t: float) -> float:
        """dJ/dt; collective."""
        data = self.data
        (u_n, u_t), (p_n, p_t) = self.at_start, self.along
        trial = trial_pressure(u_n + t * p_n, data)
        pressure = np.maximum(trial, 0.0)
        if data.bilateral is not None:
            pressure = np.where(data.bilateral, trial, pressure)
        work = np.dot(self.weight, pressure * p_n)
        if data.bound is not None:
            shear = onto_disc(trial_shear(u_t + t * p_t, data), data.bound)
            work += np.dot(self.weight, inner(shear, p_t))
        return self.force + t * self.stiffness + float(parallel.global_sum(self.comm, work))

    def lowest(self) -> float | None:
        """The t > 0 with the lowest energy; None if it does not decrease, or has no end; the same on all ranks."""
        at_zero = self.slope(0.0)
        if not at_zero < 0:
            return None
        low, high = 0.0, 1.0
        for _ in range(_DOUBLINGS):
            slope = self.slope(high)
            if abs(slope) <= -_FLAT * at_zero:
                return high
            if slope > 0:
                return float(brentq(self.slope, low, high, xtol=np.finfo(float).tiny, disp=False))
            low, high = high, 2 * high
        return None
