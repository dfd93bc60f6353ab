"""Rigid shapes as nodes at finite displacements see them: distance, direction, curvature and motion
of the shape.

The formulas of the gap at X + u are in docs/theory.md.  Functions of all shapes take the contact
points ``boundary``, the ``shapes`` by the numbers of their foundations, ``places``, displacements
of the nodes, shape (nodes, d), and the ``size`` of the body, lengths; H are the ``hessians``,
second derivatives of distances, and w is the ``way`` of the points relative to their shapes since
the last step, length, shape (n, d).

Rigid bodies are shapes that forces and moments move by v and turn about their pivot c by a rotation
vector psi, which are unknown and need not be small.  With the arm a = X + u - c - v of a point,
contact sees y - R q with R q = v + psi x a, to first order: psi is along one axis, so that in 3D no
more than one of its components may be free.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem

from signorini_fx.arrays import Array, Flags, Ints
from signorini_fx.errors import FormError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.kinematics.protocol import Kinematics
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodies, RigidBodyMotion, turn_of
from signorini_fx.mechanics.statement.rigid_body import COMPONENTS
from signorini_fx.mechanics.statement.rigid_shape import Shape
from signorini_fx.tuned import DIFFERENCE_STEP, MOST_TURNED, NEGLIGIBLE

if TYPE_CHECKING:
    from signorini_fx.mechanics.effects.contact import Contact


@dataclass
class MovingShape:
    """The shape of one foundation where it is."""

    shape: Shape  # where it is now
    nodes: Ints  # of the foundation, local numbers, ghosts included, shape (n,)
    x: Array  # their initial positions, length, shape (n, d)
    u: fem.Function  # the displacement of the body
    turns: bool  # whether forces may turn it, see ``fitting``
    added: Array = field(init=False)  # to its distance at the nodes, length, shape (n,)
    motion: FiniteRigidMotion | None = None  # by which forces have moved it; None: by none
    _home: Shape = field(init=False)  # where it is without what forces have moved it by

    def __post_init__(self) -> None:
        self._home, self.added = self.shape, np.zeros(len(self.x))

    def __call__(self, x: Array) -> Array:
        """Return the linearised gap at the nodes, which are at x, shape (n,)."""
        return self.projected()[0]

    def direction(self, x: Array) -> Array:
        """Return the direction there, shape (d, n)."""
        return self.projected()[1].T

    @property
    def as_given(self) -> Shape:
        """The shape without what forces have moved it by."""
        if not self.shape.driven:
            return self.shape
        return self.shape.model_copy(
            update={"shift": self._home.shift, "rotation": self._home.rotation}
        )

    def carry_to(self, motion: FiniteRigidMotion) -> None:
        """Put a shape that forces move where its rigid body is."""
        self.motion, home, turn, dim = motion, self._home, motion.rotation, motion.reference.size
        about = home.reference(dim) - motion.reference
        shift = np.zeros(dim) if home.shift is None else np.array(home.shift, dtype=np.float64)
        moved = shift + motion.translation + (turn_of(turn) - np.eye(dim)) @ about
        update = {"shift": tuple(map(float, moved))}
        if turn.any() or self.shape.rotation is not None:
            if reason := self.turned_otherwise(turn):
                raise FormError.at("contact", reason)
            angles = (np.asarray(home.angles()) + np.degrees(turn)).tolist()
            update["rotation"] = tuple(angles) if dim == 3 else angles[0]
        self.shape = self.shape.model_copy(update=update)

    def turned_otherwise(self, turn: Array) -> str:
        """Why forces cannot turn it by a rotation vector, as it is given turned about another axis;
        "": they can.
        """
        given = np.zeros(turn.size) + np.asarray(self._home.angles())
        if turn.size == 1 or not np.cross(given, turn).any():
            return ""
        reason = (
            "forces turn this rigid body about another axis, which is not possible yet with "
            "a nonlinear body"
        )
        return (
            f"{reason}: rotate the data of the shape (axis, normal, points), and leave rotation out"
        )

    def projected(self, *, linear: bool = True) -> tuple[Array, Array]:
        """Return the linearised gap without what is added to it, length, shape (n,), and the
        direction to the shape, unit vectors, shape (n, d), at the displaced nodes; of a shape that
        forces move linear in all unknowns, if ``linear``.
        """
        u = self.u.x.array.reshape(-1, self.x.shape[1])[self.nodes]
        places = self.x + u
        moved = np.zeros_like(u)
        if self.motion is not None:
            moved = self.motion.linear_at(places) if linear else self.motion.at(self.x)
        signed, normal = self.shape.distance(places)
        return (signed - np.einsum("ni,ni->n", normal, u - moved)), -normal


def hessians_at(
    boundary: ContactBoundary, shapes: Mapping[int, MovingShape], places: Array, size: float
) -> Array:
    """H at contact points, 1 / length, shape (n, d, d), zero without a shape: by central
    differences of normals.
    """
    dimension = boundary.x.shape[1]
    step = DIFFERENCE_STEP * size
    hessians = np.zeros((boundary.size, dimension, dimension))
    for number, moving in shapes.items():
        points = np.flatnonzero((boundary.part == number) & boundary.at_nodes)
        at = boundary.x[points] + places[boundary.nodes[points]]
        for k, axis in enumerate(step * np.eye(dimension)):
            ahead, behind = (moving.shape.distance(at + sign * axis)[1] for sign in (1, -1))
            hessians[points, :, k] = (ahead - behind) / (2 * step)
    return (hessians + hessians.transpose(0, 2, 1)) / 2


def curvature_of(hessians: Array, state: ContactState, *, symmetric: bool = True) -> Array:
    """Return what the shapes add to the tangent as their normals turn with the displacement, at
    contact tractions: forces of displacements of the points relative to shapes, force per length,
    shape (n, d, d).

    The force of a pressure lambda along the normal n turns by -lambda H d, with H the second
    derivatives of the distance; a shear m in the tangent plane turns by n (m . H d).  Where
    ``symmetric`` the transpose of what turns the shear is added: it acts on displacements along the
    normal alone, and where there is contact these are of second order in d.
    """
    boundary = state.boundary
    shear = np.einsum("nij,nj->ni", boundary.tangents, state.shear)
    turning = np.einsum("ni,nj->nij", boundary.normal, np.einsum("nij,nj->ni", hessians, shear))
    blocks = turning - state.pressure[:, None, None] * hessians
    if symmetric:
        blocks += turning.transpose(0, 2, 1)
    return boundary.weight[:, None, None] * blocks


def turning_of(state: ContactState, size: float) -> Array:
    """Return what friction of sliding points in 3D does against displacements that turn their slip,
    in the frames of the points, force per length, shape (n, d, d).

    The shear m turns with the slip s: a displacement d along the tangent plane and across s meets
    |m| / |s| d.  As a dead load it would twist rubber that is squeezed between rough plates.  A
    shear that does not follow its slip, as that of an ellipse, is left out.  Slips that are
    round-off turn as easily as the smallest other ones.
    """
    boundary = state.boundary
    slip = state.slip_length
    shear = state.shear
    blocks = np.zeros((boundary.size, boundary.x.shape[1], boundary.x.shape[1]))
    if slip.shape[1] == 2:
        far = np.linalg.norm(slip, axis=1)
        strong = np.linalg.norm(shear, axis=1)
        along = np.einsum("ni,ni->n", slip, shear) >= (1 - NEGLIGIBLE) * far * strong
        turns = np.flatnonzero(
            along & state.in_contact & (state.direction != 0.0).any(axis=1) & (far > 0.0)
        )
        across = np.column_stack((-slip[turns, 1], slip[turns, 0])) / far[turns, None]
        rate = (
            boundary.weight[turns] * strong[turns] / np.maximum(far[turns], DIFFERENCE_STEP * size)
        )
        blocks[turns, 1:, 1:] = rate[:, None, None] * np.einsum("ni,nj->nij", across, across)
    return blocks


def turned_slips(boundary: ContactBoundary, hessians: Array, way: Array) -> Array:
    """M - 1 on the tangent planes, shape (n, d - 1, d - 1), symmetric: the slip, the part of the
    way w along the plane, which turns with a displacement d, changes by M d with M = 1 - (n_f . w)
    H on the plane, not by d.
    """
    along = np.einsum("ni,ni->n", boundary.normal, way)  # - n_f . w
    bends = np.einsum("n,nki,nkl,nlj->nij", along, boundary.tangents, hessians, boundary.tangents)
    return (bends + bends.transpose(0, 2, 1)) / 2


def left_by_turning(boundary: ContactBoundary, hessians: Array, way: Array, slip: Array) -> Array:
    """Return what part of a slip s turning tangent planes undo, or take on top of it: s - M^-1 s,
    length, shape (n, d - 1).

    With M of ``turned_slips`` what is left to go, s, needs d = -M^-1 s.  In a bowl M may vanish: it
    is not taken below 1 + ``MOST_TURNED``.
    """
    sizes, axes = np.linalg.eigh(turned_slips(boundary, hessians, way))
    sizes = np.maximum(sizes, MOST_TURNED)
    return np.einsum("nij,nj,nkj,nk->ni", axes, sizes / (1 + sizes), axes, slip)


def fitting(number: int, shape: Any, dimension: int, *, turns: bool = True) -> Shape:
    """Return the shape of a foundation, if it can meet a nonlinear body.

    ``turns``: whether forces may turn it: not where the contact has a measure, or points that
        average.  In 3D components of rotation vectors add up about one axis alone.

    Raises:
        FormError: it cannot.
    """
    path = f"contact[{number}].shape"
    if not isinstance(shape, Shape):
        cure = "derive its class from Shape of signorini_fx.mechanics.statement.rigid_shape"
        raise FormError.at(path, f"{type(shape).__name__} meets a nonlinear body: {cure}")
    rotations = COMPONENTS[dimension][dimension:] if shape.drives else ()
    values = {key: shape.prescribes(key) for key in rotations}
    if not turns and any(value != 0.0 for value in values.values()):
        cure = ", ".join(f"{key} = 0" for key in rotations)
        reason = (
            "a rigid body that forces turn is not possible yet with these contact points: "
            f"prescribe {cure}"
        )
        raise FormError.at(f"{path}.prescribed", reason)
    free = [key for key in rotations if values[key] is None]
    wrong = [key for key in rotations if values[key]]
    if len(free) > 1 or (free and wrong):
        others = " and ".join(f"{key} = 0" for key in rotations if key != free[0])
        reason = (
            "a rigid body that forces turn about more than one axis is not possible yet with a "
            "nonlinear body"
        )
        cure = f"prescribe {others}, or all of {', '.join(rotations)}"
        raise FormError.at(f"{path}.prescribed", f"{reason}: {cure}")
    return shape


class FiniteRigidMotion(RigidBodyMotion):
    """How a rigid body has moved: by a translation of its pivot and a rotation vector that need
    not be small.
    """

    def at(self, x: Array) -> Array:
        turned = (x - self.reference) @ (turn_of(self.rotation) - np.eye(self.reference.size)).T
        return turned + self.translation

    def linear_at(self, places: Array) -> Array:
        """R q at displaced points, shape (n, d)."""
        return super().at(places - self.translation)

    def as_dict(
        self, contact: ContactState, contacts: Sequence[Contact], kinematics: Kinematics
    ) -> dict[str, Any]:
        """Return the entry of a rigid body; its gap is not linearised and has no error."""
        return super().as_dict(contact, contacts, kinematics) | {"gap_error": None}

    def arms(self, contact: ContactState, touching: Flags) -> Array:
        """Return arms of the displaced points, from their displacement relative to the rigid body,
        r = X + a - c - psi x a.
        """
        boundary = contact.boundary
        axes = np.eye(self.reference.size)
        relative = contact.u_n[:, None] * boundary.normal
        relative = relative + np.einsum("nij,nj->ni", boundary.cotangents, contact.u_t)
        across = super().at(self.reference + axes) - self.translation  # psi x e_i
        away = (boundary.centre + relative)[touching] - self.reference
        return np.asarray(np.linalg.solve(axes - across.T, away.T).T)

    def lever(self, x: Array, displacements: Array) -> Array:
        """Return the arms of displaced points from the displaced pivot, length, shape (n, d)."""
        return x + displacements - self.reference - self.translation


@dataclass(frozen=True)
class MovingRigidBodies(RigidBodies):
    """The rigid bodies of a problem, given where they have not moved yet, at points that have
    been displaced.
    """

    displacement: fem.Function  # of the body
    coordinates: Array  # (v, L psi) of each where it is, lengths, shape (k,)

    @property
    def motions(self) -> tuple[FiniteRigidMotion, ...]:
        """How they have moved."""
        return self.moved(self.coordinates)

    def moved(self, unknowns: Array) -> tuple[FiniteRigidMotion, ...]:
        return tuple(FiniteRigidMotion(**vars(one)) for one in super().moved(unknowns))

    def places(self, boundary: ContactBoundary) -> Array:
        """Return the displaced points less the translation of their pivot, shape (n, d)."""
        places = (
            boundary.centre
            + self.displacement.x.array.reshape(-1, boundary.x.shape[1])[boundary.nodes]
        )
        for motion in self.motions:
            places[np.isin(boundary.part, motion.body.parts)] -= motion.translation
        return places

    def relative_stiffness(self, state: ContactState, curvature: Array) -> tuple[Array, Array]:
        """Return what tractions t of contact points and ``curvature``, C, shape (n, d, d), are
        between points and rigid bodies, see ``Model.relative``; collective.

        They are forces of (r, L w), the displacement relative to the rigid body and its turn:
        normals meet r by C, tractions turn by w, and arms change by r + w x a.  The symmetric part
        of that is, with [t] b = t x b,

            [0, -[t]; [t], a . t - (a t^T + t a^T) / 2].
        """
        boundary = self.on(state.boundary)
        dim = self.kinematics.dimension
        each = self.units.size
        assert boundary.moving is not None
        tractions = boundary.nodal_forces(state.pressure, state.shear)
        turns = np.arange(dim, each)
        arms, forces = np.zeros((2, boundary.size, 3))
        arms[:, :dim] = self.places(boundary)
        seen = np.zeros(
            (boundary.size, each, dim + each * len(self.bodies))
        )  # (r, L w) of the unknowns
        seen[:, :dim, :dim], seen[:, :dim, dim:] = np.eye(dim), -boundary.moving.modes
        for number, body in enumerate(self.bodies):
            points = np.flatnonzero(np.isin(boundary.part, body.parts))
            arms[points, :dim] -= body.pivot(dim)
            forces[points, :dim] = tractions[points]
            seen[points[:, None], turns, dim + each * number + turns] = 1.0
        against = np.cross(forces[:, None], np.eye(3))  # -[t]
        products = np.einsum("ni,nj->nij", arms, forces)
        along = np.einsum("nii->n", products)[:, None, None] * np.eye(3)
        arms_turn = along - (products + products.transpose(0, 2, 1)) / 2
        turned = np.block([[np.zeros_like(against), against], [-against, arms_turn]])
        # In 2D turns are about x[2]: its rows and columns of space are left out.
        axes = [*range(dim), *range(6 + dim - each, 6)]
        blocks = turned[:, axes][:, :, axes] / np.multiply.outer(self.units, self.units)
        blocks[:, :dim, :dim] += curvature
        together = seen.transpose(0, 2, 1) @ blocks @ seen
        return together[:, :dim, dim:], parallel.global_sum(
            boundary.comm, together[:, dim:, dim:].sum(axis=0)
        )
