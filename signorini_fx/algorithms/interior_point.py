"""A contact problem with a given friction bound as a convex programme, solved by a primal-dual interior-point method.

The solution minimises a convex function, and satisfies, with s and r the multipliers of the bounds of lambda and mu,

    tau_N y - d + s = (lambda - lambda_hat) / gamma_1,    lambda s = 0,              lambda, s >= 0,
    tau_T y - r mu = (mu - mu_hat) / gamma_2,             r (F^2 g^2 - |mu|^2) / 2 = 0,    |mu| <= F g, r >= 0.

Newton's method solves these equations with both products equal to t > 0, which is reduced from step to step, and stays
inside the bounds.  Eliminated point by point, a step is one solve with A + B^T D B and D > 0, whatever is in contact:
no sets are chosen, so that none can cycle, and a body held by contact alone is held in every step.  Full steps with the
sets of its end remove what t has left.

Source: Wright, Primal-Dual Interior-Point Methods (1997), chapters 6 and 8; the disc as in Andersen, Roos and Terlaky,
Math. Program. 95 (2003) 249-277.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.algorithms.ssn import SemismoothNewton
from signorini_fx.contact.laws import (
    Nodal,
    RegularisedData,
    inner,
    length,
    natural_sets,
    onto_disc,
    slip_of,
    trial_pressure,
    trial_shear,
)
from signorini_fx.linalg import finite, options
from signorini_fx.problem.regularised import RegularisedProblem
from signorini_fx.records import IterationRecord, Status
from signorini_fx.tuned import (
    FIRST_PRESSURE,
    FIRST_SHEAR,
    LAST_PRODUCT,
    REDUCED_PRODUCT,
    RESIDUAL_TOLERANCE,
    SHARE_OF_WAY,
    SMALL_PRODUCT,
)


def interior_point(newton: SemismoothNewton, data: RegularisedData, measure: Callable[[], float | None]) -> Status:
    """Solve one problem, whatever iterate ``newton`` holds; collective.

    Args:
        newton: the inner method, with a symmetric tangent and a regularised problem.
        data: the problem, its friction bound given.
        measure: see ``SemismoothNewton.solve``.
    """
    before, problem = newton.history.linear_solves, newton.problem
    problem.set_data(data)
    try:
        status = _Programme(newton, data).solve()
    except PETSc.Error:  # see ``SemismoothNewton.attempt``
        if problem.points.comm.size > 1:
            raise
        status = Status.SINGULAR
    if status is Status.CONVERGED:
        ended, sets = newton.x.copy(), natural_sets(*problem.system.contact.traces(newton.x), data)
        status = newton.attempt(data, sets)
        if status is not Status.CONVERGED:  # sets that do not hold the body, or cycle for points at their border
            newton.begin_at(ended)
            status = Status.CONVERGED if problem.accept(ended, sets, RESIDUAL_TOLERANCE) else status
    newton.close(data, status, before, measure)
    return status


@dataclass(frozen=True)
class _Inside:
    """A point inside the bounds, or a step of it: lambda, s and r, shape (n,), and mu, shape (n, d - 1)."""

    pressure: Nodal
    opening: Nodal
    shear: Nodal
    rate: Nodal


class _Programme:
    """The interior-point method for one problem; the iterate is that of ``newton``."""

    def __init__(self, newton: SemismoothNewton, data: RegularisedData) -> None:
        assert isinstance(newton.problem, RegularisedProblem)
        self._newton, self._data, self._problem = newton, data, newton.problem
        self._points, self._comm = newton.problem.points, newton.problem.points.comm
        everywhere = self._points.everywhere
        self._one_sided = everywhere if data.bilateral is None else ~data.bilateral
        self._bound = np.zeros(everywhere.size) if data.bound is None else data.bound
        # Where it is zero there is no shear, where it is infinite no disc.
        self._rubs = (self._bound > 0) & np.isfinite(self._bound)
        stiffness = self._problem.system.contact.stiffness(self._problem.system.matrix.getDiagonal())
        self._stiffness = parallel.largest(self._comm, stiffness)
        self._force, self._change = newton.x.duplicate(), newton.x.duplicate()
        self._steps = 0

    def solve(self) -> Status:
        """Reduce the products until full steps can end the iteration."""
        newton, problem = self._newton, self._problem
        at = self._tied()
        first = 0.0 if at is None else self._product(at)
        bounds = float(parallel.global_sum(self._comm, (1.0 * self._one_sided + self._rubs).sum()))
        for _ in range(newton.max_iterations):
            if at is None:
                return Status.SINGULAR
            product = self._product(at)
            near = product <= SMALL_PRODUCT * first
            sets = natural_sets(*problem.system.contact.traces(newton.x), self._data)
            if near and (product <= LAST_PRODUCT * first or problem.accept(newton.x, sets, RESIDUAL_TOLERANCE)):
                return Status.CONVERGED
            if newton.history.exhausted:
                break
            begun = newton.x.copy()
            at = self._advanced(at, REDUCED_PRODUCT * product / bounds)
            if at is None and near:  # the products are below the round-off of the blocks
                newton.begin_at(begun)
                return Status.CONVERGED
        return Status.MAX_ITERATIONS

    def _tied(self) -> _Inside | None:
        """Where the body is if all points are tied to the foundation, pushed inside the bounds."""
        data, size = self._data, self._points.dimension - 1
        rough, x = (self._bound > 0)[:, None], self._newton.x
        blocks = np.zeros((rough.size, 1 + size, 1 + size))
        blocks[:, 0, 0] = data.gamma_n
        blocks[:, 1:, 1:] = np.where(rough, data.gamma_t, 0.0)[:, None] * np.eye(size)
        u_n, u_t = self._problem.system.contact.traces(x)
        if not self._moves(trial_pressure(u_n, data), np.where(rough, trial_shear(u_t, data), 0.0), blocks, 0):
            return None
        u_n, u_t = self._problem.system.contact.traces(x)
        pressure, shear = trial_pressure(u_n, data), np.where(rough, trial_shear(u_t, data), 0.0)
        stress = parallel.largest(self._comm, np.maximum(np.abs(pressure), length(shear)))
        away = max(stress / self._stiffness, parallel.largest(self._comm, np.abs(u_n)))
        pressure = np.where(self._one_sided, np.maximum(pressure, FIRST_PRESSURE * stress), pressure)
        shear = np.where(self._rubs[:, None], onto_disc(shear, FIRST_SHEAR * self._bound), shear)
        rate = np.divide(stress * away, self._room(shear), out=np.zeros_like(u_n), where=self._rubs)
        return _Inside(pressure, np.maximum(data.gap - u_n, away), shear, rate)

    def _room(self, shear: Nodal) -> Nodal:
        """(F^2 g^2 - |mu|^2) / 2 where there is a disc, elsewhere a number that is not zero, shape (n,)."""
        bound, size = np.where(self._rubs, self._bound, 1.0), np.where(self._rubs, length(shear), 0.0)
        return (bound - size) * (bound + size) / 2

    def _product(self, at: _Inside) -> float:
        """The sum of the products; collective."""
        products = np.where(self._one_sided, at.pressure * at.opening, 0.0) + at.rate * self._room(at.shear)
        return float(parallel.global_sum(self._comm, products.sum()))

    def _advanced(self, at: _Inside, target: float) -> _Inside | None:
        """The point after a step towards these products; None if the linear solve fails; collective."""
        data, one, rubs, room = self._data, self._one_sided, self._rubs, self._room(at.shear)
        none, x = np.zeros_like(room), self._newton.x
        u_n, u_t = self._problem.system.contact.traces(x)
        # What the equations miss, the changes of s and r eliminated.
        normal = u_n - data.gap - (at.pressure - data.lambda_hat) / data.gamma_n
        normal += np.divide(target, at.pressure, out=none.copy(), where=one)
        pull = np.divide(target, room, out=none.copy(), where=rubs)[:, None] * at.shear
        across = slip_of(u_t, data) - (at.shear - data.mu_hat) / data.gamma_t - pull
        blocks = self._blocks(at, room)

        def answer(normal: Nodal, across: Nodal) -> tuple[Nodal, Nodal]:
            return blocks[:, 0, 0] * normal, np.einsum("nij,nj->ni", blocks[:, 1:, 1:], across)

        pressure, shear = answer(normal, across)
        closed = one & (at.pressure > self._stiffness * at.opening)
        if not self._moves(at.pressure + pressure, at.shear + shear, blocks, np.count_nonzero(closed)):
            return None
        w_n, w_t = self._problem.system.contact.traces(x)
        pressure, shear = answer(normal + w_n - u_n, across + w_t - u_t)
        opening = np.divide(target - at.opening * pressure, at.pressure, out=at.opening.copy(), where=one) - at.opening
        turned = target + at.rate * inner(at.shear, shear)
        step = _Inside(pressure, opening, shear, np.divide(turned, room, out=none, where=rubs) - at.rate)
        share = min(1.0, SHARE_OF_WAY * self._way(at, step))
        x.axpy(share - 1.0, self._change)
        return _Inside(*(old + share * new for old, new in zip(vars(at).values(), vars(step).values(), strict=True)))

    def _blocks(self, at: _Inside, room: Nodal) -> Nodal:
        """D, the derivative of (lambda, mu) by the displacement, stress per length, shape (n, d, d)."""
        data, size = self._data, self._points.dimension - 1
        blocks = np.zeros((room.size, 1 + size, 1 + size))
        opens = np.divide(at.opening, at.pressure, out=np.zeros_like(room), where=self._one_sided)
        blocks[:, 0, 0] = 1.0 / (1.0 / data.gamma_n + opens)
        soft, grows = 1.0 / data.gamma_t + at.rate, np.where(self._rubs, at.rate / room, 0.0)
        share = grows / (soft + grows * inner(at.shear, at.shear))
        along = share[:, None, None] * at.shear[:, :, None] * at.shear[:, None, :]
        blocks[:, 1:, 1:] = np.where(self._bound > 0, 1.0 / soft, 0.0)[:, None, None] * (np.eye(size) - along)
        return blocks

    def _way(self, at: _Inside, step: _Inside) -> float:
        """The share of a step at which the first bound is reached; collective."""
        a, b, c = inner(step.shear, step.shear), inner(at.shear, step.shear), 2 * self._room(at.shear)
        ahead = b + np.sqrt(b**2 + a * c)
        shares = [np.divide(c, ahead, out=np.full_like(c, np.inf), where=self._rubs & (ahead > 0))]
        for values, change, where in (
            (at.pressure, step.pressure, self._one_sided),
            (at.opening, step.opening, self._one_sided),
            (at.rate, step.rate, self._rubs),
        ):
            shares.append(np.divide(-values, change, out=np.full_like(c, np.inf), where=where & (change < 0)))
        return -parallel.global_max(self._comm, -float(np.min(shares, initial=np.inf)))

    def _moves(self, pressure: Nodal, shear: Nodal, blocks: Nodal, closed: int) -> bool:
        """Move the iterate by z, (A + B^T D B) z = b - A x - B^T W (lambda, mu), if there is one; collective."""
        newton, problem, change = self._newton, self._problem, self._change
        jacobian, ksp, history = newton.snes.getJacobian()[0], newton.snes.getKSP(), newton.history
        problem.imbalance(newton.x, pressure, shear, self._force)
        problem.insert(jacobian, blocks)
        problem.system.keep_factor(ksp, None, problem.force_scale, exact=True)
        ksp.getPC().setReusePreconditioner(False)
        change.set(0.0)
        with options.defaults(problem.system.solver_defaults):
            ksp.solve(self._force, change)
        problem.factorised(jacobian)
        change.scale(-1.0)
        newton.x.axpy(1.0, change)
        self._steps += 1
        residual, active = (
            self._force.norm() / (problem.force_scale or 1.0),
            int(parallel.global_sum(self._comm, closed)),
        )
        places = history.step, history.linear_solves + 1, len(history.outer), self._steps
        history.add(IterationRecord(*places, active, 0, 0, 0, residual, True, time.perf_counter() - newton.start_time))
        return ksp.getConvergedReason() > 0 and finite(change)
