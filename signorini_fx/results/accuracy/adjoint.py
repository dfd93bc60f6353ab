"""One adjoint solve: the derivatives of a quantity by every residual force and every change of the
contact law.

Data p enter the state (x, t) through R(x, t; p) = A x - b + B^T (w t) = 0 and, for fixed active
sets, the affine law dt = D (d(B x) - dd) + c.  Here D are the blocks of the Newton tangent, dd is a
change of gap and origin of the slip, and c a change of the traction at a given displacement.
docs/theory.md has the adjoint state psi of a quantity J(x, t) with J_t = w kappa, and its
derivatives, with q = B psi - kappa; all derivatives by p are those for fixed x and t.

Without regularisation the tied components, the normal one in contact and the tangential ones of
stick, do not change at all, B dx = dd, and psi must not move them.  The multipliers chi of this
condition are found with the same matrix, as augmentation finds tractions: each time the error
shrinks by the compliance of the body times 1 / gamma.  The matrix is the transposed tangent of
Newton's method.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.state import PointState
from signorini_fx.algebra.linalg import ElasticSystem, petsc_calls, petsc_options
from signorini_fx.algebra.regularised import ContactTangent
from signorini_fx.arrays import Array, Flags, inner, length, quotient, rmatvec, unit
from signorini_fx.errors import SignoriniError
from signorini_fx.machine import parallel
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, LEFT_BY_SOLVES, MANY_STEPS, SAME_NUMBER

# Features of a scene that have no adjoint states.
REFUSES = {
    "cohesion": "derivatives are not possible yet with bonds that tear: remove 'cohesion'",
    "inertia": "derivatives of motions with inertia are not possible yet",
    "material with a state": "derivatives are not possible yet with a material that has a state",
    "mixed element": "derivatives are not possible yet with the mixed element: remove 'mixed'",
    "soft contact": "derivatives are not possible yet with soft contact: remove 'overclosure'",
    "heat": "derivatives are not possible yet with heat: remove 'heat'",
    "seeping": "derivatives are not possible yet with a fluid that seeps in: remove 'seeping'",
    "wear": "derivatives are not possible yet with wear: remove 'wear'",
    "shortening by force": "derivatives are not possible yet where a force shortens a section",
    "driven foundation": "derivatives are not possible yet where a force moves it",
}


@dataclass(frozen=True)
class LinearisedLaw:
    """The contact law, linearised at the n points of this rank."""

    # components whose displacement the law prescribes, or would prescribe without regularisation,
    # shape (n, d)
    tied: Flags
    # E, from tractions of tied components to those of all: the friction bound follows the pressure,
    # shape (n, d, d)
    spread: Array
    # the rest of the tangent: the shear follows the direction of slip, stress per length, shape
    # (n, d, d)
    turning: Array
    gamma: Array  # stiffness of each component, stress per length, shape (d,)
    exact: bool  # whether there is no regularisation
    slip: Array  # e where the shear is at its bound, else zero, shape (n, d - 1)
    between: int  # points of all ranks between two active sets: derivatives are one-sided there
    # derivatives of slips by displacements beyond the tangential displacement itself, because
    # displacements turn the contact, without unit, shape (n, d - 1, d); None: zero
    slips: Array | None = None

    @property
    def tangent(self) -> Array:
        """D, the derivative of tractions by displacements of the points, stress per length, shape
        (n, d, d).
        """
        tied = self.spread * (self.gamma * self.tied)[:, None, :]
        slopes = self.turning
        if not self.exact:
            slopes = slopes + tied
            tied = np.zeros_like(tied)
        return (slopes if self.slips is None else slopes + slopes[:, :, 1:] @ self.slips) + tied

    def by_slips(self, owed: Array) -> Array:
        """Return derivatives by the gaps and slips that the law prescribes, from derivatives by
        displacements, shape (n, d).
        """
        if self.slips is None or not self.exact:
            return owed
        normal = self.slips[:, :, 0]
        along = np.eye(self.slips.shape[1]) + self.slips[:, :, 1:]
        slips = np.asarray(
            np.linalg.solve(along.transpose(0, 2, 1), owed[:, 1:, None])[:, :, 0], dtype=np.float64
        )
        return np.column_stack((owed[:, 0] - inner(slips, normal), slips))


def law_at(
    task: Task, outcome: Outcome, start: Start, state: PointState, law: PointFriction | None
) -> LinearisedLaw:
    """Return the linearised law at the solution of a load step that has just been solved;
    collective.
    """
    exact = not all(np.isfinite(task.promised(outcome)[:2]))
    data = start.data if exact else outcome.problem.data
    gamma = data.gamma_n, data.gamma_t
    return linearised(state, law, gamma, exact=exact, before=start.data.mu_hat)


def linearised(
    state: PointState,
    law: PointFriction | None,
    gamma: tuple[float, float],
    *,
    exact: bool,
    before: Array | None = None,
) -> LinearisedLaw:
    """Return the linearised law at a solution; collective.

    Args:
        state: the state of the contact points.
        law: the friction law; None without friction.
        gamma: (gamma_1, gamma_2), stress per length; those of the regularisation unless ``exact``.
        exact: whether there is no regularisation.
        before: the shear at the beginning of the load step, stress, shape (n, d - 1).
    """
    count, tangents = state.shear.shape
    law = law if state.has_friction else None
    coefficient: Array = np.zeros(count)
    if law is not None:
        _, coefficient, _ = law.evaluate(state.pressure, 0.0)
    rubs = state.bound > 0
    moves = np.any(state.direction != 0, axis=1) | ~rubs
    slips = moves & rubs
    slip = np.where(slips[:, None], unit(state.shear), 0.0)
    tied = np.repeat((~moves & rubs)[:, None], 1 + tangents, axis=1)
    tied[:, 0] = state.in_contact
    # Where a point slips the shear is bound(pressure) e: ``spread`` has its derivative by the
    # pressure, ``turning`` that by the displacement.
    coefficient = np.where(slips, coefficient, 0.0)  # it may be infinite where there is no pressure
    spread = np.broadcast_to(np.eye(1 + tangents), (count, 1 + tangents, 1 + tangents)).copy()
    spread[:, 1:, 0] = slip * coefficient[:, None]
    turning = np.zeros_like(spread)
    turning[:, 1:, 1:] = _turning_of_shear(state, slip, gamma[1], exact=exact, before=before)
    stiffness = np.array([gamma[0], *[gamma[1]] * tangents])
    between = _between(state, gamma, slips, ~moves)
    return LinearisedLaw(tied, spread, turning, stiffness, exact, slip, between)


def _turning_of_shear(
    state: PointState, slip: Array, gamma: float, *, exact: bool, before: Array | None
) -> Array:
    """Return the derivative of bound e by the displacement, gamma bound / |xi| (I - e e^T), stress
    per length, shape (n, d - 1, d - 1), where e = xi / |xi| is ``slip`` and xi = before + gamma
    times the slip.
    """
    bound = np.where(slip.any(axis=1) & np.isfinite(state.bound), state.bound, 0.0)
    trial_shear = gamma * inner(slip, state.slip_length)
    if exact:  # where the slip is very small, the shear turns as if it were regularised
        trial_shear = np.maximum(trial_shear, bound * CERTIFICATE_TOLERANCE)
    else:
        already = 0.0 if before is None else inner(slip, before)
        trial_shear = np.maximum(trial_shear + already, bound)
    stiffness = gamma * quotient(bound, trial_shear)
    across = np.eye(slip.shape[1]) - slip[:, :, None] * slip[:, None, :]
    return stiffness[:, None, None] * across


def _between(
    state: PointState,
    gamma: tuple[float, float],
    slips: Flags,
    sticks: Flags,
) -> int:
    """Return how many points on all ranks would change their active set under a negligible change;
    collective.
    """
    comm = state.points.comm
    largest = parallel.largest(comm, np.abs(state.pressure))
    size = np.where(state.in_contact, state.pressure, gamma[0] * (state.u_n - state.gap))
    opening = ~state.bilateral & (np.abs(size) <= CERTIFICATE_TOLERANCE * largest)
    bound = np.where(np.isfinite(state.bound), state.bound, 0.0)
    tolerance = CERTIFICATE_TOLERANCE * bound
    stopping = slips & (gamma[1] * length(state.xi) <= tolerance)
    starting = sticks & np.isfinite(state.bound) & (bound - length(state.shear) <= tolerance)
    return int(parallel.total(comm, opening | stopping | starting))


@dataclass(frozen=True)
class Explicit:
    """The explicit dependence of a load step on a datum, for fixed displacement and tractions:
    values, or their derivatives.
    """

    values: Sequence[float]  # values of the quantities
    residual: PETSc.Vec  # R at the unknowns of the stiffness
    relative: Array  # B x - d, length, shape (n, d)
    bound: Array  # the friction bound, stress, shape (n,)


@dataclass(frozen=True)
class Adjoint:
    """The adjoint state of one quantity."""

    psi: PETSc.Vec  # at all unknowns of the stiffness, zero where they are prescribed
    untied: (
        Array  # q at the points, for what changes tractions at a given displacement, shape (n, d)
    )
    # minus the contributions of displacements of tied components, and of the turning of shear,
    # shape (n, d)
    tied: Array
    law: LinearisedLaw  # the linearised law
    weight: Array  # w, shape (n,)

    def derivative(self, by: Explicit, direct: float) -> float:
        """Return dJ/dp from the explicit derivatives by p and from ``direct``, J_p; collective."""
        changes = inner(self.tied, by.relative) + by.bound * inner(
            self.untied[:, 1:], self.law.slip
        )
        points = parallel.global_sum(self.psi.comm.tompi4py(), np.array(self.weight @ changes))
        return float(direct - self.psi.dot(by.residual) - points)


class TransposedTangent:
    """The transposed Newton tangent at a solution, factorised once for all quantities; collective.

    Args:
        system: the elastic system.
        law: the linearised contact law.
        symmetric: whether A is symmetric, which at finite displacements it is not where friction
            acts on a curved shape.
    """

    def __init__(
        self, system: ElasticSystem, law: LinearisedLaw, *, symmetric: bool = True
    ) -> None:
        # a Krylov system keeps the size of its forces
        self.system = copy(system)
        self._law = law
        blocks = law.tangent
        transposed = np.ascontiguousarray(law.tangent.transpose(0, 2, 1))
        askew = parallel.any_rank(system.comm, not np.array_equal(blocks, transposed))
        self._as_it_is = not symmetric
        symmetric = symmetric and not askew
        tangent = ContactTangent(self.system.matrix, self.system.contact)
        matrix = tangent.create()
        self.ksp = PETSc.KSP().create(system.comm)
        self.ksp.setOptionsPrefix(petsc_options.PREFIX)
        self.ksp.setOperators(matrix)
        with petsc_options.defaults():
            self.system.configure(self.ksp, symmetric=symmetric)
            self.ksp.setFromOptions()
        if symmetric:
            matrix.setOption(PETSc.Mat.Option.SPD, True)
        tangent.insert(matrix, blocks if self._as_it_is else transposed)

    def _solve(self, right: PETSc.Vec, x: PETSc.Vec, forces: float) -> None:
        """Solve for one right-hand side; a Krylov method stops at a residual relative to
        ``forces``; collective.
        """
        self.system.keep_factor(self.ksp, False, forces, exact=True)
        x.set(0.0)
        with petsc_options.defaults(), petsc_calls.unprinted():
            petsc_calls.solve(
                self.ksp.solveTranspose if self._as_it_is else self.ksp.solve, right, x
            )
        if self.ksp.getConvergedReason() < 0:
            raise SignoriniError(
                "the linear solver has failed for the tangent at the solution: there is no "
                "derivative"
            )

    def _left(self, x: PETSc.Vec, right: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Compute the residual of a solution."""
        matrix, _ = self.ksp.getOperators()
        (matrix.multTranspose if self._as_it_is else matrix.mult)(x, residual)
        residual.aypx(-1.0, right)

    def adjoint(self, by_displacement: PETSc.Vec, by_traction: Array) -> Adjoint:
        """Return the adjoint state of a quantity J; collective.

        Args:
            by_displacement: J_x at the unknowns of the stiffness, zero where they are prescribed.
            by_traction: kappa, J_t over the weight, shape (n, d).

        Raises:
            SignoriniError: the tangent is singular, or the iteration for chi is too slow.
        """
        law = self._law
        right = self.system.with_load(by_displacement)
        contact = right.contact
        load = right.load
        given = rmatvec(law.tangent, by_traction)
        contact.add_forces(given[:, 0], given[:, 1:], load)
        psi = load.duplicate()
        correction = load.duplicate()
        residual = load.copy()
        forces = load.norm()
        chi = np.zeros_like(by_traction)
        solves = 0
        last = np.inf
        psi.set(0.0)
        while True:
            self._solve(residual, correction, forces)
            psi.axpy(1.0, correction)
            # one step of iterative refinement: penalties hide forces from the first solve
            if not law.exact:
                self._left(psi, load, residual)
                self._solve(residual, correction, residual.norm())
                psi.axpy(1.0, correction)
            solves += 1
            moved = np.column_stack(contact.traces(psi))
            untied = moved - by_traction
            # A traction cannot move a component that supports prescribe; without regularisation it
            # is then no unknown.
            unmoved = (np.abs(moved) <= SAME_NUMBER * length(moved)[:, None]) & law.exact
            tractions = np.where(law.tied, rmatvec(law.spread, untied), 0.0)
            step = law.gamma * np.where(unmoved, 0.0, tractions)
            chi = chi + step
            change = parallel.largest(right.comm, np.abs(step))
            size = parallel.largest(right.comm, np.abs(chi))
            # Where statics alone determines the quantity chi is zero, and steps are the round-off
            # of their terms.
            terms = law.gamma * (np.abs(moved) + np.abs(by_traction))
            round_off = np.finfo(float).eps * parallel.largest(right.comm, terms)
            if not np.isfinite(change):
                raise SignoriniError(
                    "the tangent at the solution is singular: there is no derivative"
                )
            stalls = change > 0.5 * last and change <= CERTIFICATE_TOLERANCE * size
            settled = change <= max(LEFT_BY_SOLVES * size, round_off)
            if not law.exact or settled or stalls or solves >= MANY_STEPS:
                break
            last = change
            residual.set(0.0)
            contact.add_forces(
                -step[:, 0], -step[:, 1:], residual
            )  # if small, little is left for a Krylov method
        if law.exact and change > max(CERTIFICATE_TOLERANCE * size, round_off):
            raise SignoriniError(
                f"the tractions of the adjoint problem still change by {change / size:.0e} of "
                "their size "
                f"after {solves} solves: there is no derivative; larger gamma_n and gamma_t need "
                "fewer"
            )
        turned = rmatvec(law.turning, untied)
        tied = law.by_slips(chi) + turned
        return Adjoint(right.displacement(psi), untied, tied, law, contact.points.weight)
