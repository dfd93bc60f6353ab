"""The base classes of the effects of a scene: loads, supports, contacts and other entries.

Other packages add effects by entry points, whose names become keys of a scene:

    [project.entry-points."signorini_fx.effects"]
    magnet = "its.module:Magnet"
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import GenericAlias
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Protocol, TypeVar

import numpy as np
from pydantic import BaseModel, BeforeValidator, Field, TypeAdapter, ValidationInfo
from pydantic.fields import FieldInfo

from signorini_fx.arrays import Array, Expr, FieldValue, Value
from signorini_fx.extensions import CONTACT_PARTS, EFFECTS, load_class, names_of, on_registered
from signorini_fx.mechanics.statement.base import Table
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.statement.values import Entries, Finite, TimedValue

if TYPE_CHECKING:
    from signorini_fx.mechanics.kinematics import Kinematics
    from signorini_fx.mechanics.statement.load_path import LoadSteps
    from signorini_fx.mechanics.statement.settings import Accuracy, Element, SolverSettings, Units

Keys = tuple[str | int, ...]
Contradictions = Iterator[tuple[Keys, str]]
Features = tuple[tuple[str, Keys], ...]
_Model = TypeVar("_Model", bound=type[BaseModel])


class Coefficients(Protocol):
    """Values of a scene in the body or on a boundary, as UFL or as arrays at n points.

    As UFL, vectors have the shape (d,) and scalars (); as arrays (d, n) and (n,).  Code that uses
    only arithmetic works for both.
    """

    @property
    def normal(self) -> FieldValue:
        """The outward unit normal."""

    @property
    def position(self) -> FieldValue:
        """The position x, length; a vector."""

    @property
    def density(self) -> FieldValue | float:
        """The density of the material, mass per volume."""

    def total(self, effect: Effect) -> FieldValue | float:
        """Return the integral of ``effect.spread`` over the boundary of the effect, a number."""

    def value(self, value: Value) -> FieldValue:
        """Return a value of the scene, a scalar."""

    def vector(self, values: Sequence[Value]) -> FieldValue:
        """Return a vector from its components along x[0], x[1] and x[2]; the last is not used in
        2D.
        """


class BodyCoefficients(Coefficients, Protocol):
    """Values in the body."""

    @property
    def expansion(self) -> FieldValue:
        """The coefficient of thermal expansion of the material, 1 / temperature."""

    def entries(self, key: str) -> tuple[Effect, ...]:
        """Return the entries of a key of the scene."""

    def of_material(self, key: str) -> FieldValue:
        """Return a parameter of the materials by its key, 0 where a material does not give it."""

    def computed(self, name: str) -> FieldValue:
        """Return the nodal field ``name`` that effects have computed for a step, see ``Place``."""

    def value_in(self, region: str | None, value: Value) -> FieldValue:
        """Return a value in a region of the mesh (None: everywhere), 0 elsewhere.  A callable is
        evaluated at nodes of the region only.
        """


@dataclass(frozen=True)
class SampledPoints:
    """Points for pictures and bounds at which ``Coefficients`` are arrays."""

    position: Array  # length, shape (d, n)
    normal: Array  # outward unit normals, shape (d, n), or zero, which leaves pressures out
    total: Callable[[Any], float]  # from an effect to the integral of its ``spread``
    density: Array | float = 0.0  # of the material, mass per volume, shape (n,), or one for all

    def value(self, value: Value) -> Array:
        """Return a value at the points, shape (n,); zero for UFL expressions, which would need a
        compiled form.
        """
        if hasattr(value, "ufl_shape"):
            return np.zeros(self.position.shape[1])
        return sample(value, in_space(self.position.T))

    def vector(self, values: Sequence[Value]) -> Array:
        """Return a vector at the points from its components, shape (d, n)."""
        return np.stack([self.value(value) for value in values[: len(self.position)]])


def is_zero(*values: Value) -> bool:
    """Return whether all values are the number zero."""
    return all(isinstance(value, float) and value == 0.0 for value in values)


# What to do where a feature does not go with something yet.
_CURES = {
    "axisymmetric, torsion": ": leave out material.torsion",
    "driven foundation": ": prescribe its motion",
    "material with a state": ": take one without memory",
    "mixed element": ": use 'reduced'",
    "nested iteration": ": leave out solver.levels",
    "nonlinear material": ": it must be linear",
    "preload": ": prescribe a displacement",
    "requested accuracy": ": its mesh is given",
}


def not_yet(
    name: str, *features: str, words: str = "", more: Mapping[str, str] | None = None
) -> dict[str, dict[str, str]]:
    """Return ``Effect.refuses`` for a feature that does not support some other features yet.

    Args:
        name: the name of the feature.
        features: the names of the features that it does not support.
        words: its name in messages; empty: ``name``.
        more: further features, with their own reasons.
    """
    reason = f"is not possible yet with {words or name}"
    refused = {feature: reason + _CURES.get(feature, "") for feature in features}
    return {name: {**refused, **(more or {})}}


@dataclass(frozen=True, kw_only=True)
class Stated:
    """The data of a problem without its mesh.

    Attributes:
        title: any text.
        incomplete: intended parts that are missing; results list them.
        effects: all entries by their keys, in the order of the keys of a scene, including keys
            without entries; forms have the key ``contact`` only.
        kinematics: the kinematics of the body if its mesh is plane.
        element: degree and volumetric integration.
        load_steps: names and times of load steps, and an automatic ramp.
        steps: number of factors of each load; equals the number of load steps, unless there is a
            ramp between them.
        solver: algorithms, their parameters and limits.
        accuracy: the accuracy to be reached by refinement; None: no refinement.
        units: names of units for labels; None: unknown.
        bodies: the names of the regions that are bodies with their own meshes.
        generated: whether all cells are made by generators.
        remade: whether all cells are made by generators or from drawings.
        arcs: whether the mesh may represent a body with arcs.
        single: the keys of effects that can have one entry only.
        origin: other input, by its keys, used for the summary only.
        found: shortenings that result from forces, length, by the identity of a preload and the
            places of load steps.
    """

    title: str
    effects: Mapping[str, tuple[Any, ...]]
    kinematics: Kinematics
    element: Element
    load_steps: LoadSteps
    steps: int
    solver: SolverSettings
    incomplete: Sequence[str] = ()
    accuracy: Accuracy | None = None
    units: Units | None = None
    bodies: tuple[str, ...] = ()
    generated: bool = False
    remade: bool = False
    arcs: bool = True
    single: frozenset[str] = frozenset()
    origin: Mapping[str, Any] = field(default_factory=dict)
    found: Mapping[int, Mapping[float, float]] = field(default_factory=dict, compare=False)

    @property
    def contact(self) -> tuple[Any, ...]:
        """The contacts, in the order of the scene."""
        return self.effects.get("contact", ())

    @property
    def material(self) -> tuple[Any, ...]:
        """The material of the body, or one for each named region; empty where only forms
        define it.
        """
        return self.effects.get("material", ())

    @property
    def nonlinear(self) -> bool:
        """Whether some material is nonlinear, so that ``scenes.nonlinear`` solves the body."""
        return not all(material.linear for material in self.material)

    @property
    def displacement(self) -> tuple[Any, ...]:
        """The prescribed displacements."""
        return self.effects.get("displacement", ())


class Effect(Table):
    """The base class of the entries of a scene."""

    # Of its features, by their names, those that do not go together with each, and why.
    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {}

    # What it does from load step to load step, by its name among the step effects; empty: nothing.
    step_effect: ClassVar[str] = ""
    # The key of its entries, where the name of the class is another one.
    key: ClassVar[str] = ""
    # Whether it changes the strain that the stress follows from.
    gives_strain: ClassVar[bool] = False
    # Whether it acts at single nodes, without any form, see ``loads.supports``.
    nodal: ClassVar[bool] = False
    # The keys of its values.
    value_keys: ClassVar[tuple[str, ...]] = ()
    # The keys of points and directions, which have as many numbers as the mesh has dimensions.
    vectors: ClassVar[tuple[str, ...]] = ()

    @property
    def label(self) -> str:
        """The kind of the effect as text: its key, else the name of its class in lower case."""
        return self.key or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", type(self).__name__).lower()

    @cached_property
    def where(self) -> str | None:
        """The boundary on which it acts; None if it acts in the body."""
        return getattr(self, "boundary", None)

    @property
    def place(self) -> str:
        """The place of the effect as text: the name of a boundary or region, or a point; empty for
        the whole body.
        """
        at = getattr(self, "at", None)
        region = getattr(self, "region", None)
        if at is None:
            return self.where or region or ""
        point = f"({', '.join(f'{x:g}' for x in at)})"
        return point if region is None else f"{point} of {region}"

    @property
    def name(self) -> str:
        """The kind of the effect and its place as text."""
        return f"{self.label} {self.place}".rstrip()

    @property
    def given(self) -> dict[str, Value]:
        """The values of the effect by their keys, without those that are None."""
        values = {key: getattr(self, key) for key in self.value_keys}
        return {key: value for key, value in values.items() if value is not None}

    @property
    def acts(self) -> bool:
        """Whether the effect does anything; it does not if all of its values are zero."""
        return not is_zero(*self.given.values())

    @cached_property
    def varies(self) -> bool:
        """Whether some value of the effect is not a constant."""
        return not all(isinstance(value, float) for value in self.given.values())

    @property
    def features(self) -> Features:
        """The names of the features that the effect uses, which others may refuse (see
        ``statement.features``), each with the keys that request it.
        """
        return ((self.label, ()),)

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        """Yield the entries of a statement that contradict the effect: the path of the error in the
        scene, and the reason.

        ``number``: the place of the effect among those of its kind.
        """
        yield from ()

    def time_steps(self, times: Sequence[float]) -> int:
        """Return the number of time steps into which the effect divides the path through the times
        of load steps; 0 if it needs none.
        """
        return 0

    def degree(self, element: int) -> int:
        """Return the quadrature degree of its integrals for elements of degree ``element``.

        Values that vary on a boundary may jump within a facet; they get many points.
        """
        return _VARYING_DEGREE if self.varies and self.where is not None else 2 * element + 2


# Ten points on a facet: the error for a jump within it is part of the error estimate
# (``missed_loads``).
_VARYING_DEGREE = 20


class Load(Effect):
    """An effect that load steps multiply by a factor."""

    # Whether its forms are assembled with those of other loads that have the same factors.
    grouped: ClassVar[bool] = True

    factors: Annotated[Entries[Finite], Field(min_length=1)] | None = None


class ForceDensity(Load):
    """Force per volume or area."""

    # Whether at finite strains its density is that of the place to which a point has moved.
    carried: ClassVar[bool] = False

    def density(self, on: Coefficients) -> FieldValue:
        """Return the force per volume or area, a vector; pictures evaluate it at points, where UFL
        has no value.
        """
        raise NotImplementedError


class VectorForce(ForceDensity):
    """Force with components along x[0], x[1] and, in 3D, x[2]."""

    value_keys: ClassVar[tuple[str, ...]] = ("x", "y", "z")

    x: TimedValue = 0.0
    y: TimedValue = 0.0
    z: TimedValue = 0.0

    @property
    def components(self) -> tuple[Value, ...]:
        """The components along x[0], x[1] and x[2]; the last is not used in 2D."""
        return self.x, self.y, self.z

    def density(self, on: Coefficients) -> FieldValue:
        return on.vector(self.components)


class InitialStrain(Load):
    """An isotropic strain of the body, which causes stress only where it is constrained."""

    gives_strain = True

    def strain(self, on: BodyCoefficients) -> FieldValue | float:
        """Return the strain in each direction, a scalar of UFL or a number."""
        raise NotImplementedError


class Resistance(Effect):
    """Forces per area on a boundary that are linear in the displacement, and symmetric."""

    def reaction(self, y: Expr, on: Coefficients) -> Expr:
        """Return minus the force per area on the body at the displacement ``y``, stress, UFL, shape
        (d,).
        """
        raise NotImplementedError


class ContactPart(Effect):
    """A table within ``[[contact]]``, such as wear.

    Its module is imported when its key is used.  In ``contradictions`` the number is that of the
    contact.
    """

    # Whether what it does in a load step adds up where this stands for several.
    adds_up: ClassVar[bool] = False


def _contact_part(entry: object, info: ValidationInfo) -> ContactPart | None:
    """Return a part of a contact from its table, or the part itself; the key determines its
    class.
    """
    if entry is None:
        return None
    kind = load_class(CONTACT_PARTS, str(info.field_name), ContactPart)
    if isinstance(entry, kind):
        return entry
    return TypeAdapter(kind).validate_python(entry)


# A key of a contact for one, whose class is an entry point of that name.
Part = Annotated[Any, BeforeValidator(_contact_part)]


# --- those of other packages ----------------------------------------------------------------------


def listed(entry: object) -> Sequence[object]:
    """Return a list of tables; a single table becomes a list of one."""
    if isinstance(entry, Mapping | BaseModel):
        return [entry]
    if not isinstance(entry, list | tuple):
        raise ValueError("must be a table or a list of tables")
    return entry


def _of_package(entry: object, info: ValidationInfo) -> tuple[Effect, ...]:
    """Return the entries of a key that another package defines; its class is imported if there are
    any.
    """
    if not (several := listed(entry)):
        return ()
    kind = load_class(EFFECTS, str(info.field_name), Effect)
    return TypeAdapter(GenericAlias(tuple, (kind, ...))).validate_python(several)


def with_every_effect(model: _Model) -> _Model:
    """Return a model with a list of entries for each registered effect of other packages or
    programs, also for those registered later.
    """

    def add(key: str) -> None:
        if key in model.model_fields:
            return
        entries = Annotated[tuple[Any, ...], BeforeValidator(_of_package)]
        model.model_fields[key] = FieldInfo.from_annotated_attribute(entries, ())
        setattr(model, key, ())  # of models that were made before
        model.model_rebuild(force=True)

    for key in names_of(EFFECTS):
        add(key)
    on_registered(EFFECTS, add)
    return model
