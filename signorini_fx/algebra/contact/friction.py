"""Friction at the contact points: the bound of the shear as a function of the contact pressure.  No
finite elements.

Statics needs sets of tractions that are convex and have a closed form.  So the friction of n points
is first of all an envelope, min(g + F lambda, c), which no bound exceeds and most are equal to; a
law whose bound is less adds it at its points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

Nodal = npt.NDArray[np.float64]


class BoundOfPressure(Protocol):
    """The bound of a friction law at m points, and its derivative; ``laws.protocol.FrictionLaw`` is
    one.
    """

    def limit(self, pressure: Nodal) -> Nodal:
        """The largest shear at a pressure that is not negative, stress, shape (m,)."""

    def derivative(self, pressure: Nodal) -> Nodal:
        """Derivative of the bound by the pressure, at zero that towards larger ones, shape (m,)."""

    def at(self, points: npt.NDArray[np.int64]) -> BoundOfPressure:
        """The same at some of the points, by their numbers."""


@dataclass(frozen=True)
class LawAtPoints:
    """A law at m points, by their numbers, that is not its envelope; ``unknown``: what is not known
    of it, in words.
    """

    law: BoundOfPressure
    points: npt.NDArray[np.int64]
    unknown: str


@dataclass(frozen=True)
class PointFriction:
    """The friction of n contact points: |mu| <= min(given + coefficient lambda, cap), or less where
    a law says so.

    Attributes:
        given: Tresca's g, stress, shape (n,); zero at other points.
        coefficient: Coulomb's F, shape (n,); zero at other points.
        cap: largest bound, stress, shape (n,); None: unlimited.
        ends_open: points whose bound is zero where there is no pressure, shape (n,); None: there
            are none.
        laws: those whose bound is less than this envelope, the same on all ranks.
    """

    given: Nodal
    coefficient: Nodal
    cap: Nodal | None = None
    ends_open: npt.NDArray[np.bool_] | None = None
    laws: tuple[LawAtPoints, ...] = ()

    def bound(self, pressure: Nodal) -> Nodal:
        """F g with g = lambda at Coulomb points (6.1), stress; |lambda| where contact is
        bilateral.
        """
        size = np.abs(pressure)
        bound = self.given + self.coefficient * size
        bound = bound if self.cap is None else np.minimum(bound, self.cap)
        for entry in self.laws:
            bound[entry.points] = entry.law.limit(size[entry.points])
        return (
            bound
            if self.ends_open is None
            else np.where(self.ends_open & (pressure == 0), 0.0, bound)
        )

    def derivative(self, pressure: Nodal) -> Nodal:
        """Derivative of the bound by the pressure, at zero that towards larger ones, shape (n,)."""
        size = np.abs(pressure)
        slope = self.coefficient.copy()
        if self.cap is not None:
            slope = np.where(self.given + self.coefficient * size < self.cap, slope, 0.0)
        for entry in self.laws:
            slope[entry.points] = entry.law.derivative(size[entry.points])
        return np.where(pressure < 0, -slope, slope)

    @property
    def unknown(self) -> str:
        """Why the envelope is not the bound, in words; "": it is, at every point that is
        pressed.
        """
        return self.laws[0].unknown if self.laws else ""

    @property
    def affine(self) -> bool:
        """Whether the bound is given + coefficient lambda."""
        return self.cap is None and self.ends_open is None and not self.laws

    @cached_property
    def follows_pressure(self) -> bool:
        """Whether the bound of a point of this rank depends on the pressure."""
        return bool(self.laws) or self.ends_open is not None or bool((self.coefficient > 0).any())

    @property
    def acts(self) -> npt.NDArray[np.bool_]:
        """Points that can transmit shear, shape (n,)."""
        return np.asarray((self.given > 0) | (self.coefficient > 0))

    def without_pressure(self, where: npt.NDArray[np.bool_]) -> PointFriction:
        """The same where no pressure can act at some points, shape (n,): what the bound there is
        without one.
        """
        given = np.where(where, self.bound(np.zeros_like(self.given)), self.given)
        return replace(self, given=given, coefficient=np.where(where, 0.0, self.coefficient))

    def without_points(self, where: npt.NDArray[np.bool_]) -> PointFriction:
        """The same without friction at some points, shape (n,)."""
        laws = []
        for entry in self.laws:
            kept = np.flatnonzero(~where[entry.points])
            laws.append(replace(entry, law=entry.law.at(kept), points=entry.points[kept]))
        given, coefficient = (
            np.where(where, 0.0, values) for values in (self.given, self.coefficient)
        )
        return replace(self, given=given, coefficient=coefficient, laws=tuple(laws))

    def forces(self, weight: Nodal) -> PointFriction:
        """The envelope, which no bound exceeds, with forces for stresses at points with such
        weights, shape (n,).
        """
        return PointFriction(
            weight * self.given, self.coefficient, None if self.cap is None else weight * self.cap
        )

    def line(self, pressure: Nodal, bilateral: npt.NDArray[np.bool_]) -> tuple[Nodal, Nodal]:
        """Value at zero and slope of the tangent of the bound at a pressure, stress and number,
        shapes (n,); a negative pressure counts as zero but where contact cannot open.
        """
        pushing = np.where(bilateral, pressure, np.maximum(pressure, 0.0))
        slope = self.derivative(pushing)
        slope = np.where(np.isinf(slope), 0.0, slope)  # a root at zero has a vertical tangent
        return self.bound(pushing) - slope * pushing, slope


def as_given(bound: Any) -> PointFriction:
    """Friction whose bound is given."""
    values = np.asarray(bound, dtype=np.float64)
    return PointFriction(values, np.zeros_like(values))
