"""Results at the contact points, the same for every algorithm."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.points import ContactPoints
from signorini_fx.arrays import Array, Flags, inner, length
from signorini_fx.machine import parallel
from signorini_fx.tuned import ZERO_IN_SOLUTION


@dataclass(frozen=True, repr=False)
class PointState:
    """The contact points of this rank after a solve, arrays of shape (n,).

    Attributes:
        points: weights, and directions in which supports let the points move.
        gap: d, length.
        u_n: tau_N y, length; u_n - gap > 0 is penetration.
        u_t: tau_T y, length, shape (n, d - 1).
        pressure: lambda = -sigma_N, stress.
        shear: mu = -sigma_T, stress, shape (n, d - 1).
        bound: friction bound F g, stress; zero without friction.
        in_contact: True on A_c.
        direction: unit vector of the shear on A_f, zero on I_f, shape (n, d - 1); in 2D +1 on A_f,+
            and -1 on A_f,-.
        has_friction: whether a friction law acts.
        bilateral: points whose contact cannot open.
        slip_length: the slip that friction opposes, length: tau_T y, or its increment in a later
            load step, shape (n, d - 1).
        xi: slip without the elastic slip of the regularisation, length; zero at stick nodes, shape
            (n, d - 1).
        dt: duration of the load step if friction depends on the speed of slip, time; else 0.
        held: the part of pressure and shear that bonds carry, stress, shape (n, d); None without
            bonds.
        damage: damage of the bonds, from 0 to 1; None without bonds.
    """

    points: ContactPoints
    gap: Array
    u_n: Array
    u_t: Array
    pressure: Array
    shear: Array
    bound: Array
    in_contact: Flags
    direction: Array
    has_friction: bool
    bilateral: Flags
    slip_length: Array
    xi: Array
    dt: float
    held: Array | None
    damage: Array | None

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__}: {self.points.size} points of this rank, "
            f"{self.in_contact.sum()} in contact>"
        )

    @property
    def held_together(self) -> Flags:
        """Points with a bond that is not torn, shape (n,)."""
        return np.zeros_like(self.in_contact) if self.damage is None else self.damage < 1.0

    @property
    def speed(self) -> Array | None:
        """Speed of slip, length per time, shape (n,); None if friction does not depend on it."""
        return np.asarray(length(self.slip_length) / self.dt) if self.dt else None

    @property
    def held_inside(self) -> Array:
        """Depth of immovable points inside the foundation, length, shape (n,); zero at all others.

        Where contact cannot open it is the distance from the foundation on either side.
        """
        overlap = self.u_n - self.gap
        depth = np.where(self.bilateral, np.abs(overlap), np.maximum(overlap, 0.0))
        return np.where(self.points.immovable, depth, 0.0)

    @property
    def friction_energy(self) -> Array:
        """Energy dissipated by slip in this load step at each point per area, mu . xi with xi of
        (3.3c), force per length, shape (n,).

        xi is the slip without the elastic part that the regularisation adds, zero at stick nodes.
        """
        rubbing = self.shear if self.held is None else self.shear - self.held[:, 1:]
        return inner(rubbing, self.xi)

    @cached_property
    def friction_work(self) -> float:
        """Energy dissipated by slip in this load step, (mu, xi), never negative; collective."""
        work = np.dot(self.points.weight, self.friction_energy)
        return parallel.total(self.points.comm, work)

    def sliding_side(self) -> npt.NDArray[np.int8]:
        """Return ``ActiveSets.side``, with a side also for nodes that transmit no shear.

        Such nodes move freely; they count as slipping forwards, in 2D backwards if they move so by
        more than round-off.
        """
        side = ActiveSets.of(self.in_contact, self.direction).side
        back = self.slip_length[:, 0] < -ZERO_IN_SOLUTION * np.linalg.norm(
            np.column_stack((self.u_n, self.u_t)), axis=1
        )
        moving = np.where(back, -1, 1) if self.direction.shape[1] == 1 else np.ones(side.size)
        return np.where(self.bound > 0, side, moving).astype(np.int8)

    @cached_property
    def areas(self) -> dict[str, float]:
        """Areas (in 2D lengths) of the nodes in contact, and of those with a friction bound that
        stick and that slip; collective.
        """
        weight = self.points.weight
        slip = self.sliding_side() != 0
        acting = self.bound > 0
        sums = [np.dot(weight, where) for where in (self.in_contact, acting & ~slip, acting & slip)]
        total = parallel.global_sum(self.points.comm, np.array(sums))
        return dict(zip(("contact", "stick", "slip"), map(float, total), strict=True))
