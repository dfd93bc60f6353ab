"""Isotropic linear elasticity in two and three dimensions."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from signorini_fx.arrays import Expr
from signorini_fx.mechanics.materials.protocol import Material
from signorini_fx.mechanics.statement.effect import Contradictions, Stated
from signorini_fx.mechanics.statement.values import Positive
from signorini_fx.tuned import LOCKING_POISSON, SAME_NUMBER


class LinearElastic(Material):
    """Isotropic linear elasticity.

    Attributes:
        young: Young's modulus E > 0, stress, which ``grading`` multiplies.
        poisson: Poisson's ratio nu in (-1, 0.5); 0.5 too in plane stress, and with a pressure as an
            unknown.
        yield_stress: by von Mises, a stress, which gives ``utilisation`` and changes nothing else;
            None: not known.

    Examples:
        >>> steel = sfx.LinearElastic(young=210e3, poisson=0.3)  # N and mm
        >>> print([round(modulus, 1) for modulus in steel.lame])
        [121153.8, 80769.2]
    """

    isotropic = True

    young: Positive
    poisson: Annotated[float, Field(gt=-1, le=0.5, allow_inf_nan=False, strict=True)]
    yield_stress: Positive | None = None

    def stress(self, strain: Expr) -> Expr:
        import ufl

        mu = self.young / (2 * (1 + self.poisson))
        lame = self.young * self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson))
        return 2 * mu * strain + lame * ufl.tr(strain) * ufl.Identity(3)

    @property
    def natural_modulus(self) -> float:
        return self.young

    @property
    def lame(self) -> tuple[float, float]:
        """The Lame parameters (lambda, mu) of section 2.1, stresses, before grading.

        Plane strain has those of 3D; for plane stress lambda is the reduced one.  Otherwise it is
        infinite for nu = 1/2.
        """
        young = self.young
        poisson = self.poisson
        mu = young / (2 * (1 + poisson))
        if self.hypothesis == "plane stress":
            return young * poisson / (1 - poisson**2), mu
        return math.inf if poisson == 0.5 else young * poisson / (
            (1 + poisson) * (1 - 2 * poisson)
        ), mu

    def stiffest(self, *, pressed: bool) -> float:
        first, second = self.lame
        return 2 * second if pressed else 2 * second + first

    @property
    def locks(self) -> bool:
        """Whether nu is so near 1/2 that fully integrated elements lock.

        A tolerance covers the round-off of ratios that are computed from moduli of nonlinear
        materials.
        """
        return (
            self.poisson >= LOCKING_POISSON * (1 - SAME_NUMBER)
            and self.hypothesis != "plane stress"
        )

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        yield from super().contradictions(statement, number)
        apart = not all(material.isotropic for material in statement.material)
        if statement.element.pressed:
            setting = repr(statement.element.volumetric)
            if not self.poisson > 0:
                yield (
                    ("material", number, "poisson"),
                    f"must be above 0 where element.volumetric = {setting}",
                )
            if number == 0 and statement.element.degree != 2:
                yield (
                    ("element", "degree"),
                    f"must be 2 for {setting}, whose pressure has one degree less",
                )
        elif self.poisson == 0.5 and (apart or self.hypothesis != "plane stress"):
            cure = (
                'element = { degree = 2, volumetric = "mixed" }, whose pressure is an unknown '
                "of its own"
            )
            yield (
                ("material", number, "poisson"),
                f"must be below 0.5: an incompressible body needs {cure}",
            )
