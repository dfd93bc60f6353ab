"""Tools: rigid shapes that forces move, whose translation is an unknown beside the displacement of a nonlinear body.

A node X that is displaced by u is outside of a shape that has moved by v if phi(X + u - v) >= 0.  With the unit normal
n_f = grad phi there, the condition for a new displacement y and a new translation q is, to first order,

    - n_f . (y - q) <= phi(X + u - v) - n_f . (u - v),

so contact sees y - q, as with rigid bodies of linear problems, see ``rigid_bodies``: the gap is the signed distance at
any distance, as translations are not small here.  As normals turn, tractions act on d - dq: the blocks C of the points,
see ``curvature_of``, are added as B^T C B, with B = [I, -1] for the unknowns (y, q).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.forms.nonlinear.moving_shapes import MovingShape
from signorini_fx.machine import parallel
from signorini_fx.mechanics.body.contact_boundary import ContactBoundary
from signorini_fx.mechanics.body.contact_state import ContactState
from signorini_fx.mechanics.body.rigid_bodies import RigidBodies, RigidBodyMotion
from signorini_fx.mechanics.kinematics.cartesian import Kinematics

Array = npt.NDArray[np.float64]


class ToolMotion(RigidBodyMotion):
    """How a tool has moved: by a translation that need not be small."""

    def as_dict(self, contact: ContactState, contacts: Sequence[Any], kinematics: Kinematics) -> dict[str, Any]:
        """See ``RigidBodyMotion``: its gap is not linearised."""
        return super().as_dict(contact, contacts, kinematics) | {"gap_error": None}

    def arms(self, contact: ContactState, touching: npt.NDArray[np.bool_]) -> Array:
        """See ``RigidBodyMotion``: of the displaced points from its displaced pivot."""
        boundary = contact.boundary
        relative = contact.u_n[:, None] * boundary.normal
        relative = relative + np.einsum("nij,nj->ni", boundary.cotangents, contact.u_t)
        return np.asarray((boundary.centre + relative)[touching] - self.reference)


@dataclass(frozen=True)
class MovingTools:
    """The tools of a problem at their translations.

    Attributes:
        bodies: the rigid bodies, whose rotations are prescribed to be zero.
        shapes: of all foundations, by their numbers.
    """

    bodies: RigidBodies
    shapes: Mapping[int, MovingShape]

    @property
    def there(self) -> bool:
        """Whether there is one."""
        return bool(self.bodies.bodies)

    @cached_property
    def translations(self) -> Array:
        """Of each, length, shape (t, d)."""
        dim = self.bodies.kinematics.dimension
        return np.array([self.shapes[body.parts[0]].translation for body in self.bodies.bodies]).reshape(-1, dim)

    def carry_to(self, translations: Array) -> None:
        """Put their shapes at translations, shape (t, d)."""
        for body, translation in zip(self.bodies.bodies, translations, strict=True):
            for part in body.parts:
                self.shapes[part].carry_to(np.array(translation))

    @property
    def motions(self) -> tuple[RigidBodyMotion, ...]:
        """Where they are."""
        dim, turns = self.bodies.kinematics.dimension, len(self.bodies.kinematics.rotations)
        pivots = [np.asarray(self.shapes[body.parts[0]].as_given.reference(dim)) for body in self.bodies.bodies]
        moved = zip(self.bodies.bodies, pivots, self.translations, strict=True)
        return tuple(ToolMotion(body, pivot, np.array(way), np.zeros(turns)) for body, pivot, way in moved)

    def touching(self, boundary: ContactBoundary) -> npt.NDArray[np.int64]:
        """The tool of each contact point, -1: none, shape (n,)."""
        number = np.full(boundary.size, -1)
        for k, body in enumerate(self.bodies.bodies):
            number[np.isin(boundary.part, body.parts)] = k
        return number

    def at_points(self, boundary: ContactBoundary, translations: Array | None = None) -> Array:
        """Translations, shape (t, d), at contact points, zero at those of other foundations, shape (n, d)."""
        moved = self.translations if translations is None else translations
        return np.asarray(np.vstack((moved, np.zeros(boundary.x.shape[1])))[self.touching(boundary)])


@dataclass(frozen=True)
class RelativeStiffness:
    """What displacements relative to tools meet at contact points.

    Attributes:
        boundary: the contact points.
        tool: of each of them, -1: none, shape (n,).
        blocks: C, force per length, symmetric, zero where there is no tool, shape (n, d, d).
    """

    boundary: ContactBoundary
    tool: npt.NDArray[np.int64]
    blocks: Array

    def forces(self, displacements: Array, translations: Array) -> tuple[Array, Array, float]:
        """The forces at the points, shape (n, d), on the tools, shape (t, d), and the work on the displacements;
        collective.

        Args:
            displacements: of the nodes of this rank, shape (nodes, d).
            translations: of the tools, shape (t, d).
        """
        moved = np.vstack((translations, np.zeros(translations.shape[1])))[self.tool]
        relative = displacements[self.boundary.nodes] - moved
        forces = np.einsum("nij,nj->ni", self.blocks, relative)
        on_tools, touched = np.zeros_like(translations), self.tool >= 0
        np.subtract.at(on_tools, self.tool[touched], forces[touched])
        sums = np.append(on_tools.ravel(), np.sum(forces * relative))
        total = parallel.global_sum(self.boundary.comm, sums)
        return forces, total[:-1].reshape(translations.shape), float(total[-1])
