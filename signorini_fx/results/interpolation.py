"""Expressions as finite element functions: compiled, and taken at the points of a function space."""

from __future__ import annotations

from typing import Any

from dolfinx import default_scalar_type, fem

from signorini_fx.machine import compat
from signorini_fx.machine.compilation import compiling


def interpolated(expression: Any, space: fem.FunctionSpace, name: str = "f") -> fem.Function:
    """A UFL expression of the shape of the space, interpolated into it; collective."""
    function = fem.Function(space, name=name)
    with compiling():
        compiled = fem.Expression(expression, compat.interpolation_points(space.element), dtype=default_scalar_type)
    function.interpolate(compiled)
    return function
