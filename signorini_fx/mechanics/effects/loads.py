"""Forces with a density, point forces, temperature changes, bolt preloads and springs: the keys of
each, and its form.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, cast

import numpy as np
from pydantic import model_validator

from signorini_fx.arrays import Array, Expr, FieldValue, Value, diagonal
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.effect import (
    BodyCoefficients,
    Coefficients,
    Contradictions,
    Features,
    ForceDensity,
    InitialStrain,
    Load,
    Resistance,
    Stated,
    VectorForce,
    is_zero,
)
from signorini_fx.mechanics.statement.expressions import number as value_of
from signorini_fx.mechanics.statement.rigid_body import Timed
from signorini_fx.mechanics.statement.values import (
    Accepts,
    Count,
    Direction,
    NonNegative,
    NonNegativeValue,
    SampledValue,
    TimedSampledValue,
    TimedValue,
    Vector,
)
from signorini_fx.tuned import DIGITS_OF_FILES, OUTSIDE_HULL, ROOT_OF_EPS, SAME_LENGTH

if TYPE_CHECKING:
    from signorini_fx.mechanics.statement.statement import Statement


class Traction(VectorForce):
    """A traction on a boundary, h of (1.1c); tractions on one boundary add up.

    Attributes:
        boundary: its name.
        x: component along x[0], stress.
        y: component along x[1], stress.
        z: component along x[2], stress; only in 3D.
        pressure: pressure on the boundary, which acts along the inward normal, stress; at finite
            strains along that of the deformed boundary, and per deformed area.
        factors: one number per load step; None: 1 in every step.

    Examples:
        >>> pushed = sfx.Traction(boundary="top", x=0.1, y="-2*x[0]")
        >>> result = sfx.solve(scene.model_copy(update={"traction": pushed}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0. 4.]
    """

    key = "traction"
    value_keys = ("x", "y", "z", "pressure")

    boundary: str
    pressure: TimedValue = 0.0

    def density(self, on: Coefficients) -> FieldValue:
        traction = super().density(on)
        return (
            traction if is_zero(self.pressure) else traction - on.value(self.pressure) * on.normal
        )


class Force(VectorForce):
    """A force on a boundary, spread evenly over it or in proportion to a value.

    Attributes:
        boundary: its name.
        x: component along x[0], force (in 2D per thickness).
        y: component along x[1], force (in 2D per thickness).
        z: component along x[2], force; only in 3D.
        spread: value to which the force per area is proportional; its integral over the boundary
            must not be zero.
        factors: one number per load step; None: 1 in every step.

    Examples:
        >>> force = sfx.Force(boundary="top", y=-5.0)
        >>> result = sfx.solve(scene.model_copy(update={"traction": (), "force": force}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0. 5.]
    """

    key = "force"
    boundary: str
    spread: SampledValue = 1.0

    @cached_property
    def varies(self) -> bool:
        """Whether the density varies over the boundary; the components are those of the total
        force.
        """
        return not isinstance(self.spread, float)

    def density(self, on: Coefficients) -> FieldValue:
        """Return F s over the integral of s, see ``ForceDensity``, UFL."""
        return super().density(on) * on.value(self.spread) / on.total(self)


class BodyForce(VectorForce):
    """A force per volume, f of (1.1a).

    Attributes:
        x: component along x[0], stress / length.
        y: component along x[1], stress / length.
        z: component along x[2], stress / length; only in 3D.
        factors: one number per load step; None: 1 in every step.

    Examples:
        >>> weight = sfx.BodyForce(y=-1.0)  # per volume
        >>> result = sfx.solve(scene.model_copy(update={"body_force": weight}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0. 6.]
    """


class Gravity(VectorForce):
    """The weight of the whole body, from the ``density`` of its materials.

    Attributes:
        x: component of the acceleration along x[0], length / time^2.
        y: component of the acceleration along x[1], length / time^2.
        z: component of the acceleration along x[2], length / time^2; only in 3D.
        factors: one number per load step; None: 1 in every step.

    Examples:
        >>> heavy = sfx.LinearElastic(young=1000.0, poisson=0.3, density=0.2)
        >>> changes = {"material": heavy, "gravity": sfx.Gravity(y=-10.0)}
        >>> print(np.round(sfx.solve(scene.model_copy(update=changes)).contact.forces[0], 6))
        [0. 8.]
    """

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        yield from _without_density(statement, "gravity") if self.acts else ()

    def density(self, on: Coefficients) -> FieldValue:
        return on.density * super().density(on)


class Rotation(ForceDensity):
    """The centrifugal force rho omega^2 r of a steady rotation, in the frame that rotates with the
    body; r is the displaced radius if materials have finite strains.

    Attributes:
        speed: angular speed omega, radians / time.
        about: a point of the axis, length; None: the origin.
        axis: its direction, any length; None: that of a body of revolution, else perpendicular to
            the plane, in 3D along x[2].
        factors: one number per load step, which multiplies the force; None: 1 in every step.

    Examples:
        >>> heavy = sfx.LinearElastic(young=1000.0, poisson=0.3, density=0.2)
        >>> changes = {"material": heavy, "rotation": sfx.Rotation(speed=3.0)}
        >>> result = sfx.solve(scene.model_copy(update=changes))
        >>> print(round(result.resultants.of("left").force[0], 6))
        -3.6
    """

    value_keys = ("speed",)
    vectors = ("about", "axis")
    carried = True

    speed: TimedValue
    about: Vector | None = None
    axis: Direction | None = None

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        yield from _without_density(statement, "rotation") if self.acts else ()
        if reason := statement.kinematics.refused_axis(self.axis, self.about):
            yield ("rotation", number, "axis"), reason

    def density(self, on: Coefficients) -> FieldValue:
        dimension = len(
            on.position
        )  # displacements out of a section have one more than its point and axis
        about = np.zeros(dimension)
        axis = np.zeros(dimension)
        about[: len(self.about or ())] = self.about or ()
        given = np.array((0.0, 0.0, 1.0) if self.axis is None else self.axis)
        unit = (given / np.linalg.norm(given))[:dimension]  # in the plane it has no part along x[2]
        axis[: len(unit)] = unit
        arm = on.position - on.vector(tuple(about.tolist()))
        along = sum(component * part for component, part in zip(axis.tolist(), arm, strict=True))
        return (
            on.density * on.value(self.speed) ** 2 * (arm - along * on.vector(tuple(axis.tolist())))
        )


class Fluid(ForceDensity):
    """The pressure of a fluid at rest on a boundary: its weight times the depth below its level,
    and none above.

    Attributes:
        boundary: its name.
        level: height of the surface of the fluid along ``up``, length.
        weight: of the fluid, force per volume.
        up: the axis against gravity, ``x``, ``y`` or ``z``; None: y in 2D, z in 3D.
        factors: one number per load step; None: 1 in every step.

    Examples:
        >>> water = sfx.Fluid(boundary="top", level=3.0, weight=0.5)  # 2 above the top
        >>> result = sfx.solve(scene.model_copy(update={"traction": (), "fluid": water}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0. 2.]
    """

    value_keys = ("level", "weight")

    boundary: str
    level: TimedSampledValue
    weight: NonNegative
    up: Literal["x", "y", "z"] | None = None

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        if self.up == "x" and statement.kinematics.refused_axis((1.0, 0.0)):
            yield ("fluid", number, "up"), "must be along the axis of the body: y"
        if statement.kinematics.out_of_section and self.up is None:
            yield (
                ("fluid", number, "up"),
                "must have up = 'y' with torsion, the axis along which the level rises",
            )

    @property
    def acts(self) -> bool:
        return self.weight > 0

    @cached_property
    def varies(self) -> bool:
        return True

    def density(self, on: Coefficients) -> FieldValue:
        depth = (
            on.value(self.level)
            - on.position[len(on.position) - 1 if self.up is None else "xyz".index(self.up)]
        )
        return -on.value(self.weight) * (depth + abs(depth)) / 2 * on.normal


class PointForce(VectorForce):
    """A force at a node.

    Attributes:
        at: a point, which must be a node of the mesh, length.
        region: part of the body to which the node at the point belongs; None: there is only one
            node.
        x: component along x[0], force (in 2D per thickness, of a body of revolution of the whole
            ring).
        y: component along x[1], force (likewise).
        z: component along x[2], force; only in 3D.
        factors: one number per load step; None: 1 in every step.

    Examples:
        >>> force = sfx.PointForce(at=[1.0, 1.0], y=-3.0)
        >>> result = sfx.solve(scene.model_copy(update={"point_force": force}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0. 7.]
    """

    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "point force": {
            "accuracy of the energy": "a force at a point does infinite work: take the 'force', "
            "'pressure' or 'zone', "
            "or spread it over a boundary, in [[force]]",
            "local refinement": (
                "adaptive refinement does not end at a point force: use 'uniform'"
            ),
        }
    }
    nodal = True
    vectors = ("at",)

    at: Vector
    region: str | None = None

    @property
    def features(self) -> Features:
        return super().features if self.acts else ()


class Temperature(InitialStrain):
    """A change of the temperature, by which the body expands in all directions where nothing
    prevents it.

    Attributes:
        change: since the body was without stress, temperature.
        file: instead, a .csv with the columns x, y, in 3D z, and change: values at points of the
            body, between which they are interpolated linearly.
        region: name of the part of the body that it is in; None: all of it.
        factors: one number per load step; None: 1 in every step.

    Examples:
        >>> warm = sfx.LinearElastic(young=1000.0, poisson=0.3, expansion=1e-5)
        >>> changes = {"material": warm, "temperature": sfx.Temperature(change=100.0)}
        >>> result = sfx.solve(scene.model_copy(update=changes))
        >>> print(round(float(result.displacement.x.array[0::2].max()), 6))
        0.00416
    """

    key = "temperature"
    change: TimedSampledValue | None = None
    file: Accepts[str | Path | None, Path | None] = cast("Any", None)
    region: str | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.change is None) == (self.file is None):
            raise ValueError("give either change or file")
        return self

    @property
    def _value(self) -> Value:
        return self.change if self.file is None else PointValues(self.file)

    @property
    def given(self) -> dict[str, Value]:
        return {"change": self._value}

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        for material_number, material in enumerate(statement.material):
            inside = self.region is None or material.region in (None, self.region)
            if self.acts and inside and material.expansion is None:
                yield ("material", material_number), "has no expansion, which temperature needs"

    def strain(self, on: BodyCoefficients) -> FieldValue:
        return on.expansion * on.value_in(self.region, self._value)


class Springs(Resistance):
    """Springs between a boundary and the ground, with a stiffness per area; they pull and push.

    Attributes:
        boundary: its name.
        normal: stiffness per area along the normal, stress / length.
        tangential: stiffness per area in every direction along the boundary, stress / length.
        x: stiffness per area along x[0], instead of the two, stress / length.
        y: stiffness per area along x[1], stress / length.
        z: stiffness per area along x[2], stress / length; only in 3D.

    Examples:
        >>> springs = sfx.Springs(boundary="bottom", normal=100.0)
        >>> changes = {"contact": (), "springs": springs}
        >>> result = sfx.solve(scene.model_copy(update=changes))
        >>> print(np.round(result.resultants.of("bottom").force, 6))
        [0. 4.]
    """

    value_keys = ("normal", "tangential", "x", "y", "z")

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

    def reaction(self, y: Expr, on: Coefficients) -> Expr:
        """Return K y with K = k_n n n^T + k_t (I - n n^T), or diagonal with stiffnesses along the
        axes, see ``Resistance``.
        """
        import ufl

        if self.model_fields_set & {"x", "y", "z"}:
            stiffness = on.vector((self.x, self.y, self.z))
            return ufl.as_vector([stiffness[k] * y[k] for k in range(len(y))])
        across = ufl.inner(y, on.normal) * on.normal
        return on.value(self.normal) * across + on.value(self.tangential) * (y - across)


class Preload(Load):
    """A bolt preload: the two sides of a section across the bolt are moved towards each other
    along one direction, and are otherwise joined.

    In Abaqus and CalculiX it is a ``*PRE-TENSION SECTION``.

    Attributes:
        section: name of plane facets inside the mesh that cut through the bolt; None: ``point`` and
            ``axis`` give the plane.
        region: part of the mesh that this plane cuts; None: all of the body.
        point: a point of the plane, length.
        axis: normal of the plane, along which the sides move, any length.
        force: tension through the section, force; a number or an expression of the time t.
        shortening: in place of a force, how far the sides are moved towards each other, length; a
            number or an expression of the time t.
        locked_after: number of the factor, from 1, after which the shortening that the force has
            led to is kept.
        factors: one number per load step, by which force or shortening are multiplied; None: 1 in
            every step.

    Examples:
        >>> bar = sfx.LinearElastic(young=1000.0, poisson=0.0)
        >>> right = sfx.Displacement(boundary="right", x=0.0)
        >>> bolt = sfx.Preload(point=[1.0, 0.5], axis=[1.0, 0.0], shortening=0.001)
        >>> changes = {"material": bar, "displacement": (left, right), "preload": bolt}
        >>> result = sfx.solve(scene.model_copy(update=changes))
        >>> print(round(result.resultants.of("right").force[0], 6))
        0.5
    """

    value_keys = ("force", "shortening")
    vectors = ("point", "axis")
    gives_strain = True
    grouped = False

    section: str | None = None
    region: str | None = None
    point: Vector | None = None
    axis: Direction | None = None
    force: Timed | None = None
    shortening: Timed | None = None
    locked_after: Count = 1

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        plane = self.point is not None and self.axis is not None
        if (self.section is None) != plane or (
            self.section is not None and (self.region or self.point or self.axis)
        ):
            raise ValueError(
                "give either section, a name of facets inside the mesh, or point and axis of a "
                "plane"
            )
        if (self.force is None) == (self.shortening is None):
            raise ValueError("give either force or shortening")
        if isinstance(self.force, float) and self.force <= 0:
            raise ValueError("force must be positive: a tension; give shortening for anything else")
        if self.force is None and "locked_after" in self.model_fields_set:
            raise ValueError("locked_after needs a force")
        return self

    @property
    def place(self) -> str:
        if self.section is not None:
            return self.section
        return (
            f"at ({', '.join(f'{x:g}' for x in self.point or ())})"
            if self.region is None
            else self.region
        )

    @property
    def features(self) -> Features:
        return (
            *super().features,
            *((("shortening by force", ("force",)),) if self.force is not None else ()),
        )

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        path = ("preload", number)
        if self.axis is not None and (reason := statement.kinematics.refused_axis(self.axis)):
            yield (*path, "axis"), reason
        if self.force is None:
            return
        if self.factors is not None and min(self.factors[: self.locked_after]) <= 0:
            yield (*path, "factors"), "must be positive while the force acts"

    def tightens(self, step: float) -> bool:
        """Return whether the given force determines the shortening at a place in the lists of
        factors.
        """
        return self.force is not None and step <= self.locked_after - 1

    def shortening_at(self, statement: Statement, step: float) -> float:
        """Return the shortening at a place in the lists of factors, length.

        For a given force it is that found so far, or zero.
        """
        if self.force is not None:
            found = self.found_at(statement, step)
            return 0.0 if isnan(found) else found
        return self.value_at(statement, step)

    def found_at(self, statement: Statement, step: float) -> float:
        """Return the last shortening found for the force up to a place in the lists of factors,
        length; nan if there is none yet.
        """
        found = statement.found.get(id(self), {})
        return found[max(places)] if (places := [at for at in found if at <= step]) else nan

    def value_at(self, statement: Statement, step: float) -> float:
        """Return the given force or shortening at a place in the lists of factors."""
        factor, current = statement.now(self, step)
        (value,) = current.given.values()
        return factor * value_of(value)


def _without_density(statement: Stated, key: str) -> Contradictions:
    """Yield an error for each material without a density, if an effect needs it."""
    for number, material in enumerate(statement.material):
        if material.density is None:
            yield ("material", number), f"has no density, which {key} needs"


# --- values at points, from a table ---------------------------------------------------------------


@dataclass(frozen=True)
class PointValues:
    """A function of the position from a .csv file with the columns x, y, in 3D z, and change.

    It is linear on a Delaunay triangulation of the points.
    """

    file: Path

    def __call__(self, x: Array) -> Array:
        """Return the values at points of shape (3, n), shape (n,).

        Raises:
            SceneError: a point is outside of the convex hull of the points of the file.
        """
        changed = self.file.stat().st_mtime_ns if self.file.is_file() else 0
        middle, function = _read_table(self.file, changed)
        at = x[: middle.size].T
        values = np.asarray(function(at), dtype=np.float64)
        for share in (SAME_LENGTH, OUTSIDE_HULL):
            outside = np.isnan(values)
            values[outside] = function(middle + (1 - share) * (at[outside] - middle))
        if np.isnan(values).any():
            point = ", ".join(f"{c:g}" for c in at[np.argmax(np.isnan(values))])
            raise _wrong_file(
                self.file, f"has no points around ({point}) of the body; check its unit of lengths"
            )
        return values


@lru_cache(maxsize=8)
def _read_table(file: Path, _changed: int) -> tuple[Array, Callable[[Array], Array]]:
    """Return the mean of the points of a file, shape (d,), and the interpolating function."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    points, values = _distinct(file, *_rows(file))
    try:
        function = LinearNDInterpolator(points, values)
    except (QhullError, ValueError):
        raise _wrong_file(file, "has points that span no area, in 3D no volume") from None
    return points.mean(axis=0), function


def _rows(file: Path) -> tuple[Array, Array]:
    """Return the points of a table, shape (n, d), and the values at them, shape (n,).

    Raises:
        SceneError: the file cannot be read as such a table.
    """
    if file.suffix.lower() != ".csv":
        raise _wrong_file(file, "is no .csv: write the nodes and their values to one")
    try:
        table = np.atleast_1d(np.genfromtxt(file, delimiter=",", names=True, encoding="utf-8-sig"))
    except (OSError, ValueError, IndexError, StopIteration) as error:
        raise _wrong_file(file, f"cannot be read: {error}") from None
    names = table.dtype.names or ()
    axes = [name for name in "xyz" if name in names]
    if axes not in (["x", "y"], ["x", "y", "z"]) or "change" not in names:
        raise _wrong_file(
            file, f"has the columns {', '.join(names)}; it needs x, y, in 3D z, and change"
        )
    points = np.column_stack([table[name] for name in axes])
    values = np.asarray(table["change"], dtype=np.float64)
    if not (np.isfinite(points).all() and np.isfinite(values).all()):
        raise _wrong_file(file, "has an entry that is not one number, or not a finite one")
    return points, values


def _distinct(file: Path, points: Array, values: Array) -> tuple[Array, Array]:
    """Return the points without repeated ones, and their values.

    Raises:
        SceneError: one point has several values.
    """
    from scipy.spatial import cKDTree

    near = ROOT_OF_EPS * diagonal(points) if len(points) else 0.0
    earlier, later = cKDTree(points).query_pairs(near, output_type="ndarray").reshape(-1, 2).T
    unequal = np.abs(values[earlier] - values[later]) > DIGITS_OF_FILES * np.abs(values).max(
        initial=0.0
    )
    if unequal.any():
        one = earlier[unequal][0]
        other = later[unequal][0]
        place = ", ".join(f"{c:g}" for c in points[other])
        both = f"{values[one]:g} and {values[other]:g}"
        message = (
            f"has several values at one place, {both} at ({place}): give each body a file "
            "of its own, with region"
        )
        raise _wrong_file(file, message)
    first = np.setdiff1d(np.arange(len(points)), later)
    return points[first], values[first]


def _wrong_file(file: Path, message: str) -> SceneError:
    return SceneError.at("temperature.file", f"{file}: it {message}")
