"""Load steps: their names and times, and the factors of loads at a load step and between two of them.

A place in the list of factors is a number: 0 for the first entry, 0.5 for halfway to the second, -1 for the body
without any load.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from signorini_fx.scene.base import Table
from signorini_fx.scene.values import Count, Finite


class LoadSteps(Table):
    """The names and times of load steps, and an automatic ramp between them.

    Attributes:
        steps: into how many equal load steps each interval between two factors is divided to begin with; where one of
            them has no solution a smaller one is tried, and after easy ones the next is twice as large. Without any
            factors all loads grow together from nothing. None: one load step per factor.
        names: one name per factor, such as press and push; None: no names.
        times: one number per factor, increasing, for tables and ParaView; None: 1, 2, 3 and so on.
    """

    steps: Count | None = None
    names: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    times: Annotated[tuple[Finite, ...], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _increasing(self) -> Self:
        if self.times is not None and (np.diff(self.times) <= 0).any():
            raise ValueError(f"times must increase, got {list(self.times)}")
        return self


def factor_at(factors: Sequence[float], step: float) -> float:
    """The factor of a load at a place: that of the load step, or linear in between; 0 for the body without loads."""
    if step == int(step) and step >= 0:
        return factors[int(step)]
    return float(np.interp(step, np.arange(-1, len(factors)), (0.0, *factors)))
