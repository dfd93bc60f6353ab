"""A contact problem with a given friction bound as a convex programme, solved by a primal-dual
interior-point method.

The solution minimises a convex function, and satisfies, with s and r the multipliers of the bounds
of lambda and mu,

    tau_N y - d + s = (lambda - lambda_hat) / gamma_1,    lambda s = 0,    lambda, s >= 0,
    tau_T y - r mu = (mu - mu_hat) / gamma_2,    r (F^2 g^2 - |mu|^2) / 2 = 0,
    |mu| <= F g,    r >= 0.

Newton's method solves these equations with both products equal to t > 0, which is reduced from step
to step, and stays inside the bounds.  After elimination point by point, a step is one factorisation
of A + B^T D B with D > 0 and two solves, whatever is in contact: Mehrotra's predictor aims at t =
0, and his corrector at the t that the predictor shows to be in reach, with the products of the
predictor's changes.  No sets are chosen, so that none can cycle, and a body held by contact alone
is held in every step.

The iteration starts on a soft foundation.  On a foundation of stiffness gamma a slender body that
is lifted would be pulled with all of gamma, and the products would be dominated by this pull.

The method has two uses.  As a fall-back it continues until the products are round-off, and full
Newton steps with its final sets remove the remaining error.  Where full steps change few sets at a
time, as where a slender body peels off, it continues only until the sets are identified by the
quotients of two successive iterates, which tend to 0 and 1 (Tapia indicators).

Source: Mehrotra, SIAM J. Optim. 2 (1992) 575-601; Wright, Primal-Dual Interior-Point Methods
(1997), chapters 6, 8 and 10; the quotients: El-Bakry, Tapia and Zhang, SIAM Review 36 (1994) 45-72;
the disc as in Andersen, Roos and Terlaky, Math. Program. 95 (2003) 249-277.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.contact.active_sets import ActiveSets, next_sets
from signorini_fx.algebra.contact.complementarity import (
    RegularisedData,
    onto_disc,
    slip_of,
    trial_pressure,
    trial_shear,
)
from signorini_fx.algebra.linalg import finite, petsc_calls, petsc_options
from signorini_fx.algebra.linalg.petsc_calls import factor_lacks_memory, unprinted
from signorini_fx.arrays import Array, Flags, inner, length, matvec, quotient
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.tuned import (
    DECIDED,
    NEGLIGIBLE,
    NO_FORCE,
    NOTHING_LEFT,
    SAME_NUMBER,
    SLOWEST_STEPS,
)

Newton = Any  # ``ssn.SemismoothNewton``, which asks for this module


def _sets_of(newton: Newton, data: RegularisedData) -> ActiveSets:
    """Return the sets of the derivative of (3.3b) and (3.4) at the iterate itself, in the primal
    form, for a given bound only.
    """
    u_n, u_t = newton.problem.system.contact.traces(newton.x)
    return next_sets(u_n, u_t, 0.0 * u_t, trial_shear(u_t, data), data)


def interior_point(
    newton: Newton, data: RegularisedData, failed: Status, measure: Callable[[], float | None]
) -> Status:
    """Solve one problem with a given friction bound and a symmetric tangent; collective.

    Args:
        newton: the inner method, at any iterate.
        data: the problem.
        failed: the status with which ``newton`` has failed; it is returned, with the old iterate,
            if this method fails too.
        measure: returns the value of the stopping criterion of the outer algorithm.
    """
    start = newton.checkpoint()
    before = newton.history.linear_solves
    problem = newton.problem
    newton.history.add(f"{failed.value}: interior point")
    data = replace(data, sigma=np.inf)
    problem.set_data(data)
    try:
        status = _Programme(newton, data, exact=True).solve()
    except (PETSc.Error, MemoryError) as error:
        status = newton.outcome_of(error)
    if status is Status.CONVERGED:
        ended = newton.x.copy()
        sets = _sets_of(newton, data)
        status = newton.attempt(data, sets)
        if (
            status is not Status.CONVERGED
        ):  # sets that do not hold the body, or cycle for points at their border
            newton.begin_at(ended)
            status = Status.CONVERGED if problem.accept(ended, sets, NO_FORCE) else status
    newton.close(data, status, before, measure)
    if status is Status.CONVERGED:
        return status
    newton.lost = True
    newton.restore(start)
    return failed


def proposed_sets(newton: Newton) -> ActiveSets | None:
    """Return active sets that hold the body, found by a few interior-point steps from a soft
    foundation.

    For a problem with a given friction bound, after a full step.  Contact everywhere is proposed if
    the sets found would not hold the body; None is returned if a linear solve fails.  The iterate
    of ``newton`` is kept.  Collective.
    """
    problem = newton.problem
    begun = newton.x.copy()
    data = problem.data
    sets = problem.sets
    try:
        proposed = _Programme(newton, data, exact=False).sets()
    except (PETSc.Error, MemoryError) as error:
        newton.outcome_of(error)
        proposed = None
    newton.begin_at(begun)
    problem.sets = sets
    if proposed is None or problem.holds(proposed, data):
        return proposed
    return ActiveSets.all_in_contact(*data.mu_hat.shape)


@dataclass(frozen=True)
class _Inside:
    """A point inside the bounds, or a step between two such points.

    Attributes:
        pressure: lambda, shape (n,).
        opening: s, length, shape (n,).
        shear: mu, shape (n, d - 1).
        rate: r, slip per shear, shape (n,).
    """

    pressure: Array
    opening: Array
    shear: Array
    rate: Array

    def moved(self, step: _Inside, share: float) -> _Inside:
        """Return the point after ``share`` times a step."""
        return _Inside(
            *(
                old + share * new
                for old, new in zip(vars(self).values(), vars(step).values(), strict=True)
            )
        )


class _Programme:
    """The interior-point method for one problem, at the iterate of ``newton``."""

    def __init__(self, newton: Newton, data: RegularisedData, *, exact: bool) -> None:
        self._newton = newton
        self._data = data
        self._problem = newton.problem
        self._exact = exact
        self._points = newton.problem.points
        self._comm = newton.problem.points.comm
        # Where supports alone determine the gap, no pressure acts that could be bounded.
        movable = ~self._points.immovable
        self._one_sided = movable & ~data.bilateral
        self._bound = np.zeros(movable.size) if data.bound is None else data.bound
        # Where the bound is zero there is no shear, where it is infinite there is no disc.
        self._rubs = (self._bound > 0) & np.isfinite(self._bound)
        self._bounds = self._number(self._one_sided) + self._number(self._rubs)
        self._force = newton.x.duplicate()
        self._change = newton.x.duplicate()
        self._steps = 0

    def _number(self, where: Flags) -> float:
        """Return the number of points of all ranks where the flag is set; collective."""
        return parallel.total(self._comm, where)

    def solve(self) -> Status:
        """Reduce the products until full Newton steps can finish the solve, and return the
        status.
        """
        newton = self._newton
        problem = self._problem
        at = self._on_a_soft_foundation()
        first = 0.0 if at is None else self._product(at)
        for _ in range(newton.max_iterations):
            if at is None:
                return (
                    Status.NO_MEMORY
                    if factor_lacks_memory(newton.snes.getKSP())
                    else Status.SINGULAR
                )
            product = self._product(at)
            near = product <= SAME_NUMBER * first
            sets = _sets_of(newton, self._data)
            if near and (
                product <= NOTHING_LEFT**2 * first or problem.accept(newton.x, sets, NO_FORCE)
            ):
                return Status.CONVERGED
            if newton.history.exhausted:
                break
            step = self._advanced(at)
            at = None if step is None else step[0]
        return Status.MAX_ITERATIONS

    def sets(self) -> ActiveSets | None:
        """Reduce the products until the sets are identified, and return these; None if a solve
        fails.
        """
        newton = self._newton
        at = self._on_a_soft_foundation()
        first = 0.0 if at is None else self._product(at)
        if at is not None and first == 0.0:  # no point presses: there is nothing to reduce
            return _sets_of(newton, self._data)
        closed, slip = (np.zeros_like(self._one_sided) for _ in range(2))
        for _ in range(SLOWEST_STEPS):
            step = None if at is None else self._advanced(at)
            if at is None or step is None:
                return None
            begin = at
            at, share = step
            closed_before, slip_before = closed, slip
            closed, slip = self._indicated(begin, at)
            changed = self._number((closed != closed_before) | (slip != slip_before))
            small = self._product(at) <= NEGLIGIBLE * first and share > DECIDED
            if newton.history.exhausted or (small and changed <= 1):
                break
        sets = _sets_of(newton, self._data)
        return replace(sets, contact=np.where(self._one_sided, closed, sets.contact))

    def _indicated(self, begin: _Inside, end: _Inside) -> tuple[Flags, Flags]:
        """Return which points are in contact and which slip, by the quotients of two iterates."""
        one = self._one_sided
        rubs = self._rubs
        presses = quotient(end.pressure, begin.pressure, one, otherwise=1.0)
        opens = quotient(end.opening, begin.opening, one)
        slides = quotient(end.rate, begin.rate, rubs)
        remains = quotient(self._room(end.shear), self._room(begin.shear), rubs, otherwise=1.0)
        return presses > opens, rubs & (slides > remains)

    def _on_a_soft_foundation(self) -> _Inside | None:
        """Solve with all points tied to a soft foundation, and return a point inside the bounds
        with equal products; None if the solve fails.
        """
        data = self._data
        size = self._points.dimension - 1
        contact = self._problem.system.contact
        soft = data.softer(
            NEGLIGIBLE * contact.natural_stiffness(self._problem.system.matrix.getDiagonal())
        )
        rough = (self._bound > 0)[:, None]
        x = self._newton.x
        blocks = np.zeros((rough.size, 1 + size, 1 + size))
        blocks[:, 0, 0] = soft.stiffness
        blocks[:, 1:, 1:] = np.where(rough, soft.gamma_t, 0.0)[:, None] * np.eye(size)

        def tractions() -> tuple[Array, Array]:
            u_n, u_t = contact.traces(x)
            return trial_pressure(u_n, soft), np.where(rough, trial_shear(u_t, soft), 0.0)

        if not self._moves(*tractions(), blocks, 0):
            return None
        pressure, shear = tractions()
        stress = parallel.total(self._comm, np.abs(pressure)) / self._number(
            self._points.everywhere
        )
        product = stress**2 / soft.stiffness
        apart = np.sqrt(pressure**2 + 4 * stress**2)
        opening = np.asarray((apart - pressure) / (2 * soft.stiffness), dtype=np.float64)
        shear = np.where(self._rubs[:, None], onto_disc(shear, self._bound / 2), shear)
        return _Inside(
            np.where(self._one_sided, (apart + pressure) / 2, pressure),
            opening,
            shear,
            quotient(product, self._room(shear), self._rubs),
        )

    def _room(self, shear: Array) -> Array:
        """Return (F^2 g^2 - |mu|^2) / 2, but at least its round-off, shape (n,).

        The value has no meaning, but is not zero, where there is no finite positive bound.
        """
        bound = np.where(self._rubs, self._bound, 1.0)
        size = np.where(self._rubs, length(shear), 0.0)
        return np.maximum((bound - size) * (bound + size) / 2, np.finfo(np.float64).eps * bound**2)

    def _product(self, at: _Inside) -> float:
        """Return the sum of all products lambda s and r (F^2 g^2 - |mu|^2) / 2; collective."""
        products = np.where(self._one_sided, at.pressure * at.opening, 0.0) + at.rate * self._room(
            at.shear
        )
        return parallel.total(self._comm, products)

    def _advanced(self, at: _Inside) -> tuple[_Inside, float] | None:
        """Take a predictor and a corrector step, and return the new point and the share of the
        corrector that was taken; None if a solve fails.  Collective.
        """
        x = self._newton.x
        room = self._room(at.shear)
        blocks = self._blocks(at, room)
        none = np.zeros_like(room)
        ahead = self._direction(at, none, none, blocks)
        if ahead is None:
            return None
        x.axpy(-1.0, self._change)
        product = self._product(at)
        reached = self._product(at.moved(ahead, self._way(at, ahead)))
        target = max(reached / product, 0.0) ** 3 * product / self._bounds
        normal = target - ahead.pressure * ahead.opening
        turned = inner(at.shear, ahead.shear)
        disc = target + ahead.rate * turned + at.rate * inner(ahead.shear, ahead.shear) / 2
        step = self._direction(at, normal, disc, blocks)
        if step is None:
            return None
        share = min(
            1.0, 0.99 * self._way(at, step)
        )  # of Mehrotra: nearly all of the way to the nearest bound
        x.axpy(share - 1.0, self._change)
        return at.moved(step, share), share

    def _direction(
        self, at: _Inside, normal_target: Array, disc_target: Array, blocks: Array
    ) -> _Inside | None:
        """Return the full step towards given products, and move the iterate to its end; None if the
        solve fails.  Collective.

        Args:
            at: the present point.
            normal_target: products lambda s wanted, corrected by second-order terms, shape (n,).
            disc_target: products of the friction disc wanted, likewise, shape (n,).
            blocks: D, see ``_blocks``.
        """
        data = self._data
        one = self._one_sided
        rubs = self._rubs
        room = self._room(at.shear)
        traces = self._problem.system.contact.traces
        u_n, u_t = traces(self._newton.x)
        # Residuals of the equations after elimination of the changes of s and r.
        normal = u_n - data.gap - (at.pressure - data.lambda_hat) / data.stiffness
        normal += quotient(normal_target, at.pressure, one)
        pull = quotient(disc_target, room, rubs)[:, None] * at.shear
        across = slip_of(u_t, data) - (at.shear - data.mu_hat) / data.gamma_t - pull

        def answer(normal: Array, across: Array) -> tuple[Array, Array]:
            return blocks[:, 0, 0] * normal, matvec(blocks[:, 1:, 1:], across)

        pressure, shear = answer(normal, across)
        closed = one & (at.pressure > data.stiffness * at.opening)
        if not self._moves(
            at.pressure + pressure, at.shear + shear, blocks, np.count_nonzero(closed)
        ):
            return None
        w_n, w_t = traces(self._newton.x)
        pressure, shear = answer(normal + w_n - u_n, across + w_t - u_t)
        opens = quotient(
            normal_target - at.opening * pressure, at.pressure, one, otherwise=at.opening
        )
        slides = quotient(disc_target + at.rate * inner(at.shear, shear), room, rubs)
        return _Inside(pressure, opens - at.opening, shear, slides - at.rate)

    def _blocks(self, at: _Inside, room: Array) -> Array:
        """Return D, the derivative of (lambda, mu) with respect to the displacement, stress per
        length, shape (n, d, d).
        """
        data = self._data
        size = self._points.dimension - 1
        blocks = np.zeros((room.size, 1 + size, 1 + size))
        opens = quotient(at.opening, at.pressure, self._one_sided)
        blocks[:, 0, 0] = 1.0 / (1.0 / data.stiffness + opens)
        soft = 1.0 / data.gamma_t + at.rate
        grows = quotient(at.rate, room, self._rubs)
        share = grows / (soft + grows * inner(at.shear, at.shear))
        along = share[:, None, None] * at.shear[:, :, None] * at.shear[:, None, :]
        blocks[:, 1:, 1:] = np.where(self._bound > 0, 1.0 / soft, 0.0)[:, None, None] * (
            np.eye(size) - along
        )
        return blocks

    def _way(self, at: _Inside, step: _Inside) -> float:
        """Return the share of a step at which the first bound is reached; collective."""
        a = inner(step.shear, step.shear)
        b = inner(at.shear, step.shear)
        c = 2 * self._room(at.shear)
        ahead = b + np.sqrt(b**2 + a * c)
        shares = [quotient(c, ahead, self._rubs & (ahead > 0), otherwise=np.inf)]
        for values, change, where in (
            (at.pressure, step.pressure, self._one_sided),
            (at.opening, step.opening, self._one_sided),
            (at.rate, step.rate, self._rubs),
        ):
            shares.append(quotient(-values, change, where & (change < 0), otherwise=np.inf))
        return -parallel.global_max(self._comm, -float(np.min(shares, initial=np.inf)))

    def _moves(self, pressure: Array, shear: Array, blocks: Array, closed: int) -> bool:
        """Solve (A + B^T D B) z = b - A x - B^T W (lambda, mu), add z to the iterate, and return
        whether the solve succeeded.  Collective.

        Args:
            pressure: lambda, shape (n,).
            shear: mu, shape (n, d - 1).
            blocks: D, shape (n, d, d).
            closed: number of points in contact on this rank, for the history.
        """
        newton = self._newton
        problem = self._problem
        change = self._change
        jacobian = newton.snes.getJacobian()[0]
        ksp = newton.snes.getKSP()
        problem.imbalance(newton.x, pressure, shear, self._force)
        problem.insert(jacobian, blocks)
        renewed = not problem.unchanged
        problem.system.keep_factor(ksp, False, problem.force_scale, exact=self._exact)
        ksp.getPC().setReusePreconditioner(False)
        change.set(0.0)
        with petsc_options.defaults(), unprinted():
            petsc_calls.solve(ksp.solve, self._force, change)
        problem.factorised(jacobian)
        change.scale(-1.0)
        newton.x.axpy(1.0, change)
        self._steps += 1
        residual = self._force.norm() / (problem.force_scale or 1.0)
        active = parallel.global_sum(self._comm, closed)
        newton.record(self._steps, (int(active), 0, 0, 0), residual, factorised=renewed)
        return ksp.getConvergedReason() > 0 and finite(change)
