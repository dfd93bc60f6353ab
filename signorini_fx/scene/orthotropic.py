"""The nine constants of an orthotropic material, and the directions of its axes.  No dolfinx here."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from signorini_fx.scene.base import Table, refused
from signorini_fx.scene.expressions import Expression, sample
from signorini_fx.scene.values import Finite, Positive, SampledValue

Array = npt.NDArray[np.float64]
VectorField = Annotated[tuple[SampledValue, ...], Field(min_length=2, max_length=3)]

# The pairs of axes that Poisson's ratios and shear moduli belong to.
_PAIRS = ((0, 1), (0, 2), (1, 2))
# A vector below this share of the longest one is zero, or parallel to the other one.
_NO_DIRECTION = 1e-6


class Orthotropic(Table):
    """Linear elasticity with three planes of symmetry, whose axes 1, 2 and 3 may turn from place to place.

    Under a stress s along axis i alone, the strain is s / E_i along i, and -nu_ij s / E_i along j; nu_ji / E_j is
    nu_ij / E_i.  In the plane axis 3 is across it, of bodies of revolution along the circumference.

    Attributes:
        young: E_1, E_2, E_3, stresses.
        poisson: nu_12, nu_13, nu_23.
        shear: shear moduli G_12, G_13, G_23, stresses.
        direction: axis 1, a vector of any length, whose components are values; None: along x[0].
        second: in space, a vector that with ``direction`` spans the plane of the axes 1 and 2; None: along x[1].
    """

    young: tuple[Positive, Positive, Positive]
    poisson: tuple[Finite, Finite, Finite]
    shear: tuple[Positive, Positive, Positive]
    direction: VectorField | None = None
    second: VectorField | None = None

    @model_validator(mode="after")
    def _positive_energy(self) -> Self:
        for (i, j), ratio in zip(_PAIRS, self.poisson, strict=True):
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
        """Strains, of shear twice epsilon_ij, from the stresses 11, 22, 33, 12, 13, 23 along the axes, shape (6, 6)."""
        matrix = np.diag([*(1 / modulus for modulus in self.young), *(1 / modulus for modulus in self.shear)])
        for (i, j), ratio in zip(_PAIRS, self.poisson, strict=True):
            matrix[i, j] = matrix[j, i] = -ratio / self.young[i]
        return matrix

    @property
    def mean_lame(self) -> tuple[float, float]:
        """Lame parameters of the isotropic material whose stiffness is the mean over all directions (W. Voigt,
        Lehrbuch der Kristallphysik, Teubner, 1910): what the scales and settings of a scene follow.
        """
        c = np.linalg.inv(self.compliance)
        normal, mixed, shear = np.trace(c[:3, :3]), c[0, 1] + c[0, 2] + c[1, 2], np.trace(c[3:, 3:])
        mu = float((normal - mixed + 3 * shear) / 15)
        return float((normal + 2 * mixed) / 9) - 2 * mu / 3, mu

    @property
    def said(self) -> str:
        """Its constants in words."""
        constants = (("E", self.young), ("nu", self.poisson), ("G", self.shear))
        return "; ".join(f"{name} = {', '.join(f'{number:g}' for number in values)}" for name, values in constants)

    def problems(self, dimension: int) -> Iterator[tuple[str, str]]:
        """What does not fit to a mesh of a dimension: the key, and why."""
        for key, axis in (("direction", self.direction), ("second", self.second)):
            if axis is not None and len(axis) != dimension:
                yield key, f"give {dimension} values, not {len(axis)}: the mesh has {dimension} dimensions"
            if any(isinstance(component, Expression) and component.coordinates > dimension for component in axis or ()):
                yield key, "the mesh is plane: there is no x[2]"
        if dimension == 2 and self.second is not None:
            yield "second", "the mesh is plane: direction determines the axes, leave it out"

    def axes(self, x: Array) -> Array:
        """The unit vectors along the axes at points ``x``, shape (3, n), as the columns of (n, 3, 3).

        They are not finite where the vectors of the scene are not, are zero, or are parallel.
        """
        first, second = _vectors(self.direction, 0, x), _vectors(self.second, 1, x)
        if self.direction is not None and len(self.direction) == 2:
            second = np.column_stack((-first[:, 1], first[:, 0], first[:, 2]))
        first = _unit(first)
        second = _unit(second)
        second = _unit(second - first * np.einsum("ij,ij->i", first, second)[:, None], longest=1.0)
        return np.stack((first, second, np.cross(first, second)), axis=2)


def _vectors(components: tuple[object, ...] | None, axis: int, x: Array) -> Array:
    vectors = np.zeros((x.shape[1], 3))
    if components is None:
        vectors[:, axis] = 1.0
        return vectors
    for k, value in enumerate(components):
        vectors[:, k] = sample(value, x)
    return vectors


def _unit(vectors: Array, longest: float | None = None) -> Array:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    longest = float(np.max(length, initial=0.0, where=np.isfinite(length))) if longest is None else longest
    nothing = ~(length > _NO_DIRECTION * longest)
    return np.where(nothing, np.nan, vectors / np.where(nothing, 1.0, length))


_ENERGY = "otherwise some strain has no positive energy"
