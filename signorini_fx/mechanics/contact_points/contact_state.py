"""Results at the contact points with their geometry: forces and moments along the
coordinate axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np

from signorini_fx.algebra.contact.state import PointState
from signorini_fx.arrays import Array, matvec
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary


@dataclass(frozen=True, repr=False)
class ContactState(PointState):
    """The contact state of the contact points of this rank after a solve.

    Attributes:
        boundary: the contact points, with weights and normals.
        columns: columns that effects add to the contact table, by name, each of shape (n,).
    """

    boundary: ContactBoundary
    columns: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, state: PointState, boundary: ContactBoundary) -> ContactState:
        """Return a state of points together with their boundary."""
        return cls(
            **{one.name: getattr(state, one.name) for one in fields(state)}, boundary=boundary
        )

    @cached_property
    def forces(self) -> tuple[Array, Array]:
        """The resultants of the contact force and of the friction force on the body, each of shape
        (d,); collective.
        """
        contact, friction = self.forces_of_each.sum(axis=0)
        return contact, friction

    @cached_property
    def forces_of_each(self) -> Array:
        """The resultants ``forces`` of each contact boundary, in the order of the scene, shape
        (boundaries, 2, d); collective.

        Between two bodies they are the forces on the body that has the contact points.
        """
        boundary = self.boundary
        forces = self.forces_at_points
        count = int(parallel.largest(boundary.comm, boundary.part, -1)) + 1
        sums = np.zeros((count, *forces.shape[1:]))
        np.add.at(sums, boundary.part, forces)
        return parallel.global_sum(boundary.comm, sums)

    @property
    def forces_at_points(self) -> Array:
        """Contact force and friction force on the body at each point, shape (n, 2, d)."""
        boundary = self.boundary
        none_n = np.zeros_like(self.pressure)
        none_t = np.zeros_like(self.shear)
        tractions = (self.pressure, none_t), (none_n, self.shear)
        return -np.stack([boundary.nodal_forces(*traction) for traction in tractions], axis=1)

    @cached_property
    def moments(self) -> tuple[Array, Array]:
        """The moments of ``forces`` about the origin, in 3D only, each of shape (3,); collective.

        Of a section with torsion only the moment about the axis x[1] is not zero, as the others
        cancel over a revolution.
        """
        boundary = self.boundary
        about_origin = np.cross(boundary.centre[:, None], self.forces_at_points).sum(axis=0)
        contact, friction = boundary.kinematics.unbalanced[3:] * parallel.global_sum(
            boundary.comm, about_origin
        )
        return contact, friction

    @property
    def mean_tangential_displacement(self) -> float | Array:
        """The mean of tau_T y over the contact boundary, length: along the tangent; in 3D a vector,
        shape (3,); collective.
        """
        return self.mean_tangential_displacements[0]

    @cached_property
    def mean_tangential_displacements(self) -> list[float | Array]:
        """The mean tangential displacement of all contact boundaries together, then of each in the
        order of the scene; collective.
        """
        boundary = self.boundary
        along = self.displaced(self.u_t)
        sums = np.zeros((len(self.forces_of_each), along.shape[1] + 1))
        np.add.at(
            sums,
            boundary.part,
            boundary.weight[:, None] * np.column_stack((along, np.ones(len(along)))),
        )
        total = parallel.global_sum(boundary.comm, sums)
        means = [mean[:-1] / mean[-1] for mean in (total.sum(axis=0), *total)]
        return [float(mean[0]) if mean.size == 1 else mean for mean in means]

    def tangential(self, vectors: Array) -> Array:
        """Return shears, shape (n, d - 1), as tables show them.

        In 2D they are components along the tangent; in 3D vectors, shape (n, 3), which do not
        depend on the choice of tangents.
        """
        if vectors.shape[1] == 1:
            return vectors
        return matvec(self.boundary.tangents, vectors)

    def displaced(self, vectors: Array) -> Array:
        """Return tangential displacements or slips as tables show them, see ``tangential``."""
        return vectors if vectors.shape[1] == 1 else matvec(self.boundary.cotangents, vectors)
