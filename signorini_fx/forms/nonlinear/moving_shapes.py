"""Rigid shapes at finite displacements of the body: gap, direction, curvature and motion.

The formulas of the gap at X + u are in docs/theory.md.  Functions share these arguments: the
contact points ``boundary``; the ``shapes`` by contact number; ``places``, the displacements of the
nodes, shape (nodes, d); the ``size`` of the body, length; ``hessians``, H, the second derivatives
of distances; and the ``way``, w, the displacement of the points relative to their shapes since the
last step, length, shape (n, d).

Rigid bodies are shapes that forces and moments move by v and rotate about their pivot c by a
rotation vector psi.  Both are unknown and need not be small.  With the arm a = X + u - c - v of a
point, contact depends on y - R q with R q = v + psi x a, to first order.  The axis of psi is fixed:
in 3D at most one of its components may be free.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem

from signorini_fx.arrays import Array, Flags, Ints, Plain
from signorini_fx.errors import FormError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.kinematics import Kinematics
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodies, RigidBodyMotion, turn_of
from signorini_fx.mechanics.statement.rigid_body import COMPONENTS
from signorini_fx.mechanics.statement.rigid_shape import Shape
from signorini_fx.tuned import DIFFERENCE_STEP, MOST_TURNED, NEGLIGIBLE

if TYPE_CHECKING:
    from signorini_fx.mechanics.effects.contact import Contact


@dataclass
class MovingShape:
    """The shape of one foundation at its present place."""

    shape: Shape  # the shape at its present place
    nodes: Ints  # nodes of the foundation, local, ghosts included, shape (n,)
    x: Array  # their initial positions, length, shape (n, d)
    u: fem.Function  # the displacement of the body
    turns: bool  # whether forces may turn it, see ``fitting``
    added: Array = field(init=False)  # gap added to the distance at the nodes, length, shape (n,)
    motion: FiniteRigidMotion | None = None  # the motion by forces; None: there is none
    _home: Shape = field(init=False)  # the shape without the motion by forces

    def __post_init__(self) -> None:
        self._home, self.added = self.shape, np.zeros(len(self.x))

    def __call__(self, x: Array) -> Array:
        """Return the linearised gap at the displaced nodes, length, shape (n,); ``x`` is unused."""
        return self.projected()[0]

    def direction(self, x: Array) -> Array:
        """Return the directions to the shape at the displaced nodes, unit vectors, shape (d, n);
        ``x`` is unused.
        """
        return self.projected()[1].T

    @property
    def as_given(self) -> Shape:
        """The shape without the motion by forces."""
        if not self.shape.driven:
            return self.shape
        return self.shape.model_copy(
            update={"shift": self._home.shift, "rotation": self._home.rotation}
        )

    def carry_to(self, motion: FiniteRigidMotion) -> None:
        """Move the shape to the present motion of its rigid body."""
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
        """Return why forces cannot rotate the shape by a rotation vector, or "" if they can.

        They cannot if the shape itself is given with a rotation about another axis.
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
        """Return the linearised gap, without the added gap, length, shape (n,), and the directions
        to the shape, unit vectors, shape (n, d), at the displaced nodes.

        Args:
            linear: whether the motion by forces is linearised, too.
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
    """Return the second derivatives H of the distances at contact points by central differences of
    normals, 1 / length, shape (n, d, d), zero without a shape.
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
    """Return the geometric stiffness of shapes, whose normals turn with the displacement, force per
    length, shape (n, d, d).

    It acts on the displacements of the points relative to the shapes.  The force of a pressure
    lambda along the normal n turns by -lambda H d, with H the second derivatives of the distance; a
    shear m in the tangent plane turns by n (m . H d).

    Args:
        hessians: H at the points.
        state: the contact tractions.
        symmetric: whether to add the transpose of the shear term.  It acts only on displacements
            along the normal, which are of second order in d where there is contact.
    """
    boundary = state.boundary
    shear = np.einsum("nij,nj->ni", boundary.tangents, state.shear)
    turning = np.einsum("ni,nj->nij", boundary.normal, np.einsum("nij,nj->ni", hessians, shear))
    blocks = turning - state.pressure[:, None, None] * hessians
    if symmetric:
        blocks += turning.transpose(0, 2, 1)
    return boundary.weight[:, None, None] * blocks


