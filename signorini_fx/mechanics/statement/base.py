"""The base class of all tables of a scene, and the conversion of validation errors to messages of
this package: the path of the key, what is wrong, and what is allowed.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Generator, Iterable, Mapping, Sequence
from inspect import Parameter, Signature
from typing import (
    TYPE_CHECKING,
    Any,
    ClassVar,
    Self,
    cast,
    dataclass_transform,
    get_args,
    get_origin,
)

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.values import shown

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass as _ModelMetaclass

    from signorini_fx.arrays import Plain
else:
    _ModelMetaclass = type(BaseModel)


@dataclass_transform(kw_only_default=True, field_specifiers=(Field, PrivateAttr))
class _OwnErrors(_ModelMetaclass):
    """Metaclass of tables: tables built in Python, too, raise the errors of this package."""

    def __call__(cls, *positional: Any, **data: Any) -> Any:
        table = cast("type[Table]", cls)
        named = dict(zip(table.positional, positional, strict=False))
        if len(positional) > len(table.positional) or named.keys() & data:
            raise TypeError(
                f"{cls.__name__} takes keyword arguments: "
                f"{', '.join(table.__signature__.parameters)}"
            )
        try:
            return super().__call__(**named, **data)
        except ValidationError as error:
            raise table.error(problems_of(error, named | data, table), cls.__name__) from None


class Table(BaseModel, metaclass=_OwnErrors):
    """A table of a scene: unknown keys are errors, and entries are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)

    # Keys that Python may give without their names, in this order; and the error of a table that
    # Python makes.
    positional: ClassVar[tuple[str, ...]] = ()
    error: ClassVar[type[SceneError]] = SceneError

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Plain) -> None:
        """Set a signature with keys and defaults for help and notebooks, without the validation
        types.
        """
        parameters = (
            Parameter(
                name,
                Parameter.KEYWORD_ONLY,
                default=Parameter.empty if field.is_required() else field.default,
            )
            for name, field in cls.model_fields.items()
        )
        # What must be given comes first, also where a base class has the other keys.
        cls.__signature__ = Signature(
            sorted(parameters, key=lambda key: key.default is not Parameter.empty)
        )

    def __iter__(self) -> Generator[tuple[str, Any], None, None]:
        """Yield the keys with their values, without cached properties."""
        for name in type(self).model_fields:
            yield name, getattr(self, name)

    # Keys whose values are asked at a time where they are used.
    asked_later: ClassVar[tuple[str, ...]] = ()

    @property
    def timed(self) -> bool:
        """Whether some value depends on the time t: an expression, a vector, a shape or a friction
        law.
        """
        return any(_timed(value) for key, value in self if key not in self.asked_later)

    def at_time(self, time: float) -> Self:
        """Return the table with its values at a time; the same object if none depends on
        the time.
        """
        timed = [key for key, value in self if key not in self.asked_later and _timed(value)]
        return (
            self.model_copy(update={key: at_time(getattr(self, key), time) for key in timed})
            if timed
            else self
        )

    def remade(self, **changes: Any) -> Self:
        """Return the table with changed entries; all entries are validated again."""
        return type(self)(**{key: getattr(self, key) for key in self.model_fields_set} | changes)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with changed values, which are not validated; a single table becomes a list
        of one where a list is expected.

        Raises:
            SceneError: a key is unknown.
        """
        fields = type(self).model_fields
        changes = dict(update or {})
        unknown = [
            (key, f"unknown key; there are: {', '.join(fields)}")
            for key in changes
            if key not in fields
        ]
        if unknown:
            raise SceneError(unknown, type(self).__name__)
        for key, value in changes.items():
            if get_origin(fields[key].annotation) is tuple and isinstance(value, list | BaseModel):
                changes[key] = tuple(value) if isinstance(value, list) else (value,)
        copy = super().model_copy(update=changes, deep=deep)
        for name in (
            copy.__dict__.keys() - fields.keys()
        ):  # what a cached property has made of the old values
            del copy.__dict__[name]
        return copy


def _timed(value: object) -> bool:
    return any(map(_timed, value)) if isinstance(value, tuple) else getattr(value, "timed", False)


def at_time(value: Any, time: float) -> Any:
    """Return a value, or each entry of a tuple, at a time, where it depends on the time."""
    if isinstance(value, tuple):
        return tuple(at_time(entry, time) for entry in value)
    return value.at_time(time) if _timed(value) else value


def refused(table: str, problems: Iterable[tuple[tuple[str | int, ...], str]]) -> ValidationError:
    """Return a validation error with several problems, each with its location in the table."""
    details = [
        InitErrorDetails(
            type=PydanticCustomError("value_error", "{why}", {"why": why}), loc=location, input={}
        )
        for location, why in problems
    ]
    return ValidationError.from_exception_data(table, details)


# --- messages -------------------------------------------------------------------------------------

_MESSAGES = {
    "extra_forbidden": "unknown key",
    "unexpected_keyword_argument": "unknown key",
    "missing": "is missing",
    "union_tag_not_found": "is missing",
}


def plain_message(detail: ErrorDetails) -> str:
    """Return the message of a pydantic error, reworded for users of this package, with the wrong
    value.
    """
    message = _reworded(detail)
    entry = detail.get("input")
    if (
        detail["type"] not in (*_MESSAGES, "too_short", "too_long")
        and isinstance(entry, str | int | float)
        and shown(entry) not in message
    ):
        message += f", got {shown(entry)}"
    return message


def _reworded(detail: ErrorDetails) -> str:
    match detail:
        case {"type": str(kind)} if kind in _MESSAGES:
            return _MESSAGES[kind]
        case {"type": "model_type" | "model_attributes_type", "loc": place}:
            friction = "friction" in place
            return "must be a table" + friction * ', such as { law = "coulomb", coefficient = 0.3 }'
        case {"type": "string_type", "loc": (*_, "boundary"), "input": list()}:
            return "must be one name: write a table for each boundary"
        case {"type": "tuple_type"}:
            return "must be a list in brackets, such as [0.5, 1.0]"
        case {"type": "too_short", "ctx": {"min_length": least, "actual_length": count}}:
            return f"must have at least {_entries(least)}, got {count}"
        case {"type": "too_long", "ctx": {"max_length": most, **further}}:
            count = further.get("actual_length")
            return f"must have at most {_entries(most)}" + (
                f", got {count}" if count is not None else ""
            )
        case {"type": "dict_type" | "mapping_type"}:
            return "must be a table"
        case {"type": "union_tag_invalid", "ctx": {"tag": tag, "expected_tags": known}}:
            return f"must be one of {known}, got {tag!r}"
    message = str(detail["msg"]).removeprefix("Value error, ").partition(", unable to parse")[0]
    message = re.sub(
        r"^Input should be( a valid)?",
        lambda prefix: "must be a" if prefix[1] else "must be",
        message,
    )
    for of_pydantic, plain in (
        ("must be a integer", "must be an integer"),
        ("greater than or equal to", "at least"),
        ("less than or equal to", "at most"),
    ):
        message = message.replace(of_pydantic, plain)
    return message


def _entries(count: int) -> str:
    return "1 entry" if count == 1 else f"{count} entries"


def problems_of(
    error: ValidationError, data: Mapping[str, Plain], model: type[BaseModel]
) -> list[tuple[str, str]]:
    """Return the errors that pydantic found in ``data`` as pairs of path and message for
    ``SceneError``.

    Errors at the same path, one for each allowed type, are joined.
    """
    by_path: dict[str, list[str]] = {}
    for detail in error.errors():
        path, message = _problem(detail, data, model)
        by_path.setdefault(path, []).append(message)
    return [(path, "; or: ".join(dict.fromkeys(messages))) for path, messages in by_path.items()]


def _problem(
    detail: ErrorDetails, data: Mapping[str, Any], model: type[BaseModel]
) -> tuple[str, str]:
    """Return path and message for one pydantic error: list positions as [i], without pydantic's
    union labels.
    """
    path = ""
    node = data
    for part in detail["loc"]:
        if isinstance(part, int):
            path += f"[{part}]" if isinstance(node, Sequence) else ""
            node = node[part] if isinstance(node, Sequence) and part < len(node) else node
        elif (isinstance(node, Mapping) and part in node) or (
            detail["type"] == "missing" and part == detail["loc"][-1]
        ):
            name = part or '""'
            path += f".{name}" if path else name
            node = node[part] if isinstance(node, Mapping) and part in node else node
    message = plain_message(detail)
    if detail["type"].startswith("union_tag"):
        path += ".law"
    if detail["type"] == "extra_forbidden":
        message += _meant(str(detail["loc"][-1]), model)
    return path or "scene", message


_ELSEWHERE = {
    "rho": "weight is written [gravity], with the density of each [[material]]",
    "alpha": "the coefficient of thermal expansion is written expansion, and the heat "
    "[[temperature]]",
    "thickness": "a plane body has thickness 1, and forces are per thickness",
}


def _meant(key: str, model: type[BaseModel]) -> str:
    """Return advice for an unknown key: the table that it belongs to, or a key with a
    similar name.
    """
    if key in _ELSEWHERE:
        return f": {_ELSEWHERE[key]}"
    if key in model.model_fields and model.__name__ == "Scene":
        return f" here: {key!r} belongs to the top level of the scene, above the first [table]"
    homes = [
        f"[{name}]"
        for name, field in model.model_fields.items()
        if any(key in table.model_fields for table in _own_tables(field.annotation))
    ]
    if 0 < len(homes) <= 3:
        return f" here: it belongs to {' or '.join(homes)}"
    similar = difflib.get_close_matches(key, _keys(BaseModel), n=1, cutoff=0.75)
    if not similar or key in similar:
        return "; the file that signorini-fx new writes has all keys"
    return f": did you mean {similar[0]!r}?"


def _own_tables(annotation: type | None) -> set[type[BaseModel]]:
    """Return the table classes that an annotation allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return {annotation}
    return set().union(*map(_own_tables, get_args(annotation)))


def tables(annotation: type | None) -> set[type[BaseModel]]:
    """Return the table classes that an annotation allows, and those nested in them."""
    own = _own_tables(annotation)
    inner = (tables(field.annotation) for table in own for field in table.model_fields.values())
    return own.union(*inner)


def _keys(model: type[BaseModel]) -> set[str]:
    """Return all keys of a table and of its subclasses."""
    return set(model.model_fields).union(*map(_keys, model.__subclasses__()))


# Between the names of boundaries that are one together.
JOIN = " + "


class TaggedMeshBase:
    """The base class of ``mesh.TaggedMesh``, which lets a scene hold a mesh without importing
    dolfinx.
    """
