"""Loads with a density, changes of temperature, and springs: each class has the keys of its entries, and its form."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from signorini_fx.mechanics.statement.effect import (
    BodyCoefficients,
    Coefficients,
    Contradictions,
    Features,
    Force,
    InitialStrain,
    Resistance,
    VectorForce,
    is_zero,
)
from signorini_fx.mechanics.statement.point_values import PointValues
from signorini_fx.mechanics.statement.values import (
    Direction,
    NonNegative,
    NonNegativeValue,
    SampledValue,
    TimedSampledValue,
    TimedValue,
    Vector,
)


class SurfaceTraction(VectorForce):
    """Traction on a boundary, h of (1.1c); it adds to others on the same boundary.

    Attributes:
        boundary: its name.
        x: component along x[0], stress.
        y: component along x[1], stress.
        z: component along x[2], stress; only in 3D.
        pressure: pressure on the boundary, which acts along the inward normal, stress; at finite strains along that of
            the deformed boundary, and per deformed area.
        factors: one number per load step; None: 1 in every step.
    """

    key: ClassVar[str] = "traction"
    value_keys: ClassVar[tuple[str, ...]] = ("x", "y", "z", "pressure")

    boundary: str
    pressure: TimedValue = 0.0

    def density(self, on: Coefficients) -> Any:
        traction = super().density(on)
        return traction if is_zero(self.pressure) else traction - on.value(self.pressure) * on.normal


class TotalForce(VectorForce):
    """A force on a boundary, spread evenly over it or in proportion to a value.

    Attributes:
        boundary: its name.
        x: component along x[0], force (in 2D per thickness).
        y: component along x[1], force (in 2D per thickness).
        z: component along x[2], force; only in 3D.
        spread: to what the force per area is proportional; its integral over the boundary must not be zero.
        factors: one number per load step; None: 1 in every step.
    """

    key: ClassVar[str] = "force"
    boundary: str
    spread: SampledValue = 1.0

    @cached_property
    def varies(self) -> bool:
        """The components are those of the total, see ``Effect``."""
        return not isinstance(self.spread, float)

    def density(self, on: Coefficients) -> Any:
        """F s over the integral of s, see ``Force``."""
        return super().density(on) * on.value(self.spread) / on.total(self)


class BodyForce(VectorForce):
    """Force per volume, f of (1.1a).

    Attributes:
        x: component along x[0], stress / length.
        y: component along x[1], stress / length.
        z: component along x[2], stress / length; only in 3D.
        factors: one number per load step; None: 1 in every step.
    """


class Gravity(VectorForce):
    """Weight of the whole body, from the ``density`` of its materials.

    Attributes:
        x: component of the acceleration along x[0], length / time^2.
        y: component of the acceleration along x[1], length / time^2.
        z: component of the acceleration along x[2], length / time^2; only in 3D.
        factors: one number per load step; None: 1 in every step.
    """

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        yield from _without_density(statement, "gravity") if self.acts else ()

    def density(self, on: Coefficients) -> Any:
        return on.density * super().density(on)


class Rotation(Force):
    """Centrifugal force rho omega^2 r of a body that rotates steadily, in the frame that rotates with it; r is the
    displaced radius where materials know finite strains.

    Attributes:
        speed: angular speed omega, radians / time.
        about: a point of the axis, length; None: the origin.
        axis: its direction, any length; None: perpendicular to the plane, in 3D along x[2].
        factors: one number per load step, which multiplies the force; None: 1 in every step.
    """

    value_keys: ClassVar[tuple[str, ...]] = ("speed",)
    vectors: ClassVar[tuple[str, ...]] = ("about", "axis")
    carried: ClassVar[bool] = True

    speed: TimedValue
    about: Vector | None = None
    axis: Direction | None = None

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        yield from _without_density(statement, "rotation") if self.acts else ()
        if reason := statement.kinematics.refused_axis(self.axis, self.about):
            yield ("rotation", number, "axis"), reason

    def density(self, on: Coefficients) -> Any:
        dimension = len(on.position)  # displacements out of a section have one more than its point and axis
        about, axis = np.zeros(dimension), np.zeros(dimension)
        about[: len(self.about or ())] = self.about or ()
        given = np.array((0.0, 0.0, 1.0) if self.axis is None else self.axis)
        unit = (given / np.linalg.norm(given))[:dimension]  # in the plane it has no part along x[2]
        axis[: len(unit)] = unit
        arm = on.position - on.vector(tuple(about.tolist()))
        along = sum(component * part for component, part in zip(axis.tolist(), arm, strict=True))
        return on.density * on.value(self.speed) ** 2 * (arm - along * on.vector(tuple(axis.tolist())))


class Fluid(Force):
    """Pressure of a fluid at rest on a boundary: its weight times the depth below its level, and none above.

    Attributes:
        boundary: its name.
        level: height of the surface of the fluid along ``up``, length.
        weight: of the fluid, force per volume.
        up: the axis against gravity, ``x``, ``y`` or ``z``; None: y in 2D, z in 3D.
        factors: one number per load step; None: 1 in every step.
    """

    value_keys: ClassVar[tuple[str, ...]] = ("level", "weight")

    boundary: str
    level: TimedSampledValue
    weight: NonNegative
    up: Literal["x", "y", "z"] | None = None

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        if self.up == "x" and statement.kinematics.refused_axis((1.0, 0.0)):
            yield ("fluid", number, "up"), "must be along the axis of the body: y"
        if statement.kinematics.out_of_section and self.up is None:
            yield ("fluid", number, "up"), "say along which axis of the section it rises: up = 'y'"

    @property
    def acts(self) -> bool:
        return self.weight > 0

    @cached_property
    def varies(self) -> bool:
        return True

    def density(self, on: Coefficients) -> Any:
        depth = on.value(self.level) - on.position[self.axis_in(len(on.position))]
        return -on.value(self.weight) * (depth + abs(depth)) / 2 * on.normal

    def axis_in(self, dimension: int) -> int:
        """The number of the axis along which it rises."""
        return dimension - 1 if self.up is None else "xyz".index(self.up)


class PointForce(VectorForce):
    """A force at a node.

    Attributes:
        at: a point, which must be a node of the mesh, length.
        region: of the point: the part of the body whose node is meant; None: there is only one node.
        x: component along x[0], force (in 2D per thickness, of a body of revolution of the whole ring).
        y: component along x[1], force (likewise).
        z: component along x[2], force; only in 3D.
        factors: one number per load step; None: 1 in every step.
    """

    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "point force": {
            "accuracy of the energy": "a force at a point does infinite work: take the 'force', 'pressure' or 'zone', "
            "or spread it over a boundary, in [[force]]",
            "local refinement": "cells at a force at a point would be divided without end: use 'uniform'",
        }
    }
    nodal: ClassVar[bool] = True
    vectors: ClassVar[tuple[str, ...]] = ("at",)

    at: Vector
    region: str | None = None

    @property
    def features(self) -> Features:
        return super().features if self.acts else ()

    def density(self, on: Coefficients) -> Any:
        """Zero: it has none, see ``Force``."""
        return on.vector((0.0, 0.0, 0.0))


class TemperatureChange(InitialStrain):
    """A change of the temperature, by which the body expands in all directions where nothing prevents it.

    Attributes:
        change: since the body was without stress, temperature.
        file: instead, a .csv with the columns x, y, in 3D z, and change: values at points of the body, between
            which they are interpolated linearly.
        region: name of the part of the body that it is in; None: all of it.
        factors: one number per load step; None: 1 in every step.
    """

    key: ClassVar[str] = "temperature"
    change: TimedSampledValue | None = None
    file: Path | None = None
    region: str | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.change is None) == (self.file is None):
            raise ValueError("give either change or file")
        return self

    @property
    def _value(self) -> Any:
        return self.change if self.file is None else PointValues(self.file)

    @property
    def given(self) -> dict[str, Any]:
        return {"change": self._value}

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        for material_number, material in enumerate(statement.material):
            inside = self.region is None or material.region in (None, self.region)
            if self.acts and inside and material.expansion is None:
                yield ("material", material_number), "has no expansion, which temperature needs"

    def strain(self, on: BodyCoefficients) -> Any:
        return on.expansion * on.value_in(self.region, self._value)


class Springs(Resistance):
    """Springs on a boundary, which pull with the stiffness per area times the displacement, and push as well.

    Attributes:
        boundary: its name.
        normal: stiffness per area along the normal, stress / length.
        tangential: stiffness per area in every direction along the boundary, stress / length.
        x: stiffness per area along x[0], instead of the two, stress / length.
        y: stiffness per area along x[1], stress / length.
        z: stiffness per area along x[2], stress / length; only in 3D.
    """

    value_keys: ClassVar[tuple[str, ...]] = ("normal", "tangential", "x", "y", "z")

    boundary: str
    normal: NonNegativeValue = 0.0
    tangential: NonNegativeValue = 0.0
    x: NonNegativeValue = 0.0
    y: NonNegativeValue = 0.0
    z: NonNegativeValue = 0.0

    @model_validator(mode="after")
    def _one_frame(self) -> Self:
        named = self.model_fields_set - {"boundary"}
        if not named or (named & {"x", "y", "z"} and named & {"normal", "tangential"}):
            raise ValueError("give either normal and tangential or x and y, or one of them")
        return self

    def reaction(self, y: Any, on: Coefficients) -> Any:
        """K y with K = k_n n n^T + k_t (I - n n^T), or diagonal, see ``Resistance``."""
        import ufl

        if self.model_fields_set & {"x", "y", "z"}:
            stiffness = on.vector((self.x, self.y, self.z))
            return ufl.as_vector([stiffness[k] * y[k] for k in range(len(y))])
        across = ufl.inner(y, on.normal) * on.normal
        return on.value(self.normal) * across + on.value(self.tangential) * (y - across)


def _without_density(statement: Any, key: str) -> Contradictions:
    """The materials that have no density although an effect needs it."""
    for number, material in enumerate(statement.material):
        if material.density is None:
            yield ("material", number), f"has no density, which {key} needs"
