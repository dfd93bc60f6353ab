"""The Mooney-Rivlin material: rubber up to about twice its length (M. Mooney, J. Appl. Phys. 11 (1940) 582-592)."""

from __future__ import annotations

from typing import Any, Literal, Self

import numpy as np
from pydantic import model_validator

from signorini_fx.mechanics.materials.nonlinear import Hyperelastic, deviator, inverse_transposed
from signorini_fx.mechanics.materials.protocol import Array
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
        """See ``NonlinearMaterial``."""
        return 2 * (self.c10 + self.c01), self.bulk

    def shape_energy(self, gradient: Any) -> Any:
        """See ``Hyperelastic``."""
        import ufl

        right, volume = gradient.T * gradient, ufl.det(gradient)
        first = ufl.tr(right)
        second = (first**2 - ufl.inner(right, right)) / 2
        return self.c10 * (first * volume ** (-2 / 3) - 3) + self.c01 * (second * volume ** (-4 / 3) - 3)

    def volume_energy(self, volume: Any) -> Any:
        """See ``Hyperelastic``."""
        return self.bulk / 2 * (volume - 1) ** 2

    def shape_stress_at(self, gradient: Array) -> Array:
        """See ``Hyperelastic``: by the Kirchhoff stress in the deformed body."""
        stretch = gradient @ gradient.swapaxes(-1, -2) * np.linalg.det(gradient)[..., None, None] ** (-2 / 3)
        first = np.trace(stretch, axis1=-2, axis2=-1)[..., None, None]
        kirchhoff = 2 * deviator((self.c10 + self.c01 * first) * stretch - self.c01 * stretch @ stretch)
        return np.asarray(kirchhoff @ inverse_transposed(gradient))

    def volume_stress_at(self, volume: Array) -> Array:
        """See ``Hyperelastic``."""
        return self.bulk * (volume - 1)

    @property
    def said(self) -> str:
        """See ``Material``."""
        return f"C10 = {self.c10:g}, C01 = {self.c01:g}, bulk = {self.bulk:g}, finite strains"
