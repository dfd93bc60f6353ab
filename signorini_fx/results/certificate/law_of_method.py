"""The claims of a result: its contact law, its contact tractions, and the previous load step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from dolfinx import fem

from signorini_fx.arrays import Array, matvec
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodyMotion

if TYPE_CHECKING:
    from signorini_fx.mechanics.effects.contact import Contact, Overclosure


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
