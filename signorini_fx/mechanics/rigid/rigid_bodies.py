"""Rigid bodies: foundations whose motion is an unknown, driven by forces, moments or prescribed
components.

A rigid body with its pivot c moves by a translation v and a small rotation w.  Its unknowns are
lengths, q = (v, L w) with a length L, and it moves a contact point x_i by

    R_i q = v + w x (x_i - c).

Contact depends on the displacement of the body relative to it.  The unknowns (u, q) have

    K = [A 0; 0 S],   B_i = F_i^T [I, -R_i],   b = [f; (force, moment / L)],

with the stiffness S of springs at c.  So equilibrium of a rigid body, S q - R^T B^T (w t) = (force,
moment / L), adds k rows, while laws, active sets and algorithms depend on tau_N y and tau_T y as
before.  Gap and normals are evaluated in its given position: its motion is small compared with its
geometry, like the displacement of the body.

The k unknowns come last, on the last rank, so that all others keep their numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from signorini_fx.arrays import Array, Flags, Plain
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, MovingFoundation
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.kinematics import Kinematics
from signorini_fx.mechanics.rigid.rigid_motions import rigid_modes
from signorini_fx.mechanics.statement.rigid_body import RigidBody
from signorini_fx.mechanics.statement.rigid_shape import Shape, turning

if TYPE_CHECKING:
    from signorini_fx.mechanics.effects.contact import Contact

# Force and moment on a rigid body, and the components that are prescribed, nan where they are free.
Drive = tuple[Array, Array]


@dataclass(frozen=True)
class Driven:
    """Loads and prescribed motions of all rigid bodies by their unknowns, shapes (k,).

    ``forces``: (force, moment / L); ``motion``: prescribed components, lengths, zero for free ones.
    """

    forces: Array
    motion: Array

    @classmethod
    def together(cls, parts: Sequence[tuple[float, Driven]]) -> Driven | None:
        """Return a linear combination of drives with their factors; None if there are none."""
        if not parts:
            return None
        scaled = [(factor * drive.forces, factor * drive.motion) for factor, drive in parts]
        return cls(*np.sum(scaled, axis=0))


@dataclass(frozen=True)
class RigidBodies:
    """The rigid bodies of a problem, t of them with m unknowns each; t may be zero.

    Attributes:
        bodies: their contacts and their loads, shape (t,).
        kinematics: the kinematics of the deformable body, which limits their motions.
        length: L.
    """

    bodies: Sequence[RigidBody]
    kinematics: Kinematics
    length: float

    @property
    def units(self) -> Array:
        """The scale of the unknowns of each component: one for translations, L for rotations, shape
        (m,).
        """
        rotations = len(self.kinematics.rotations)
        return np.array([1.0] * self.kinematics.dimension + [self.length] * rotations)

    @property
    def parts(self) -> list[int]:
        """The numbers of the contacts of all rigid bodies."""
        return [part for body in self.bodies for part in body.parts]

    def on(self, boundary: ContactBoundary) -> ContactBoundary:
        """Return the contact points with the motions of rigid bodies as further unknowns."""
        if not self.bodies:
            return boundary
        motion_count = self.kinematics.motions
        count = len(self.bodies)
        dim = self.kinematics.dimension
        modes = np.zeros((boundary.size, dim, count, motion_count))
        for k, body in enumerate(self.bodies):
            touching = np.isin(boundary.part, body.parts)
            x = self.places(boundary)[touching]
            modes[touching, :, k] = rigid_modes(x, body.pivot(dim), np.array(self.length))
        flat = modes.reshape(boundary.size, dim, count * motion_count)
        number = np.repeat(np.arange(count), motion_count)
        moving = replace(
            boundary, moving=MovingFoundation(flat, self.fixed, self.stiffness, number, self.bodies)
        )
        if moving.friction_axes is not None:
            moving.friction_axes.check_supports(
                moving.points.movable, "contact.friction", moving.comm
            )
        return moving

    def places(self, boundary: ContactBoundary) -> Array:
        """Return the positions at which forces act on the points in the undeformed body, length,
        shape (n, d).
        """
        return boundary.centre

    def drives(self, time: float = 0.0) -> list[Drive]:
        """Return, for each rigid body, its force and moment at a time, and its prescribed
        components, shapes (m,).
        """
        return [body.motion.drive(self.kinematics.dimension, time) for body in self.bodies]

    @property
    def fixed(self) -> Flags:
        """Flags of the unknowns that are prescribed or that the kinematics exclude, shape (k,)."""
        prescribed = [
            ~np.isnan(motion) | ~self.kinematics.unbalanced for _, motion in self.drives()
        ]
        return np.array(prescribed, dtype=bool).ravel()

    @property
    def stiffness(self) -> Array:
        """The stiffness of the springs at the pivots, force / length, shape (k,)."""
        dim = self.kinematics.dimension
        of_bodies = [
            body.motion.stiffness(dim)[: self.units.size] / self.units**2 for body in self.bodies
        ]
        return np.array(of_bodies, dtype=np.float64).ravel()

    def driven(self, time: float = 0.0, number: int | None = None) -> Driven:
        """Return loads and prescribed motions of all rigid bodies at a time.

        ``number``: the only body to be driven, with zeros for the others; None: all.
        """
        drives = np.array(self.drives(time), dtype=np.float64).reshape(
            len(self.bodies), 2, self.units.size
        )
        if number is not None:
            drives[np.arange(len(drives)) != number] = 0.0
        return Driven(
            (drives[:, 0] / self.units).ravel(), np.nan_to_num(drives[:, 1] * self.units).ravel()
        )

    def moved(self, unknowns: Array) -> tuple[RigidBodyMotion, ...]:
        """Return the motions of the rigid bodies from their unknowns in a displacement, see
        ``Model.driven``.
        """
        dim = self.kinematics.dimension
        units = self.units
        motions = unknowns.reshape(len(self.bodies), units.size) / units
        return tuple(
            RigidBodyMotion(body, body.pivot(dim), motions[k, :dim], motions[k, dim:])
            for k, body in enumerate(self.bodies)
        )


@dataclass(frozen=True)
class RigidBodyMotion:
    """The displacement of a rigid body from its given position, v + w x (x - c), in 2D with w along
    x[2].

    Attributes:
        body: the rigid body, with its name and the numbers of its contacts.
        reference: its pivot c, length, shape (d,).
        translation: v, length, shape (d,).
        rotation: w, radians; in 2D shape (1,), in 3D shape (3,).
    """

    body: RigidBody
    reference: Array
    translation: Array
    rotation: Array

    def at(self, x: Array) -> Array:
        """Return the displacement of the rigid body at points of shape (n, d), length."""
        motion = np.concatenate((self.translation, self.rotation))
        return rigid_modes(x, self.reference, np.array(1.0)) @ motion

    def gap_error(self, contact: ContactState, shapes: Mapping[int, Shape]) -> float:
        """Return the largest error of the linearised gap at points under pressure, compared with
        the gap at the final position of the rigid body, length; collective.

        ``shapes``: the shapes in their initial position, by the numbers of the contacts.
        """
        if not np.isfinite(self.translation).all():
            return np.nan
        boundary = contact.boundary
        turn = turn_of(self.rotation)
        off = [np.zeros(0)]
        for part, shape in shapes.items():
            x = boundary.centre[(boundary.part == part) & (contact.pressure > 0)]
            if x.size:
                gap, normal = shape.distance(x)
                moved, _ = shape.distance(
                    (x - self.reference - self.translation) @ turn + self.reference
                )
                off.append(np.abs(moved - gap + np.sum(normal * self.at(x), axis=1)))
        return parallel.largest(boundary.comm, np.concatenate(off))

    def arms(self, contact: ContactState, touching: Flags) -> Array:
        """Return the vectors from the pivot to some of the contact points, length, shape (m, d)."""
        return contact.boundary.centre[touching] - self.reference

    def as_dict(
        self, contact: ContactState, contacts: Sequence[Contact], kinematics: Kinematics
    ) -> dict[str, Plain]:
        """Return a row of the summary: the motion, the force and moment of the body on it, and
        ``gap_error``; collective.

        ``contacts``: the contacts of the scene. ``kinematics``: the kinematics of the body, by
        which some forces and moments cancel.
        """
        from signorini_fx.machine.display import clean

        boundary = contact.boundary
        dim = self.reference.size
        touching = np.isin(boundary.part, self.body.parts)
        forces = boundary.nodal_forces(contact.pressure, contact.shear)[touching]
        both = np.column_stack((forces, kinematics.turned(self.arms(contact, touching), forces)))
        total, size = parallel.global_sum(
            boundary.comm, np.array([both.sum(axis=0), np.abs(both).sum(axis=0)])
        )
        total[~kinematics.unbalanced] = 0.0
        force, moment, moved, turned = (
            clean(values.tolist(), float(np.max(sizes)))
            for values, sizes in (
                (total[:dim], size[:dim]),
                (total[dim:], size[dim:]),
                (self.translation, np.abs(self.translation)),
                (self.rotation, np.abs(self.rotation)),
            )
        )
        surfaces = {part: contacts[part].surface for part in self.body.parts}
        shapes = {part: surface for part, surface in surfaces.items() if surface is not None}
        return {
            "boundary": self.body.name,
            "reference": self.reference.tolist(),
            "displacement": moved,
            "rotation": turned if dim == 3 else turned[0],
            "force": force,
            "moment": moment if dim == 3 else moment[0],
            "gap_error": self.gap_error(contact, shapes) if shapes else None,
        }

    def unbalanced(
        self, drive: Drive, resultant: tuple[Array, float, float], least: float = 0.0
    ) -> float:
        """Return the relative residual of the rigid body: the largest unbalanced force or moment on
        a free component over the forces on it, or the largest error of a prescribed component over
        its motion.

        Args:
            drive: its loads and prescribed components.
            resultant: force and moment of contact on it, their size and their lever, see
                ``ContactNodes.resultant``.
            least: a force below which everything is round-off.
        """
        load, prescribed = drive
        taken, size, reach = resultant
        dim = self.reference.size
        free = np.isnan(prescribed)
        motion = np.append(self.translation, self.rotation)
        # Moments as forces and rotations as lengths at this lever, so that neither depends on
        # units.
        lever = np.append(np.ones(dim), np.full(motion.size - dim, reach or 1.0))
        springs = self.body.motion.stiffness(dim)[: motion.size] * motion
        acting = np.array([load, -springs, taken]) / lever
        motion = motion * lever
        prescribed = prescribed * lever
        residual = acting.sum(axis=0)
        size = max(size, float(np.abs(acting[:2]).max()), least)  # springs may balance loads alone
        missed = float(np.abs(motion - prescribed)[~free].max(initial=0.0))
        far = max(np.abs(motion).max(), np.abs(prescribed[~free]).max(initial=0))
        force_share = float(np.abs(residual[free]).max(initial=0.0)) / size if size > 0 else 0.0
        return max(force_share, missed / far if far > 0 else float(missed > 0))


def turn_of(turn: Array) -> Array:
    """Return the rotation matrix, shape (d, d), of a rotation vector in radians, in 2D of
    an angle.
    """
    degrees = [float(angle) for angle in np.degrees(turn)]
    return turning(tuple(degrees), 3) if turn.size == 3 else turning(degrees[0], 2)
