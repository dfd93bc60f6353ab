"""Friction that depends on the speed of slip: R. Stribeck's curve as a formula, and a table."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from signorini_fx.arrays import Array
from signorini_fx.mechanics.laws.directed import DirectedLaw
from signorini_fx.mechanics.laws.protocol import Envelope, Parameter, acting
from signorini_fx.mechanics.statement.base import refused
from signorini_fx.mechanics.statement.values import NonNegative, Positive, bounded


class SpeedLaw(DirectedLaw):
    """Friction |mu| <= F(v) lambda with the speed v of the slip in a load step.

    Attributes:
        law: its name.
        ratio: see ``DirectedLaw``.
        along: see ``DirectedLaw``.
    """

    follows_slip = True

    @property
    def typical_speeds(self) -> Array:
        """Speeds that include one at which F falls about as fast as anywhere, shape (k,), length
        per time.
        """
        raise NotImplementedError

    def coefficient_at(self, speed: Array) -> tuple[Array, Array]:
        """Return F and dF/dv at speeds of shape (n,), without unit and time per length."""
        raise NotImplementedError

    @property
    def steepest_fall(self) -> float:
        """The largest -dF/dv, time per length; 0 if F falls nowhere, or if its parameters are not
        all numbers.
        """
        if not all(isinstance(value, float) for value in self.parameters.values()):
            return 0.0
        return max(0.0, -float(self.coefficient_at(self.typical_speeds)[1].min()))

    def evaluate(self, pressure: Array, slip: Array, dt: float) -> tuple[Array, Array, Array]:
        coefficient, by_speed = self.coefficient_at(np.asarray(slip / dt))
        return coefficient * pressure, coefficient, np.asarray(by_speed * pressure / dt)


class Stribeck(SpeedLaw):
    """Friction |mu| <= F(v) lambda with F = kinetic + (coefficient - kinetic) exp(-(v /
    speed)^exponent) + viscous v, where v is the speed of the slip in a load step.

    Attributes:
        coefficient: F at rest, without unit.
        kinetic: F of fast slip, without the viscous part, without unit.
        speed: over which F goes from one to the other, length per time.
        exponent: of the speed, at least 1.
        viscous: growth of F with the speed, time per length; None: none.

    Examples:
        >>> rubs = sfx.Stribeck(0.4, kinetic=0.2, speed=0.01)
        >>> changes = {
        ...     "displacement": sfx.Displacement(boundary="top", x="0.02*t", y=-0.001),
        ...     "traction": (),
        ...     "contact": sfx.Contact(boundary="bottom", friction=rubs),
        ...     "load_steps": sfx.LoadSteps(times=(1.0, 2.0, 3.0)),
        ... }
        >>> contact = sfx.solve(scene.model_copy(update=changes)).contact
        >>> print(np.round(contact.forces[1][0] / contact.forces[0][1], 3))
        -0.204
    """

    apart = ("speed", "exponent", *DirectedLaw.apart)

    law: Literal["stribeck"] = "stribeck"
    coefficient: Parameter = Field(kw_only=False)
    kinetic: Parameter = Field(kw_only=False)
    speed: Positive
    exponent: Annotated[
        float, Field(ge=1, allow_inf_nan=False, strict=True), AfterValidator(bounded)
    ] = 2.0
    viscous: Parameter | None = Field(default=None, kw_only=False)

    @property
    def typical_speeds(self) -> Array:
        return np.asarray(np.linspace(0.0, 2.0 * self.speed))

    def coefficient_at(self, speed: Array) -> tuple[Array, Array]:
        viscous = 0.0 if self.viscous is None else self.viscous
        ratio = speed / self.speed
        left = (self.coefficient - self.kinetic) * np.exp(-(ratio**self.exponent))
        falls = left * self.exponent / self.speed * ratio ** (self.exponent - 1)
        return self.kinetic + left + viscous * speed, viscous - falls

    def envelope(self, zero: Array) -> Envelope:
        most = np.maximum(self.coefficient, self.kinetic) + zero
        viscous = zero if self.viscous is None else self.viscous
        return Envelope(np.where(viscous > 0, np.inf, zero), np.where(viscous > 0, 0.0, most))

    @property
    def acts(self) -> bool:
        return acting(self.coefficient, self.kinetic, self.viscous)


class SpeedTable(SpeedLaw):
    """Friction |mu| <= F(v) lambda with F linear between the speeds of a table, and constant beyond
    them.

    Attributes:
        speeds: of the slip in a load step, ascending from 0, length per time.
        coefficients: F at each of them, without unit.

    Examples:
        >>> print(sfx.SpeedTable(speeds=(0.0, 0.01, 0.1), coefficients=(0.4, 0.3, 0.2)).limit(2.0))
        0.8
    """

    apart = ("speeds", "coefficients", *DirectedLaw.apart)

    law: Literal["speeds"] = "speeds"
    speeds: Annotated[tuple[NonNegative, ...], Field(min_length=2)]
    coefficients: Annotated[tuple[NonNegative, ...], Field(min_length=2)]

    @property
    def typical_speeds(self) -> Array:
        return np.array(self.speeds)

    @model_validator(mode="after")
    def _table(self) -> Self:
        wrong = []
        if self.speeds[0] != 0 or (np.diff(self.speeds) <= 0).any():
            wrong.append((("speeds",), "must begin with 0 and increase"))
        if len(self.speeds) != len(self.coefficients):
            wrong.append((("coefficients",), f"must be {len(self.speeds)}, one for each speed"))
        if wrong:
            raise refused(type(self).__name__, wrong)
        return self

    def coefficient_at(self, speed: Array) -> tuple[Array, Array]:
        at = np.searchsorted(self.speeds, speed, side="right")
        slopes = np.diff(self.coefficients) / np.diff(self.speeds)
        return np.interp(speed, self.speeds, self.coefficients), np.append(slopes, 0.0)[at - 1]

    def envelope(self, zero: Array) -> Envelope:
        return Envelope(zero, max(self.coefficients) + zero)

    @property
    def acts(self) -> bool:
        return any(self.coefficients)
