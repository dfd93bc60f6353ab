"""Results at the contact points together with where these are: forces and moments in the axes of space."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.contact.state import PointState
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary


@dataclass(frozen=True, repr=False)
class ContactState(PointState):
    """The contact nodes of this rank after a solve, see ``PointState``.

    Attributes:
        boundary: nodes, weights and normals.
    """

    boundary: ContactBoundary

    @classmethod
    def of(cls, state: PointState, boundary: ContactBoundary) -> ContactState:
        """A state at the points of a boundary."""
        return cls(**{field.name: getattr(state, field.name) for field in fields(state)}, boundary=boundary)

    @cached_property
    def forces(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Resultants that the foundation exerts on the body: contact force, friction force, shape (d,); collective."""
        contact, friction = self.forces_of_each.sum(axis=0)
        return contact, friction

    @cached_property
    def forces_of_each(self) -> npt.NDArray[np.float64]:
        """``forces`` of each contact boundary, in the order of the scene, shape (boundaries, 2, d); collective.

        Between bodies each is on the body that has the contact points, and their sum on none.
        """
        boundary = self.boundary
        normal = boundary.nodal_forces(self.pressure, np.zeros_like(self.shear))
        along = boundary.nodal_forces(np.zeros_like(self.pressure), self.shear)
        count = int(parallel.largest(boundary.comm, boundary.part, -1)) + 1
        forces = np.zeros((count, 2, normal.shape[1]))
        np.subtract.at(forces, boundary.part, np.stack((normal, along), axis=1))
        return parallel.global_sum(boundary.comm, forces)

    @cached_property
    def moments(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Moments of ``forces`` about the origin, in 3D only, shape (3,); of a section those about the
        axis x[1] alone, as others cancel over a revolution; collective.
        """
        boundary = self.boundary
        none_n, none_t = np.zeros_like(self.pressure), np.zeros_like(self.shear)
        moments = [
            parallel.global_sum(boundary.comm, -np.cross(boundary.centre, forces).sum(axis=0))
            for forces in (boundary.nodal_forces(self.pressure, none_t), boundary.nodal_forces(none_n, self.shear))
        ]
        remaining = boundary.kinematics.unbalanced[3:]
        return remaining * moments[0], remaining * moments[1]

    @cached_property
    def mean_tangential_displacement(self) -> float | Nodal:
        """Mean of tau_T y over the contact boundary, length: along the tangent; in 3D a vector, shape (3,);
        collective.
        """
        weight = self.boundary.weight
        sums = parallel.global_sum(self.boundary.comm, np.append(weight @ self.displaced(self.u_t), weight.sum()))
        mean: Nodal = sums[:-1] / sums[-1]
        return float(mean[0]) if mean.size == 1 else mean

    @cached_property
    def mean_tangential_of_each(self) -> list[float | Nodal]:
        """The same of each contact boundary, in the order of the scene; collective."""
        boundary, along = self.boundary, self.displaced(self.u_t)
        sums = np.zeros((len(self.forces_of_each), along.shape[1] + 1))
        np.add.at(sums, boundary.part, boundary.weight[:, None] * np.column_stack((along, np.ones(len(along)))))
        total = parallel.global_sum(boundary.comm, sums)
        means = total[:, :-1] / total[:, -1:]
        return [float(mean[0]) if mean.size == 1 else mean for mean in means]

    def tangential(self, vectors: Nodal) -> Nodal:
        """Shears, shape (n, d - 1), as in tables: in 2D along the tangent, shape (n, 1), in 3D as
        vectors with three components, shape (n, 3), which do not depend on the choice of tangents.
        """
        if vectors.shape[1] == 1:
            return vectors
        return np.asarray(np.einsum("ijk,ik->ij", self.boundary.tangents, vectors))

    def displaced(self, vectors: Nodal) -> Nodal:
        """The same for tangential displacements and slips."""
        return vectors if vectors.shape[1] == 1 else np.einsum("ijk,ik->ij", self.boundary.cotangents, vectors)
