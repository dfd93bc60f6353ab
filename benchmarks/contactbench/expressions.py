"""Formulas of the problem files: numbers, names, arithmetic, comparisons and a few functions, nothing else.

A formula is evaluated in NumPy, after its syntax tree has shown that it has nothing else.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

_ALLOWED = (
    *(ast.Expression, ast.Constant, ast.Name, ast.Load, ast.BinOp, ast.UnaryOp, ast.Compare, ast.Call),
    *(ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.USub, ast.UAdd, ast.Lt, ast.LtE, ast.Gt, ast.GtE),
)
NUMPY: dict[str, Callable[..., Any]] = {
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
    found = {node.id for node in ast.walk(_parsed(text)) if isinstance(node, ast.Name)}
    return found - {"pi", *NUMPY}


def evaluate(text: str | float, values: Mapping[str, Any]) -> Any:
    """The value of a formula.

    Args:
        text: the formula, or a number.
        values: what its names stand for: numbers, arrays, or formulas, which are evaluated where they are named.

    Raises:
        ExpressionError: it is none, or a name is not known.
    """
    return _value(text, dict(values))


def _parsed(text: str | float) -> ast.Expression:
    try:
        tree = ast.parse(str(text).strip(), mode="eval")
    except SyntaxError as error:
        raise ExpressionError(f"{text!r} is not a formula: {error.msg}") from None
    for node in ast.walk(tree):
        allowed = isinstance(node, _ALLOWED)
        if isinstance(node, ast.Constant):
            allowed = type(node.value) in (int, float)
            node.value = float(node.value) if allowed else 0.0  # type: ignore[arg-type]  # powers of integers have no end
        elif isinstance(node, ast.Call):
            allowed = isinstance(node.func, ast.Name) and node.func.id in NUMPY
        elif isinstance(node, ast.Compare):
            allowed = len(node.ops) == 1
        if not allowed:
            raise ExpressionError(f"{text!r} has {type(node).__name__}, which is not part of a formula")
    return tree


def _value(text: str | float, values: dict[str, Any]) -> Any:
    for name in names(text):
        if name not in values:
            raise ExpressionError(f"{name!r} in {str(text)!r} is not known: known are {', '.join(sorted(values))}")
        if isinstance(values[name], str):
            # Evaluated once; a formula that names itself finds no name.
            formula = values.pop(name)
            values[name] = _value(formula, values)
    # ``names`` has refused all but arithmetic with these names and functions.
    code = compile(_parsed(text), str(text), "eval")
    return eval(code, {"__builtins__": {}}, {"pi": math.pi, **NUMPY, **values})
