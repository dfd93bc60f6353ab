"""Hyperelastic materials: rubber at strains of all sizes, and Hooke's law at large rotations."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from signorini_fx.arrays import Expr
from signorini_fx.mechanics.materials.nonlinear import (
    Hyperelastic,
    PoissonBelowHalf,
    green_strain,
    growth,
    logarithm_beyond_line,
    power_beyond_line,
    strain_beyond_growth,
)
from signorini_fx.mechanics.statement.base import refused
from signorini_fx.mechanics.statement.effect import Contradictions
from signorini_fx.mechanics.statement.values import Entries, Finite, NonNegative, Positive
from signorini_fx.tuned import EQUAL_STRETCHES


class NeoHooke(Hyperelastic):
    """Rubber at moderate strains (R. S. Rivlin, Phil. Trans. R. Soc. A 240 (1948) 459-490): the
    energy mu/2 (tr C - 3) - mu ln J + lambda/2 ln^2 J, or, ``isochoric``, mu/2 (J^(-2/3) tr C - 3)
    + kappa/2 (J - 1)^2, per undeformed volume.

    Attributes:
        law: its name.
        young: Young's modulus at small strains, stress.
        poisson: Poisson's ratio at small strains, in (-1, 0.5).
        isochoric: which energy: the second one is that of Abaqus, Ansys and CalculiX, with C10 =
            mu/2, D1 = 2/kappa.

    Examples:
        >>> soft = sfx.NeoHooke(law="neo-hooke", young=50.0, poisson=0.3)
        >>> result = sfx.solve(scene.model_copy(update={"material": soft}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0.       4.062466]
    """

    law: Literal["neo-hooke"]
    young: Positive
    poisson: PoissonBelowHalf
    isochoric: bool = False

    def shape_energy_by_change(self, change: Expr) -> Expr:
        import ufl

        shear, _ = self.constants_at_rest
        grown = growth(change)
        beyond = strain_beyond_growth(change)
        if self.isochoric:
            curved = power_beyond_line(grown, -2 / 3)
            further = ufl.tr(green_strain(change)) * (curved - 2 / 3 * grown)
            return shear * (beyond + 3 / 2 * curved + further)
        return shear * (beyond - logarithm_beyond_line(grown))

    def volume_energy_by_change(self, growth: Expr) -> Expr:
        shear, bulk = self.constants_at_rest
        if self.isochoric:
            return bulk / 2 * growth**2
        return (bulk - 2 * shear / 3) / 2 * (growth + logarithm_beyond_line(growth)) ** 2


class MooneyRivlin(Hyperelastic):
    """Rubber up to about twice its length (M. Mooney, J. Appl. Phys. 11 (1940) 582-592): the energy
    C10 (I1 - 3) + C01 (I2 - 3) + kappa/2 (J - 1)^2, with the invariants I1 and I2 of J^(-2/3) C,
    per undeformed volume.

    Attributes:
        law: its name.
        c10: C10, stress.
        c01: C01, stress; both are not negative, and the shear modulus at small strains is twice
            their sum.
        bulk: bulk modulus kappa, stress; 2 / D1 of Abaqus and CalculiX.

    Examples:
        >>> soft = sfx.MooneyRivlin(law="mooney-rivlin", c10=8.0, c01=2.0, bulk=40.0)
        >>> result = sfx.solve(scene.model_copy(update={"material": soft}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0.       4.055304]
    """

    law: Literal["mooney-rivlin"]
    c10: NonNegative
    c01: NonNegative = 0.0
    bulk: Positive

    @model_validator(mode="after")
    def _stiff(self) -> Self:
        if not self.c10 + self.c01 > 0:
            raise refused(
                "MooneyRivlin",
                [(("c10",), "must be above 0, or c01: the shear modulus is 2 (c10 + c01)")],
            )
        return self

    @property
    def constants_at_rest(self) -> tuple[float, float]:
        return 2 * (self.c10 + self.c01), self.bulk

    def shape_energy_by_change(self, change: Expr) -> Expr:
        """Return the isochoric energy; C has the invariants 3 + 2 tr E and 3 + 4 tr E + 4 II(E)."""
        import ufl

        strain = green_strain(change)
        grown = growth(change)
        beyond = strain_beyond_growth(change)
        first = ufl.tr(strain)
        second = (ufl.tr(strain) ** 2 - ufl.inner(strain, strain)) / 2
        curved = power_beyond_line(grown, -2 / 3)
        steeper = power_beyond_line(grown, -4 / 3)
        energy = self.c10 * (2 * beyond + 3 * curved + 2 * first * (curved - 2 / 3 * grown))
        further = second + (first + second) * (steeper - 4 / 3 * grown)
        return energy + self.c01 * (4 * beyond + 3 * steeper + 4 * further)

    def volume_energy_by_change(self, growth: Expr) -> Expr:
        return self.bulk / 2 * growth**2


class Ogden(Hyperelastic):
    """Rubber up to several times its length (R. W. Ogden, Proc. R. Soc. A 326 (1972) 565-584): the
    energy sum_p mu_p / alpha_p (l_1^alpha_p + l_2^alpha_p + l_3^alpha_p - 3) + kappa/2 (J - 1)^2 of
    the stretches l_i J^(-1/3), per undeformed volume.

    Abaqus and CalculiX have 2 mu_p / alpha_p^2 in place of mu_p / alpha_p: their mu_p is mu_p
    alpha_p / 2 of these.

    Attributes:
        law: its name.
        mu: mu_p, stresses; each has the sign of its exponent, and the shear modulus at small
            strains is half the sum of mu_p alpha_p.
        alpha: the exponents alpha_p, as many.
        bulk: bulk modulus kappa, stress; 2 / D1 of Abaqus and CalculiX.

    Examples:
        >>> soft = sfx.Ogden(law="ogden", mu=[10.0], alpha=[2.0], bulk=40.0)
        >>> result = sfx.solve(scene.model_copy(update={"material": soft}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0.       4.152052]
    """

    law: Literal["ogden"]
    mu: Annotated[Entries[Finite], Field(min_length=1)]
    alpha: Annotated[Entries[Finite], Field(min_length=1)]
    bulk: Positive

    @model_validator(mode="after")
    def _stiff(self) -> Self:
        if len(self.mu) != len(self.alpha):
            reason = (
                f"has {len(self.alpha)} exponents, one for each of {len(self.mu)} mu is expected"
            )
            raise refused("Ogden", [(("alpha",), reason)])
        wrong = [
            number
            for number, pair in enumerate(zip(self.mu, self.alpha, strict=True))
            if not np.prod(pair) > 0
        ]
        if wrong:
            reason = (
                "must have the sign of its exponent alpha: otherwise some shear has no "
                "positive energy"
            )
            raise refused("Ogden", [(("mu", number), reason) for number in wrong])
        return self

    @property
    def constants_at_rest(self) -> tuple[float, float]:
        return float(np.dot(self.mu, self.alpha)) / 2, self.bulk

    def dimension_problems(self, dimension: int) -> Contradictions:
        if dimension == 3:
            yield ("law",), "'ogden' is not possible in 3D yet: take 'mooney-rivlin'"

    def shape_energy_by_change(self, change: Expr) -> Expr:
        """Return the isochoric energy; F has no shear across the mesh, and the principal values of
        C in the section have the mean 1 + m.
        """
        strain = green_strain(change)
        grown = growth(change)
        beyond = strain_beyond_growth(change)
        mean = strain[0, 0] + strain[1, 1]
        across = 2 * strain[2, 2]
        apart = (strain[0, 0] - strain[1, 1]) ** 2 + 4 * strain[0, 1] ** 2
        energy = 0
        for mu, alpha in zip(self.mu, self.alpha, strict=True):
            power = alpha / 2
            curved = power_beyond_line(grown, -alpha / 3)
            of_mean, of_across = (power_beyond_line(part, power) for part in (mean, across))
            pair = 2 * (1 + power * mean + of_mean) * _beyond_mean(apart / (1 + mean) ** 2, power)
            quadratic = 2 * of_mean + of_across + pair
            share = power * (2 * mean + across) + quadratic
            energy += (
                mu
                / alpha
                * (alpha * beyond + 3 * curved + quadratic + share * (curved - alpha / 3 * grown))
            )
        return energy

    def volume_energy_by_change(self, growth: Expr) -> Expr:
        return self.bulk / 2 * growth**2


def _beyond_mean(ratio: Expr, power: float) -> Expr:
    """Return ((1 + r)^p + (1 - r)^p)/2 - 1 with r^2 = ``ratio``, UFL.

    Near 0, where r is not a smooth function of r^2, it is the series in r^2.
    """
    import ufl

    near = ufl.lt(ratio, EQUAL_STRETCHES**2)
    far = ufl.conditional(ufl.lt(ratio, EQUAL_STRETCHES**2), 1, ratio)
    series, factor = 0, 1.0
    for k in range(1, 5):
        factor *= (power - 2 * k + 2) * (power - 2 * k + 1) / (2 * k * (2 * k - 1))
        series = series + factor * ratio**k
    root = ufl.sqrt(far)
    return ufl.conditional(near, series, ((1 + root) ** power + (1 - root) ** power) / 2 - 1)


class SaintVenantKirchhoff(Hyperelastic):
    """Large rotations at small strains: the energy mu E : E + lambda/2 tr^2 E, with E = (F^T F -
    I)/2, per undeformed volume.

    Under strong compression it softens, and it has no resistance to vanishing volume (A. Raoult,
    Aplikace matematiky 31 (1986) 417-419): then take ``neo-hooke``.

    Attributes:
        law: its name.
        young: Young's modulus, stress.
        poisson: Poisson's ratio, in (-1, 0.5).

    Examples:
        >>> soft = sfx.SaintVenantKirchhoff(law="saint-venant-kirchhoff", young=50.0, poisson=0.3)
        >>> result = sfx.solve(scene.model_copy(update={"material": soft}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0.       4.065479]
    """

    splits = False

    law: Literal["saint-venant-kirchhoff"]
    young: Positive
    poisson: PoissonBelowHalf

    def shape_energy_by_change(self, change: Expr) -> Expr:
        import ufl

        shear, bulk = self.constants_at_rest
        strain = green_strain(change)
        return shear * ufl.inner(strain, strain) + (bulk - 2 * shear / 3) / 2 * ufl.tr(strain) ** 2
