"""The admissible contact tractions closest to given ones in L2 that balance the loads of bodies
that move freely.

With the work R of unit tractions at the vertices of facets on the free motions, and the weights W
of the vertices, they are

    z(y) = P(z_0 - W^-1 R y),   R^T z(y) + L = 0,

where P is the projection onto the closest point of the admissible set.  The Lagrange multipliers y,
one per free motion, maximise a concave function whose gradient is the imbalance; Newton's method
finds the maximum.  The motions of all pieces of the body are taken together, because one pressure
may occur in the balance of two pieces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signorini_fx.addons.bounds.simplices import EPS
from signorini_fx.arrays import Array, quotient
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import MANY_STEPS, NOTHING_LEFT


@dataclass(frozen=True)
class AdmissibleTractions:
    """The admissible tractions of one contact, at k vertices of each of its m facets."""

    pressure: Array  # p, stress, shape (m, k)
    shear: Array  # mu, stress, shape (m, k, d)
    least: Array  # of which |mu| is at most, stress, shape (m, k)
    normal: Array  # work of unit pressures on the free motions, shape (m, k, n)
    across: Array  # that of unit shears, shape (m, k, d, n)
    weight: Array  # areas, shape (m,)

    def at(self, y: Array) -> tuple[Array, Array]:
        """Return the admissible pressure and shear for multipliers y."""
        unit = self.weight[:, None]
        pressure = (self.pressure - self.normal @ y / unit).clip(min=0.0)
        return pressure, onto_disc(self.shear - self.across @ y / unit[:, :, None], self.least)

    def work(self, pressure: Array, shear: Array) -> Array:
        """Return the work of the tractions on the free motions, shape (n,)."""
        return np.einsum("fak,fa->k", self.normal, pressure) + np.einsum(
            "fadk,fad->k", self.across, shear
        )

    def distance(self, pressure: Array, shear: Array) -> float:
        """Return half of the squared distance to the given tractions in L2."""
        squares = (pressure - self.pressure) ** 2 + ((shear - self.shear) ** 2).sum(axis=2)
        return float((self.weight[:, None] * squares).sum()) / 2

    @property
    def resistance(self) -> float:
        """The trace of ``slope`` if all vertices transmit forces."""
        unit = self.weight[:, None]
        return float(
            ((self.normal**2).sum(axis=2) / unit).sum()
            + ((self.across**2).sum(axis=(2, 3)) / unit).sum()
        )

    def slope(self, y: Array) -> Array:
        """Return minus the derivative of the work by the multipliers, shape (n, n)."""
        unit = self.weight[:, None, None]
        room = (self.pressure - self.normal @ y / unit[..., 0] >= 0)[:, :, None]
        free = self.shear - self.across @ y / unit
        size = np.linalg.norm(free, axis=2)
        inside = size < self.least
        share = quotient(self.least, size, ~inside & (size > 0), otherwise=1.0)
        unit_shear = quotient(free, size[..., None])
        along = np.einsum("fadk,fad->fak", self.across, unit_shear) * ~inside[..., None]
        across = share[:, :, None, None] * (self.across - unit_shear[..., None] * along[:, :, None])
        return np.einsum("fak,fal->kl", self.normal / unit, self.normal * room) + np.einsum(
            "fadk,fadl->kl", self.across / unit[..., None], across
        )


def balanced(
    loads: Array, contacts: list[AdmissibleTractions], small: Array
) -> list[tuple[Array, Array]]:
    """Return pressures and shears of each contact that balance the loads, except for at most
    ``small`` of each.

    Args:
        loads: work of the loads on the free motions, force, shape (n,).
        contacts: the admissible tractions of each contact.
        small: the largest imbalance allowed, shape (n,).

    Raises:
        Refused: none were found.
    """
    y: Array = np.zeros(len(loads))

    def imbalance(unbalanced: Array) -> float:
        return float((np.abs(unbalanced) - small).max())

    def tried(multipliers: Array) -> tuple[list[tuple[Array, Array]], Array, float]:
        tractions = [contact.at(multipliers) for contact in contacts]
        unbalanced = loads + sum(
            contact.work(*pair) for contact, pair in zip(contacts, tractions, strict=True)
        )
        far = sum(
            contact.distance(*pair) for contact, pair in zip(contacts, tractions, strict=True)
        )
        return tractions, unbalanced, float(far + multipliers @ unbalanced)

    tractions, unbalanced, value = tried(y)
    for _ in range(MANY_STEPS):
        if (last := imbalance(unbalanced)) <= 0:
            return tractions
        slope = sum((contact.slope(y) for contact in contacts), np.zeros((len(y), len(y))))
        # Where the vertices that carry resist no motion that is not balanced, the step is along it,
        # as far as others.
        resisted = slope + NOTHING_LEFT * sum(contact.resistance for contact in contacts) * np.eye(
            len(y)
        )
        step = np.linalg.lstsq(resisted, unbalanced, rcond=None)[0]
        length = 1.0
        while True:
            tractions, unbalanced, reached = tried(y + length * step)
            # Near the maximum the change of the function is round-off; then the imbalance decides.
            if reached >= value or length < NOTHING_LEFT or imbalance(unbalanced) < last:
                break
            length /= 2
        y = y + length * step
        value = reached
    if imbalance(unbalanced) <= 0:
        return tractions
    raise Refused("no admissible tractions near the nodal ones balance the loads")


def onto_disc(shear: Array, least: Array) -> Array:
    """Return the closest vectors with a magnitude of at most ``least``, shape (..., d)."""
    size = np.linalg.norm(shear, axis=-1)
    share = quotient(least, size, size > least, otherwise=1.0) * (1 - 2 * EPS)
    return shear * share[..., None]
