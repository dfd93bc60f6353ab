"""Formulas of the problem files: numbers, names, arithmetic, comparisons and a few functions, nothing else.

A formula is evaluated in NumPy, after its syntax tree has shown that it has nothing else.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.USub, ast.UAdd, ast.Lt, ast.LtE, ast.Gt, ast.GtE)
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
    found: set[str] = set()
    _walk(_parsed(text), found)
    return found


def evaluate(text: str | float, values: Mapping[str, Any]) -> Any:
    """The value of a formula.

    Args:
        text: the formula, or a number.
        values: what its names stand for: numbers, arrays, or formulas, which are evaluated where they are named.

    Raises:
        ExpressionError: it is none, or a name is not known.
    """
    return _value(text, dict(values))


def _parsed(text: str | float) -> ast.expr:
    try:
        tree = ast.parse(str(text).strip(), mode="eval").body
    except SyntaxError as error:
        raise ExpressionError(f"{text!r} is not a formula: {error.msg}") from None
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and type(node.value) is int:
            node.value = float(node.value)  # powers of integers have no end
    return tree


def _walk(node: ast.expr, found: set[str]) -> None:
    match node:
        case ast.Constant(value=bool() | str() | bytes() | None | complex()):
            raise ExpressionError(f"{ast.unparse(node)!r} is not a number")
        case ast.Constant():
            pass
        case ast.Name(id=name):
            if name != "pi":
                found.add(name)
        case ast.BinOp(left=left, op=op, right=right) if isinstance(op, _OPERATORS):
            _walk(left, found)
            _walk(right, found)
        case ast.UnaryOp(op=op, operand=operand) if isinstance(op, _OPERATORS):
            _walk(operand, found)
        case ast.Compare(left=left, ops=[op], comparators=[right]) if isinstance(op, _OPERATORS):
            _walk(left, found)
            _walk(right, found)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in NUMPY:
            for argument in arguments:
                _walk(argument, found)
        case _:
            raise ExpressionError(f"{ast.unparse(node)!r} is not part of a formula")


def _value(text: str | float, values: dict[str, Any]) -> Any:
    for name in names(text):
        if name not in values:
            raise ExpressionError(f"{name!r} in {str(text)!r} is not known: known are {', '.join(sorted(values))}")
        if isinstance(values[name], str):
            # Evaluated once; a formula that names itself finds no name.
            formula = values.pop(name)
            values[name] = _value(formula, values)
    # ``names`` has refused all but arithmetic with these names and functions.
    code = compile(ast.Expression(_parsed(text)), str(text), "eval")
    return eval(code, {"__builtins__": {}}, {"pi": math.pi, **NUMPY, **values})
