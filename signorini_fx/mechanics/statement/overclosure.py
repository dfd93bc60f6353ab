"""How far contact gives way under its pressure: soft contact, as programs with a penalty have it.

Each law says the overclosure h at a pressure p >= 0, a length that is positive where one side has entered the other,
and with its second opinion the pressure at an overclosure.  Both grow with each other.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from signorini_fx.mechanics.statement.base import Table
from signorini_fx.mechanics.statement.values import NonNegative, Positive

Array = npt.NDArray[np.float64]


class Overclosure(Table):
    """A law of soft contact.

    Attributes:
        law: its name.
    """

    # Whether the overclosure is proportional to the pressure.
    proportional: ClassVar[bool] = False

    law: str

    def tangent(self, pressure: Array) -> tuple[Array, Array]:
        """The overclosure at a pressure, length, and its derivative by that, length per stress, both of shape (n,)."""
        raise NotImplementedError

    def pressure_at(self, overclosure: Array) -> Array:
        """The second opinion: the pressure at an overclosure, stress, shape (n,)."""
        raise NotImplementedError

    @property
    def start(self) -> float:
        """A pressure to begin with, stress."""
        raise NotImplementedError


class LinearOverclosure(Overclosure):
    """Pressure = stiffness times overclosure.

    Attributes:
        law: its name.
        stiffness: stress per length.
    """

    proportional: ClassVar[bool] = True

    law: Literal["linear"] = "linear"
    stiffness: Positive

    def tangent(self, pressure: Array) -> tuple[Array, Array]:
        """See ``Overclosure``."""
        return np.asarray(pressure / self.stiffness, dtype=np.float64), np.full_like(pressure, 1.0 / self.stiffness)

    def pressure_at(self, overclosure: Array) -> Array:
        """See ``Overclosure``."""
        return np.asarray(self.stiffness * np.maximum(overclosure, 0.0))

    @property
    def start(self) -> float:
        """See ``Overclosure``."""
        return 0.0


class ExponentialOverclosure(Overclosure):
    """Pressure = p_0 100^(h / c_0): at the overclosure zero p_0, at the clearance c_0 a hundredth of it, and from there
    on the tangent until it is zero, at c_0 (1 + 1 / ln 100).

    Attributes:
        law: its name.
        clearance: c_0, length.
        pressure: p_0, stress.
    """

    law: Literal["exponential"] = "exponential"
    clearance: Positive
    pressure: Positive

    @property
    def _rate(self) -> float:
        return float(np.log(100.0)) / self.clearance

    @property
    def start(self) -> float:
        """See ``Overclosure``."""
        return self.pressure

    def tangent(self, pressure: Array) -> tuple[Array, Array]:
        """See ``Overclosure``."""
        least = self.pressure / 100.0
        at = np.maximum(pressure, least)
        slope = np.asarray(1.0 / (self._rate * at), dtype=np.float64)
        return np.log(at / self.pressure) / self._rate + (pressure - at) * slope, slope

    def pressure_at(self, overclosure: Array) -> Array:
        """See ``Overclosure``."""
        near = np.maximum(overclosure, -self.clearance)
        tail = 1.0 + np.log(100.0) * np.minimum(overclosure / self.clearance + 1.0, 0.0)
        return np.asarray(self.pressure * 100.0 ** (near / self.clearance) * np.maximum(tail, 0.0))


class TabularOverclosure(Overclosure):
    """Lines between rows of pressure and overclosure, and on beyond the last one as between the last two.

    Attributes:
        law: its name.
        rows: [pressure, overclosure], both increasing; the first pressure is zero.
    """

    law: Literal["tabular"] = "tabular"
    rows: Annotated[tuple[tuple[NonNegative, float], ...], Field(min_length=2)]

    @model_validator(mode="after")
    def _increasing(self) -> Self:
        table = np.array(self.rows)
        if not (np.isfinite(table).all() and (np.diff(table, axis=0) > 0).all() and table[0, 0] == 0):
            raise ValueError("rows must increase in pressure and overclosure, from the pressure 0 on")
        return self

    @property
    def start(self) -> float:
        """See ``Overclosure``."""
        return float(self.rows[1][0])

    def tangent(self, pressure: Array) -> tuple[Array, Array]:
        """See ``Overclosure``."""
        p, h = np.array(self.rows).T
        row = np.clip(np.searchsorted(p, pressure, side="right") - 1, 0, len(p) - 2)
        slope = np.diff(h)[row] / np.diff(p)[row]
        return h[row] + slope * (pressure - p[row]), slope

    def pressure_at(self, overclosure: Array) -> Array:
        """See ``Overclosure``: by interpolation, and what is beyond by the last line."""
        p, h = np.array(self.rows).T
        beyond = np.maximum(overclosure - h[-1], 0.0) * (p[-1] - p[-2]) / (h[-1] - h[-2])
        return np.asarray(np.interp(overclosure, h, p) + beyond)


OneOverclosure = Annotated[LinearOverclosure | ExponentialOverclosure | TabularOverclosure, Field(discriminator="law")]
