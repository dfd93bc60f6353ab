"""The unregularised limit, gamma = infinity: nodal complementarity solved by elimination of the active constraints.

On A_c the normal displacement is set to the gap, on I_f the tangential one to zero, and lambda and mu are the nodal
reactions: no penalty, hence no round-off of one.  The sets follow from (2.3b), (2.3c) and (2.8), which no longer depend
on gamma.  It needs normals along the axes; ``linalg.rotated`` turns the contact nodes for other ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.boundary import ContactBoundary
from signorini_fx.complementarity import ActiveSets, Nodal, at_bound, inner, keep_closed, length, slip_of, unit
from signorini_fx.linalg import ElasticSystem
from signorini_fx.problem import ProblemState
from signorini_fx.rigid import RigidMotions


class ExactProblem(ProblemState):
    """R(x) = A x^ - b + (mu, tau_T .) in the free rows and x - x^ in the constrained ones; see
    ``problem.ContactProblem``.

    x^ is x with the constraints of the current sets put in, so that a full Newton step solves the problem with these
    sets exactly although the constrained columns of the Jacobian are empty.
    """

    def __init__(self, system: ElasticSystem, boundary: ContactBoundary, motions: RigidMotions) -> None:
        super().__init__(system, boundary, motions)
        self._factorised: dict[int, npt.NDArray[np.int32]] = {}
        self._constrained: dict[int, npt.NDArray[np.int32]] = {}
        unknowns, blocks = system.contact.entries()
        place = np.abs(blocks).argmax(axis=2)
        rows = np.arange(boundary.size)[:, None]
        # The unknown that each component of the relative displacement is, the normal one first, and its sign.
        self._unknown = unknowns[rows, place]
        self._sign = np.sign(blocks[rows, np.arange(blocks.shape[1]), place])
        self._free = ~system.fixed[self._unknown]
        self._work = system.load.duplicate()

    def multipliers(self, x: PETSc.Vec, sets: ActiveSets) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``: the nodal reactions (A x - b) / w on the constraints of ``sets``."""
        self.system.matrix.mult(x, self._work)
        self._work.axpy(-1.0, self.system.load)
        reaction = self._work.getArray(readonly=True)[self._unknown]
        traction = np.where(self._free, -self._sign * reaction / self.boundary.weight[:, None], 0.0)
        pressure = np.where(sets.contact, traction[:, 0], 0.0)
        if not self.data.has_friction:
            return pressure, np.zeros_like(traction[:, 1:])
        slipping = at_bound(sets, self.data.friction_bound(pressure)) + self._turned(x, sets)
        return pressure, np.where(sets.slip[:, None], slipping, traction[:, 1:])

    def _turned(self, x: PETSc.Vec, sets: ActiveSets) -> Nodal:
        """What a slip across its direction adds to the shear; zero in the plane."""
        _, u_t = self.traces(x)
        return sets.turning[:, None] * sets.across(slip_of(u_t, self.data))

    def _classify(self, x: PETSc.Vec) -> ActiveSets:
        u_n, u_t = self.traces(x)
        pressure, shear = self.multipliers(x, self.sets)
        contact = np.where(self.sets.contact, pressure > 0, u_n > self.data.gap)
        contact = keep_closed(contact, self.data) & self._free[:, 0]
        if not self.data.has_friction:
            return ActiveSets.of(contact, np.zeros_like(u_t))
        bound, motion = self.data.friction_bound(pressure), slip_of(u_t, self.data)
        # A point passes through stick: from slip it sticks where it would move against mu, from stick it slips.
        slip = np.where(self.sets.slip, ~(inner(self.sets.direction, motion) < 0), length(shear) > bound)
        transmits = bound > 0
        direction = np.where(transmits[:, None], unit(shear), unit(motion))
        return ActiveSets.of(contact, np.where((slip | ~transmits)[:, None], direction, 0.0))

    def _constraints(self, sets: ActiveSets) -> tuple[Any, Nodal]:
        """Constrained local unknowns and the values that they are set to."""
        constrained = np.empty_like(self._free)
        constrained[:, 0] = sets.contact
        constrained[:, 1:] = ~sets.slip[:, None] & self.data.has_friction
        constrained &= self._free
        origin = 0.0 if self.data.slip_origin is None else self.data.slip_origin
        wanted = np.empty(self._free.shape)
        wanted[:, 0], wanted[:, 1:] = self.data.gap, origin
        # All normal ones first: a node of two boundaries has the values of the later one.
        order = constrained.T
        return self._unknown.T[order], (self._sign * wanted).T[order]

    def friction_bounds(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``."""
        bound = self.data.friction_bound(self.multipliers(x, self.sets)[0])
        return bound, bound

    def away(self, x: PETSc.Vec) -> Nodal:
        """See ``ProblemState``: how far mu is from F g in the direction of the slip."""
        pressure, shear = self.multipliers(x, self.sets)
        motion = slip_of(self.traces(x)[1], self.data)
        wanted = self.data.friction_bound(pressure)[:, None] * unit(motion)
        return np.where(self.sets.slip & (length(motion) > 0), length(shear - wanted), 0.0)

    def create_jacobian(self, *, symmetric: bool) -> PETSc.Mat:
        """See ``ContactProblem``."""
        jacobian = super().create_jacobian(symmetric=symmetric)
        jacobian.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        return jacobian

    def residual(self, snes: PETSc.SNES | None, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """See ``ContactProblem``."""
        wanted = self.next.wanted if self._forced_first else self._classify(x)
        self._hold(wanted, *self.multipliers(x, self.sets))
        sets = self.next.sets
        dofs, values = self._constraints(sets)
        shear = np.zeros((self.boundary.size, self._unknown.shape[1] - 1))
        if self.data.has_friction:
            pressure, _ = self.multipliers(x, sets)
            slipping = sets.slip[:, None] & self._free[:, 1:]
            shear = np.where(slipping, at_bound(sets, self.data.friction_bound(pressure)) + self._turned(x, sets), 0.0)
        placed = x.copy()
        placed.getArray()[dofs] = values
        self.system.matrix.mult(placed, f)
        self._measure(f, placed)
        f.axpy(-1.0, self.system.load)
        self.system.contact.add_forces(np.zeros(self.boundary.size), shear, f)
        f.getArray()[dofs] = self._stiffness * (x.getArray(readonly=True)[dofs] - values)

    def factorised(self, jacobian: PETSc.Mat) -> None:
        """See ``ContactProblem``."""
        self._factorised[jacobian.handle] = self._constrained[jacobian.handle]

    def assemble_jacobian(self, snes: PETSc.SNES | None, x: PETSc.Vec, jacobian: PETSc.Mat, _: Any = None) -> None:
        """See ``ContactProblem``."""
        self.sets = self.next.sets
        self._forced_first = False
        dofs, _values = self._constraints(self.sets)
        comm = self.system.comm
        factorised = self._factorised.get(jacobian.handle)
        differs = parallel.any_rank(comm, factorised is None or not np.array_equal(factorised, dofs))
        self.moved = None if differs else 0  # rows come and go: either the matrix is the same or it is another one
        last = self._constrained.get(jacobian.handle)
        if not parallel.any_rank(comm, last is None or not np.array_equal(last, dofs)):
            return
        self._constrained[jacobian.handle] = dofs
        self.system.matrix.copy(jacobian, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        first = self.system.matrix.getOwnershipRange()[0]
        jacobian.zeroRowsColumns((first + dofs).astype(PETSc.IntType), diag=self._stiffness)
        self._declare(jacobian)
