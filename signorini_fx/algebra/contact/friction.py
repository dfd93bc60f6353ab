"""Friction at the contact points: the bound of the shear as a function of pressure and slip.

Statics needs convex sets of tractions in closed form.  So the friction of n points is described by
an envelope, min(g + F lambda, c), which no bound exceeds and which most laws equal; a law with a
smaller bound is added at its points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from signorini_fx.arrays import Array, Flags, Ints, quotient

Evaluated = tuple[Array, Array, Array]  # a bound, stress; d/dpressure; d/dslip


class FrictionBound(Protocol):
    """The bound of a friction law at m points; ``laws.protocol.FrictionLaw`` implements it."""

    follows_slip: ClassVar[bool]

    def evaluate(
        self, pressure: Array, slip: Array, dt: float
    ) -> tuple[Array, Array | float, Array | float]:
        """Return the bound of the shear and its derivatives, see ``PointFriction.evaluate``."""

    def at(self, points: Ints) -> FrictionBound:
        """Return the law at some of the points, given by their numbers."""


def envelope_at(given: Array, coefficient: Array, cap: Array | None, pressure: Array) -> Evaluated:
    """Return min(given + coefficient lambda, cap) and its derivatives at non-negative pressures;
    arrays of shape (n,).
    """
    bound = given + coefficient * pressure
    by_pressure = np.broadcast_to(coefficient, bound.shape).copy()
    if cap is not None:
        by_pressure = np.where(bound < cap, by_pressure, 0.0)
        bound = np.minimum(bound, cap)
    return bound, by_pressure, np.zeros_like(by_pressure)


@dataclass(frozen=True)
class LawAtPoints:
    """A friction law at m points whose bound is smaller than the envelope.

    Attributes:
        law: the law.
        points: numbers of the points, shape (m,).
        unknown: message about what statics cannot know of it.
    """

    law: FrictionBound
    points: Ints
    unknown: str


@dataclass(frozen=True)
class PointFriction:
    """The friction of n contact points: |mu| <= min(given + coefficient lambda, cap), or a smaller
    bound where a law has one.

    Attributes:
        given: Tresca's g, stress, shape (n,); zero at other points.
        coefficient: Coulomb's F, shape (n,); zero at other points.
        cap: largest bound, stress, shape (n,); None: unlimited.
        ends_open: points whose bound is zero where there is no pressure, shape (n,); None: there
            are none.
        laws: laws with a smaller bound than this envelope, the same on all ranks.
        dt: duration of the slip, for laws that depend on its speed, time; 0: nothing slips.
        pressure: a fixed pressure at which the bound is evaluated, stress, shape (n,), not
            negative; None: the present pressure.
    """

    given: Array
    coefficient: Array
    cap: Array | None = None
    ends_open: Flags | None = None
    laws: tuple[LawAtPoints, ...] = ()
    dt: float = 0.0
    pressure: Array | None = None

    def evaluate(self, pressure: Array, slip: Array | float) -> Evaluated:
        """Return the bound of the shear at the n points, F g with g = lambda at Coulomb points
        (6.1), and its derivatives with respect to pressure and slip.

        Args:
            pressure: stress, shape (n,); negative only where contact is bilateral, where its
                magnitude counts.
            slip: length of the slip of the load step, not negative, shape (n,).

        Returns:
            bound, stress; d/dpressure, dimensionless, at zero towards larger pressures;
            d/dslip, stress per length; all of shape (n,).
        """
        if self.pressure is not None:
            given = replace(self, pressure=None).evaluate(self.pressure, slip)
            return given[0], np.zeros_like(pressure), given[2]
        size = np.abs(pressure)
        bound, by_pressure, by_slip = envelope_at(self.given, self.coefficient, self.cap, size)
        slips = np.broadcast_to(slip, size.shape)
        dt = self.dt
        if dt == 0.0:
            slips = np.zeros_like(size)
            dt = 1.0
        for entry in self.laws:
            at = entry.points
            values = entry.law.evaluate(size[at], slips[at], dt)
            bound[at], by_pressure[at], by_slip[at] = values
        if self.ends_open is not None:
            bound = np.where(self.ends_open & (pressure == 0), 0.0, bound)
        return bound, np.where(pressure < 0, -by_pressure, by_pressure), by_slip

    @property
    def unknown(self) -> str:
        """Message why the envelope is not the bound; "" if it is, at every point with pressure."""
        return self.laws[0].unknown if self.laws else ""

    @property
    def affine(self) -> bool:
        """Whether the bound is given + coefficient lambda, without cap."""
        return self.cap is None and self.ends_open is None and not self.laws

    @cached_property
    def follows_pressure(self) -> bool:
        """Whether the bound of a point of this rank depends on the pressure."""
        return bool(self.laws) or self.ends_open is not None or bool((self.coefficient > 0).any())

    @property
    def follows_slip(self) -> bool:
        """Whether the bound depends on the slip; the same on all ranks."""
        return any(entry.law.follows_slip for entry in self.laws)

    @property
    def acts(self) -> Flags:
        """Points that can transmit shear, shape (n,)."""
        return (self.given > 0) | (self.coefficient > 0)

    def without_pressure(self, where: Flags) -> PointFriction:
        """Return the law for some points, shape (n,), without pressure: there the bound is that of
        zero pressure.
        """
        given = np.where(where, self.evaluate(np.zeros_like(self.given), 0.0)[0], self.given)
        return replace(self, given=given, coefficient=np.where(where, 0.0, self.coefficient))

    def without_points(self, where: Flags) -> PointFriction:
        """Return the law without friction at some points, shape (n,)."""
        laws = []
        for entry in self.laws:
            kept = np.flatnonzero(~where[entry.points])
            laws.append(replace(entry, law=entry.law.at(kept), points=entry.points[kept]))
        given, coefficient = (
            np.where(where, 0.0, values) for values in (self.given, self.coefficient)
        )
        return replace(self, given=given, coefficient=coefficient, laws=tuple(laws))

    def forces(self, weight: Array) -> PointFriction:
        """Return the envelope, which no bound exceeds, in forces in place of stresses, for weights
        of shape (n,).
        """
        return PointFriction(
            weight * self.given, self.coefficient, None if self.cap is None else weight * self.cap
        )

    def line(
        self,
        pressure: Array,
        bilateral: Flags,
        slip: Array | float = 0.0,
        along: Array | float = 0.0,
        careful: bool = False,
    ) -> Evaluated:
        """Return the tangent of the bound, at_zero + by_pressure lambda + by_slip s.

        Args:
            pressure: where it touches, stress, shape (n,); a negative one counts as zero except
                where contact cannot open.
            bilateral: where contact cannot open, shape (n,).
            slip: where it touches, length, shape (n,).
            along: s there, the part of the slip along the direction of the shear, length, shape
                (n,).
            careful: whether by_slip is at least the slope of the chord from no slip to this one.

        Returns:
            at_zero, stress; by_pressure; by_slip, stress per length; all of shape (n,).
        """
        pushing = np.where(bilateral, pressure, np.maximum(pressure, 0.0))
        bound, by_pressure, by_slip = self.evaluate(pushing, slip)
        # A bound like a root of the pressure has a vertical tangent at zero.
        by_pressure = np.where(np.isinf(by_pressure), 0.0, by_pressure)
        if self.follows_slip:
            # Where slip begins, the tangent of a decreasing bound overshoots.
            by_slip = np.where(np.greater(along, 0.0), by_slip, np.maximum(by_slip, 0.0))
            if careful:
                risen = bound - self.evaluate(pushing, 0.0)[0]
                steepness = quotient(risen, slip)
                by_slip = np.maximum(by_slip, steepness)
        return bound - by_pressure * pushing - by_slip * along, by_pressure, by_slip


def as_given(bound: npt.ArrayLike) -> PointFriction:
    """Return friction with a given bound, independent of the pressure."""
    values = np.asarray(bound, dtype=np.float64)
    return PointFriction(values, np.zeros_like(values))
