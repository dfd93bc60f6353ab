"""No friction: the shear is zero."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from signorini_fx.mechanics.laws.protocol import Array, Envelope, FrictionLaw


class NoFriction(FrictionLaw):
    """Frictionless contact.

    Attributes:
        law: its name.
    """

    follows_pressure: ClassVar[bool] = False
    law: Literal["none"] = "none"

    def limit(self, pressure: Array) -> Array:
        return np.zeros_like(pressure)

    derivative = limit

    def envelope(self, zero: Array) -> Envelope:
        return Envelope(zero, zero)

    @property
    def unknown(self) -> str:
        return ""

    @property
    def acts(self) -> bool:
        return False
