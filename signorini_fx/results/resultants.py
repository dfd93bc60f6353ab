"""Resultants on the body: for each boundary the force, its moment, and the point where it acts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.arrays import Array, Plain
from signorini_fx.machine import parallel
from signorini_fx.machine.display import clean
from signorini_fx.mechanics.assembly.mesh_entities import assemble, node_positions
from signorini_fx.mechanics.contact_points.contact_boundary import unit_contact_form
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.kinematics import CARTESIAN, Kinematics
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.mechanics.step_effect import AddedForces
from signorini_fx.results.certificate.contact_nodes import (
    ContactConditions,
    ContactNodes,
    Tractions,
)
from signorini_fx.results.certificate.equilibrium import Balance
from signorini_fx.tuned import ZERO_IN_SOLUTION

# A part of the boundary, None for the body; what acts there, in words; the forces, shape (owned
# nodes, d).
NamedForces = tuple[str | None, str, Array]
# Points of this rank and the forces there, shapes (n, d), by what exerts them.
ByCause = dict[str, tuple[Array, Array]]


@dataclass(frozen=True)
class Resultant:
    """Force and moment on the body through a boundary, in 2D per unit thickness.

    Of axisymmetric bodies the first component of the force is the sum of all radial forces, the
    third that of all forces around the axis; the moment is that about the axis alone, the torque.

    Attributes:
        boundary: its name, or a point such as ``(0, 1)`` with a support; None for the body force.
        acts: what acts there: ``support``, ``contact``, and kinds of loads and resistances, such as
            ``traction`` or ``body force``.
        force: force on the body, shape (d,).
        moment: its moment about ``about``; a number in 2D (counterclockwise), shape (3,) in 3D.
        about: a point, length, shape (d,).
        acts_at: a point of the line of action, length, shape (d,): on a flat boundary where that
            line meets its plane, in 3D the point of its plane about which the forces have no moment
            except along the normal; otherwise the point of the central axis nearest to the middle
            of the boundary. None where the forces have no resultant.
        size: sum of the magnitudes of the nodal forces, and of their moments, by which round-off is
            judged.
    """

    boundary: str | None
    acts: tuple[str, ...]
    force: Array
    moment: float | Array
    about: Array
    acts_at: Array | None
    size: tuple[float, float]

    def moment_about(self, point: npt.ArrayLike) -> float | Array:
        """Return the moment about another point, length, shape (d,)."""
        arms = self.about - np.asarray(point, dtype=np.float64)
        return _plain(np.atleast_1d(self.moment) + moments(arms, self.force))

    def as_dict(self, size: tuple[float, float], extent: float) -> dict[str, Plain]:
        """Return a row of the summary, JSON-safe.

        Forces and moments that are round-off of ``size``, and lengths that are round-off of
        ``extent``, the size of the body, become zero.
        """
        moment = clean(np.atleast_1d(self.moment).tolist(), size[1])
        return {
            "boundary": self.boundary,
            "acts": list(self.acts),
            "force": clean(self.force.tolist(), size[0]),
            "moment": moment if len(moment) > 1 else moment[0],
            "about": self.about.tolist(),
            "acts_at": None if self.acts_at is None else clean(self.acts_at.tolist(), extent),
        }


@dataclass(frozen=True)
class ActingForces:
    """The forces other than contact that act on a body at one displacement, evaluated anew."""

    balance: Balance
    supports: Sequence[
        str | None
    ]  # the support of each number in ``balance.supports.by``, None for none
    loads: Sequence[NamedForces]
    names: Sequence[str | None]  # boundaries with any of these forces
    displaced: bool = False  # whether forces act at displaced points

    def with_added(self, added: AddedForces) -> ActingForces:
        """Return the same with the forces of an effect in time."""
        loads = [*self.loads, *added.named]
        return replace(self, balance=self.balance.with_added(added), loads=loads)


@dataclass(frozen=True, repr=False)
class Resultants:
    """The resultants of one load step, from nodal forces: exact for the discrete solution, so that
    they are in balance.

    Reactions are the residual forces of the stresses at the nodes of supports (at a node of two
    supports each component belongs to one of them); those of contact come from the contact
    tractions.

    Attributes:
        model: the body on its mesh.
        statement: the named entries of the problem.
        displacement: y, length.
        contact: the contact boundary of this rank; None without contact.
        conditions: the contact points and their conditions; None without contact.
        acting: all other forces on the body.
    """

    model: Model
    statement: Statement
    displacement: fem.Function
    contact: ContactState | None
    conditions: ContactConditions | None
    acting: ActingForces

    def of(self, boundary: str, about: npt.ArrayLike | None = None) -> Resultant:
        """Return the resultant on a named boundary; zero where nothing acts.  Collective.

        Args:
            boundary: its name.
            about: the point that the moment is about, length, shape (d,); None for the origin.

        Raises:
            MeshError: there is no such boundary; the message lists the known ones.
            ValueError: the point has not d coordinates.
        """
        if boundary not in self._points:
            self.model.tagged.facets(boundary)
        return self._sum(boundary, self._through(boundary), about)

    def body_force(self, about: npt.ArrayLike | None = None) -> Resultant:
        """Return the resultant of the body force; collective."""
        return self._sum(None, self._at_nodes(None), about)

    def every(self) -> list[Resultant]:
        """Return the resultants of all boundaries with loads, supports or contact, and of the body
        force; collective.
        """
        resultants = [self.of(name) for name in self._names]
        return [*resultants, *([self.body_force()] if self._at_nodes(None) else [])]

    def as_rows(self) -> list[dict[str, Plain]]:
        """Return the rows of ``every`` for the summary; none if the displacement is not finite.
        Collective.
        """
        if parallel.any_rank(self.model.comm, not np.isfinite(self.displacement.x.array).all()):
            return []
        resultants = self.every()
        sizes = np.array([resultant.size for resultant in resultants]).reshape(-1, 2)
        force, moment = sizes.max(axis=0, initial=0.0).tolist()
        return [
            resultant.as_dict((force, moment), self.model.tagged.size) for resultant in resultants
        ]

    @property
    def _names(self) -> list[str]:
        """The names of the boundaries through which something acts."""
        sides = [
            name for effect in self.model.contacts for name in (effect.boundary, effect.against)
        ]
        return list(
            dict.fromkeys(
                name for name in [*self.acting.names, *sides, *self._points] if name is not None
            )
        )

    @property
    def _points(self) -> dict[str, tuple[float, ...]]:
        """The points with supports, by name."""
        return {
            effect.place: effect.at
            for effect in self.statement.displacement
            if effect.at is not None
        }

    @cached_property
    def _moved(self) -> Array:
        """The displacement of the nodes if forces act at displaced points, otherwise zero, length,
        shape (nodes, d).
        """
        y = self.displacement.x.array.reshape(-1, self.model.dimension)
        return y if self.acting.displaced else np.zeros_like(y)

    @cached_property
    def _x(self) -> Array:
        """Positions of the owned nodes where forces act, length, shape (owned nodes, d)."""
        owned, dim = self.acting.balance.external.shape
        return node_positions(self.displacement.function_space)[:owned, :dim] + self._moved[:owned]

    def _at_partners(self, boundary: str, parts: Sequence[int]) -> tuple[Array, Array]:
        """Return the positions of the nodes and the contact forces on them on the other body of
        some contacts.  Collective.
        """
        space = self.displacement.function_space
        facets = self.model.tagged.facets(boundary)
        on_boundary = fem.locate_dofs_topological(
            space, self.model.tagged.mesh.topology.dim - 1, facets
        )
        total = self._of_contact(*parts)
        total[~np.isin(np.arange(len(total)), on_boundary)] = 0.0
        return self._x, -total

    def _of_contact(self, *parts: int) -> Array:
        """Return the nodal forces of the contact tractions, of all contacts or of these, shape
        (owned nodes, d).  Collective.
        """
        total = np.zeros_like(self._x)
        if self.contact is not None and self.conditions is not None:
            claimed = ContactNodes.of(self.conditions, Tractions.of(self.contact))
            nodes, forces, _ = claimed.forces(len(total), *parts)
            np.add.at(total, nodes, forces)
        return total

    @cached_property
    def _reactions(self) -> Array:
        """The forces that the supports take: the residual of all other forces, shape (owned nodes,
        d).  Collective.
        """
        return self.acting.balance.residual(self._of_contact())

    def _through(self, boundary: str) -> ByCause:
        """Return the forces on the body at the nodes of a boundary, by cause."""
        by_cause = self._at_nodes(boundary)
        for sign, key in (
            (-1.0, "boundary"),
            (1.0, "against"),
        ):  # on the other body they are opposite
            parts = [
                k
                for k, effect in enumerate(self.model.contacts)
                if getattr(effect, key) == boundary
            ]
            if parts and self.contact is not None and self.conditions is not None:
                state = self.contact
                points = self.contact.boundary
                pairs = self.conditions.pairs
                on_boundary = np.isin(points.part, parts)
                forces = sign * points.nodal_forces(state.pressure, state.shear)
                placed = [
                    number for number, pair in pairs.items() if pair.displaced
                ]  # points on sides that slide are displaced already
                moved = np.where(
                    np.isin(points.part, placed)[:, None], 0.0, self._moved[points.nodes]
                )
                places = (points.centre + moved)[on_boundary]
                acting = forces[on_boundary]
                if "contact" in by_cause:  # the body touches itself
                    places = np.concatenate((by_cause["contact"][0], places))
                    acting = np.concatenate((by_cause["contact"][1], acting))
                by_cause["contact"] = places, acting
                # The displacement has moved partners away from the points.
                kept = any(part in pairs and not pairs[part].displaced for part in parts)
                if key == "against" and self.acting.displaced and kept:
                    by_cause["contact"] = self._at_partners(boundary, parts)
        return by_cause

    def _at_nodes(self, boundary: str | None) -> ByCause:
        """Return the nodal forces of supports, loads and resistances at a boundary, by cause; None
        for those in the body.  Collective.
        """
        held = [
            number
            for number, name in enumerate(self.acting.supports)
            if name == boundary is not None
        ]
        by_cause = dict[str, Array]()
        if held:
            taken = [self.acting.balance.supports.taken(self._reactions, number) for number in held]
            by_cause["support"] = np.sum(taken, axis=0)
        for where, cause, values in self.acting.loads:
            if where == boundary:
                by_cause[cause] = by_cause.get(cause, 0.0) + values
        return {cause: (self._x, values) for cause, values in by_cause.items()}

    def _sum(self, boundary: str | None, forces: ByCause, about: npt.ArrayLike | None) -> Resultant:
        """Return the resultant of the forces through a boundary."""
        dim = self.model.dimension
        comm = self.model.comm
        point = np.zeros(dim) if about is None else np.asarray(about, dtype=np.float64)
        if point.shape != (dim,):
            raise ValueError(f"about: a point with {dim} coordinates is expected, got {about!r}")
        total: Array = np.zeros(self._kinematics.motions + 2)
        for points, values in forces.values():
            turning = (
                moments(points - point, values).sum(axis=0) * self._kinematics.unbalanced[dim:]
            )
            sizes = np.linalg.norm(values, axis=1)
            arms = np.linalg.norm(points - point, axis=1)
            total += np.concatenate((values.sum(axis=0), turning, [sizes.sum(), arms @ sizes]))
        total = parallel.global_sum(comm, total)
        force = total[:dim]
        moment = total[dim:-2]
        size = (float(total[-2]), float(total[-1]))
        acts_at: Array | None = None
        if np.linalg.norm(force) > ZERO_IN_SOLUTION * size[0] and self._kinematics.unbalanced.all():
            middle, normal = (point, None) if boundary is None else self._middle(boundary)
            shifted = moment + moments(point - middle, force)
            acts_at = middle + arm(shifted, force, normal)
        return Resultant(boundary, tuple(forces), force, _plain(moment), point, acts_at, size)

    @property
    def _kinematics(self) -> Kinematics:
        """The kinematics of the body, in which some moments cancel."""
        return self.statement.kinematics_in(self.model.tagged.dimension)

    def _middle(self, boundary: str) -> tuple[Array, Array | None]:
        """Return the middle of a boundary, length, shape (d,), and its normal if it is flat and not
        displaced, otherwise None.  For a point support the point itself is returned.
        """
        if boundary in self._points:
            return np.array(self._points[boundary]), None
        space = self.displacement.function_space
        form = unit_contact_form(space, self.model.tagged.facets(boundary))
        areas = assemble(form).reshape(self._x.shape)
        weights = np.linalg.norm(areas, axis=1)
        sums = np.concatenate((weights @ self._x, areas.sum(axis=0), [weights.sum()]))
        sums = parallel.global_sum(self.model.comm, sums)
        dim = self.model.dimension
        total = sums[-1]
        normal = sums[dim:-1] / total
        flat = not self.acting.displaced and np.linalg.norm(normal) > 1 - ZERO_IN_SOLUTION
        return sums[:dim] / total, normal if flat else None


def moments(arms: Array, forces: Array) -> Array:
    """Return moments of forces, shape (..., d), at ``arms`` from a point: shape (..., 1) in 2D,
    (..., 3) in 3D.
    """
    return CARTESIAN[forces.shape[-1]].turned(arms, forces)


def arm(moment: Array, force: Array, normal: Array | None) -> Array:
    """Return the vector from a point to where a force acts that has this moment about the point,
    shape (d,).

    With a normal it is n x M / (n . F), in the plane across the normal, where no moment is left but
    that along it; without one, or if the force lies in that plane, it is the nearest place F x M /
    F^2.
    """
    axis = force
    if normal is not None and abs(normal @ force) > ZERO_IN_SOLUTION * np.linalg.norm(force):
        axis = normal
    if force.size == 2:
        return np.array([axis[1], -axis[0]]) * moment[0] / (axis @ force)
    return np.cross(axis, moment) / (axis @ force)


def _plain(moment: Array) -> float | Array:
    return moment if moment.size > 1 else float(moment[0])
