"""The neo-Hookean material: rubber at moderate strains (R. S. Rivlin, Phil. Trans. R. Soc. A 240 (1948) 459-490)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from signorini_fx.mechanics.materials.nonlinear import Hyperelastic, deviator, inverse_transposed
from signorini_fx.mechanics.materials.protocol import Array
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
        """See ``NonlinearMaterial``."""
        return self.young / (2 * (1 + self.poisson)), self.young / (3 * (1 - 2 * self.poisson))

    def shape_energy(self, gradient: Any) -> Any:
        """See ``Hyperelastic``."""
        import ufl

        (shear, _), volume, stretch = self.constants_at_rest, ufl.det(gradient), ufl.inner(gradient, gradient)
        if self.isochoric:
            return shear / 2 * (stretch * volume ** (-2 / 3) - 3)
        return shear / 2 * (stretch - 3) - shear * ufl.ln(volume)

    def volume_energy(self, volume: Any) -> Any:
        """See ``Hyperelastic``."""
        import ufl

        shear, bulk = self.constants_at_rest
        return bulk / 2 * (volume - 1) ** 2 if self.isochoric else (bulk - 2 * shear / 3) / 2 * ufl.ln(volume) ** 2

    def shape_stress_at(self, gradient: Array) -> Array:
        """See ``Hyperelastic``: by the Kirchhoff stress in the deformed body."""
        (shear, _), squares = self.constants_at_rest, gradient @ gradient.swapaxes(-1, -2)
        if self.isochoric:
            kirchhoff = shear * np.linalg.det(gradient)[..., None, None] ** (-2 / 3) * deviator(squares)
        else:
            kirchhoff = shear * (squares - np.eye(3))
        return np.asarray(kirchhoff @ inverse_transposed(gradient))

    def volume_stress_at(self, volume: Array) -> Array:
        """See ``Hyperelastic``."""
        shear, bulk = self.constants_at_rest
        if self.isochoric:
            return bulk * (volume - 1)
        return np.asarray((bulk - 2 * shear / 3) * np.log(volume) / volume)

    @property
    def said(self) -> str:
        """See ``Material``."""
        return f"E = {self.young:g}, nu = {self.poisson:g}{', isochoric' * self.isochoric}, finite strains"
