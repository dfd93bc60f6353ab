"""The contact problem as SNES callbacks: residual and active-set Jacobian, regularised (3.3)."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.boundary import ContactBoundary
from signorini_fx.complementarity import (
    ActiveSets,
    Nodal,
    RegularisedData,
    classify,
    multipliers,
    release,
    tangent_coefficients,
    trial_pressure,
)
from signorini_fx.holding import fewest_ties, hold
from signorini_fx.linalg import ElasticSystem
from signorini_fx.results import Status
from signorini_fx.rigid import RigidMotions


class ContactProblem(Protocol):
    """What the semi-smooth Newton method needs of a problem.

    ``sets`` are those of the last linear solve; evaluating the residual classifies the nodes anew (``following``)
    without touching them, so that SNES may evaluate it as often as it likes; assembling the Jacobian takes the new sets
    over.

    Attributes:
        system: the elastic system.
        boundary: the contact nodes.
        data: what outer algorithms change.
        sets: active sets of the last linear solve.
        following: active sets of the last residual.
        force_scale: size of the forces in the last residual.
        loose: how the body gets away from the sets of the last residual; None: they hold it.
        kept: whether these sets differ from those that the iterate asked for, in order to hold it.
        wanted: those that it asked for.
        moved: contact nodes whose blocks in the Jacobian differ from those of its last factorisation; None: there is
            none, or too many to tell.
    """

    system: ElasticSystem
    boundary: ContactBoundary
    data: RegularisedData
    sets: ActiveSets
    following: ActiveSets
    force_scale: float
    loose: Status | None
    kept: bool
    wanted: ActiveSets
    moved: int | None

    def set_data(self, data: RegularisedData, first_sets: ActiveSets | None = None) -> None:
        """Begin a new problem.

        Args:
            data: its data.
            first_sets: sets of the first linear solve; None: from the iterate and the sets of the problem before.
        """

    def traces(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """(tau_N y, tau_T y) at the contact nodes."""

    def multipliers(self, x: PETSc.Vec, sets: ActiveSets) -> tuple[Nodal, Nodal]:
        """(lambda, mu) at the contact nodes for given sets."""

    def friction_bounds(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """The friction bounds that the current and the following sets stand for."""

    def accept(self, x: PETSc.Vec, sets: ActiveSets, tolerance: float) -> bool:
        """Take these sets for those of the solution, if they leave no more than a share of the forces; collective."""

    def holds(self, sets: ActiveSets, data: RegularisedData) -> bool:
        """Whether these sets resist every rigid motion; collective."""

    def ties(self, sets: ActiveSets, opening: Nodal, slipping: Nodal) -> tuple[Any, Any]:
        """Nodes that would hold the body if they were tied, see ``holding.fewest_ties``; collective."""

    def drowned(self, x: PETSc.Vec, tolerance: float) -> bool:
        """Whether the round-off of the penalty is above a share of the forces in the last residual; collective."""

    def create_jacobian(self, *, symmetric: bool) -> PETSc.Mat:
        """A matrix with the pattern of the Jacobian."""

    def residual(self, snes: PETSc.SNES | None, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """The residual with the sets that follow from x."""

    def factorised(self, jacobian: PETSc.Mat) -> None:
        """Take note that the Jacobian is factorised as it is now."""

    def assemble_jacobian(self, snes: PETSc.SNES | None, x: PETSc.Vec, jacobian: PETSc.Mat, _: Any = None) -> None:
        """The Jacobian with the sets of the last residual, which become the current ones."""


ROUND_OFF = 1e-8
# Share of the stiffness times the displacement of which a residual of 1e-8 is still above round-off.
_ATTAINABLE = 1e-7


class ProblemState:
    """The state that every contact problem keeps, and what becomes of it; see ``ContactProblem``."""

    def __init__(
        self, system: ElasticSystem, boundary: ContactBoundary, physical: ContactBoundary, motions: RigidMotions
    ) -> None:
        self.system = system
        self.boundary = boundary
        self.data: RegularisedData
        self.sets = self.following = ActiveSets.all_in_contact(boundary.size)
        self.force_scale = 0.0
        self.loose: Status | None = None
        self.kept = False
        self.wanted = self.sets
        self.moved: int | None = None
        self._physical = physical
        self._motions = motions
        self._forced_first = False
        self._definite: set[int] = set()
        self._stiffness = parallel.global_max(
            system.comm, parallel.local_max(system.matrix.getDiagonal().getArray(readonly=True))
        )

    def set_data(self, data: RegularisedData, first_sets: ActiveSets | None = None) -> None:
        """See ``ContactProblem``."""
        self.data = data
        self._forced_first = first_sets is not None
        if first_sets is not None:
            self.following = release(first_sets, data)

    def traces(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``."""
        return self.boundary.traces(x.getArray(readonly=True)[self.system.contact_dofs])

    def accept(self, x: PETSc.Vec, sets: ActiveSets, tolerance: float) -> bool:
        """See ``ContactProblem``: never, where sets are constraints."""
        return False

    def holds(self, sets: ActiveSets, data: RegularisedData) -> bool:
        """See ``ContactProblem``."""
        stick = (sets.slip == 0) if data.has_friction else np.zeros_like(sets.contact)
        return self._motions.held_by(self._physical, sets.contact, stick)

    def ties(self, sets: ActiveSets, opening: Nodal, slipping: Nodal) -> tuple[Any, Any]:
        """See ``ContactProblem``."""
        return fewest_ties(sets, opening, slipping, self._physical, self._motions)

    def drowned(self, x: PETSc.Vec, tolerance: float) -> bool:
        """See ``ContactProblem``."""
        data = self.data
        if not np.isfinite(data.gamma_n):
            return False
        u_n, u_t = self.traces(x)
        stretch = data.gamma_n * np.maximum(np.abs(u_n), np.abs(data.gap))
        if data.has_friction:
            stretch = np.maximum(stretch, data.gamma_t * np.abs(u_t))
        largest = parallel.global_max(self.system.comm, parallel.local_max(self.boundary.weight * stretch))
        return bool(largest * np.finfo(float).eps > tolerance * self.force_scale)

    def create_jacobian(self, *, symmetric: bool) -> PETSc.Mat:
        """See ``ContactProblem``: a copy of A."""
        jacobian = self.system.matrix.duplicate(copy=True)
        if symmetric:
            self._definite.add(jacobian.handle)
        return jacobian

    def _declare(self, jacobian: PETSc.Mat) -> None:
        """PETSc forgets it at every assembly, and LAPACK's Cholesky is three times as fast as its LDL^T."""
        if jacobian.handle in self._definite:
            jacobian.setOption(PETSc.Mat.Option.SPD, True)

    def _hold(self, pressure: Nodal, shear: Nodal) -> None:
        """Replace the following sets by sets that hold the body, or note how it gets away."""
        self.wanted = self.following
        self.following, self.loose, self.kept = hold(
            self.following,
            self.sets,
            pressure,
            shear,
            self.data,
            self._physical,
            self._motions,
            self.system.resultant,
        )

    def _measure(self, forces: PETSc.Vec, x: PETSc.Vec) -> None:
        """Take the size of the forces A x as the scale of the residual."""
        round_off = _ATTAINABLE * self._stiffness * x.norm()
        self.force_scale = max(forces.norm(), self.system.load.norm(), round_off)


