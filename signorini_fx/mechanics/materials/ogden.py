"""Ogden's material: rubber up to several times its length, by its stretches (R. W. Ogden, Proc. R. Soc. A 326 (1972)
565-584).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from signorini_fx.mechanics.materials.nonlinear import Hyperelastic
from signorini_fx.mechanics.materials.protocol import Array
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
        """See ``NonlinearMaterial``."""
        return sum(mu * alpha for mu, alpha in self._terms) / 2, self.bulk

    def dimension_problems(self, dimension: int) -> Contradictions:
        """See ``Material``."""
        if dimension == 3:
            yield ("law",), "'ogden' is not possible in space yet: take 'mooney-rivlin'"

    def shape_energy(self, gradient: Any) -> Any:
        """See ``Hyperelastic``; F has no shear across the mesh."""
        import ufl

        right, volume = gradient.T * gradient, ufl.det(gradient)
        mean = (right[0, 0] + right[1, 1]) / 2
        apart = ((right[0, 0] - right[1, 1]) / 2) ** 2 + right[0, 1] ** 2
        energy = 0
        for mu, alpha in self._terms:
            in_section = _sum_of_powers(mean, apart, alpha / 2)
            across = right[2, 2] ** (alpha / 2)
            energy += mu / alpha * ((in_section + across) * volume ** (-alpha / 3) - 3)
        return energy

    def volume_energy(self, volume: Any) -> Any:
        """See ``Hyperelastic``."""
        return self.bulk / 2 * (volume - 1) ** 2

    def shape_stress_at(self, gradient: Array) -> Array:
        """See ``Hyperelastic``: by singular values, which need no care where two are equal."""
        outward, stretches, inward = np.linalg.svd(gradient)
        changed = stretches * np.prod(stretches, axis=-1, keepdims=True) ** (-1 / 3)
        kirchhoff = np.zeros_like(stretches)
        for mu, alpha in self._terms:
            powers = changed**alpha
            kirchhoff += mu * (powers - powers.mean(axis=-1, keepdims=True))
        return np.asarray((outward * (kirchhoff / stretches)[..., None, :]) @ inward)

    def volume_stress_at(self, volume: Array) -> Array:
        """See ``Hyperelastic``."""
        return self.bulk * (volume - 1)

    @property
    def said(self) -> str:
        """See ``Material``."""
        terms = "; ".join(f"mu = {mu:g}, alpha = {alpha:g}" for mu, alpha in self._terms)
        return f"{terms}; bulk = {self.bulk:g}, finite strains"


def _sum_of_powers(mean: Any, apart: Any, power: float) -> Any:
    """(m + r)^p + (m - r)^p with r^2 = ``apart``, UFL: smooth in r^2, but r is not smooth where it vanishes.

    There its Taylor series in r^2 / m^2 takes its place, up to the fourth power, which errs by round-off.
    """
    import ufl

    ratio = apart / mean**2
    near, far = ufl.lt(ratio, EQUAL_STRETCHES**2), ufl.conditional(ufl.lt(ratio, EQUAL_STRETCHES**2), 1, ratio)
    series, factor = 1, 1.0
    for k in range(1, 5):
        factor *= (power - 2 * k + 2) * (power - 2 * k + 1) / (2 * k * (2 * k - 1))
        series = series + factor * ratio**k
    root = ufl.sqrt(far)
    half_sum = ufl.conditional(near, series, ((1 + root) ** power + (1 - root) ** power) / 2)
    return 2 * mean**power * half_sum
