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
from signorini_fx.complementarity import ActiveSets, Nodal, at_bound, keep_closed, slip_of
from signorini_fx.linalg import ElasticSystem
from signorini_fx.problem import ProblemState
from signorini_fx.rigid import RigidMotions


class ExactProblem(ProblemState):
    """R(x) = A x^ - b + (mu, tau_T .) in the free rows and x - x^ in the constrained ones; see
    ``problem.ContactProblem``.

    x^ is x with the constraints of the current sets put in, so that a full Newton step solves the problem with these
    sets exactly although the constrained columns of the Jacobian are empty.  With monolithic Coulomb friction mu is
    +-F lambda at slip nodes, with lambda the nodal reaction: their tangential row gets a share of the normal one.
    """

    def __init__(
        self, system: ElasticSystem, boundary: ContactBoundary, physical: ContactBoundary, motions: RigidMotions
    ) -> None:
        super().__init__(system, boundary, physical, motions)
        self._factorised: dict[int, npt.NDArray[np.float64]] = {}
        self._inserted: dict[int, npt.NDArray[np.float64]] = {}
        rows = np.arange(boundary.size)
        axis = np.argmax(np.abs(boundary.normal), axis=1)
        self._n = system.contact_dofs[rows, axis]
        self._t = system.contact_dofs[rows, 1 - axis]
        self._n_sign = boundary.normal[rows, axis]
        self._t_sign = boundary.tangent[rows, 1 - axis]
        self._n_free = boundary.free[rows, axis]
        self._t_free = boundary.free[rows, 1 - axis]
        self._work = system.load.duplicate()

    def multipliers(self, x: PETSc.Vec, sets: ActiveSets) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``: the nodal reactions (A x - b) / w on the constraints of ``sets``."""
        self.system.matrix.mult(x, self._work)
        self._work.axpy(-1.0, self.system.load)
        reaction = self._work.getArray(readonly=True)
        weight = self.boundary.weight
        pressure = np.where(sets.contact & self._n_free, -self._n_sign * reaction[self._n] / weight, 0.0)
        if not self.data.has_friction:
            return pressure, np.zeros_like(pressure)
        stick = -self._t_sign * reaction[self._t] / weight
        return pressure, np.where(sets.slip == 0, np.where(self._t_free, stick, 0.0), self._at_bound(sets, pressure))

    def _at_bound(self, sets: ActiveSets, pressure: Nodal) -> Nodal:
        """Mu at slip nodes; a bound that follows a pressure follows it below zero too, so that the map stays affine."""
        data = self.data
        if data.bound is None:
            return np.zeros_like(pressure)
        return at_bound(sets, data.bound if data.coupling is None else data.bound + data.coupling * pressure)

    def _classify(self, x: PETSc.Vec) -> ActiveSets:
        u_n, u_t = self.traces(x)
        pressure, shear = self.multipliers(x, self.sets)
        contact = np.where(self.sets.contact, pressure > 0, u_n > self.data.gap)
        contact = keep_closed(contact, self.data) & self._n_free
        if not self.data.has_friction:
            return ActiveSets(contact, np.zeros_like(self.sets.slip))
        bound = self.data.friction_bound(pressure)
        slip = self.sets.slip
        # A node passes through stick: from slip it sticks where it would move against mu, from stick it slips.
        from_stick = (shear > bound).astype(np.int8) - (shear < -bound).astype(np.int8)
        moved = slip_of(u_t, self.data)
        from_slip = np.where(slip * moved < 0, 0, slip)
        following = np.where(slip == 0, from_stick, from_slip)
        # Where a support decides on the slip there is nothing to iterate.
        following = np.where(self._t_free, following, np.sign(moved))
        free = np.where(moved < 0, -1, 1)
        return ActiveSets(contact, np.where(bound == 0, free, following).astype(np.int8))

    def _constraints(self, sets: ActiveSets) -> tuple[Any, Nodal]:
        """Constrained local dofs and the values that they are set to."""
        normal = sets.contact & self._n_free
        stick = (sets.slip == 0) & self._t_free if self.data.has_friction else np.zeros_like(normal)
        dofs = np.concatenate([self._n[normal], self._t[stick]])
        origin = np.zeros(stick.size) if self.data.slip_origin is None else self.data.slip_origin
        values = np.concatenate([(self._n_sign * self.data.gap)[normal], (self._t_sign * origin)[stick]])
        return dofs, values

    def friction_bounds(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``."""
        bound = self.data.friction_bound(self.multipliers(x, self.sets)[0])
        return bound, bound

    def create_jacobian(self, *, symmetric: bool) -> PETSc.Mat:
        """See ``ContactProblem``."""
        jacobian = super().create_jacobian(symmetric=symmetric)
        jacobian.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        return jacobian

    def residual(self, snes: PETSc.SNES | None, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """See ``ContactProblem``."""
        if not self._forced_first:
            self.following = self._classify(x)
        self._hold(*self.multipliers(x, self.sets))
        dofs, values = self._constraints(self.following)
        shear = np.zeros(self.boundary.size)
        placed = x.copy()
        placed.getArray()[dofs] = values
        if self.data.has_friction:
            pressure, _ = self.multipliers(placed, self.following)
            slipping = (self.following.slip != 0) & self._t_free
            shear[slipping] = self._at_bound(self.following, pressure)[slipping]
        self.system.matrix.mult(placed, f)
        self._measure(f, placed)
        f.axpy(-1.0, self.system.load)
        array = f.getArray()
        np.add.at(array, self._t, self._t_sign * self.boundary.weight * shear)
        array[dofs] = self._stiffness * (x.getArray(readonly=True)[dofs] - values)

    def factorised(self, jacobian: PETSc.Mat) -> None:
        """See ``ContactProblem``."""
        self._factorised[jacobian.handle] = self._inserted[jacobian.handle]

    def assemble_jacobian(self, snes: PETSc.SNES | None, x: PETSc.Vec, jacobian: PETSc.Mat, _: Any = None) -> None:
        """See ``ContactProblem``."""
        self.sets = self.following
        self._forced_first = False
        dofs, _values = self._constraints(self.sets)
        comm = self.system.comm
        state = np.concatenate([dofs, self._slopes(self.sets)])
        factorised = self._factorised.get(jacobian.handle)
        differs = parallel.any_rank(comm, factorised is None or not np.array_equal(factorised, state))
        self.moved = None if differs else 0  # rows come and go: either the matrix is the same or it is another one
        last = self._inserted.get(jacobian.handle)
        if not parallel.any_rank(comm, last is None or not np.array_equal(last, state)):
            return
        self._inserted[jacobian.handle] = state
        matrix = self.system.matrix
        matrix.copy(jacobian, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        first = matrix.getOwnershipRange()[0]
        if self.data.coupling is not None:
            slopes = self._slopes(self.sets)
            for node in np.flatnonzero(slopes):  # the rows of a node have the same columns
                columns, values = matrix.getRow(first + self._n[node])
                jacobian.setValues(
                    first + self._t[node], columns, slopes[node] * values, addv=PETSc.InsertMode.ADD_VALUES
                )
            jacobian.assemble()
        jacobian.zeroRowsColumns((first + dofs).astype(PETSc.IntType), diag=self._stiffness)
        self._declare(jacobian)

    def _slopes(self, sets: ActiveSets) -> Nodal:
        """Share of the row along the normal in the row along the tangent: d mu / d lambda where mu = +-F lambda."""
        if self.data.coupling is None:
            return np.zeros(self.boundary.size)
        pressing = sets.contact & self._n_free & self._t_free
        return np.where(pressing, -self._t_sign * self._n_sign * sets.slip * self.data.coupling, 0.0)
