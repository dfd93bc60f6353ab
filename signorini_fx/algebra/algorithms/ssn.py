"""Algorithm (SSN), section 4: semi-smooth Newton as an active-set method, driven by PETSc SNES."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra import Settings
from signorini_fx.algebra.contact.active_sets import ActiveSets, next_sets, slip_multiplier
from signorini_fx.algebra.contact.complementarity import (
    RegularisedData,
    onto_disc,
    project,
    slip_of,
)
from signorini_fx.algebra.linalg import finite, petsc_calls, petsc_options
from signorini_fx.algebra.linalg.petsc_calls import (
    call,
    called_back,
    factor_lacks_memory,
    memory_ended,
    unlock,
    unprinted,
    weakly,
)
from signorini_fx.algebra.regularised import RegularisedProblem
from signorini_fx.arrays import Array, length, matvec, unit
from signorini_fx.machine import parallel
from signorini_fx.records import History, IterationRecord, OuterRecord, Status
from signorini_fx.tuned import (
    CERTIFICATE_TOLERANCE,
    DECIDED,
    NEGLIGIBLE,
    NO_FORCE,
    NOTABLE,
    SAME_NUMBER,
    SLOW_STEPS,
    SLOWEST_STEPS,
)

if TYPE_CHECKING:
    from signorini_fx.algebra.algorithms.softening import Descent

_RENEW = -2
_KEEP = -1
# While the sets repeat and directions of slip change, the residual of the law must be halved in
# this many steps, and sets may come back as often.
_TURNS = 6
_NO_SUCH_FACTOR = 92  # PETSC_ERR_MISSING_FACTOR
_SNES = PETSc.SNES.ConvergedReason
Checkpoint = tuple[PETSc.Vec, ActiveSets, RegularisedData]  # (x, sets, data) of an iterate


class SemismoothNewton:
    """Solves contact problems on one elastic system; the solver objects are set up once and kept.

    A full Newton step with fixed sets is step 4 of the algorithm; the iteration stops when the sets
    repeat (step 3) and the residual is small.  Because an iterate depends on its sets alone, sets
    that occurred before mean a cycle.  In 3D the problem is not affine for given sets: directions
    of slip still change while the sets stay.  There the friction law must hold as well, and sets
    that occurred before mean a cycle only if the residual of the law is unchanged, or if it has not
    been halved after several returns.  PETSc options with the prefix ``sfx_`` apply to the SNES,
    KSP and PC; otherwise the defaults are used.

    ``symmetric`` states whether the Jacobian is symmetric; it is not if the friction bound depends
    on the pressure.

    Attributes:
        problem: the regularised problem.
        history: the record of all solves.
        x: the iterate, which two methods may share.
        start_time: clock time at which the method was created, s.
        max_iterations: largest number of linear solves for one problem.
        fails_in_step: whether a Krylov method has failed in this load step, so that matrices are
            factorised.
        linear: whether there is no contact point on any rank, so that one linear solve suffices.
        lost: whether the interior-point method has failed for a problem of this load step.  Such a
            problem most likely has no solution, as in a fixed-point iteration beyond a limit load,
            so the method is not tried again in the step.
    """

    def __init__(
        self,
        problem: RegularisedProblem,
        x: PETSc.Vec,
        settings: Settings,
        history: History,
        *,
        symmetric: bool = True,
    ) -> None:
        self.problem = problem
        self.history = history
        self.x = x
        self.start_time = time.perf_counter()
        self.max_iterations = settings.max_iterations
        self._settings = settings
        self.lost = False
        self._symmetric = symmetric
        self._factor: PETSc.KSP | None = None
        self.fails_in_step = False  # whether a Krylov method has failed in this load step
        # whether the usual preconditioner belongs to a matrix before the last factorised one
        self._outdated = False
        self._point_count = int(parallel.total(problem.points.comm, problem.points.size))
        self.linear = self._point_count == 0

    @cached_property
    def snes(self) -> PETSc.SNES:
        """The SNES, set up when it is first needed; collective."""
        symmetric = self._symmetric
        snes = PETSc.SNES().create(self.problem.points.comm)
        snes.setOptionsPrefix(petsc_options.PREFIX)
        snes.setType(PETSc.SNES.Type.NEWTONLS)
        snes.setFunction(weakly(self.problem.residual), self.x.duplicate())
        jacobian = self.problem.create_jacobian(symmetric=symmetric)
        snes.setJacobian(weakly(self._assemble_jacobian), jacobian)
        snes.setTolerances(rtol=NO_FORCE, max_it=self.max_iterations)
        snes.setConvergenceTest(weakly(self._test))
        snes.getKSP().setOperators(jacobian)
        self.problem.system.configure(snes.getKSP(), symmetric=symmetric)
        try:
            with petsc_options.defaults(
                {"snes_linesearch_type": "basic"}
            ):  # petsc4py 3.22 has no setter for it
                snes.setFromOptions()
        except PETSc.Error as error:
            raise petsc_options.refused(error) or error from None
        self.max_iterations = snes.getTolerances()[3]
        return snes

    @cached_property
    def _descent(self) -> Descent:
        """The method that solves problems with bonds."""
        from signorini_fx.algebra.algorithms.softening import Descent

        return Descent(self)

    @called_back
    def _assemble_jacobian(
        self, snes: PETSc.SNES, x: PETSc.Vec, jacobian: PETSc.Mat, _: PETSc.Mat
    ) -> None:
        """Assemble the Jacobian at ``x``, and decide whether the factor of an earlier one
        is kept.
        """
        problem = self.problem
        self._assembled = True
        problem.assemble_jacobian(jacobian)
        ksp = snes.getKSP()
        least = problem.least_share(x)
        forces = max(least, NEGLIGIBLE) * problem.force_scale
        exact = not self._may_keep or least < NEGLIGIBLE
        keeps_factor = problem.system.keep_factor(ksp, problem.unchanged, forces, exact=exact)
        self._factorised = not keeps_factor or (self._outdated and self._factor is None)
        self._outdated &= self._factor is not None
        self._loosened |= problem.system.inexact
        if self._factorised:
            problem.factorised(jacobian)
        # SNES decides about the factor after this callback: -2 renews it once, -1 keeps it.
        call("SNESSetLagPreconditioner", snes, _RENEW if self._factorised else _KEEP)

    def solve(
        self,
        data: RegularisedData,
        first_sets: ActiveSets | None = None,
        *,
        first_iteration: int = 1,
        max_iterations: int | None = None,
        measure: Callable[[], float | None] = lambda: None,
    ) -> Status:
        """Solve one problem; the iterate stays in ``x``, the sets in ``problem.sets``.

        If the sets cycle or the iteration is too long, the interior-point method is tried as a
        fall-back where the friction bound is given.

        Args:
            data: the regularised problem.
            first_sets: active sets of the first linear solve; None: from the iterate and its sets.
            first_iteration: number of the first linear solve; 0 if it only computes the start
                (section 7).
            max_iterations: linear solves allowed, without fall-backs; None: those of the settings.
            measure: returns the value of the stopping criterion of the outer algorithm, for the
                history.
        """
        solves_before = self.history.linear_solves
        status = self.attempt(
            data, first_sets, first_iteration=first_iteration, max_iterations=max_iterations
        )
        self.close(data, status, solves_before, measure)
        if max_iterations is not None or status not in (Status.CYCLING, Status.MAX_ITERATIONS):
            return status
        if data.bond is not None:
            return status
        if self.problem.lost_to_round_off(self.x, NO_FORCE):
            return Status.ROUND_OFF
        # With a friction bound that depends on the pressure there is no energy, and no convex
        # programme; a limit that the user has set is no failure.
        ran_on = status is Status.CYCLING or not self._settings.limited("max_iterations")
        beyond_help = self.lost or self.history.exhausted
        if not self._settings.fallbacks or data.follows is not None or not ran_on or beyond_help:
            return status
        from signorini_fx.algebra.algorithms.interior_point import interior_point

        return interior_point(self, data, status, measure)

    def close(
        self,
        data: RegularisedData,
        status: Status,
        solves_before: int,
        measure: Callable[[], float | None] = lambda: None,
    ) -> None:
        """Add the record of a solved problem to the history.

        Args:
            data: the problem.
            status: how it has ended.
            solves_before: number of linear solves before it.
            measure: returns the value of the stopping criterion of the outer algorithm.
        """
        history = self.history
        solves = history.linear_solves - solves_before
        history.add(
            OuterRecord(
                history.step, len(history.outer), solves, data.gamma_n, measure(), status.value
            )
        )

    def attempt(
        self,
        data: RegularisedData,
        first_sets: ActiveSets | None = None,
        *,
        first_iteration: int = 1,
        max_iterations: int | None = None,
    ) -> Status:
        """Run the iteration without fall-backs and without an outer record; see ``solve``."""
        # With bonds, contact need not hold the body, and the sets follow from the iterate.
        self.problem.set_data(data, None if data.bond is not None else first_sets)
        self._first_iteration = first_iteration
        self._solves_before = self.history.linear_solves
        self._seen: dict[int, float] = {}
        self._returns = 0  # how often sets have come back
        self._changes: list[tuple[int, int]] = []
        self._stalls: list[float] = []
        self._status: Status | None = None
        self._last_forces = 0.0  # their size at the last iterate
        self._vanishing = False  # whether the forces still decrease while the sets stay
        if self.history.exhausted:
            return Status.MAX_ITERATIONS
        remaining = self.history.limit - self._solves_before
        limit = int(min(self.max_iterations, max_iterations or self.max_iterations, remaining))
        self.snes.setTolerances(max_it=limit)
        self._may_keep = True
        self._loosened = False
        self._assembled = False
        given = data.follows is None and np.isinf(data.sigma)
        self._may_propose = given and self._symmetric and max_iterations is None
        self._slow = False
        try:
            with petsc_options.defaults(), unprinted():
                if data.bond is not None:
                    return self._descent.descend(limit, first_iteration)
                status = self._run(data, limit)
        except (PETSc.Error, MemoryError) as error:
            status = self.outcome_of(error)
        # Some sets of a cycle may make the system singular; those of the solution do not.
        return Status.CYCLING if self._returns and status is Status.SINGULAR else status

    def outcome_of(self, error: Exception) -> Status:
        """Return the status for an error that a factorisation package has raised.

        Some packages raise an error where others only set a reason.

        Raises:
            Exception: the error, on several ranks, as not all of them may have it.
            OptionsError: options of the user may have caused it.
        """
        if (
            isinstance(error, PETSc.Error) and error.ierr == _NO_SUCH_FACTOR
        ):  # all ranks have this one
            raise petsc_options.refused(error) or error
        if self.problem.points.comm.size > 1:
            raise error
        unlock(self.x)
        if memory_ended(error):
            return Status.NO_MEMORY
        if isinstance(error, PETSc.Error) and petsc_options.user_sets(
            "mat_"
        ):  # PETSc reads them when it factorises
            raise petsc_options.refused(error) or error
        return Status.SINGULAR

    def _run(self, data: RegularisedData, limit: int) -> Status:
        """Run SNES, and again as long as ``_improved`` changes something after a failure."""
        usual = self.snes.getKSP()
        first = self._first_iteration
        if self.fails_in_step:
            self._factorise()
        try:
            status = self._iterate()
            while (
                done := self.history.linear_solves - self._solves_before
            ) < limit and self._improved(status):
                self._status = None
                self._first_iteration = first + done
                self._seen.clear()
                self._changes.clear()
                self.snes.setTolerances(max_it=limit - done)
                self.problem.set_data(data, self.problem.sets)
                status = self._iterate()
        finally:
            if self._factor is not None:
                self.snes.setKSP(usual)
                self._factor.destroy()
                self._factor = None
                self._outdated = True
        return status

    def _improved(self, status: Status) -> bool:
        """Return whether something was changed with which SNES may succeed after a failure;
        collective.

        It proposes other sets, resets the iterate to zero, requires exact linear solves, or
        factorises the matrix.
        """
        if self._slow:
            self._propose()
            return True
        if status is Status.ROUND_OFF and self._vanishing:
            # Each solve leaves only round-off of the previous iterate: nothing acts, so the
            # solution is zero.
            self._vanishing = False
            self._stalls.clear()
            self.x.zeroEntries()
            return True
        # The failure may be due to an inexact linear solve, or to a kept factor.
        cheaper = (
            self._loosened
            if status is Status.CYCLING
            else status is Status.LINEAR_SOLVER and not self._factorised
        )
        if self._may_keep and cheaper:
            self._may_keep = False
            return True
        if status is not Status.LINEAR_SOLVER or not self._factorise():
            return False
        self.history.add(f"{status.value}: the matrix is factorised")
        self.fails_in_step = True
        return True

    def _propose(self) -> None:
        """Set the sets of the next full step to those that the interior-point method proposes;
        without a proposal, to the next sets of the iteration.  Collective.
        """
        from signorini_fx.algebra.algorithms.interior_point import proposed_sets

        self._slow = False
        following = self.problem.next.sets
        solves = self.history.linear_solves
        proposed = proposed_sets(self)
        if (
            proposed is None and self._factorise()
        ):  # inexact Krylov solves may not be enough to identify the sets
            proposed = proposed_sets(self)
        self.problem.sets = following if proposed is None else proposed
        asked = self.history.linear_solves - solves
        self.history.add(f"sets: damped change of the active sets ({asked} extra solves)")

    def _factorise(self) -> bool:
        """Replace a Krylov method by a direct solver; return whether this was possible.
        Collective.
        """
        if self._factor is not None:
            return False
        ksp = PETSc.KSP().create(self.problem.points.comm)
        ksp.setOptionsPrefix(petsc_options.PREFIX)
        ksp.setOperators(self.snes.getJacobian()[0])
        if not self.problem.system.factorise(ksp, symmetric=self._symmetric):
            ksp.destroy()
            return False
        self.snes.setKSP(ksp)
        self._factor = ksp
        return True

    def _iterate(self) -> Status:
        petsc_calls.solve(self.snes.solve, None, self.x)
        return self._status or self._reason()

    def checkpoint(self) -> Checkpoint:
        """Return the iterate with its sets and its problem, for ``restore``."""
        return self.x.copy(), self.problem.sets, self.problem.data

    def restore(self, checkpoint: Checkpoint) -> None:
        """Restore an iterate, its sets and its problem from a checkpoint."""
        x, sets, data = checkpoint
        self.problem.set_data(data)
        self.problem.sets = sets
        x.copy(self.x)

    def begin_at(self, x: PETSc.Vec) -> None:
        """Copy an iterate into ``x``; the sets stay."""
        self.x.getArray()[:] = x.getArray(readonly=True)

    def pose(self, data: RegularisedData, sets: ActiveSets) -> None:
        """Set a problem and its sets without solving it."""
        self.problem.set_data(data, sets)
        self.problem.sets = self.problem.next.sets

    def multipliers(self) -> tuple[Array, Array]:
        """Return (lambda, mu) of the last iterate."""
        return self.problem.multipliers(self.x, self.problem.sets)

    def shifts(self, data: RegularisedData) -> tuple[Array, Array]:
        """Return (lambda, mu) made feasible, as the next lambda_hat and mu_hat.

        A point may slip but be unable to move in some tangential direction, because of supports or
        of another contact of its node.  The shear along that direction would tend to its limit,
        that of the direction of slip, the more slowly the smaller the slip, so it is set to the
        limit at once.  The same is done where supports prescribe a slip and the shear is below its
        bound.
        """
        problem = self.problem
        points = self.problem.points
        u_n, u_t = problem.system.contact.traces(self.x)
        pressure, shear = project(*self.multipliers(), u_t, data)
        still, entered = points.closed(problem.sets.contact, u_n - data.gap)
        bound = data.friction_bound(pressure, u_t)
        slip = slip_of(u_t - entered, data)
        slips = problem.sets.slip | (
            problem.sets.contact & points.dragged(slip, np.column_stack((u_n, u_t)))
        )
        slips &= np.isfinite(bound) & (length(slip) > 0)
        limit = np.where(slips, bound, 0.0)[:, None] * unit(slip)
        missing = matvec(still, np.where(slips[:, None], limit - shear, 0.0))
        shear = onto_disc(shear + missing, bound)
        return pressure, shear

    def continued_sets(self, data: RegularisedData) -> ActiveSets:
        """Return the first sets for ``data`` when it starts from the variables (y, lambda, xi, mu)
        of the last problem.
        """
        problem = self.problem
        u_n, u_t = problem.system.contact.traces(self.x)
        _, mu = self.multipliers()
        return next_sets(u_n, u_t, slip_multiplier(problem.sets, mu, u_t, problem.data), mu, data)

    @called_back
    def _test(self, snes: PETSc.SNES, k: int, norms: tuple[float, float, float]) -> int:
        """Return the SNES reason after linear solve ``k`` (step 3 of the algorithm; k = 0: before
        the first).
        """
        problem = self.problem
        active, plus, minus, changed, fingerprint = self.counts(*problem.friction_bounds(self.x))
        residual = norms[2] / problem.force_scale if problem.force_scale > 0 else norms[2]
        last_forces = self._last_forces
        self._last_forces = problem.force_scale
        law = 0.0 if problem.affine or k == 0 else problem.law_residual(self.x)
        if k > 0:
            counts = (active, plus, minus, changed)
            self.record(
                k - 1 + self._first_iteration, counts, residual, factorised=self._factorised
            )
        if k > 0 and changed == 0:
            if (
                problem.next.repaired
            ):  # the trial sets would not hold the body, but the forces may be in balance
                balanced = problem.accept(self.x, problem.next.trial, snes.getTolerances()[0])
                return (
                    int(_SNES.CONVERGED_FNORM_RELATIVE) if balanced else self._stop(Status.CYCLING)
                )
            if self._settled(residual, law):
                from_afar = (
                    NEGLIGIBLE * norms[1] > norms[0]
                    or NEGLIGIBLE * last_forces > problem.force_scale
                )
                from_afar = from_afar and residual > SAME_NUMBER and k < snes.getTolerances()[3]
                return int(
                    _SNES.CONVERGED_ITERATING if from_afar else _SNES.CONVERGED_FNORM_RELATIVE
                )
            # The sets are right.  Either the linear solve was not exact, which the next step with
            # the same sets corrects, or directions of slip still change.
            self._stalls.append(max(residual, law))
            self._vanishing = NEGLIGIBLE * last_forces > problem.force_scale > 0
            turning = law > snes.getTolerances()[0]
            patience = _TURNS if turning else 2
            if len(self._stalls) > patience and self._stalls[-1] > 0.5 * self._stalls[-patience]:
                if turning:
                    return self._stop(Status.CYCLING)
                # No solve removes the round-off of gamma times the displacement.
                least = self._stalls[-1]
                lost = self.problem.lost_to_round_off(self.x, least)
                if lost and least <= CERTIFICATE_TOLERANCE:
                    return int(_SNES.CONVERGED_FNORM_RELATIVE)
                return self._stop(Status.ROUND_OFF)
        elif fingerprint in self._seen:
            # Sets that recur without a residual differ only at points on the border between two
            # sets: both are solutions.
            sound = k > 0 and not problem.next.repaired and problem.next.escapes is None
            if sound and residual <= snes.getTolerances()[0] and self._settled(residual, law):
                return int(_SNES.CONVERGED_FNORM_RELATIVE)
            # Where directions of slip change, or the bound depends on the slip, the same sets have
            # another tangent when they recur; in a true cycle the residual of the law recurs, too.
            seen = self._seen[fingerprint]
            now = max(law, snes.getTolerances()[0])
            self._returns += 1
            turned = self._returns <= _TURNS and abs(now - seen) > NOTABLE * seen
            if problem.affine or not (now <= 0.5 * seen or turned):
                return self._stop(Status.CYCLING)
        self._changes.append((changed, active))
        if self._may_propose and self._is_slow(k):
            self._may_propose = False
            self._slow = True
            return self._stop(Status.MAX_ITERATIONS)
        # The residual of the law with the first sets is not known.
        self._seen[fingerprint] = max(law, snes.getTolerances()[0]) if k > 0 else np.inf
        if problem.next.escapes is not None:
            return self._stop(problem.next.escapes)
        if k > 0 and self.history.overdue():
            return self._stop(Status.MAX_ITERATIONS)
        return int(_SNES.CONVERGED_ITERATING)

    def _is_slow(self, k: int) -> bool:
        """Return whether, after linear solve ``k``, so few sets change per solve that full steps
        would take many more.
        """
        changes = [changed for changed, _ in self._changes[-6:]]
        if k < SLOW_STEPS or min(changes[-3:]) == 0:
            return False
        lost = (self._changes[-4][1] - self._changes[-1][1]) / 3
        left = self._changes[-1][1] if lost > 0 else self._point_count - self._changes[-1][1]
        enough = sum(changes[-3:]) >= DECIDED * sum(changes[:3])
        return (enough and 0 < abs(lost) * SLOWEST_STEPS <= left) or k >= SLOWEST_STEPS

    def _settled(self, residual: float, law: float) -> bool:
        """Return whether sets that repeat are those of a solution.

        Args:
            residual: of the equations with the next sets, relative.
            law: residual of the friction law, relative.
        """
        # The residual is that of the next sets.  Where directions change, that of the present sets
        # counts.
        tolerance = self.snes.getTolerances()[0]
        if self.problem.affine or law > tolerance or residual <= tolerance:
            return law <= tolerance and residual <= tolerance
        return self.problem.accept(self.x, self.problem.sets, tolerance)

    def _reason(self) -> Status:
        """Return the status for the reason that SNES gives, if the convergence test has not stopped
        it.
        """
        reason = self.snes.getConvergedReason()
        if reason > 0:
            return Status.CONVERGED
        if reason == _SNES.DIVERGED_MAX_IT:
            return Status.MAX_ITERATIONS
        if reason == _SNES.DIVERGED_LINEAR_SOLVE and finite(self.snes.getJacobian()[0]):
            ksp = self.snes.getKSP()
            if factor_lacks_memory(ksp):
                return Status.NO_MEMORY
            sound = ksp.getPC().getFailedReason() == PETSc.PC.FailedReason.NOERROR
            return Status.LINEAR_SOLVER if sound else Status.SINGULAR
        # If the matrix is finite and the solution is not, the linear solve has broken down.
        solved = self._assembled and finite(self.snes.getJacobian()[0])
        return (
            Status.SINGULAR
            if solved and not finite(self.snes.getSolutionUpdate())
            else Status.NOT_FINITE
        )

    def _stop(self, status: Status) -> int:
        self._status = status
        return int(_SNES.DIVERGED_LOCAL_MIN)

    def record(
        self,
        iteration: int,
        counts: tuple[int, int, int, int],
        residual: float,
        *,
        factorised: bool,
    ) -> None:
        """Add the record of a linear solve to the history.

        Args:
            iteration: its number in the problem.
            counts: numbers of nodes in contact, slipping either way, and changing their set.
            residual: of the next sets, relative.
            factorised: whether the matrix was factorised for it.
        """
        history = self.history
        seconds = time.perf_counter() - self.start_time
        numbers = history.step, history.linear_solves + 1, len(history.outer), iteration
        history.add(IterationRecord(*numbers, *counts, residual, factorised, seconds))

    def counts(self, bound: Array, next_bound: Array) -> list[int]:
        """Return the numbers of nodes in contact, slipping forwards, slipping backwards and
        changing their set, and a hash of the next sets; all summed over the ranks.
        """
        # Points that can transmit no shear count as sticking.
        sets = self.problem.sets.sticking(~(bound > 0))
        following = self.problem.next.sets.sticking(~(next_bound > 0))
        side = sets.side
        changed = sets.changed(following)
        comm = self.problem.points.comm
        state = (following.contact.tobytes(), following.side.tobytes())
        numbers = [np.count_nonzero(mask) for mask in (sets.contact, side > 0, side < 0, changed)]
        sums = parallel.global_sum(
            comm, np.array([*numbers, hash((comm.rank, *state))], dtype=np.int64)
        )
        return [int(number) for number in sums]
