"""Newton's method for softening bonds: a blend of tangent and secant, with a line search.

Where bonds soften, Newton's method with plain tangents cycles.  The matrix uses theta T + (1 -
theta) S of the tangent T of the bonds and of their secant S, with the largest tried theta for which
the matrix is definite, apart from the coupling of Coulomb friction.  With theta = 0 a secant step
lowers the energy.  The line search halves a step until it no longer goes far beyond the zero of the
residual along its direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.contact.active_sets import tangent
from signorini_fx.algebra.contact.complementarity import trial_pressure
from signorini_fx.algebra.linalg import finite, petsc_calls
from signorini_fx.arrays import Array
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, LINE_SEARCH_STEPS, NO_FORCE, WHOLE_SLOPE

Newton = Any  # ``ssn.SemismoothNewton``, which asks for this module

_TANGENT_SHARES = (1.0, 0.97, 0.9, 0.7, 0.4, 0.0)
_PATIENCE = 4  # steps in which round-off may leave the residual as it is


class Descent:
    """Solves the problems with bonds of an inner method and updates its iterate; methods are
    collective.
    """

    def __init__(self, newton: Newton) -> None:
        problem = newton.problem
        self._newton = newton
        self._jacobian = problem.create_jacobian(symmetric=False)
        self._symmetric = problem.tangent.create()
        self._ksp = PETSc.KSP().create(problem.points.comm)
        self._ksp.setOperators(self._jacobian)
        if not problem.system.factorise(self._ksp, symmetric=False):
            problem.system.configure(self._ksp, symmetric=False)

    def descend(self, limit: int, first: int) -> Status:
        """Iterate until the residual is small.

        Args:
            limit: linear solves allowed.
            first: number of the first linear solve in the history.
        """
        newton = self._newton
        problem = newton.problem
        x = newton.x
        force = x.duplicate()
        way = x.duplicate()
        problem.residual(None, x, force)
        left = []
        share = 1.0
        for k in range(limit):
            if problem.next.escapes is not None:
                return problem.next.escapes
            problem.sets = problem.next.sets
            # After a line search without success a full secant step is taken.
            stuck = share <= 0.5**LINE_SEARCH_STEPS
            self._assemble(_TANGENT_SHARES[-1:] if stuck else _TANGENT_SHARES)
            petsc_calls.solve(self._ksp.solve, force, way)
            if self._ksp.getConvergedReason() < 0 or not finite(way):
                return Status.SINGULAR
            begun = way.dot(force)
            broken = problem.data.broken
            share = 1.0
            x.axpy(-1.0, way)
            problem.residual(None, x, force)
            # If no bond is damaged further, full steps find the contact sets without a line search.
            torn = not np.array_equal(broken, problem.data.broken)
            searched = k > 0 and not stuck and parallel.any_rank(problem.points.comm, torn)
            while (
                searched
                and share > 0.5**LINE_SEARCH_STEPS
                and -way.dot(force) > WHOLE_SLOPE * abs(begun)
            ):
                share /= 2
                x.axpy(share, way)
                problem.residual(None, x, force)
            *counts, _ = newton.counts(*problem.friction_bounds(x))
            size = force.norm()
            residual = size / problem.force_scale if problem.force_scale > 0 else size
            active, plus, minus, changed = counts
            newton.record(k + first, (active, plus, minus, changed), residual, factorised=True)
            if not np.isfinite(residual):
                return Status.NOT_FINITE
            left.append(residual)
            law = 0.0
            if residual <= NO_FORCE or self._stagnates(left):
                problem.sets = problem.next.sets
                law = 0.0 if problem.affine else problem.law_residual(x)
                if law <= max(NO_FORCE, residual):
                    return Status.CONVERGED
            if newton.history.overdue():
                break
        return Status.MAX_ITERATIONS

    @staticmethod
    def _stagnates(left: list[float]) -> bool:
        """Return whether the residuals are small and no longer decrease, so that only round-off is
        left.
        """
        last = left[-_PATIENCE:]
        small = max(last) <= CERTIFICATE_TOLERANCE
        return small and len(left) > _PATIENCE and last[-1] > WHOLE_SLOPE * last[0]

    def _assemble(self, shares: Sequence[float]) -> None:
        """Assemble the Jacobian at the iterate with the first of the ``shares`` for which it is
        definite.

        ``shares`` are values of theta in descending order; the last one is used if none is
        definite.
        """
        problem = self._newton.problem
        data = problem.data
        bond = data.bond
        assert bond is not None
        traces = problem.system.contact.traces(self._newton.x)
        contact = tangent(problem.sets, data)
        uncoupled = contact.copy()
        uncoupled[:, 1:, 0] = 0.0
        for theta in shares:
            blocks = bond.blocks(traces, theta)
            symmetric = 0.5 * (blocks + blocks.swapaxes(1, 2))
            if theta == shares[-1] or self._definite(uncoupled + symmetric):
                break
        coupling = np.zeros_like(blocks)
        if data.bound is not None:
            pressure = np.where(problem.sets.contact, trial_pressure(traces[0], data), 0.0)
            # The friction bound of fully damaged bonds.
            whole = replace(data, broken=None).friction_bound(pressure, traces[1])
            slips = problem.sets.slip & problem.sets.contact & np.isfinite(whole)
            bound = np.where(slips, whole, 0.0)[:, None] * problem.sets.direction
            coupling[:, 1:] = bound[:, :, None] * bond.damage_by(traces)[:, None, :]
        problem.insert(self._jacobian, contact + blocks + coupling)

    def _definite(self, blocks: Array) -> bool:
        """Return whether the elastic matrix with these blocks at the contact points is definite."""
        problem = self._newton.problem
        matrix = self._symmetric
        problem.tangent.insert(matrix, blocks)
        return bool(problem.system.is_definite(matrix))
