"""Formulas of the problem files: numbers, names, arithmetic, comparisons and a few functions, nothing else.

A formula is evaluated in NumPy or, with other functions, in the symbols of another program (UFL).
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_COMPARED: dict[type, Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
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


def evaluate(
    text: str | float, values: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]] | None = None
) -> Any:
    """The value of a formula.

    Args:
        text: the formula, or a number.
        values: what its names stand for: numbers, arrays, symbols, or formulas, which are evaluated where they are
            named.
        functions: what its functions are; None: those of NumPy.

    Raises:
        ExpressionError: it is none, or a name is not known.
    """
    names(text)
    return _value(_parsed(text), dict(values), functions or NUMPY, str(text))


def _parsed(text: str | float) -> ast.expr:
    try:
        return ast.parse(str(text).strip(), mode="eval").body
    except SyntaxError as error:
        raise ExpressionError(f"{text!r} is not a formula: {error.msg}") from None


def _walk(node: ast.expr, found: set[str]) -> None:
    match node:
        case ast.Constant(value=bool() | str() | bytes() | None | complex()):
            raise ExpressionError(f"{ast.unparse(node)!r} is not a number")
        case ast.Constant():
            pass
        case ast.Name(id=name):
            if name != "pi":
                found.add(name)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            _walk(left, found)
            _walk(right, found)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            _walk(operand, found)
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARED:
            _walk(left, found)
            _walk(right, found)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in NUMPY:
            for argument in arguments:
                _walk(argument, found)
        case _:
            raise ExpressionError(f"{ast.unparse(node)!r} is not part of a formula")


def _value(node: ast.expr, values: dict[str, Any], functions: Mapping[str, Callable[..., Any]], text: str) -> Any:
    match node:
        case ast.Constant(value=number):
            return float(number)
        case ast.Name(id="pi"):
            return math.pi
        case ast.Name(id=name):
            if name not in values:
                raise ExpressionError(f"{name!r} in {text!r} is not known: known are {', '.join(sorted(values))}")
            if isinstance(values[name], str):
                # Evaluated once; a formula that names itself finds no name.
                formula = values.pop(name)
                values[name] = _value(_parsed(formula), values, functions, formula)
            return values[name]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            first, second = (_value(part, values, functions, text) for part in (left, right))
            return _BINARY[type(op)](first, second)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, values, functions, text)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _value(operand, values, functions, text)
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARED:
            first, second = (_value(part, values, functions, text) for part in (left, right))
            return _COMPARED[type(op)](first, second)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in functions:
            return functions[name](*(_value(argument, values, functions, text) for argument in arguments))
    raise ExpressionError(f"{ast.unparse(node)!r} in {text!r} is not part of a formula")
