"""Bonds at contact points that soften and tear: tractions as functions of opening and slip, damage,
and their derivatives.

Arrays have one entry per point.  w is the penetration, negative where the bond has opened, s the
slip since it was made.  The opening d = sqrt(min(w, 0)^2 + |s|^2) has a share B = |s|^2 / d^2 of
shear.  The bond softens from an opening ``first``, where the tractions reach the quadratic ellipse
of both strengths, to ``last``, where it has taken the energy of Benzeggagh and Kenane.  Contact and
friction act in addition: the tractions of the bond pull where it has opened, and shear everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from signorini_fx.arrays import Array, inner, quotient

# Shares of shear at which energy and strength are sampled.
_SHARES = np.linspace(0.0, 1.0, 33)


class _Opened(NamedTuple):
    """The opening of bonds: along the normal, shape (n,); their slip, shape (n, d - 1); both
    together, shape (n,); and the share of shear, shape (n,).
    """

    along: Array
    slip: Array
    size: Array
    shear: Array


class _Limits(NamedTuple):
    """Openings at which bonds begin to soften and are torn, and their derivatives with respect to
    the share of shear, shape (n,) each.
    """

    first: Array
    last: Array
    first_by_shear: Array
    last_by_shear: Array


@dataclass(frozen=True)
class Bond:
    """The bonds of n points from the beginning of a load step on.

    Attributes:
        stiffness: k, stress per length; this and all others but the last two of shape (n,).
        strength: t, against opening, stress.
        shear_strength: S, stress.
        energy: G_I, energy for opening alone, stress times length.
        shear_energy: G_II, energy for shear alone, stress times length.
        exponent: of Benzeggagh and Kenane, for the energy between both.
        damage: at the beginning of the step; 1: there is no bond, or it is torn.
        separation: the slip since the bond was made, at the beginning of the step, length, shape
            (n, d - 1).
        position: the relative displacement at which the bond is free of stress, length, shape (n,
            d).
    """

    stiffness: Array
    strength: Array
    shear_strength: Array
    energy: Array
    shear_energy: Array
    exponent: Array
    damage: Array
    separation: Array
    position: Array

    @property
    def symmetric(self) -> bool:
        """Whether the derivatives are symmetric: strengths and energies are equal for opening and
        shear at all points with bonds on this rank.
        """
        same = self.energy == self.shear_energy
        same &= self.strength == self.shear_strength
        return bool((same | (self.damage >= 1.0)).all())

    def least_stiffness(self) -> Array:
        """Return the stiffness that bonds must exceed in order to soften before they are torn,
        shape (n,).
        """
        unit = replace(self, stiffness=np.ones_like(self.stiffness))
        limits = [unit._limits(np.full_like(self.strength, share)) for share in _SHARES]
        return np.max([first / last for first, last, _, _ in limits], axis=0)

    def begun(self, gap: Array, slip_origin: Array) -> Bond:
        """Return the bonds for displacements with this gap, length, shape (n,), and this origin of
        the slip in the step, length, shape (n, d - 1).
        """
        return replace(self, position=np.column_stack((gap, slip_origin - self.separation)))

    def at(self, along: Array, slip: Array) -> tuple[Array, Array]:
        """Return (tau_N y, tau_T y) for a penetration and a slip since the bond was made."""
        return self.position[:, 0] + along, self.position[:, 1:] + slip

    def damaged(self, traces: tuple[Array, Array]) -> Array:
        """Return the damage, from 0 to 1, shape (n,)."""
        opened = self._opened(traces)
        return np.maximum(self.damage, self._wanted(opened, self._limits(opened.shear)))

    def tractions(self, traces: tuple[Array, Array]) -> Array:
        """Return the pressures of the bonds, which are not positive, and their shears, stress,
        shape (n, d).
        """
        opened = self._opened(traces)
        holding = (1.0 - self.damaged(traces)) * self.stiffness
        return holding[:, None] * np.column_stack((-opened.along, opened.slip))

    def blocks(self, traces: tuple[Array, Array], theta: float = 1.0) -> Array:
        """Return a weighted mean of tangent and secant of the tractions, stress per length, shape
        (n, d, d).

        Secants are definite.  Closed bonds resist shear only, as contact takes the pressure.

        Args:
            traces: (tau_N y, tau_T y).
            theta: the weight of the tangent.
        """
        opened = self._opened(traces)
        count, tangents = opened.slip.shape
        holding = (1.0 - self.damaged(traces)) * self.stiffness
        blocks = np.zeros((count, 1 + tangents, 1 + tangents))
        blocks[:, 0, 0] = np.where(traces[0] <= self.position[:, 0], holding, 0.0)
        blocks[:, 1:, 1:] = holding[:, None, None] * np.eye(tangents)
        pulled = self.stiffness[:, None] * np.column_stack((-opened.along, opened.slip))
        return blocks - theta * pulled[:, :, None] * self.damage_by(traces)[:, None, :]

    def damage_by(self, traces: tuple[Array, Array]) -> Array:
        """Return the derivative of the damage with respect to the relative displacement, 1 /
        length, shape (n, d); zero where it does not grow.
        """
        opened = self._opened(traces)
        along, slip, size, shear = opened
        limits = self._limits(shear)
        first, last, first_by, last_by = limits
        wanted = self._wanted(opened, limits)
        grows = (wanted > self.damage) & (wanted < 1.0)
        size = np.where(grows, size, 1.0)
        span = last - first
        by_size = last * first / (size**2 * span)
        by_first = -last * (last - size) / (size * span**2)
        by_last = -first * (size - first) / (size * span**2)
        by_shear = by_first * first_by + by_last * last_by
        size_by = np.column_stack((-along, slip)) / size[:, None]
        shear_by = np.column_stack((2 * shear * along, 2 * ((1 - shear)[:, None] * slip)))
        shear_by /= size[:, None] ** 2
        slope = by_size[:, None] * size_by + by_shear[:, None] * shear_by
        return np.where(grows[:, None], slope, 0.0)

    def torn(self, traces: tuple[Array, Array]) -> Array:
        """Return the energy dissipated by damage, and the part dissipated before this step, at the
        present share of shear, stress times length, shape (n, 2).
        """
        first, last, _, _ = self._limits(self._opened(traces).shear)
        reached = np.column_stack((self.damaged(traces), self.damage))
        # The opening at which the damage was reached.
        span = (last - first)[:, None]
        opening = (first * last)[:, None] / (last[:, None] - reached * span)
        taken = 0.5 * (self.stiffness * first * last)[:, None] * (opening - first[:, None]) / span
        return taken

    def stored(self, traces: tuple[Array, Array]) -> Array:
        """Return the elastic energy stored in the bonds, stress times length, shape (n,)."""
        size = self._opened(traces).size
        return 0.5 * (1.0 - self.damaged(traces)) * self.stiffness * size**2

    def _opened(self, traces: tuple[Array, Array]) -> _Opened:
        """Return opening and slip of the bonds."""
        along = np.maximum(self.position[:, 0] - traces[0], 0.0)
        slip = traces[1] - self.position[:, 1:]
        squared = inner(slip, slip)
        size = np.sqrt(along**2 + squared)
        shear = quotient(squared, size**2, size > 0)
        return _Opened(along, slip, size, shear)

    def _limits(self, shear: Array) -> _Limits:
        """Return the openings between which bonds soften, for given shares of shear."""
        k = self.stiffness
        opens, shears = self.strength**-2, self.shear_strength**-2
        ratio = (1.0 - shear) * opens + shear * shears
        first = 1.0 / (k * np.sqrt(ratio))
        more = self.shear_energy - self.energy
        energy = self.energy + more * shear**self.exponent
        energy_by = more * self.exponent * shear ** (self.exponent - 1.0)
        last = 2.0 * energy / (k * first)
        first_by = -first * (shears - opens) / (2.0 * ratio)
        return _Limits(
            first, last, first_by, 2.0 * energy_by / (k * first) - last * first_by / first
        )

    @staticmethod
    def _wanted(opened: _Opened, limits: _Limits) -> Array:
        """Return the damage that the opening causes in undamaged bonds, from 0 to 1."""
        first, last, _, _ = limits
        size = np.maximum(opened.size, first)
        return np.clip(last * (size - first) / (size * (last - first)), 0.0, 1.0)
