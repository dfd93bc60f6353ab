"""How far contact gives way under its pressure: soft contact, as programs with a penalty have it."""

from __future__ import annotations

from typing import Literal

from signorini_fx.mechanics.statement.base import Table
from signorini_fx.mechanics.statement.values import Positive


class Overclosure(Table):
    """Pressure = stiffness times overclosure, the length by which one side has entered the other.

    Attributes:
        law: its name.
        stiffness: stress per length.
    """

    law: Literal["linear"] = "linear"
    stiffness: Positive
