"""The regularised contact problem (3.3) on an elastic system: residual and active-set Jacobian as SNES callbacks."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.boundary import ContactBoundary
from signorini_fx.complementarity import (
    ActiveSets,
    Nodal,
    RegularisedData,
    classify,
    contact_pressure,
    tangent_coefficients,
    tangential_traction,
)
from signorini_fx.linalg import ElasticSystem


class RegularisedProblem:
    """R(x) = A x - b + (lambda, tau_N .) + (mu, tau_T .) with lambda and mu of the current active sets.

    For fixed sets R is affine, so that a full Newton step solves step 4 of Algorithm (SSN) exactly.  ``sets`` are those
    of the last linear solve; evaluating the residual classifies the nodes anew (``next_sets``) without touching them, so
    that SNES may evaluate it as often as it likes; assembling the Jacobian takes the new sets over.

    Attributes:
        system: the elastic system.
        boundary: the contact nodes.
        data: what outer algorithms change.
        sets: active sets of the last linear solve.
        next_sets: active sets of the last residual.
    """

    def __init__(self, system: ElasticSystem, boundary: ContactBoundary) -> None:
        self.system = system
        self.boundary = boundary
        self.data: RegularisedData
        self.sets = ActiveSets.all_in_contact(boundary.size)
        self.next_sets = self.sets
        self._forced_first = False
        self.force_scale = 0.0
        self.jacobian = system.matrix.duplicate(copy=True)
        self._blocks = _NodeBlocks(system, boundary)

    def set_data(self, data: RegularisedData, first_sets: ActiveSets | None = None) -> None:
        """Begin a new regularised problem.

        Args:
            data: its data.
            first_sets: sets of the first linear solve; None: from the iterate and the sets of the problem before.
        """
        self.data = data
        self._forced_first = first_sets is not None
        if first_sets is not None:
            self.next_sets = first_sets

    def traces(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """(tau_N y, tau_T y) at the contact nodes."""
        return self.boundary.traces(x.getArray(readonly=True)[self.system.contact_dofs])

    def multipliers(self, x: PETSc.Vec, sets: ActiveSets) -> tuple[Nodal, Nodal]:
        """(lambda, mu) at the contact nodes for given sets."""
        u_n, u_t = self.traces(x)
        return contact_pressure(sets, u_n, self.data), tangential_traction(sets, u_t, self.data)

    def residual(self, snes: PETSc.SNES | None, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """R(x) with the sets that follow from x."""
        if not self._forced_first:
            self.next_sets = classify(self.sets, *self.traces(x), self.data)
        pressure, shear = self.multipliers(x, self.next_sets)
        self.system.matrix.mult(x, f)
        self.force_scale = max(f.norm(), self.system.load.norm())
        f.axpy(-1.0, self.system.load)
        forces = self.boundary.nodal_forces(pressure, shear) * self.boundary.free
        np.add.at(f.getArray(), self.system.contact_dofs, forces)

    def assemble_jacobian(self, snes: PETSc.SNES | None, x: PETSc.Vec, jacobian: PETSc.Mat, _: Any = None) -> None:
        """A plus the contact blocks of the sets of the last residual, which become the current sets."""
        self.sets = self.next_sets
        self._forced_first = False
        self._blocks.insert(jacobian, *tangent_coefficients(self.sets, self.data))


class _NodeBlocks:
    """The 2 x 2 diagonal blocks of the contact nodes: the only entries of the Jacobian that ever change."""

    def __init__(self, system: ElasticSystem, boundary: ContactBoundary) -> None:
        first = system.matrix.getOwnershipRange()[0]
        dofs, self._node = np.unique(system.contact_dofs, axis=0, return_inverse=True)
        self._node = self._node.ravel()
        self._rows = (first + dofs).astype(PETSc.IntType)
        self._elastic = np.array([system.matrix.getValues(rows, rows) for rows in self._rows]).reshape(-1, 2, 2)
        masked = boundary.free[:, :, None] & boundary.free[:, None, :]
        weight = boundary.weight[:, None, None] * masked
        self._normal = weight * np.einsum("ij,ik->ijk", boundary.normal, boundary.normal)
        self._tangential = weight * np.einsum("ij,ik->ijk", boundary.tangent, boundary.tangent)

    def insert(self, matrix: PETSc.Mat, normal: Nodal, tangential: Nodal) -> None:
        blocks = self._elastic.copy()
        contact = normal[:, None, None] * self._normal + tangential[:, None, None] * self._tangential
        np.add.at(blocks, self._node, contact)
        if self._rows.size:
            matrix.setValuesRCV(self._rows, self._rows, blocks)
        matrix.assemble()


