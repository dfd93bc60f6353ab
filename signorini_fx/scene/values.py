"""Kinds of values in a scene: numbers, expressions, counts, words; each has one error message for everything else."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from signorini_fx.scene import magnitudes
from signorini_fx.scene.expressions import Expression

_LONGEST_SHOWN = 200


def shown(given: Any) -> str:
    """A value in a message, shortened if it is long."""
    try:
        text = repr(given).lower() if isinstance(given, bool) else repr(given)
    except ValueError:  # Python does not print whole numbers of thousands of digits
        return "a number with thousands of digits"
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."


def kind_of(given: object) -> str:
    """A description of the wrong argument for a message."""
    kind = type(given)
    module = kind.__module__.partition(".")[0]
    return kind.__name__ if module in ("builtins", "signorini_fx") else f"{module}'s {kind.__name__}"


def plain_number(given: Any) -> Any:
    """A number; NumPy's numbers are accepted."""
    if isinstance(given, np.number | np.ndarray) and given.ndim == 0:
        given = given.item()
    if not isinstance(given, str | int | float | bool | None):
        raise ValueError(f"must be a number, not {kind_of(given)}")
    return given


def timed(given: Any) -> Any:
    """The same as ``value``, for what load steps change: an expression may depend on the time t."""
    return Expression(given, allows_time=True) if isinstance(given, str) else value(given)


def sampled(given: Any) -> Any:
    """A value that is evaluated at points; fields and expressions of FEniCSx cannot be."""
    found = value(given)
    if hasattr(found, "ufl_domain"):
        raise ValueError(
            f"{kind_of(given)} cannot be evaluated at points: give a number, an expression of the position, or a "
            "callable f(x) of points of shape (3, n)"
        )
    return found


def bounded(number: float) -> float:
    """The number, if its magnitude is in the allowed range.

    Raises:
        ValueError: it is not.
    """
    wrong = magnitudes.complaint(number)
    if wrong is not None:
        raise ValueError(f"{wrong}, got {shown(number)}")
    return number


def value(given: Any) -> Any:
    """A number, an expression, a callable or UFL; everything else is refused."""
    if isinstance(given, bool):
        raise ValueError("a number or an expression of the position is expected, not true or false")
    given = plain_number(given) if isinstance(given, np.number | np.ndarray) else given
    if isinstance(given, int | float):
        try:
            number = float(given)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise ValueError("the number must be finite")
        return bounded(number)
    if isinstance(given, str):
        return Expression(given)
    if isinstance(given, Expression) or callable(given) or hasattr(given, "ufl_domain"):
        return given
    raise ValueError(f"a number or an expression of the position is expected, not {kind_of(given)}")


def not_negative(given: Any) -> Any:
    """A value that is not a negative number."""
    if isinstance(given, float) and given < 0:
        raise ValueError(f"must not be negative, got {given:g}")
    return given


class _NumberOrText:
    """The JSON schema of values; each key has its own, because pydantic writes the default of a key into it."""

    def __get_pydantic_json_schema__(self, _: Any, __: Any) -> dict[str, Any]:
        return {"type": ["number", "string"]}


Value = Annotated[Any, BeforeValidator(value), _NumberOrText()]


TimedValue = Annotated[Any, BeforeValidator(timed), _NumberOrText()]
TimedSampledValue = Annotated[Any, BeforeValidator(lambda v: sampled(timed(v))), _NumberOrText()]
SampledValue = Annotated[Any, BeforeValidator(sampled), _NumberOrText()]
NonNegativeValue = Annotated[Any, BeforeValidator(lambda v: not_negative(sampled(v))), _NumberOrText()]
NonNegativeTimedValue = Annotated[Any, BeforeValidator(lambda v: not_negative(sampled(timed(v)))), _NumberOrText()]


def share(given: Any) -> Any:
    """A number, or a text such as ``5%``."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*%\s*", given) if isinstance(given, str) else None
    return given if match is None else float(match[1]) / 100


def number_or_auto(given: Any) -> Any:
    """A positive number or the word auto, with one message where it is neither."""
    given = given.item() if isinstance(given, np.number) else given
    if given != "auto" and not (type(given) in (int, float) and 0 < given < math.inf):
        raise ValueError(f"a positive number or 'auto' is expected, got {shown(given)}")
    return given if given == "auto" else bounded(given)


def count_or_auto(given: Any) -> Any:
    """A positive whole number or the word auto, with one message where it is neither."""
    given = given.item() if isinstance(given, np.number) else given
    if given != "auto" and not (type(given) is int and 0 < given <= 100_000):
        raise ValueError(f"a positive whole number or 'auto' is expected, got {shown(given)}")
    return given


Finite = Annotated[
    float, Field(allow_inf_nan=False, strict=True), BeforeValidator(plain_number), AfterValidator(bounded)
]
Positive = Annotated[
    float, Field(gt=0, allow_inf_nan=False, strict=True), BeforeValidator(plain_number), AfterValidator(bounded)
]
NonNegative = Annotated[
    float,
    Field(allow_inf_nan=False, strict=True),
    BeforeValidator(plain_number),
    AfterValidator(not_negative),
    AfterValidator(bounded),
]
Count = Annotated[int, Field(gt=0, le=100_000, strict=True)]


def _not_zero(given: tuple[float, ...]) -> tuple[float, ...]:
    if not any(given):
        raise ValueError("must not be zero")
    return given


NOT_ZERO = AfterValidator(_not_zero)
Vector = Annotated[tuple[Finite, ...], Field(min_length=2, max_length=3)]
Direction = Annotated[Vector, NOT_ZERO]


Automatic = Annotated[float | Literal["auto"], BeforeValidator(number_or_auto)]


def selection(given: Any) -> Any:
    """A number in the cell data of a mesh file, a list of them, or a rule; everything else is refused."""
    if type(given) is int or isinstance(given, Expression) or callable(given):
        return given
    if isinstance(given, str):
        if given.isidentifier() and given not in ("x", "pi"):
            number = given.rpartition("_")[2]
            write = f": write {number}" if number.isdigit() else ", which needs no other one: use it where it acts"
            raise ValueError(f"{given!r} is a name{write}")
        return Expression(given)
    if isinstance(given, list | tuple) and given and all(type(number) is int for number in given):
        return tuple(given)
    expected = "a whole number, a list of them, or an expression of the position"
    raise ValueError(f"{expected} is expected, not {kind_of(given)}")


_SELECTION_SCHEMA = {"type": ["integer", "string", "array"], "items": {"type": "integer"}, "minItems": 1}
Selection = Annotated[Any, BeforeValidator(selection), WithJsonSchema(_SELECTION_SCHEMA)]
