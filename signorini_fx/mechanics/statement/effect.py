"""What the effects of a scene have in common, and how they are found: by their keys in ``ENTRIES``.

Other packages have more by entry points, whose names are keys of a scene as well:

    [project.entry-points."signorini_fx.effects"]
    magnet = "its.module:Magnet"

An effect is a ``Force`` (a load in the body or on a boundary), an ``InitialStrain`` (a strain without stress), a
``Resistance`` (forces that grow with the displacement), another ``Load`` (something that load steps multiply), or none
of these.  All that assembles, judges and tells of a scene asks the methods of these classes, and nowhere for a
particular effect.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import import_module
from inspect import cleandoc
from types import GenericAlias
from typing import Annotated, Any, ClassVar, Protocol, Self, TypeVar, get_origin

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, BeforeValidator, Field, TypeAdapter, ValidationInfo, create_model
from pydantic.fields import FieldInfo

from signorini_fx.extensions import EFFECTS, is_of_package, load_class, names_of, on_registered
from signorini_fx.mechanics.statement.base import Table
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.statement.values import Finite, TimedValue

Array = npt.NDArray[np.float64]
Keys = tuple[str | int, ...]
Contradictions = Iterator[tuple[Keys, str]]
Features = tuple[tuple[str, Keys], ...]


class Coefficients(Protocol):
    """Values of a scene in the body or on a boundary: as UFL, or as arrays of n points.

    As UFL vectors have the shape (d,) and values (), as arrays (d, n) and (n,): what arithmetic says is said of both.
    """

    @property
    def normal(self) -> Any:
        """Outward unit normal."""

    @property
    def position(self) -> Any:
        """X, length; a vector."""

    @property
    def density(self) -> Any:
        """Of the material, mass per volume."""

    def total(self, effect: Any) -> Any:
        """The integral of ``effect.spread`` over the boundary of the effect, a number."""

    def value(self, value: Any) -> Any:
        """A value."""

    def vector(self, values: tuple[Any, ...]) -> Any:
        """Values along x[0], x[1] and x[2], which is not used in 2D."""


class BodyCoefficients(Coefficients, Protocol):
    """Values in the body."""

    @property
    def expansion(self) -> Any:
        """Of the material, coefficient of thermal expansion, 1 / temperature."""

    def value_in(self, region: str | None, value: Any) -> Any:
        """A value in a region of the mesh, 0 elsewhere; None: everywhere.  A callable is asked at nodes of the region
        alone.
        """


@dataclass(frozen=True)
class SampledPoints:
    """Points for pictures and bounds, ``Coefficients`` as arrays.

    Attributes:
        position: length, shape (d, n).
        normal: outward unit normals, shape (d, n), or zero, which leaves pressures out.
        total: from an effect to the integral of its ``spread``.
        density: of the material, mass per volume, shape (n,), or one for all.
    """

    position: Array
    normal: Array
    total: Callable[[Any], float]
    density: Any = 0.0

    def value(self, value: Any) -> Array:
        """Shape (n,); zero of expressions of UFL, which only a compiled form could evaluate."""
        if hasattr(value, "ufl_shape"):
            return np.zeros(self.position.shape[1])
        return sample(value, in_space(self.position.T))

    def vector(self, values: tuple[Any, ...]) -> Array:
        """Shape (d, n)."""
        return np.stack([self.value(value) for value in values[: len(self.position)]])


def is_zero(*values: Any) -> bool:
    """Whether all values are the number zero."""
    return all(isinstance(value, float) and value == 0.0 for value in values)


class Effect(Table):
    """An entry of a scene.

    Attributes:
        refuses: of its features, by their names, those that do not go together with each, and why.
    """

    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {}

    # Whether it changes the strain that the stress follows from.
    strains: ClassVar[bool] = False
    # Whether it acts at single nodes, without any form, see ``loads.supports``.
    nodal: ClassVar[bool] = False
    # The keys of points and directions, which have as many numbers as the mesh has dimensions.
    vectors: ClassVar[tuple[str, ...]] = ()

    @property
    def label(self) -> str:
        """What it is, in words: its key, or the name of the class of another package."""
        kind = type(self)
        if is_of_package(kind):
            keys = (key for key, place in ENTRIES.items() if place == ("loads", kind.__name__))
            return next(keys, kind.__module__.rpartition(".")[2]).replace("_", " ")
        return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", kind.__name__).lower()

    @cached_property
    def where(self) -> str | None:
        """The boundary that it acts on; None: it acts in the body."""
        return getattr(self, "boundary", None)

    @property
    def place(self) -> str:
        """Where it acts, in words: the name of a boundary or region, or a point; "": in all of the body."""
        at, region = getattr(self, "at", None), getattr(self, "region", None)
        if at is None:
            return self.where or region or ""
        point = f"({', '.join(f'{x:g}' for x in at)})"
        return point if region is None else f"{point} of {region}"

    @property
    def name(self) -> str:
        """What it is and where."""
        return f"{self.label} {self.place}".rstrip()

    @property
    def given(self) -> dict[str, Any]:
        """Its values by their keys; those that are None or left out do not act."""
        return {}

    @property
    def acts(self) -> bool:
        """Whether it does anything; numbers that are zero do not."""
        return not is_zero(*self.given.values())

    @cached_property
    def varies(self) -> bool:
        """Whether it is more than constants."""
        return not all(isinstance(value, float) for value in self.given.values())

    @cached_property
    def timed(self) -> bool:
        """Whether one of its values depends on the time t: an expression, a shape or a friction law."""
        return any(getattr(value, "timed", False) for _, value in self)

    def at_time(self, time: float) -> Self:
        """The same with its values at a time; itself if none depends on it."""
        if not self.timed:
            return self
        moved = {key: value.at_time(time) for key, value in self if getattr(value, "timed", False)}
        return self.model_copy(update=moved)

    @property
    def features(self) -> Features:
        """The names by which other objects refuse it, see ``statement.features``, with the keys that ask for them."""
        return ((self.label, ()),)

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        """Why it does not go together with other entries: the place of the error in the scene, and the reason.

        Args:
            statement: all entries.
            number: of this one among those of its kind.
        """
        yield from ()

    def degree(self, element: int) -> int:
        """Quadrature degree of its integrals for elements of a degree; what varies on a boundary may jump within a
        facet, and is integrated with many points.
        """
        return _VARYING_DEGREE if self.varies and self.where is not None else 2 * element + 2


# Ten points on a facet: the error for a jump within it is part of the error estimate (``missed_loads``).
_VARYING_DEGREE = 20


class Load(Effect):
    """What load steps multiply by a factor."""

    # Whether its forms are assembled with those of other loads that have the same factors.
    grouped: ClassVar[bool] = True

    factors: Annotated[tuple[Finite, ...], Field(min_length=1)] | None = None


class Force(Load):
    """Force per volume or area."""

    # Whether at finite strains its density is that of the place to which a point has moved.
    carried: ClassVar[bool] = False

    def density(self, on: Coefficients) -> Any:
        """Force per volume or area, a vector; pictures ask for it at points, where functions of UFL have no value."""
        raise NotImplementedError


class VectorForce(Force):
    """Force with components along x[0], x[1] and, in 3D, x[2]."""

    x: TimedValue = 0.0
    y: TimedValue = 0.0
    z: TimedValue = 0.0

    @property
    def components(self) -> tuple[Any, Any, Any]:
        """Along x[0], x[1] and x[2], which is not used in 2D."""
        return self.x, self.y, self.z

    @property
    def given(self) -> dict[str, Any]:
        return dict(zip("xyz", self.components, strict=True))

    def density(self, on: Coefficients) -> Any:
        return on.vector(self.components)


class InitialStrain(Load):
    """A strain of the body, the same in all directions, which causes stress only where it is prevented."""

    strains: ClassVar[bool] = True

    def strain(self, on: BodyCoefficients) -> Any:
        """The strain in each direction, UFL, a number."""
        raise NotImplementedError


class Resistance(Effect):
    """Forces per area on a boundary that are linear in the displacement, and symmetric."""

    def reaction(self, y: Any, on: Coefficients) -> Any:
        """Minus the force per area on the body, stress, UFL, shape (d,)."""
        raise NotImplementedError


# --- how they are found ----------------------------------------------------------------------------------------------

PACKAGE = "signorini_fx.mechanics.effects"
# The file of each key in this package, and the type of its entries there.
ENTRIES = {
    "body_force": ("loads", "BodyForce"),
    "contact": ("contact", "Entry"),
    "displacement": ("displacement", "PrescribedDisplacement"),
    "fluid": ("loads", "Fluid"),
    "force": ("loads", "TotalForce"),
    "gravity": ("loads", "Gravity"),
    "material": ("material", "Entry"),
    "point_force": ("loads", "PointForce"),
    "preload": ("preload", "Preload"),
    "rotation": ("loads", "Rotation"),
    "springs": ("loads", "Springs"),
    "temperature": ("loads", "TemperatureChange"),
    "traction": ("loads", "SurfaceTraction"),
}
_Model = TypeVar("_Model", bound=type[BaseModel])


def keys() -> tuple[str, ...]:
    """The keys of all effects, those of other packages last; none is imported."""
    return tuple(dict.fromkeys((*ENTRIES, *names_of(EFFECTS))))


def entry_type(key: str) -> Any:
    """The type of the entries of a key, whose file is imported.

    Raises:
        InstallationError: that of another package cannot be imported, or is no ``Effect``.
    """
    if key not in ENTRIES:
        return load_class(EFFECTS, key, Effect)
    file, name = ENTRIES[key]
    return getattr(import_module(f"{PACKAGE}.{file}"), name)


def _described_type(key: str) -> Any:
    """The same, of a key whose entries are of several files from all of them."""
    return import_module(f"{PACKAGE}.material").every_entry() if key == "material" else entry_type(key)


def _type(entry: Any, *, many: bool) -> Any:
    return GenericAlias(tuple, (entry, ...)) if many else entry | None


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def _read_many(entry: Any, info: ValidationInfo) -> Any:
    several = [entry] if isinstance(entry, Mapping | BaseModel) else entry
    if several in ((), []):
        return ()
    return _adapter(_type(entry_type(str(info.field_name)), many=True)).validate_python(several)


def _read_one(entry: Any, info: ValidationInfo) -> Any:
    return (
        None if entry is None else _adapter(_type(entry_type(str(info.field_name)), many=False)).validate_python(entry)
    )


# The entries of a key that a scene has: its file is imported when there is one.
Entries = Annotated[tuple[Any, ...], BeforeValidator(_read_many)]
OneEntry = Annotated[Any, BeforeValidator(_read_one)]


def with_every_effect(model: _Model) -> _Model:
    """A model with a list of entries for each effect that it has no key for, also of those that a program registers
    later.
    """
    added: dict[str, Any] = {key: (Entries, ()) for key in keys() if key not in model.model_fields}
    made = _extended(model, added)
    key_lines = "".join(f"\n    {key}: see ``{ENTRIES[key][1]}``; default: none." for key in added if key in ENTRIES)
    made.__doc__ = cleandoc(model.__doc__ or "") + key_lines

    def add(key: str) -> None:
        if key in made.model_fields:
            return
        made.model_fields[key] = FieldInfo.from_annotated_attribute(Entries, ())
        setattr(made, key, ())  # of models that were made before
        made.model_rebuild(force=True)
        described.cache_clear()

    on_registered(EFFECTS, add)
    return made


@cache
def described(model: type[BaseModel]) -> type[BaseModel]:
    """The same model with the types of all entries, for help and messages: this imports all effects."""
    fields = ((key, model.model_fields[key]) for key in keys())
    types = {
        key: (
            _type(_described_type(key), many=get_origin(field.annotation) is tuple),
            ... if field.is_required() else field.default,
        )
        for key, field in fields
    }
    return _extended(model, types)


def _extended(model: Any, fields: dict[str, Any]) -> Any:
    return create_model(model.__name__, __base__=model, __module__=model.__module__, __doc__=model.__doc__, **fields)
