"""Formulas of the problem files: numbers, names, ``pi``, arithmetic and functions of NumPy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

_FUNCTIONS = {
    "abs": np.abs,
    "acosh": np.arccosh,
    "asin": np.arcsin,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "cos": np.cos,
    "exp": np.exp,
    "log": np.log,
    "max": np.maximum,
    "min": np.minimum,
    "pi": np.pi,
    "sin": np.sin,
    "sqrt": np.sqrt,
    "tan": np.tan,
    "where": np.where,
}
COORDINATES = ("x", "y", "z")


class ExpressionError(ValueError):
    """A formula that is not one: the message names it and what is wrong."""


def names(text: str | float) -> set[str]:
    """The names that a formula uses, functions left out.

    Raises:
        ExpressionError: it is none.
    """
    return set(_compiled(text).co_names) - _FUNCTIONS.keys()


def evaluate(text: str | float, values: Mapping[str, Any]) -> Any:
    """The value of a formula.

    Args:
        text: the formula, or a number.
        values: what its names stand for: numbers, arrays, or formulas, which are evaluated where
        they are named.

    Raises:
        ExpressionError: it is none, or a name is not known.
    """
    return _value(text, dict(values))


def _compiled(text: str | float) -> Any:
    try:
        return compile(str(text).strip(), str(text), "eval")
    except SyntaxError as error:
        raise ExpressionError(f"{text!r} is not a formula: {error.msg}") from None


def _value(text: str | float, values: dict[str, Any]) -> Any:
    for name in names(text):
        if name not in values:
            raise ExpressionError(
                f"{name!r} in {str(text)!r} is not known: known are {', '.join(sorted(values))}"
            )
        if isinstance(values[name], str):
            # Evaluated once; a formula that names itself finds no name.
            formula = values.pop(name)
            values[name] = _value(formula, values)
    return eval(_compiled(text), {"__builtins__": {}}, {**_FUNCTIONS, **values})
