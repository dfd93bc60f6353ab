"""The unregularised limit, gamma = infinity: nodal complementarity solved by elimination of the active constraints.

On A_c the normal displacement is set to the gap, on I_f the tangential one to zero, and lambda and mu are the nodal
reactions: no penalty, hence no round-off of one.  The sets follow from (2.3b), (2.3c) and (2.8), which no longer depend
on gamma.  It needs unknowns of which each component of a relative displacement is one.

In space a slipping node has the shear of ``laws``, F g e + k (I - e e^T) tau_T y with k = F g / (e . tau_T y), and a
node that begins to slip a k so large that it hardly moves perpendicular to e.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.algebra.contact.active_sets import (
    ActiveSets,
    bound_of_sets,
    keep_closed,
    linearised,
    sliding_shear,
    slope_of_bound,
)
from signorini_fx.algebra.contact.complementarity import onto_disc, slip_of
from signorini_fx.algebra.contact.motions import FreeMotions
from signorini_fx.algebra.contact.nodal_vectors import Nodal, inner, length, unit
from signorini_fx.algebra.linalg import ElasticSystem, keep_diagonal
from signorini_fx.algebra.linalg.callbacks import called_back
from signorini_fx.algebra.problem.protocol import Problem
from signorini_fx.machine import parallel
from signorini_fx.tuned import LARGEST_TURNING_STIFFNESS


class ExactProblem(Problem):
    """R(x) = A x^ - b + (mu, tau_T .) in the free rows and x - x^ in the constrained ones; see ``Problem``.

    x^ is x with the constraints of the current sets inserted, so that a full Newton step solves the problem with these
    sets exactly although the constrained columns of the Jacobian are empty.  With monolithic Coulomb friction mu is
    +-F lambda at slip nodes, with lambda the nodal reaction: their tangential row gets a share of the normal one.
    """

    def __init__(self, system: ElasticSystem, motions: FreeMotions) -> None:
        super().__init__(system, motions)
        self._factorised: dict[int, npt.NDArray[np.float64]] = {}
        self._inserted: dict[int, npt.NDArray[np.float64]] = {}
        # The normal component first; components in axes of friction are multiples of unknowns.
        self._unknown, self._scale = system.contact.selected()
        self._free = ~system.contact.fixed[self._unknown]
        self._work = system.load.duplicate()
        self._stress = self._stiffness / self.points.weight  # of a slip by one

    def multipliers(self, x: PETSc.Vec, sets: ActiveSets) -> tuple[Nodal, Nodal]:
        """See ``Problem``: the nodal reactions (A x - b) / w on the constraints of ``sets``."""
        self.system.matrix.mult(x, self._work)
        self._work.axpy(-1.0, self.system.load)
        reaction = self._work.getArray(readonly=True)[self._unknown]
        traction = np.where(self._free, -reaction / (self._scale * self.points.weight[:, None]), 0.0)
        pressure = np.where(sets.contact, traction[:, 0], 0.0)
        if self.data.bound is None:
            return pressure, np.zeros_like(traction[:, 1:])
        slipping = self._at_bound(x, sets, pressure)
        return pressure, np.where(sets.slip[:, None], slipping, traction[:, 1:])

    def _at_bound(self, x: PETSc.Vec, sets: ActiveSets, pressure: Nodal) -> Nodal:
        """Mu at slip points; a bound that follows a pressure follows it below zero, so that the map stays affine."""
        data = self.data
        _, u_t = self.system.contact.traces(x)
        if data.bound is None:
            return np.zeros_like(u_t)
        return sliding_shear(sets, bound_of_sets(sets, pressure, data), slip_of(u_t, data))

    def _classify(self, x: PETSc.Vec) -> ActiveSets:
        u_n, u_t = self.system.contact.traces(x)
        pressure, shear = self.multipliers(x, self.sets)
        contact = np.where(self.sets.contact, pressure > 0, u_n > self.data.gap)
        contact = keep_closed(contact, self.data) & self._free[:, 0]
        if self.data.bound is None:
            return ActiveSets.of(contact, np.zeros_like(u_t))
        bound, motion = self.data.friction_bound(pressure), slip_of(u_t, self.data)
        # A point passes through stick: from slip it sticks where it would move against mu, from stick it slips.
        slip = np.where(self.sets.slip, ~(inner(self.sets.direction, motion) < 0), length(shear) > bound)
        turned = sliding_shear(self.sets, bound, motion)
        turned = np.where((length(turned) > 0)[:, None], unit(turned), self.sets.direction)
        direction = np.where(slip[:, None], np.where(self.sets.slip[:, None], turned, unit(shear)), 0.0)
        # Where a support prescribes the slip there is nothing to iterate; where the bound is zero, the point moves
        # freely.
        moves = np.where((length(motion) > 0)[:, None], unit(motion), 0.0)
        direction = np.where(np.any(self._free[:, 1:], axis=1, keepdims=True), direction, moves)
        direction = np.where((bound > 0)[:, None], direction, unit(motion))
        bound = np.where(np.isfinite(bound), bound, 0.0)
        least = bound / (LARGEST_TURNING_STIFFNESS * self._stress)
        reach = np.maximum(inner(direction, motion), least)
        turning = np.divide(bound, reach, out=np.zeros_like(bound), where=reach > 0)
        return ActiveSets.of(contact, direction, turning)

    def _constraints(self, sets: ActiveSets) -> tuple[Any, Nodal]:
        """Constrained local unknowns and the values that they are set to."""
        constrained = np.empty_like(self._free)
        constrained[:, 0] = sets.contact
        constrained[:, 1:] = ~sets.slip[:, None] & (self.data.bound is not None)
        constrained &= self._free
        target = np.empty(self._free.shape)
        target[:, 0], target[:, 1:] = self.data.gap, self.data.slip_origin
        # All normal ones first: a node of two boundaries has the values of the later one.
        order = constrained.T
        return self._unknown.T[order], (target / self._scale).T[order]

    def friction_bounds(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """See ``Problem``."""
        bound = self.data.friction_bound(self.multipliers(x, self.sets)[0])
        return bound, bound

    def away(self, x: PETSc.Vec) -> Nodal:
        """See ``Problem``: how far mu is from the projection of mu + c tau_T y, c the stiffness of a node."""
        pressure, shear = self.multipliers(x, self.sets)
        if self.data.bound is None:
            return np.zeros_like(pressure)
        trial = shear + self._stress[:, None] * slip_of(self.system.contact.traces(x)[1], self.data)
        return length(shear - onto_disc(trial, self.data.friction_bound(pressure)))

    def create_jacobian(self, *, symmetric: bool) -> PETSc.Mat:
        """See ``Problem``."""
        jacobian = super().create_jacobian(symmetric=symmetric)
        jacobian.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        return jacobian

    @called_back
    def residual(self, snes: PETSc.SNES | None, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """See ``Problem``."""
        trial = self.next.trial if self._forced_first else self._classify(x)
        pressure, shear = self.multipliers(x, self.sets)
        self._hold(linearised(trial, pressure, self.data), lambda: (pressure, shear))
        sets = self.next.sets
        dofs, values = self._constraints(sets)
        shear = np.zeros((self.points.size, self._unknown.shape[1] - 1))
        placed = x.copy()
        placed.getArray()[dofs] = values
        if self.data.bound is not None:
            pressure, _ = self.multipliers(placed, sets)
            slipping = sets.slip[:, None] & self._free[:, 1:]
            shear = np.where(slipping, self._at_bound(placed, sets, pressure), 0.0)
        self.system.matrix.mult(placed, f)
        self._measure(f, placed)
        f.axpy(-1.0, self.system.load)
        self.system.contact.add_forces(np.zeros(self.points.size), shear, f)
        f.getArray()[dofs] = self._stiffness * (x.getArray(readonly=True)[dofs] - values)

    def factorised(self, jacobian: PETSc.Mat) -> None:
        """See ``Problem``."""
        self._factorised[jacobian.handle] = self._inserted[jacobian.handle]

    def assemble_jacobian(self, snes: PETSc.SNES | None, x: PETSc.Vec, jacobian: PETSc.Mat, _: Any = None) -> None:
        """See ``Problem``."""
        self.sets = self.next.sets
        self._forced_first = False
        dofs, _values = self._constraints(self.sets)
        comm = self.points.comm
        slopes, turning = self._slopes(self.sets), self._turning(self.sets)
        state = np.concatenate([dofs, slopes.ravel(), turning.ravel()])
        factorised = self._factorised.get(jacobian.handle)
        differs = parallel.any_rank(comm, factorised is None or not np.array_equal(factorised, state))
        self.moved = None if differs else 0  # rows change: either the matrix is the same or it is another one
        last = self._inserted.get(jacobian.handle)
        if not parallel.any_rank(comm, last is None or not np.array_equal(last, state)):
            return
        self._inserted[jacobian.handle] = state
        matrix = self.system.matrix
        matrix.copy(jacobian, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        first = matrix.getOwnershipRange()[0]
        if self.data.follows is not None:
            for point, component in np.argwhere(slopes):  # the rows of a point have the same columns
                normal, *tangential = first + self._unknown[point]
                columns, values = matrix.getRow(normal)
                jacobian.setValues(
                    tangential[component],
                    columns,
                    slopes[point, component] * values,
                    addv=PETSc.InsertMode.ADD_VALUES,
                )
            jacobian.assemble()
        if parallel.any_rank(comm, bool(turning.any())):
            for point in np.flatnonzero(turning.any(axis=(1, 2))):
                tangential = (first + self._unknown[point, 1:]).astype(PETSc.IntType)
                jacobian.setValues(tangential, tangential, turning[point], addv=PETSc.InsertMode.ADD_VALUES)
            jacobian.assemble()
        keep_diagonal(jacobian, dofs, self._stiffness)
        self._declare(jacobian)

    def _turning(self, sets: ActiveSets) -> Nodal:
        """W k (I - e e^T) at slip points in the unknowns of the system, shape (n, d - 1, d - 1); zero in the plane."""
        direction = sets.direction
        across = np.eye(direction.shape[1]) - direction[:, :, None] * direction[:, None, :]
        share = np.where(sets.slip, self.points.weight * sets.turning, 0.0) if self.data.bound is not None else 0.0
        scales = self._scale[:, 1:] * self._free[:, 1:]
        if direction.shape[1] == 1:
            return np.zeros_like(across)
        return np.asarray(np.reshape(share, (-1, 1, 1)) * across * scales[:, :, None] * scales[:, None, :])

    def _slopes(self, sets: ActiveSets) -> Nodal:
        """Share of the row along the normal in those along the tangents: d mu / d lambda where mu = F lambda e."""
        slope = slope_of_bound(sets, self.data)
        if slope is None:
            return np.zeros_like(sets.direction)
        pressing = (sets.contact & self._free[:, 0])[:, None] & self._free[:, 1:]
        return np.where(pressing, -self._scale[:, 1:] * self._scale[:, :1] * sets.direction * slope[:, None], 0.0)
