"""The base class of all tables of a scene: their keys, and the errors of models that are built in Python."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping
from inspect import Parameter, Signature
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.validation import problems_of

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass as _ModelMetaclass
else:
    _ModelMetaclass = type(BaseModel)


class _OwnErrors(_ModelMetaclass):
    """Models that are built in Python raise the errors of this package as well."""

    def __call__(cls, *positional: Any, **data: Any) -> Any:
        table = cast("type[Table]", cls)
        named = dict(zip(table.positional, positional, strict=False))
        if len(positional) > len(table.positional) or named.keys() & data:
            raise TypeError(f"{cls.__name__} takes keyword arguments: {', '.join(table.__signature__.parameters)}")
        try:
            return super().__call__(**named, **data)
        except ValidationError as error:
            raise table.refusal(problems_of(error, named | data, table.described())) from None


class Table(BaseModel, metaclass=_OwnErrors):
    """A table of a scene: unknown keys are errors, and entries are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)

    # Keys that Python may give without their names, in this order.
    positional: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def refusal(cls, problems: list[tuple[str, str]]) -> SceneError:
        """The error of a table that Python has made, from the paths of wrong keys and what is wrong."""
        return SceneError(problems, cls.__name__)

    @classmethod
    def described(cls) -> type[BaseModel]:
        """The same keys with their types, for help and messages."""
        return cls

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Show keys and defaults in help and notebooks, and not the types by which they are checked."""
        parameters = (
            Parameter(name, Parameter.KEYWORD_ONLY, default=Parameter.empty if field.is_required() else field.default)
            for name, field in cls.model_fields.items()
        )
        # What must be given comes first, also where a base class has the other keys.
        cls.__signature__ = Signature(sorted(parameters, key=lambda key: key.default is not Parameter.empty))

    def __iter__(self) -> Generator[tuple[str, Any], None, None]:
        """The keys with their values, without what is kept of what follows from them."""
        for name in type(self).model_fields:
            yield name, getattr(self, name)

    def remade(self, **changes: Any) -> Self:
        """The same with other entries of some keys, all validated anew."""
        return type(self)(**{key: getattr(self, key) for key in self.model_fields_set} | changes)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A changed copy, whose new values are not validated; a single table stands for a list of one.

        Raises:
            SceneError: a key is not known.
        """
        fields, changes = type(self).model_fields, dict(update or {})
        unknown = [(key, f"unknown key; there are: {', '.join(fields)}") for key in changes if key not in fields]
        if unknown:
            raise SceneError(unknown, type(self).__name__)
        for key, value in changes.items():
            if get_origin(fields[key].annotation) is tuple and isinstance(value, list | BaseModel):
                changes[key] = tuple(value) if isinstance(value, list) else (value,)
        copy = super().model_copy(update=changes, deep=deep)
        for name in copy.__dict__.keys() - fields.keys():  # what a cached property has made of the old values
            del copy.__dict__[name]
        return copy


def refused(table: str, problems: Iterable[tuple[tuple[str | int, ...], str]]) -> ValidationError:
    """The error of a validator that has found several, each with its place in the table."""
    details = [
        InitErrorDetails(type=PydanticCustomError("value_error", "{why}", {"why": why}), loc=location, input={})
        for location, why in problems
    ]
    return ValidationError.from_exception_data(table, details)
