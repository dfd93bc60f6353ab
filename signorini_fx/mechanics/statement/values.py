"""Kinds of values in a scene: numbers, expressions, counts, words; each kind has one error message
for invalid input.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Generic, Literal, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from signorini_fx.arrays import Array, Value
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.tuned import LARGEST_NUMBER

if TYPE_CHECKING:
    from pydantic import GetJsonSchemaHandler
    from pydantic.json_schema import JsonSchemaValue
    from pydantic_core import CoreSchema

_LONGEST_SHOWN = 200
_Given = TypeVar("_Given")
_Kept = TypeVar("_Kept")


def shown(entry: object) -> str:
    """Return a value as text for a message, shortened if it is long."""
    try:
        text = repr(entry).lower() if isinstance(entry, bool) else repr(entry)
    except ValueError:  # Python does not print whole numbers of thousands of digits
        return "a number with thousands of digits"
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."


def kind_of(entry: object) -> str:
    """Return a description of the wrong argument for a message."""
    kind = type(entry)
    module = kind.__module__.partition(".")[0]
    return (
        kind.__name__ if module in ("builtins", "signorini_fx") else f"{module}'s {kind.__name__}"
    )


def plain_number(entry: Any) -> Any:
    """Return a number; NumPy's numbers are converted."""
    if isinstance(entry, np.number | np.ndarray) and entry.ndim == 0:
        entry = entry.item()
    if not isinstance(entry, str | int | float | bool | None):
        raise ValueError(f"must be a number, not {kind_of(entry)}")
    return entry


def timed(entry: Value | str) -> Value:
    """Return a valid value; an expression may depend on the time t."""
    return Expression(entry, allows_time=True) if isinstance(entry, str) else value(entry)


def sampled(entry: Value | str) -> Value:
    """Return a value that is evaluated at points; fields and expressions of FEniCSx cannot be."""
    checked = value(entry)
    if hasattr(checked, "ufl_domain"):
        raise ValueError(not_at_points(entry))
    return checked


def not_at_points(entry: object) -> str:
    """Return the message for a UFL value where values at points are needed."""
    return (
        f"{kind_of(entry)} cannot be evaluated at points: give a number, an expression of the "
        "position, or a "
        "callable f(x) of points of shape (3, n)"
    )


def bounded(number: float) -> float:
    """Return the number if its magnitude is in the allowed range.

    Energies, squares of forces and products of stiffness, length and penalty must not overflow or
    vanish in double precision, whatever the units.

    Raises:
        ValueError: the number is too large or too small.
    """
    if abs(number) > LARGEST_NUMBER:
        limit = f"larger than {LARGEST_NUMBER:g}, or forces and energies overflow: take other units"
    elif 0 < abs(number) < 1 / LARGEST_NUMBER:
        limit = (
            f"smaller than {1 / LARGEST_NUMBER:g}, or forces and energies vanish: take other "
            "units, or 0"
        )
    else:
        return number
    raise ValueError(f"must not be {limit}, got {shown(number)}")


def value(entry: Value | str) -> Value:
    """Return a valid value: a number, an expression, a callable or UFL.

    Raises:
        ValueError: the entry is none of these.
    """
    if isinstance(entry, bool):
        raise ValueError("a number or an expression of the position is expected, not true or false")
    entry = plain_number(entry) if isinstance(entry, np.number | np.ndarray) else entry
    if isinstance(entry, int | float):
        try:
            number = float(entry)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise ValueError("the number must be finite")
        return bounded(number)
    if isinstance(entry, str):
        return Expression(entry)
    if isinstance(entry, Expression) or callable(entry) or hasattr(entry, "ufl_domain"):
        return entry
    raise ValueError(f"a number or an expression of the position is expected, not {kind_of(entry)}")


def not_negative(entry: _Given) -> _Given:
    """Return a value unchanged unless it is a negative number, which raises a ValueError."""
    if isinstance(entry, float) and entry < 0:
        raise ValueError(f"must not be negative, got {float(entry)}")
    return entry


