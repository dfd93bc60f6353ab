"""Values in UFL as expressions of the position, which are known between points of quadrature too."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from ufl.algorithms import expand_derivatives
from ufl.algorithms.analysis import extract_constants
from ufl.algorithms.expand_indices import expand_indices

from signorini_fx.machine import compat
from signorini_fx.mechanics.statement.expressions import Expression

_FUNCTIONS = {"sin": "sin", "cos": "cos", "exp": "exp", "sqrt": "sqrt", "tan": "tan", "tanh": "tanh", "ln": "log"}
_BETWEEN = {
    "Sum": " + ",
    "Product": " * ",
    "Division": " / ",
    "Power": " ** ",
    "LE": " <= ",
    "LT": " < ",
    "GE": " >= ",
    "GT": " > ",
    "AndCondition": " and ",
    "OrCondition": " or ",
}
_PACKAGE = "signorini_fx."
_CALLS = {"Abs": "abs", "MinValue": "min", "MaxValue": "max", "NotCondition": "not "}


def stated(value: Any) -> Any:
    """A scalar as a number or an ``Expression``; a callable and what else is no UFL as it is.

    Raises:
        ValueError: it has a part that no expression has, such as a Function.
    """
    if isinstance(value, int | float | np.number):
        return float(value)
    if not hasattr(value, "ufl_shape"):
        return value
    text = _text(expand_indices(expand_derivatives(value)))
    expression = Expression(text)
    return expression if "x[" in text else expression.at_its_time


def _text(node: Any) -> str:
    kind, operands = type(node).__name__, node.ufl_operands
    if isinstance(node, ufl.constantvalue.Zero):
        return "0.0"
    if isinstance(node, ufl.constantvalue.ScalarValue):
        return f"({float(node)!r})"
    if isinstance(node, fem.Constant):
        return f"({float(node.value)!r})"
    if isinstance(node, ufl.indexed.Indexed):
        tensor, index = operands[0], tuple(int(k) for k in operands[1])
        if isinstance(tensor, ufl.SpatialCoordinate):
            return f"x[{index[0]}]"
        if isinstance(tensor, fem.Constant):
            return f"({float(tensor.value[index])!r})"
        kind = type(tensor).__name__
    if isinstance(node, ufl.SpatialCoordinate):
        return "x[0]"
    if kind in _BETWEEN:
        return f"({_BETWEEN[kind].join(map(_text, operands))})"
    if kind in _CALLS:
        return f"({_CALLS[kind]}({', '.join(map(_text, operands))}))"
    if kind == "Conditional":
        condition, then, otherwise = map(_text, operands)
        return f"({then} if {condition} else {otherwise})"
    if isinstance(node, ufl.mathfunctions.MathFunction) and (name := getattr(node, "_name", "")) in _FUNCTIONS:
        return f"{_FUNCTIONS[name]}({_text(operands[0])})"
    raise ValueError(f"{kind} is known at points of quadrature alone")


def constants_of(compiled: Iterable[fem.Form], entries: Any) -> list[float]:
    """The values of all Constants of forms, and of contacts with what belongs to them."""
    values = [float(number) for form in compiled for number in compat.packed_constants(form)]
    if isinstance(entries, Mapping):
        return values + constants_of((), list(entries.values()))
    if isinstance(entries, list | tuple):
        return values + [number for entry in entries for number in constants_of((), entry)]
    if isinstance(entries, ufl.core.expr.Expr):
        return values + [float(number) for node in extract_constants(entries) for number in np.ravel(node.value)]
    if isinstance(getattr(entries, "__dict__", None), dict) and type(entries).__module__.startswith(_PACKAGE):
        return values + constants_of((), vars(entries))
    return values
