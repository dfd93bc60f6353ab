"""Tools: rigid shapes that forces and moments move, whose finite motion is unknown beside the displacement of a body.

A tool with the pivot c turns about it by a rotation vector psi, and moves by v.  A node X that is displaced by u is
outside of it if phi(X + u) >= 0, with phi the distance of the tool where it is.  With the unit normal n_f = grad phi
there and the arm a = X + u - c - v, the condition for a new displacement y and a new motion q = (v, psi) is, to first
order,

    - n_f . (y - R q) <= phi(X + u) - n_f . (u - R q_now),   R q = v + psi x a.

So contact sees y - R q, as with rigid bodies of linear problems, see ``rigid_bodies``, but with the arms of now.  It is
exact to first order where psi is along one axis, about which all turns are: in 3D no more than one of its components
may be free.

The tractions t at the points act on the tool by t and a x t.  As normals turn they meet relative displacements
r = d - R dq by the blocks C of ``curvature_of``.  As the tool turns by w they turn with it, and arms change by
r + w x a; the symmetric part of that is, for (r, w),

    [0, -[t]; [t], a . t - (a t^T + t a^T) / 2],   with [t] b = t x b.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.forms.nonlinear.moving_shapes import MovingShape, across_arms, rigid_motion
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.kinematics.protocol import Kinematics
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodies, RigidBodyMotion

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class DisplacedRigidBodies(RigidBodies):
    """Rigid bodies at points that have been displaced.

    Attributes:
        at: the displacement.
    """

    at: fem.Function

    def places(self, boundary: ContactBoundary) -> Array:
        return np.asarray(boundary.centre + self.at.x.array.reshape(-1, boundary.x.shape[1])[boundary.nodes])


class ToolMotion(RigidBodyMotion):
    """How a tool has moved: by a translation of its pivot and a rotation vector that need not be small."""

    def at(self, x: Array) -> Array:
        return rigid_motion(x, self.translation, self.rotation, self.reference)

    def as_dict(self, contact: ContactState, contacts: Sequence[Any], kinematics: Kinematics) -> dict[str, Any]:
        """Its gap is not linearised."""
        return super().as_dict(contact, contacts, kinematics) | {"gap_error": None}

    def arms(self, contact: ContactState, touching: npt.NDArray[np.bool_]) -> Array:
        """Arms of the displaced points, from their displacement relative to the tool, r = X + a - c - psi x a."""
        boundary = contact.boundary
        relative = contact.u_n[:, None] * boundary.normal
        relative = relative + np.einsum("nij,nj->ni", boundary.cotangents, contact.u_t)
        turns = np.eye(self.reference.size) - turning_matrices(self.rotation[None], self.reference.size)[0]
        away = (boundary.centre + relative)[touching] - self.reference
        return np.asarray(np.linalg.solve(turns, away.T).T)

    def lever(self, x: Array, displacements: Array) -> Array:
        """Where they are, from where the pivot is."""
        return np.asarray(x + displacements - self.reference - self.translation)


@dataclass(frozen=True)
class MovingTools:
    """The tools of a problem where they are.

    Attributes:
        bodies: the rigid bodies.
        shapes: of all foundations, by their numbers.
    """

    bodies: RigidBodies
    shapes: Mapping[int, MovingShape]

    @cached_property
    def coordinates(self) -> Array:
        """(v, L psi) of each, lengths, shape (t, m)."""
        rows = [np.append(at.translation, self.bodies.length * at.turn) for at in self._drivers]
        return np.array(rows).reshape(len(rows), self._translations + len(self.bodies.kinematics.rotations))

    def carry_to(self, coordinates: Array) -> None:
        """Put their shapes where they are at coordinates of shape (t, m)."""
        dim = self._translations
        moves = zip(self.bodies.bodies, self._pivots, coordinates, strict=True)
        for body, pivot, moved in moves:
            for part in body.parts:
                translation, turn = np.split(np.asarray(moved), [dim])
                self.shapes[part].carry_to(translation.copy(), np.asarray(turn / self.bodies.length), pivot)

    @property
    def motions(self) -> tuple[RigidBodyMotion, ...]:
        """How they have moved."""
        moved = zip(self.bodies.bodies, self._pivots, self._drivers, strict=True)
        return tuple(ToolMotion(body, pivot, at.translation.copy(), at.turn.copy()) for body, pivot, at in moved)

    @property
    def _translations(self) -> int:
        return self.bodies.kinematics.dimension

    @property
    def _drivers(self) -> list[MovingShape]:
        """The shape of each that says what drives it."""
        return [
            self.shapes[next((k for k in body.parts if self.shapes[k].shape.drives), body.parts[0])]
            for body in self.bodies.bodies
        ]

    @property
    def _pivots(self) -> list[Array]:
        """Where the pivot of each is given, length, shape (d,)."""
        return [np.asarray(at.as_given.reference(self._translations)) for at in self._drivers]

    def touching(self, boundary: ContactBoundary) -> npt.NDArray[np.int64]:
        """The tool of each contact point, -1: none, shape (n,)."""
        number = np.full(boundary.size, -1)
        for k, body in enumerate(self.bodies.bodies):
            number[np.isin(boundary.part, body.parts)] = k
        return number

    def at_points(self, boundary: ContactBoundary) -> Array:
        """R q at contact points, zero at those of other foundations, length, shape (n, d)."""
        if boundary.moving is None:
            return np.zeros_like(boundary.x)
        return np.asarray(boundary.moving.modes @ self.coordinates.ravel())

    def relative_stiffness(self, state: ContactState, curvature: Array, displacement: Array) -> Array:
        """Forces of (r, L w), the displacement relative to the tool and its turn, from the tractions of contact points,
        force per length, symmetric, zero where there is no tool, shape (n, m, m); ``curvature``: C, shape (n, d, d).
        """
        boundary, tool = state.boundary, self.touching(state.boundary)
        dim, turns, touched = self._translations, len(self.bodies.kinematics.rotations), tool >= 0
        blocks = np.zeros((boundary.size, dim + turns, dim + turns))
        blocks[:, :dim, :dim] = np.where(touched[:, None, None], curvature, 0.0)
        pivots = np.array([pivot + at.translation for pivot, at in zip(self._pivots, self._drivers, strict=True)])
        arms = (boundary.centre + displacement[boundary.nodes])[touched] - pivots[tool[touched]]
        forces = boundary.nodal_forces(state.pressure, state.shear)[touched]
        # In 2D turns are about x[2]: its rows and columns of space are left out.
        space, axes = np.zeros((2, len(arms), 3)), [*range(dim), *range(6 - turns, 6)]
        space[0, :, :dim], space[1, :, :dim] = arms, forces
        turned, force = np.zeros((len(arms), 6, 6)), turning_matrices(space[1], 3)
        turned[:, :3, 3:], turned[:, 3:, :3] = -force, force
        products = np.einsum("ni,nj->nij", *space)
        along = np.einsum("nii->n", products)[:, None, None] * np.eye(3)
        turned[:, 3:, 3:] = along - (products + products.transpose(0, 2, 1)) / 2
        lengths = np.append(np.ones(dim), np.full(turns, self.bodies.length))
        blocks[touched] += turned[:, axes][:, :, axes] / np.multiply.outer(lengths, lengths)
        return blocks


def turning_matrices(vectors: Array, dimension: int) -> Array:
    """The matrices of the products w x a, shape (n, d, d), of vectors w of shape (n, 3), in 2D (n, 1)."""
    units = np.tile(np.eye(dimension), (len(vectors), 1, 1))
    return np.stack([across_arms(vectors, units[:, axis]) for axis in range(dimension)], axis=2)