class _NumberOrText:
    """The JSON schema of values; each key has its own, because pydantic writes the default of a key
    into it.
    """

    def __get_pydantic_json_schema__(
        self, _: CoreSchema, __: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"type": ["number", "string"]}


GivenValue = Annotated[Any, BeforeValidator(value), _NumberOrText()]


TimedValue = Annotated[Any, BeforeValidator(timed), _NumberOrText()]
TimedSampledValue = Annotated[Any, BeforeValidator(lambda v: sampled(timed(v))), _NumberOrText()]
SampledValue = Annotated[Any, BeforeValidator(sampled), _NumberOrText()]
NonNegativeValue = Annotated[
    Any, BeforeValidator(lambda v: not_negative(sampled(v))), _NumberOrText()
]


def share(entry: _Given) -> _Given | float:
    """Return a text such as ``5%`` as a number, and other entries unchanged."""
    match = (
        re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*%\s*", entry) if isinstance(entry, str) else None
    )
    return entry if match is None else float(match[1]) / 100


Finite = Annotated[
    float,
    Field(allow_inf_nan=False, strict=True),
    BeforeValidator(plain_number),
    AfterValidator(bounded),
]
Positive = Annotated[
    float,
    Field(gt=0, allow_inf_nan=False, strict=True),
    BeforeValidator(plain_number),
    AfterValidator(bounded),
]
NonNegative = Annotated[Finite, AfterValidator(not_negative)]
Count = Annotated[int, Field(gt=0, le=100_000, strict=True), BeforeValidator(plain_number)]


def _not_zero(vector: Sequence[float]) -> Sequence[float]:
    if not any(vector):
        raise ValueError("must not be zero")
    return vector


_Entry = TypeVar("_Entry")
# A list of entries, which is kept as a tuple.
if TYPE_CHECKING:
    Entries = Sequence
else:
    Entries = tuple[_Entry, ...]


class Accepts(Generic[_Given, _Kept]):
    """The annotation of a field whose constructor takes other types than the field has afterwards.

    For type checkers it is a descriptor (PEP 681); pydantic has only the second type.
    """

    if TYPE_CHECKING:

        def __get__(self, table: object, owner: type | None = None) -> _Kept: ...

        def __set__(self, table: object, given: _Given) -> None: ...
    else:

        def __class_getitem__(cls, types: tuple[type, type]) -> object:
            return Annotated[types[1], cls.__name__]


Vector = Annotated[Entries[Finite], Field(min_length=2, max_length=3)]
Direction = Annotated[Vector, AfterValidator(_not_zero)]
Automatic = Positive | Literal["auto"]


def selection(
    entry: int | Sequence[int] | str | Callable[[Array], npt.ArrayLike],
) -> int | tuple[int, ...] | Callable[[Array], npt.ArrayLike]:
    """Return a number in the cell data of a mesh file, a list of them, or a rule.

    Raises:
        ValueError: the entry is none of these.
    """
    if type(entry) is int or isinstance(entry, Expression) or callable(entry):
        return entry
    if isinstance(entry, str):
        if entry.isidentifier() and entry not in ("x", "pi"):
            number = entry.rpartition("_")[2]
            write = (
                f": write {number}"
                if number.isdigit()
                else ", which needs no other one: use it where it acts"
            )
            raise ValueError(f"{entry!r} is a name{write}")
        return Expression(entry)
    if isinstance(entry, list | tuple) and entry and all(type(number) is int for number in entry):
        return tuple(entry)
    expected = "a whole number, a list of them, or an expression of the position"
    raise ValueError(f"{expected} is expected, not {kind_of(entry)}")


_SELECTION_SCHEMA = {
    "type": ["integer", "string", "array"],
    "items": {"type": "integer"},
    "minItems": 1,
}
Selection = Annotated[Any, BeforeValidator(selection), WithJsonSchema(_SELECTION_SCHEMA)]
