"""Linear elasticity with three planes of symmetry, such as that of wood: nine constants."""

from __future__ import annotations

import math
from typing import Any, Self

import numpy as np
from pydantic import model_validator

from signorini_fx.mechanics.materials.directed import Axes
from signorini_fx.mechanics.materials.protocol import PAIRS, Array, Material
from signorini_fx.mechanics.statement.base import refused
from signorini_fx.mechanics.statement.effect import Contradictions
from signorini_fx.mechanics.statement.values import Finite, Positive

# The pairs of axes that Poisson's ratios and shear moduli belong to.
_SHEARS = PAIRS[3:]


class Orthotropic(Axes):
    """The constants along the axes, and these.

    Under a stress s along axis i alone, the strain is s / E_i along i, and -nu_ij s / E_i along j; nu_ji / E_j is
    nu_ij / E_i.

    Attributes:
        young: E_1, E_2, E_3, stresses.
        poisson: nu_12, nu_13, nu_23.
        shear: shear moduli G_12, G_13, G_23, stresses.
    """

    young: tuple[Positive, Positive, Positive]
    poisson: tuple[Finite, Finite, Finite]
    shear: tuple[Positive, Positive, Positive]

    @model_validator(mode="after")
    def _positive_energy(self) -> Self:
        for (i, j), ratio in zip(_SHEARS, self.poisson, strict=True):
            largest = math.sqrt(self.young[i] / self.young[j])
            if not abs(ratio) < largest:
                why = f"nu_{i + 1}{j + 1} = {ratio:g} must be between -{largest:.6g} and {largest:.6g}, the square root"
                raise refused("Orthotropic", [(("poisson",), f"{why} of E_{i + 1} / E_{j + 1}: {_ENERGY}")])
        scale = np.sqrt(np.array(self.young))
        determinant = float(np.linalg.det(self.compliance[:3, :3] * np.outer(scale, scale)))
        if not determinant > 0:
            formula = "1 - nu_12 nu_21 - nu_13 nu_31 - nu_23 nu_32 - 2 nu_21 nu_32 nu_13"
            raise refused("Orthotropic", [(("poisson",), f"{formula} = {determinant:.6g} must be positive: {_ENERGY}")])
        return self

    @property
    def compliance(self) -> Array:
        """See ``Material``."""
        matrix = np.diag([*(1 / modulus for modulus in self.young), *(1 / modulus for modulus in self.shear)])
        for (i, j), ratio in zip(_SHEARS, self.poisson, strict=True):
            matrix[i, j] = matrix[j, i] = -ratio / self.young[i]
        return matrix


class OrthotropicElastic(Material):
    """An orthotropic material.

    Attributes:
        orthotropic: its constants and the directions of its axes.
        hypothesis, torsion, grading, density, expansion, region: see ``Material``.
    """

    orthotropic: Orthotropic

    @property
    def compliance(self) -> Array:
        return self.orthotropic.compliance

    @property
    def stiffness(self) -> Array:
        return np.asarray(np.linalg.inv(self.compliance))

    def stress(self, strain: Any) -> Any:
        import ufl

        along = [strain[i, j] * (1 if i == j else 2) for i, j in PAIRS]
        stress = [sum(float(c) * part for c, part in zip(row, along, strict=True)) for row in self.stiffness]
        at = {frozenset(pair): component for pair, component in zip(PAIRS, stress, strict=True)}
        return ufl.as_matrix([[at[frozenset((i, j))] for j in range(3)] for i in range(3)])

    def axes(self, x: Array) -> Array:
        return self.orthotropic.axes(x)

    @property
    def varies(self) -> bool:
        return self.grading is not None or self.orthotropic.turns

    @property
    def words(self) -> str:
        return "an orthotropic material"

    def dimension_problems(self, dimension: int) -> Contradictions:
        return ((("orthotropic", *path), reason) for path, reason in self.orthotropic.dimension_problems(dimension))


_ENERGY = "otherwise some strain has no positive energy"
