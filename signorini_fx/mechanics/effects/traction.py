"""Traction and pressure on a boundary."""

from __future__ import annotations

from typing import Any

from signorini_fx.mechanics.statement.effect import Coefficients, Features, VectorForce, is_zero
from signorini_fx.mechanics.statement.values import TimedValue


class SurfaceTraction(VectorForce):
    """Traction on a boundary, h of (1.1c); it adds to others on the same boundary.

    Attributes:
        boundary: its name.
        x: component along x[0], stress.
        y: component along x[1], stress.
        z: component along x[2], stress; only in 3D.
        pressure: pressure on the boundary, which acts along the inward normal, stress; at finite strains along that of
            the deformed boundary, and per deformed area.
        factors: one number per load step; None: 1 in every step.
    """

    boundary: str
    pressure: TimedValue = 0.0

    @property
    def given(self) -> dict[str, Any]:
        return {**super().given, "pressure": self.pressure}

    @property
    def pressure_acts(self) -> bool:
        """Whether it has a pressure."""
        return not is_zero(self.pressure)

    @property
    def features(self) -> Features:
        return (*super().features, *(() if is_zero(self.pressure) else (("pressure", ("pressure",)),)))

    def density(self, on: Coefficients) -> Any:
        traction = super().density(on)
        return traction if is_zero(self.pressure) else traction - on.value(self.pressure) * on.normal


Entry = SurfaceTraction
