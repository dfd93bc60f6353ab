"""Hooke's law between Green's strain and the second Piola-Kirchhoff stress: large rotations at small strains.

Under strong compression it softens, and it has no resistance to vanishing volume (A. Raoult, Aplikace matematiky 31
(1986) 417-419): then take ``neo-hooke``.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from signorini_fx.mechanics.materials.neo_hooke import PoissonBelowHalf
from signorini_fx.mechanics.materials.nonlinear import Hyperelastic, green_strain
from signorini_fx.mechanics.statement.values import Positive


class SaintVenantKirchhoff(Hyperelastic):
    """The energy mu E : E + lambda/2 tr^2 E, with E = (F^T F - I)/2, per undeformed volume.

    Attributes:
        law: its name.
        young: Young's modulus, stress.
        poisson: Poisson's ratio, in (-1, 0.5).
        hypothesis, torsion, grading, density, expansion, region: see ``Material``.
    """

    splits: ClassVar[bool] = False

    law: Literal["saint-venant-kirchhoff"]
    young: Positive
    poisson: PoissonBelowHalf

    @property
    def constants_at_rest(self) -> tuple[float, float]:
        return self.young / (2 * (1 + self.poisson)), self.young / (3 * (1 - 2 * self.poisson))

    def shape_energy_by_change(self, change: Any) -> Any:
        import ufl

        (shear, bulk), strain = self.constants_at_rest, green_strain(change)
        return shear * ufl.inner(strain, strain) + (bulk - 2 * shear / 3) / 2 * ufl.tr(strain) ** 2


Entry = SaintVenantKirchhoff
