"""The Mooney-Rivlin material: rubber up to about twice its length (M. Mooney, J. Appl. Phys. 11 (1940) 582-592)."""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import model_validator

from signorini_fx.mechanics.materials.nonlinear import (
    Hyperelastic,
    green_strain,
    growth,
    power_beyond_line,
    strain_beyond_growth,
)
from signorini_fx.mechanics.statement.base import refused
from signorini_fx.mechanics.statement.values import NonNegative, Positive


class MooneyRivlin(Hyperelastic):
    """The energy C10 (I1 - 3) + C01 (I2 - 3) + kappa/2 (J - 1)^2, with the invariants I1 and I2 of J^(-2/3) C, per
    undeformed volume.

    Attributes:
        law: its name.
        c10: C10, stress.
        c01: C01, stress; both are not negative, and the shear modulus at small strains is twice their sum.
        bulk: bulk modulus kappa, stress; 2 / D1 of Abaqus and CalculiX.
        hypothesis, torsion, grading, density, expansion, region: see ``Material``.
    """

    law: Literal["mooney-rivlin"]
    c10: NonNegative
    c01: NonNegative = 0.0
    bulk: Positive

    @model_validator(mode="after")
    def _stiff(self) -> Self:
        if not self.c10 + self.c01 > 0:
            raise refused("MooneyRivlin", [(("c10",), "must be above 0, or c01: the shear modulus is 2 (c10 + c01)")])
        return self

    @property
    def constants_at_rest(self) -> tuple[float, float]:
        return 2 * (self.c10 + self.c01), self.bulk

    def shape_energy_by_change(self, change: Any) -> Any:
        """See ``Hyperelastic``: C has the invariants 3 + 2 tr E and 3 + 4 tr E + 4 II(E)."""
        import ufl

        strain, grown, beyond = green_strain(change), growth(change), strain_beyond_growth(change)
        first, second = ufl.tr(strain), (ufl.tr(strain) ** 2 - ufl.inner(strain, strain)) / 2
        curved, steeper = power_beyond_line(grown, -2 / 3), power_beyond_line(grown, -4 / 3)
        energy = self.c10 * (2 * beyond + 3 * curved + 2 * first * (curved - 2 / 3 * grown))
        further = second + (first + second) * (steeper - 4 / 3 * grown)
        return energy + self.c01 * (4 * beyond + 3 * steeper + 4 * further)

    def volume_energy_by_change(self, growth: Any) -> Any:
        return self.bulk / 2 * growth**2


Entry = MooneyRivlin
