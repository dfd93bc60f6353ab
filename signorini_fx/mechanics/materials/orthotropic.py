"""Materials whose stress depends on the direction: axes 1, 2 and 3, which may vary from place to
place.

In 2D axis 3 is across the mesh, in bodies of revolution along the circumference.  An orthotropic
material, such as wood, has three planes of symmetry and nine constants.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from signorini_fx.arrays import Array, Value, inner
from signorini_fx.mechanics.materials.protocol import PAIRS, Material
from signorini_fx.mechanics.statement.base import Table, refused
from signorini_fx.mechanics.statement.effect import Contradictions
from signorini_fx.mechanics.statement.expressions import Expression, sample
from signorini_fx.mechanics.statement.values import Accepts, Entries, Finite, Positive, SampledValue
from signorini_fx.tuned import CERTIFICATE_TOLERANCE

# The pairs of axes that Poisson's ratios and shear moduli belong to.
_SHEARS = PAIRS[3:]
_ENERGY = "otherwise some strain has no positive energy"
VectorField = Annotated[Entries[SampledValue], Field(min_length=2, max_length=3)]


class Axes(Table):
    """The axes of a material.

    Attributes:
        direction: axis 1, a vector of any length, whose components are values; None: along x[0].
        second: in 3D, a vector that with ``direction`` spans the plane of the axes 1 and 2; None:
            along x[1].
    """

    direction: VectorField | None = None
    second: VectorField | None = None

    @property
    def turns(self) -> bool:
        """Whether the axes may vary from place to place."""
        return not all(
            isinstance(value, float) for value in (*(self.direction or ()), *(self.second or ()))
        )

    def dimension_problems(self, dimension: int) -> Contradictions:
        """Yield a key and a message for each value that does not fit meshes of this dimension."""
        for key, axis in (("direction", self.direction), ("second", self.second)):
            if axis is not None and len(axis) != dimension:
                yield (
                    (key,),
                    f"give {dimension} values, not {len(axis)}: the mesh has {dimension} "
                    "dimensions",
                )
            if any(
                isinstance(component, Expression) and component.coordinates > dimension
                for component in axis or ()
            ):
                yield (key,), "the mesh is plane: there is no x[2]"
        if dimension == 2 and self.second is not None:
            yield ("second",), "the mesh is plane: direction determines the axes, leave it out"

    def axes(self, x: Array) -> Array:
        """Return the axes as ``Material.axes`` does; not finite where the given vectors are not
        finite, zero or parallel.
        """
        first = _vectors(self.direction or (1.0,), x)
        second = _vectors(self.second or (0.0, 1.0), x)
        if self.direction is not None and len(self.direction) == 2:
            second = np.column_stack((-first[:, 1], first[:, 0], first[:, 2]))
        first = _unit(first)
        second = _unit(second)
        second = _unit(second - first * inner(first, second)[:, None], longest=1.0)
        return np.stack((first, second, np.cross(first, second)), axis=2)


class OrientedMaterial(Axes, Material):
    """A material with axes; a material of your own with axes derives from it.

    Attributes:
        direction, second: see ``Axes``.
        hypothesis, torsion, grading, density, region: see ``Material``.
        expansion, conductivity, specific_heat, reference_temperature: see ``Material``.

    Examples:
        >>> class Fibres(sfx.OrientedMaterial):
        ...     stiff: float  # additional modulus along axis 1
        ...
        ...     def stress(self, strain):
        ...         axis = ufl.as_matrix(np.diag([1.0, 0.0, 0.0]).tolist())
        ...         return 500.0 * strain + self.stiff * strain[0, 0] * axis
        >>> fibres = Fibres(stiff=2000.0, direction=[0.0, 1.0])
        >>> result = sfx.solve(scene.model_copy(update={"material": fibres}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0. 4.]
    """

    @property
    def varies(self) -> bool:
        return self.grading is not None or self.turns


def _vectors(components: Sequence[Value], x: Array) -> Array:
    vectors = np.zeros((x.shape[1], 3))
    for k, value in enumerate(components):
        vectors[:, k] = sample(value, x)
    return vectors


def _unit(vectors: Array, longest: float | None = None) -> Array:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    longest = (
        float(np.max(length, initial=0.0, where=np.isfinite(length)))
        if longest is None
        else longest
    )
    nothing = ~(length > CERTIFICATE_TOLERANCE * longest)
    return np.where(nothing, np.nan, vectors / np.where(nothing, 1.0, length))


class Orthotropic(Axes):
    """The constants of an orthotropic material, and its axes.

    Under a stress s along axis i alone, the strain is s / E_i along i, and -nu_ij s / E_i along j;
    nu_ji / E_j is nu_ij / E_i.

    Attributes:
        young: E_1, E_2, E_3, stresses.
        poisson: nu_12, nu_13, nu_23.
        shear: shear moduli G_12, G_13, G_23, stresses.
    """

    young: Accepts[Sequence[float], tuple[Positive, Positive, Positive]]
    poisson: Accepts[Sequence[float], tuple[Finite, Finite, Finite]]
    shear: Accepts[Sequence[float], tuple[Positive, Positive, Positive]]

    @model_validator(mode="after")
    def _positive_energy(self) -> Self:
        for (i, j), ratio in zip(_SHEARS, self.poisson, strict=True):
            largest = math.sqrt(self.young[i] / self.young[j])
            if not abs(ratio) < largest:
                why = (
                    f"nu_{i + 1}{j + 1} = {ratio:g} must be between -{largest:.6g} and "
                    f"{largest:.6g}, the square root"
                )
                raise refused(
                    "Orthotropic", [(("poisson",), f"{why} of E_{i + 1} / E_{j + 1}: {_ENERGY}")]
                )
        scale = np.sqrt(np.array(self.young))
        determinant = float(np.linalg.det(self.compliance[:3, :3] * np.outer(scale, scale)))
        if not determinant > 0:
            formula = "1 - nu_12 nu_21 - nu_13 nu_31 - nu_23 nu_32 - 2 nu_21 nu_32 nu_13"
            raise refused(
                "Orthotropic",
                [(("poisson",), f"{formula} = {determinant:.6g} must be positive: {_ENERGY}")],
            )
        return self

    @property
    def compliance(self) -> Array:
        """The compliance in the order 11, 22, 33 and the shears, 1 / stress, shape (6, 6)."""
        matrix = np.diag(
            [*(1 / modulus for modulus in self.young), *(1 / modulus for modulus in self.shear)]
        )
        for (i, j), ratio in zip(_SHEARS, self.poisson, strict=True):
            matrix[i, j] = matrix[j, i] = -ratio / self.young[i]
        return matrix


class OrthotropicElastic(Material):
    """An orthotropic linear elastic material, such as wood.

    Attributes:
        orthotropic: its constants and the directions of its axes.

    Examples:
        >>> moduli = {"young": [9e3, 6e2, 6e2], "poisson": [0.3, 0.3, 0.4], "shear": [7e2] * 3}
        >>> wood = sfx.OrthotropicElastic(orthotropic=moduli | {"direction": [0.0, 1.0]})
        >>> result = sfx.solve(scene.model_copy(update={"material": wood}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0. 4.]
    """

    orthotropic: Orthotropic

    @property
    def compliance(self) -> Array:
        return self.orthotropic.compliance

    @property
    def stiffness(self) -> Array:
        return np.asarray(np.linalg.inv(self.compliance))

    def axes(self, x: Array) -> Array:
        return self.orthotropic.axes(x)

    @property
    def varies(self) -> bool:
        return self.grading is not None or self.orthotropic.turns

    @property
    def words(self) -> str:
        return "an orthotropic material"

    def dimension_problems(self, dimension: int) -> Contradictions:
        return (
            (("orthotropic", *path), reason)
            for path, reason in self.orthotropic.dimension_problems(dimension)
        )
