"""Thermal strain: the change of the temperature times the coefficient of expansion of each material."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

from pydantic import model_validator

from signorini_fx.mechanics.statement.effect import BodyCoefficients, Contradictions, InitialStrain
from signorini_fx.mechanics.statement.point_values import PointValues
from signorini_fx.mechanics.statement.values import TimedSampledValue


class TemperatureChange(InitialStrain):
    """A change of the temperature, by which the body expands in all directions where nothing prevents it.

    Attributes:
        change: since the body was without stress, temperature.
        file: instead, a .csv with the columns x, y, in 3D z, and change: values at points of the body, between
            which they are interpolated linearly.
        region: name of the part of the body that it is in; None: all of it.
        factors: one number per load step; None: 1 in every step.
    """

    change: TimedSampledValue | None = None
    file: Path | None = None
    region: str | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.change is None) == (self.file is None):
            raise ValueError("give either change or file")
        return self

    @property
    def _value(self) -> Any:
        return self.change if self.file is None else PointValues(self.file)

    @property
    def given(self) -> dict[str, Any]:
        return {"change": self._value}

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        for material_number, material in enumerate(statement.material):
            inside = self.region is None or material.region in (None, self.region)
            if self.acts and inside and material.expansion is None:
                yield ("material", material_number), "has no expansion, which temperature needs"

    def strain(self, on: BodyCoefficients) -> Any:
        return on.expansion * on.value_in(self.region, self._value)


Entry = TemperatureChange
