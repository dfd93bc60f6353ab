"""The friction laws of the paper: none; Tresca, whose given bound acts even without a pressure;
Coulomb.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from signorini_fx.arrays import Array
from signorini_fx.mechanics.laws.directed import DirectedLaw
from signorini_fx.mechanics.laws.protocol import Envelope, FrictionLaw, Parameter, acting


class NoFriction(FrictionLaw):
    """Frictionless contact.

    Examples:
        >>> smooth = sfx.Contact(boundary="bottom", friction=sfx.NoFriction())
        >>> result = sfx.solve(scene.model_copy(update={"contact": smooth}))
        >>> print(np.round(result.contact.forces[1], 6))
        [0. 0.]
    """

    follows_pressure = False
    law: Literal["none"] = "none"

    def envelope(self, zero: Array) -> Envelope:
        return Envelope(zero, zero)

    @property
    def acts(self) -> bool:
        return False


class Tresca(DirectedLaw):
    """Tresca friction: |mu| <= bound (2.3d').

    Attributes:
        bound: largest shear, stress.

    Examples:
        >>> pushed = sfx.Traction(boundary="top", x=0.2, y=-2.0)
        >>> rough = sfx.Contact(boundary="bottom", friction=sfx.Tresca(bound=0.4))
        >>> changes = {"displacement": (), "traction": pushed, "contact": rough}
        >>> print(np.round(sfx.solve(scene.model_copy(update=changes)).contact.forces[1], 6))
        [-0.4  0. ]
    """

    follows_pressure = False
    law: Literal["tresca"] = "tresca"
    bound: Parameter = Field(kw_only=False)

    def envelope(self, zero: Array) -> Envelope:
        return Envelope(self.bound + zero, zero)

    @property
    def acts(self) -> bool:
        return acting(self.bound)


class Coulomb(DirectedLaw):
    """Coulomb friction: |mu| <= min(cohesion + coefficient * lambda, cap) in contact, (1.1e) and
    (1.1f).

    Attributes:
        coefficient: F, without unit.
        cap: largest shear that the contact can transmit, stress; None: no such limit.
        cohesion: shear that it transmits without pressure, stress, until it opens; None: none.

    Examples:
        >>> pushed = sfx.Traction(boundary="top", x=0.2, y=-2.0)
        >>> rough = sfx.Contact(boundary="bottom", friction=sfx.Coulomb(0.3))
        >>> changes = {"displacement": (), "traction": pushed, "contact": rough}
        >>> print(np.round(sfx.solve(scene.model_copy(update=changes)).contact.forces[1], 6))
        [-0.4  0. ]
    """

    law: Literal["coulomb"] = "coulomb"
    coefficient: Parameter = Field(kw_only=False)
    cap: Parameter | None = Field(default=None, kw_only=False)
    cohesion: Parameter | None = Field(default=None, kw_only=False)

    def envelope(self, zero: Array) -> Envelope:
        return Envelope(
            zero if self.cohesion is None else self.cohesion, self.coefficient, self.cap
        )

    @property
    def ends_open(self) -> bool:
        return self.cohesion is not None

    @property
    def unknown(self) -> str:
        return ""

    @property
    def acts(self) -> bool:
        return acting(self.coefficient, self.cohesion) and (self.cap is None or acting(self.cap))
