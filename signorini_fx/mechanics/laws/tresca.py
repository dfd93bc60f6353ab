"""Tresca friction: the bound is given, and acts without a pressure too."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from signorini_fx.mechanics.laws.directed import DirectedLaw, Ratio, VectorField
from signorini_fx.mechanics.laws.protocol import Array, Envelope, Parameter, acting


class Tresca(DirectedLaw):
    """Tresca friction: |mu| <= bound (2.3d').

    Attributes:
        law: its name.
        bound: largest shear, stress.
        ratio: that of the friction across ``along`` to the friction along it; None: it is the same in all directions.
        along: a vector, whose part in the tangent plane counts; None: along x[0].
    """

    follows_pressure: ClassVar[bool] = False
    law: Literal["tresca"] = "tresca"
    bound: Parameter
    ratio: Ratio | None = None
    along: VectorField | None = None

    def limit(self, pressure: Array) -> Array:
        return np.asarray(self.bound + 0.0 * pressure)

    def derivative(self, pressure: Array) -> Array:
        return np.zeros_like(pressure)

    def envelope(self, zero: Array) -> Envelope:
        return Envelope(self.bound, zero)

    @property
    def unknown(self) -> str:
        return ""

    @property
    def acts(self) -> bool:
        return acting(self.bound)
