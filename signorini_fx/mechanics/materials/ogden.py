"""Ogden's material: rubber up to several times its length, by its stretches (R. W. Ogden, Proc. R. Soc. A 326 (1972)
565-584).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from signorini_fx.mechanics.materials.nonlinear import (
    Hyperelastic,
    green_strain,
    growth,
    power_beyond_line,
    strain_beyond_growth,
)
from signorini_fx.mechanics.statement.base import refused
from signorini_fx.mechanics.statement.effect import Contradictions
from signorini_fx.mechanics.statement.values import Finite, Positive
from signorini_fx.tuned import EQUAL_STRETCHES


class Ogden(Hyperelastic):
    """The energy sum_p mu_p / alpha_p (l_1^alpha_p + l_2^alpha_p + l_3^alpha_p - 3) + kappa/2 (J - 1)^2 of the
    stretches l_i J^(-1/3), per undeformed volume.

    Abaqus and CalculiX have 2 mu_p / alpha_p^2 in place of mu_p / alpha_p: their mu_p is mu_p alpha_p / 2 of these.

    Attributes:
        law: its name.
        mu: mu_p, stresses; each has the sign of its exponent, and the shear modulus at small strains is half the sum of
            mu_p alpha_p.
        alpha: the exponents alpha_p, as many.
        bulk: bulk modulus kappa, stress; 2 / D1 of Abaqus and CalculiX.
        hypothesis, torsion, grading, density, expansion, region: see ``Material``.
    """

    law: Literal["ogden"]
    mu: Annotated[tuple[Finite, ...], Field(min_length=1)]
    alpha: Annotated[tuple[Finite, ...], Field(min_length=1)]
    bulk: Positive

    @model_validator(mode="after")
    def _stiff(self) -> Self:
        if len(self.mu) != len(self.alpha):
            reason = f"has {len(self.alpha)} exponents, one for each of {len(self.mu)} mu is expected"
            raise refused("Ogden", [(("alpha",), reason)])
        wrong = [number for number, pair in enumerate(zip(self.mu, self.alpha, strict=True)) if not np.prod(pair) > 0]
        if wrong:
            reason = "must have the sign of its exponent alpha: otherwise some shear has no positive energy"
            raise refused("Ogden", [(("mu", number), reason) for number in wrong])
        return self

    @property
    def _terms(self) -> list[tuple[float, float]]:
        return [*zip(self.mu, self.alpha, strict=True)]

    @property
    def constants_at_rest(self) -> tuple[float, float]:
        return sum(mu * alpha for mu, alpha in self._terms) / 2, self.bulk

    def dimension_problems(self, dimension: int) -> Contradictions:
        if dimension == 3:
            yield ("law",), "'ogden' is not possible in 3D yet: take 'mooney-rivlin'"

    def shape_energy_by_change(self, change: Any) -> Any:
        """See ``Hyperelastic``; F has no shear across the mesh.  C has the mean 1 + m in the section."""
        strain, grown, beyond = green_strain(change), growth(change), strain_beyond_growth(change)
        mean, across = strain[0, 0] + strain[1, 1], 2 * strain[2, 2]
        apart = (strain[0, 0] - strain[1, 1]) ** 2 + 4 * strain[0, 1] ** 2
        energy = 0
        for mu, alpha in self._terms:
            power, curved = alpha / 2, power_beyond_line(grown, -alpha / 3)
            of_mean, of_across = (power_beyond_line(part, power) for part in (mean, across))
            pair = 2 * (1 + power * mean + of_mean) * _beyond_mean(apart / (1 + mean) ** 2, power)
            quadratic = 2 * of_mean + of_across + pair
            share = power * (2 * mean + across) + quadratic
            energy += mu / alpha * (alpha * beyond + 3 * curved + quadratic + share * (curved - alpha / 3 * grown))
        return energy

    def volume_energy_by_change(self, growth: Any) -> Any:
        return self.bulk / 2 * growth**2


def _beyond_mean(ratio: Any, power: float) -> Any:
    """((1 + r)^p + (1 - r)^p)/2 - 1 with r^2 = ``ratio``, UFL: smooth in r^2, but r is not smooth where it vanishes.

    There its Taylor series in r^2 takes its place, up to the fourth power, which errs by round-off.
    """
    import ufl

    near, far = ufl.lt(ratio, EQUAL_STRETCHES**2), ufl.conditional(ufl.lt(ratio, EQUAL_STRETCHES**2), 1, ratio)
    series, factor = 0, 1.0
    for k in range(1, 5):
        factor *= (power - 2 * k + 2) * (power - 2 * k + 1) / (2 * k * (2 * k - 1))
        series = series + factor * ratio**k
    root = ufl.sqrt(far)
    return ufl.conditional(near, series, ((1 + root) ** power + (1 - root) ** power) / 2 - 1)


Entry = Ogden
