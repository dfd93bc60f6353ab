"""The contact points of the certificate: their positions, gaps and conditions at a displacement,
with the tractions of a result.

A result claims a contact law, contact tractions, and the previous load step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from dolfinx import fem

from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.arrays import Array, Flags, Ints, matvec, rmatvec
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners, to_owners
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.kinematics import CARTESIAN
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodyMotion
from signorini_fx.tuned import NEGLIGIBLE

if TYPE_CHECKING:
    from signorini_fx.algebra.contact.bond import Bond
    from signorini_fx.mechanics.effects.contact import Contact, Overclosure
    from signorini_fx.results.certificate.pair_points import PairPoints


@dataclass(frozen=True)
class ContactConditions:
    """The n contact points of this rank at a displacement, and the conditions that hold there."""

    boundary: ContactBoundary
    gap: Array  # d, length, shape (n,)
    law: PointFriction | None  # friction law; None without friction
    bilateral: Flags  # where contact cannot open, shape (n,)
    pairs: Mapping[int, PairPoints]  # points between two bodies, by the number of the contact
    bond: Bond | None  # at the beginning of the step; None without one

    def part(self, *numbers: int) -> Ints:
        """Return the points of the contacts with these numbers."""
        return np.flatnonzero(np.isin(self.boundary.part, numbers))

    @cached_property
    def of_pairs(self) -> list[tuple[PairPoints, Ints]]:
        """The pairs of bodies, each with the indices of its points."""
        return [(pair, self.part(number)) for number, pair in self.pairs.items()]

    @cached_property
    def paired(self) -> Flags:
        """Which points belong to pairs of bodies, shape (n,)."""
        return np.isin(self.boundary.part, list(self.pairs))


@dataclass(frozen=True)
class ContactNodes(ContactConditions):
    """The contact points of this rank with the tractions at them.

    Displacements ``y`` are those of the owned nodes, length, shape (owned nodes, d).  Methods are
    collective.
    """

    pressure: Array  # stress, shape (n,)
    shear: Array  # in Cartesian components, stress, shape (n, d)
    broken: Array | None = None  # share of friction that acts, shape (n,); None: all of it

    @classmethod
    def of(cls, contact: ContactConditions, tractions: Tractions) -> ContactNodes:
        """Return the contact points of a problem with tractions at them."""
        known = {field.name: getattr(contact, field.name) for field in fields(ContactConditions)}
        return cls(**known, pressure=tractions.pressure, shear=tractions.shear)

    def bound(self, slip: Array) -> Array:
        """Return the largest shear that friction allows at each point, stress, shape (n,).

        Args:
            slip: magnitude of the slip, length, shape (n,).
        """
        if self.law is None:
            return np.zeros_like(self.pressure)
        bound = self.law.evaluate(self.pressure, slip)[0]
        return bound if self.broken is None else self.broken * bound

    def without_bond(self, u_n: Array, slip: Array) -> ContactNodes:
        """Return the points with the tractions of contact and friction alone, without those of a
        bond.

        Args:
            u_n: tau_N y, length, shape (n,).
            slip: tangential slip of the step, length, shape (n, d).
        """
        if self.bond is None:
            return self
        tangents = self.boundary.tangents
        traces = u_n, rmatvec(tangents, slip)
        bond = self.bond.begun(self.gap, np.zeros_like(traces[1]))
        held = bond.tractions(traces)
        shear = self.shear - matvec(tangents, held[:, 1:])
        return replace(
            self, pressure=self.pressure - held[:, 0], shear=shear, broken=bond.damaged(traces)
        )

    def rounded(self, vectors: Array, power: int) -> Array:
        """Return tangential vectors with their part across the direction of friction times r^power,
        where r is the ratio of the axes of orthotropic friction.

        With -1 admissible shears fill a disc; with 1 slips that are normal to the ellipse become
        normal to the disc.
        """
        axes = self.boundary.friction_axes
        if axes is None:
            return vectors
        across = self.boundary.tangents[:, :, 1] / axes.ratio[:, None]
        part = np.sum(vectors * across, axis=1) * (axes.ratio**power - 1)
        return vectors + part[:, None] * across

    def along(self, vectors: Array) -> Array:
        """Return the tangential part of vectors at the points, shape (n, d)."""
        return (
            vectors - np.sum(vectors * self.boundary.normal, axis=1)[:, None] * self.boundary.normal
        )

    @property
    def traction(self) -> Array:
        """Pressure and shear as one vector, stress, shape (n, d)."""
        return self.pressure[:, None] * self.boundary.normal + self.shear

    def traces(self, y: Array, rigid: Sequence[RigidBodyMotion] = ()) -> tuple[Array, Array]:
        """Return (tau_N y, tau_T y), shapes (n,) and (n, d), relative to rigid bodies that have
        moved.
        """
        averages = self.boundary.averages
        values = from_owners(y, averages.nodes, self.boundary.comm)
        relative = (averages.operator @ values.ravel()).reshape(self.boundary.normal.shape)
        for pair, part in self.of_pairs:
            if pair.moving is not None:
                relative[part] = pair.relative(pair.moving, y, self.boundary.normal[part])
        for motion in rigid:
            points = self.part(*motion.body.parts)
            relative[points] -= motion.at(self._x[points])
        return np.sum(relative * self.boundary.normal, axis=1), self.along(relative)

    @property
    def _x(self) -> Array:
        """Positions of the points, in pairs those on one of the bodies, length, shape (n, d)."""
        averages = self.boundary.averages
        return np.where(self.paired[:, None], self.boundary.x, averages.shares @ averages.x)

    def pieces(self, of_node: Ints) -> tuple[Ints, Ints]:
        """Return the piece of the body at each point, and the piece on the other side, -1 where the
        foundation is rigid, both of shape (n,).

        Args:
            of_node: the piece that each owned node is in.
        """
        opposite = np.full(self.boundary.size, -1, dtype=np.int64)
        for pair, part in self.of_pairs:
            opposite[part] = pair.on_other_side(of_node)
        return of_node[self.boundary.nodes], opposite

    def resultant(
        self, motion: RigidBodyMotion, y: Array, *, displaced: bool
    ) -> tuple[Array, float, float]:
        """Return the resultant of the contact tractions on a rigid body.

        These are force and moment about its pivot, shape (m,), the sum of the magnitudes of the
        nodal forces, and their largest distance from the pivot.  ``displaced``: whether points and
        pivot are where they have moved to.
        """
        part = self.part(*motion.body.parts)
        averages = self.boundary.averages
        comm = self.boundary.comm
        force = self.boundary.weight[part, None] * self.traction[part]
        arm = self._x[part] - motion.reference
        if displaced:
            averaged = averages.shares @ from_owners(y, averages.nodes, comm)
            moved = np.where(self.paired[:, None], y[self.boundary.nodes], averaged)
            arm += moved[part] - motion.translation
        moment = CARTESIAN[arm.shape[1]].turned(arm, force)
        size = np.linalg.norm(force, axis=1).sum()
        total = parallel.global_sum(
            comm, np.concatenate((force.sum(axis=0), moment.sum(axis=0), [size]))
        )
        reach = parallel.largest(comm, np.linalg.norm(arm, axis=1))
        return total[:-1], float(total[-1]), reach

    def terms(self, y: Array) -> Array:
        """Return the sums of the magnitudes of the terms that the relative displacement of two
        bodies is summed from, length, shape (n,); 0 on a rigid foundation.  Their round-off limits
        the accuracy of the relative displacement.
        """
        averages = self.boundary.averages
        if not self.pairs:
            return np.zeros(self.boundary.size)
        sums = (
            abs(averages.operator)
            @ from_owners(np.abs(y), averages.nodes, self.boundary.comm).ravel()
        )
        return np.where(
            self.paired, np.linalg.norm(sums.reshape(self.boundary.normal.shape), axis=1), 0.0
        )

    def forces(self, owned: int, *parts: int) -> tuple[Ints, Array, Array]:
        """Return the nodal forces of the tractions: the local nodes that they act on, shape (m,),
        the forces on them, shape (m, d), and the areas of these nodes, shape (m,).

        Args:
            owned: number of owned nodes.
            parts: numbers of the contacts that count; all without any.
        """
        boundary = self.boundary
        averages = self.boundary.averages
        force = boundary.weight[:, None] * self.traction
        if parts:
            force[~np.isin(boundary.part, parts)] = 0.0
        dim = force.shape[1]
        entries = averages.operator.tocoo()
        places = entries.row // dim, entries.col // dim
        moving = sp.csr_array(
            sp.coo_array((entries.data != 0, places), shape=averages.shares.shape)
        )
        # A node that moves a point by turning facets alone has a small area.
        moves = NEGLIGIBLE * moving.astype(bool).astype(np.float64)
        areas = abs(averages.shares).maximum(moves).T @ boundary.weight
        values = np.column_stack(((averages.operator.T @ force.ravel()).reshape(-1, dim), areas))
        rows = to_owners(values, averages.nodes, boundary.comm, owned)
        reached = np.flatnonzero(rows[:, -1] > 0)
        area = rows[reached, -1]
        for pair in self.pairs.values():
            area = np.maximum(area, pair.least_area()[reached])
        return reached, rows[reached, :-1], area

    @property
    def felt(self) -> Array:
        """The larger of pressure and shear at each point, without what supports take and without
        what the two cancel of each other, stress, shape (n,).
        """
        free = self.boundary.free
        axes = self.boundary.axes
        tractions = self.pressure[:, None] * self.boundary.normal, self.shear, self.traction
        pressure, shear, both = (
            np.linalg.norm(np.where(free, rmatvec(axes, part), 0.0), axis=1) for part in tractions
        )
        return np.minimum(np.maximum(pressure, shear), both)


@dataclass(frozen=True)
class Law:
    """The contact law that a result is checked against.

    With finite gamma it is the regularised law: lambda = max(0, gamma_n (tau_N y - d)), and mu is
    the projection of mu_0 + gamma_t times the slip onto |mu| <= F g, where mu_0 is the previous
    shear.  With infinite gamma it is the law of contact and friction itself.

    If the tractions were computed from displacements, also by augmentation, they have the round-off
    of displacements times ``penalty``; otherwise ``penalty`` is 0.
    """

    gamma_n: float = np.inf  # stress per length, as those below
    gamma_t: float = np.inf
    penalty: float = field(default=0.0, compare=False)
    # laws of soft contact, which replace gamma_n, by the number of the contact
    overclosures: Mapping[int, Overclosure] = field(default_factory=dict, compare=False)
    # Growth of gaps with the pressure, length per stress, shape (n,); None: zero.
    softness: Array | None = field(default=None, compare=False)

    @property
    def regularised(self) -> bool:
        """Whether it allows penetration and elastic slip."""
        return bool(np.isfinite(self.gamma_n) or np.isfinite(self.gamma_t))

    def __str__(self) -> str:
        if not self.regularised:
            return "the unregularised law"
        return f"the regularised law, gamma_n = {self.gamma_n:.3g}, gamma_t = {self.gamma_t:.3g}"


UNREGULARISED = Law()


def overclosures_of(contacts: Sequence[Contact]) -> dict[int, Overclosure]:
    """Return the laws of soft contact by the number of their contact."""
    laws = (
        (number, getattr(contact, "overclosure", None)) for number, contact in enumerate(contacts)
    )
    return {number: law for number, law in laws if law is not None}


@dataclass(frozen=True)
class Tractions:
    """The contact tractions at the n contact points of this rank, stresses.

    Attributes:
        pressure: lambda, shape (n,).
        shear: mu in Cartesian components, shape (n, d): no frame is shared with the solver.
    """

    pressure: Array
    shear: Array

    @classmethod
    def none(cls, boundary: ContactBoundary) -> Tractions:
        """Return zero tractions at all points."""
        return cls(np.zeros(boundary.size), np.zeros_like(boundary.x))

    @classmethod
    def of(cls, state: ContactState) -> Tractions:
        """Return the contact tractions of a contact state."""
        return cls(state.pressure, matvec(state.boundary.tangents, state.shear))


@dataclass(frozen=True)
class PreviousStep:
    """The state at the end of the previous load step, from which friction acts."""

    displacement: fem.Function
    tractions: Tractions
    elastic_slip: Array | None = (
        None  # the part of its slip that is due to the regularised law, length, shape (n, d)
    )
    moved: Array | None = (
        None  # motion of the foundations at the contact points since, length, shape (n, d)
    )
    rigid: tuple[RigidBodyMotion, ...] = ()  # motions of rigid bodies at its end