def turning_of(state: ContactState, size: float) -> Array:
    """Return the stiffness of friction at sliding points in 3D against displacements that turn the
    slip, in the frames of the points, force per length, shape (n, d, d).

    The shear m turns with the slip s: a tangential displacement d across s meets |m| / |s| d.  As a
    dead load the shear would twist rubber that is squeezed between rough plates.  A shear that is
    not parallel to its slip, as with an ellipse of friction, is left out.  Slips below round-off
    count as the smallest length that is resolved.
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
    """Return M - 1 on the tangent planes, symmetric, shape (n, d - 1, d - 1).

    The slip is the part of the way w in the tangent plane.  As the plane turns with a displacement
    d, the slip changes by M d instead of d, with M = 1 - (n_f . w) H on the plane.
    """
    along = np.einsum("ni,ni->n", boundary.normal, way)  # - n_f . w
    bends = np.einsum("n,nki,nkl,nlj->nij", along, boundary.tangents, hessians, boundary.tangents)
    return (bends + bends.transpose(0, 2, 1)) / 2


def left_by_turning(boundary: ContactBoundary, hessians: Array, way: Array, slip: Array) -> Array:
    """Return the part s - M^-1 s of a slip s that results from turning tangent planes, length,
    shape (n, d - 1).

    With M of ``turned_slips`` a remaining slip s needs the displacement d = -M^-1 s.  In a bowl M
    may become singular: its eigenvalues are at least 1 + ``MOST_TURNED``.
    """
    sizes, axes = np.linalg.eigh(turned_slips(boundary, hessians, way))
    sizes = np.maximum(sizes, MOST_TURNED)
    return np.einsum("nij,nj,nkj,nk->ni", axes, sizes / (1 + sizes), axes, slip)


def fitting(number: int, shape: Any, dimension: int, *, turns: bool = True) -> Shape:
    """Return the shape of a foundation if it can be in contact with a nonlinear body.

    Args:
        number: number of the contact.
        shape: the shape.
        dimension: the dimension of space.
        turns: whether forces may rotate it: not if the contact has a measure, or averaging points.

    Raises:
        FormError: it cannot, for example because forces would rotate it about more than one axis:
            components of rotation vectors only add up about a single axis.
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
    """The motion of a rigid body: a translation of its pivot and a rotation vector, which need not
    be small.
    """

    def at(self, x: Array) -> Array:
        turned = (x - self.reference) @ (turn_of(self.rotation) - np.eye(self.reference.size)).T
        return turned + self.translation

    def linear_at(self, places: Array) -> Array:
        """Return the linear motion R q at displaced points, length, shape (n, d)."""
        return super().at(places - self.translation)

    def as_dict(
        self, contact: ContactState, contacts: Sequence[Contact], kinematics: Kinematics
    ) -> dict[str, Plain]:
        """Return the entry of a rigid body; its gap is not linearised and has no error."""
        return super().as_dict(contact, contacts, kinematics) | {"gap_error": None}

    def arms(self, contact: ContactState, touching: Flags) -> Array:
        """Return the arms r of the displaced points, from their displacement a relative to the
        rigid body: r = X + a - c - psi x a.
        """
        boundary = contact.boundary
        axes = np.eye(self.reference.size)
        relative = contact.u_n[:, None] * boundary.normal
        relative = relative + np.einsum("nij,nj->ni", boundary.cotangents, contact.u_t)
        across = super().at(self.reference + axes) - self.translation  # psi x e_i
        away = (boundary.centre + relative)[touching] - self.reference
        return np.asarray(np.linalg.solve(axes - across.T, away.T).T)


@dataclass(frozen=True)
class MovingRigidBodies(RigidBodies):
    """The rigid bodies of a problem, at displaced contact points.

    ``bodies`` holds them in their initial positions.
    """

    displacement: fem.Function  # the displacement of the body
    coordinates: Array  # present (v, L psi) of each, lengths, shape (k,)

    @property
    def motions(self) -> tuple[FiniteRigidMotion, ...]:
        """The present motions of the rigid bodies."""
        return self.moved(self.coordinates)

    def moved(self, unknowns: Array) -> tuple[FiniteRigidMotion, ...]:
        return tuple(FiniteRigidMotion(**vars(one)) for one in super().moved(unknowns))

    def places(self, boundary: ContactBoundary) -> Array:
        """Return the displaced points minus their pivot's translation, length, shape (n, d)."""
        places = (
            boundary.centre
            + self.displacement.x.array.reshape(-1, boundary.x.shape[1])[boundary.nodes]
        )
        for motion in self.motions:
            places[np.isin(boundary.part, motion.body.parts)] -= motion.translation
        return places

    def relative_stiffness(self, state: ContactState, curvature: Array) -> tuple[Array, Array]:
        """Return the stiffness between contact points and rigid bodies that comes from tractions t
        and from ``curvature``, C, shape (n, d, d), see ``Model.relative``; collective.

        It acts on (r, L w), the displacement relative to the rigid body and its rotation: normals
        turn with r by C, tractions turn with w, and arms change by r + w x a.  With [t] b = t x b
        the symmetric part of the terms of t is

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
        )  # maps the unknowns to (r, L w)
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
        # In 2D rotations are about x[2]: only its row and column are kept.
        axes = [*range(dim), *range(6 + dim - each, 6)]
        blocks = turned[:, axes][:, :, axes] / np.multiply.outer(self.units, self.units)
        blocks[:, :dim, :dim] += curvature
        together = seen.transpose(0, 2, 1) @ blocks @ seen
        return together[:, :dim, dim:], parallel.global_sum(
            boundary.comm, together[:, dim:, dim:].sum(axis=0)
        )
