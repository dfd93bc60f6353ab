"""The neo-Hookean material: rubber at moderate strains (R. S. Rivlin, Phil. Trans. R. Soc. A 240 (1948) 459-490)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from signorini_fx.mechanics.materials.nonlinear import (
    Hyperelastic,
    green_strain,
    growth,
    logarithm_beyond_line,
    power_beyond_line,
    strain_beyond_growth,
)
from signorini_fx.mechanics.statement.values import Positive

PoissonBelowHalf = Annotated[float, Field(gt=-1, lt=0.5, allow_inf_nan=False, strict=True)]


class NeoHooke(Hyperelastic):
    """The energy mu/2 (tr C - 3) - mu ln J + lambda/2 ln^2 J, or, ``isochoric``, mu/2 (J^(-2/3) tr C - 3) +
    kappa/2 (J - 1)^2, per undeformed volume.

    Attributes:
        law: its name.
        young: Young's modulus at small strains, stress.
        poisson: Poisson's ratio at small strains, in (-1, 0.5).
        isochoric: which energy: the second one is that of Abaqus, Ansys and CalculiX, with C10 = mu/2, D1 = 2/kappa.
        hypothesis, torsion, grading, density, expansion, region: see ``Material``.
    """

    law: Literal["neo-hooke"]
    young: Positive
    poisson: PoissonBelowHalf
    isochoric: bool = False

    @property
    def constants_at_rest(self) -> tuple[float, float]:
        return self.young / (2 * (1 + self.poisson)), self.young / (3 * (1 - 2 * self.poisson))

    def shape_energy_by_change(self, change: Any) -> Any:
        import ufl

        (shear, _), grown, beyond = self.constants_at_rest, growth(change), strain_beyond_growth(change)
        if self.isochoric:
            curved = power_beyond_line(grown, -2 / 3)
            further = ufl.tr(green_strain(change)) * (curved - 2 / 3 * grown)
            return shear * (beyond + 3 / 2 * curved + further)
        return shear * (beyond - logarithm_beyond_line(grown))

    def volume_energy_by_change(self, growth: Any) -> Any:
        shear, bulk = self.constants_at_rest
        if self.isochoric:
            return bulk / 2 * growth**2
        return (bulk - 2 * shear / 3) / 2 * (growth + logarithm_beyond_line(growth)) ** 2


Entry = NeoHooke