class RegularisedProblem(ProblemState):
    """R(x) = A x - b + (lambda, tau_N .) + (mu, tau_T .) with lambda and mu of the current active sets (3.3a).

    For fixed sets R is affine, so that a full Newton step solves step 4 of Algorithm (SSN) exactly.
    See ``ContactProblem``.
    """

    def __init__(self, system: ElasticSystem, boundary: ContactBoundary, motions: RigidMotions) -> None:
        super().__init__(system, boundary, boundary, motions)
        self._blocks = _NodeBlocks(system, boundary)

    def multipliers(self, x: PETSc.Vec, sets: ActiveSets) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``."""
        return multipliers(sets, *self.traces(x), self.data)

    def friction_bounds(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """See ``ContactProblem``."""
        u_n, _ = self.traces(x)
        pressure, _ = self.multipliers(x, self.sets)
        return self.data.friction_bound(pressure), self.data.friction_bound(trial_pressure(u_n, self.data))

    def residual(self, snes: PETSc.SNES | None, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """See ``ContactProblem``."""
        if not self._forced_first:
            self.following = classify(self.sets, *self.traces(x), self.data)
        self._hold(*self.multipliers(x, self.sets))
        self._imbalance(x, self.following, f)

    def _imbalance(self, x: PETSc.Vec, sets: ActiveSets, f: PETSc.Vec) -> None:
        """R(x) for given sets."""
        self.system.matrix.mult(x, f)
        self._measure(f, x)
        f.axpy(-1.0, self.system.load)
        forces = self.boundary.nodal_forces(*self.multipliers(x, sets)) * self.boundary.free
        np.add.at(f.getArray(), self.system.contact_dofs, forces)

    def accept(self, x: PETSc.Vec, sets: ActiveSets, tolerance: float) -> bool:
        """See ``ContactProblem``."""
        force = x.duplicate()
        self._imbalance(x, sets, force)
        if not force.norm() <= tolerance * self.force_scale:
            return False
        self.sets = self.following = sets
        return True

    def assemble_jacobian(self, snes: PETSc.SNES | None, x: PETSc.Vec, jacobian: PETSc.Mat, _: Any = None) -> None:
        """See ``ContactProblem``."""
        self.sets = self.following
        self._forced_first = False
        # PETSc keeps its factor as long as the matrix is left alone.
        self.moved = self._blocks.insert(jacobian, *tangent_coefficients(self.sets, self.data))
        self._declare(jacobian)

    def factorised(self, jacobian: PETSc.Mat) -> None:
        """See ``ContactProblem``."""
        self._blocks.factorised[jacobian.handle] = self._blocks.inserted[jacobian.handle]


class _NodeBlocks:
    """The 2 x 2 diagonal blocks of the contact nodes: the only entries of the Jacobian that ever change."""

    def __init__(self, system: ElasticSystem, boundary: ContactBoundary) -> None:
        self._comm = system.comm
        self.inserted: dict[int, npt.NDArray[np.float64]] = {}
        self.factorised: dict[int, npt.NDArray[np.float64]] = {}
        first = system.matrix.getOwnershipRange()[0]
        dofs, node = np.unique(system.contact_dofs, axis=0, return_inverse=True)
        self._node = node.ravel()
        self._rows = (first + dofs).astype(PETSc.IntType)
        self._elastic = np.array([system.matrix.getValues(rows, rows) for rows in self._rows]).reshape(-1, 2, 2)
        masked = boundary.free[:, :, None] & boundary.free[:, None, :]
        weight = boundary.weight[:, None, None] * masked
        n, t = boundary.normal, boundary.tangent
        self._nn, self._tt, self._tn = (weight * np.einsum("ij,ik->ijk", a, b) for a, b in ((n, n), (t, t), (t, n)))

    def insert(self, matrix: PETSc.Mat, normal: Nodal, tangential: Nodal, coupling: Nodal | None) -> int | None:
        """Put A's blocks plus w (normal n n + tangential t t + coupling t n) into the matrix, if they are not there.

        Returns:
            How many nodes differ from the last factorisation, None if there is none; the same on all ranks.
        """
        state = np.stack([normal, tangential, np.zeros_like(normal) if coupling is None else coupling])
        known = [table.get(matrix.handle) for table in (self.inserted, self.factorised)]
        differ = [1 + state.size if old is None else np.count_nonzero((old != state).any(axis=0)) for old in known]
        changed, moved = (int(count) for count in parallel.global_sum(self._comm, np.array(differ)))
        since = None if known[1] is None else moved
        if changed == 0:
            return since
        self.inserted[matrix.handle] = state
        contact = normal[:, None, None] * self._nn + tangential[:, None, None] * self._tt
        if coupling is not None:
            contact += coupling[:, None, None] * self._tn
        blocks = self._elastic.copy()
        np.add.at(blocks, self._node, contact)
        if self._rows.size:
            matrix.setValuesRCV(self._rows, self._rows, blocks)
        matrix.assemble()
        return since
