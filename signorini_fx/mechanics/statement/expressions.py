"""Expressions of the position in scenes: parsed by Python, evaluated with NumPy or converted to
UFL.

An example is ``gap = "0.003*(x[0] - 1.5)**2 + 0.001"``.  Python executes nothing of it: its syntax
tree is evaluated node by node.  An expression is tried at one point when it is made; anything but
``_ALLOWED`` is refused.
"""

from __future__ import annotations

import ast
import copy
import math
import operator
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, reduce
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np
import numpy.typing as npt

from signorini_fx.arrays import Array, Expr, FieldValue, Value
from signorini_fx.tuned import SAME_NUMBER

if TYPE_CHECKING:
    from dolfinx.mesh import Mesh

Operand: TypeAlias = "FieldValue | float"
_ONE_ARGUMENT = ("abs", "cos", "exp", "log", "sign", "sin", "sqrt", "tan", "tanh")
_ARITHMETIC: dict[type, Callable[..., Operand]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_SIGNS: dict[type, Callable[..., Operand]] = {ast.USub: operator.neg, ast.UAdd: operator.pos}
_ALLOWED = (
    "Allowed are numbers, pi, x[0], x[1], in 3D x[2], + - * / **, < <= > >=, and, or, not, "
    f"A if C else B, where(C, A, B), min(A, ...), max(A, ...), and {', '.join(_ONE_ARGUMENT)} of "
    "one number; in loads "
    "and prescribed displacements also the time t"
)


# The operations of expressions, in NumPy or UFL, by their names.
_Algebra = dict[str, Callable[..., Any]]
_NUMPY: _Algebra = {
    **{name: getattr(np, name) for name in _ONE_ARGUMENT},
    "min": np.minimum,
    "max": np.maximum,
    "where": np.where,
    "and": np.logical_and,
    "or": np.logical_or,
    "not": np.logical_not,
    # A NumPy float: arithmetic then gives inf or nan, which is reported where it happens, and never
    # an exception.
    "number": np.float64,
    "reach": lambda position: np.abs(position).max(initial=0.0),
    "is condition": lambda value: value.dtype == np.bool_,
}


def _ufl_algebra(mesh: Mesh) -> _Algebra:
    """Return the operations in UFL.

    Numbers become ``fem.Constant``, so that forms that differ only in a number are compiled once.
    """
    import ufl
    from dolfinx import default_scalar_type, fem

    def number(value: float) -> fem.Constant:
        return fem.Constant(mesh, default_scalar_type(value))

    return {
        **{name: getattr(ufl, name) for name in _ONE_ARGUMENT if name not in ("abs", "log")},
        # UFL turns |(|a|)| into an Abs that is its own operand, which leads to an endless
        # recursion.
        "abs": lambda value: value if isinstance(value, ufl.algebra.Abs) else abs(value),
        "log": ufl.ln,
        "min": ufl.min_value,
        "max": ufl.max_value,
        "where": ufl.conditional,
        "and": ufl.And,
        "or": ufl.Or,
        "not": ufl.Not,
        "number": number,
        "reach": lambda _: number(float(np.abs(mesh.geometry.x).max(initial=0.0))),
        "is condition": lambda value: isinstance(value, ufl.classes.Condition),
    }


class _Evaluator:
    """Evaluates a syntax tree at one position and time."""

    def __init__(self, algebra: _Algebra, position: FieldValue, time: Operand) -> None:
        self._algebra = algebra
        self._position = position
        self._time = time

    def value(self, node: ast.expr) -> Operand:
        """Return the value of a node of the tree.

        Raises:
            ValueError: the node is not allowed; the message states why.
        """
        algebra = self._algebra
        match node:
            case ast.Constant(value=number) if type(number) in (int, float):
                if abs(number) > sys.float_info.max:
                    raise ValueError("a number is too large")
                return algebra["number"](number)
            case ast.Name(id="pi"):
                return algebra["number"](math.pi)
            case ast.Name(id="t"):
                return self._time
            case ast.Subscript(value=ast.Name(id="x"), slice=ast.Constant(value=index)) if (
                type(index) is int
            ):
                if index not in (0, 1, 2):
                    raise ValueError(
                        f"x[{index}] is not a coordinate: use x[0] or x[1], in 3D also x[2]"
                    )
                return self._position[index]
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return algebra["not"](*self._conditions(operand))
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _SIGNS:
                return _SIGNS[type(op)](*self._numbers(operand))
            case ast.BinOp(left=left, op=ast.BitAnd() | ast.BitOr() as op, right=right):
                return algebra["and" if isinstance(op, ast.BitAnd) else "or"](
                    *self._conditions(left, right)
                )
            case ast.BinOp(op=ast.BitXor()):
                raise ValueError("a power is written **, not ^")
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
                return _ARITHMETIC[type(op)](*self._numbers(left, right))
            case ast.BoolOp(op=op, values=values):
                return reduce(
                    algebra["and" if isinstance(op, ast.And) else "or"], self._conditions(*values)
                )
            case ast.Compare(left=left, ops=ops, comparators=comparators):
                pairs = zip(ops, pairwise((left, *comparators)), strict=True)
                return reduce(algebra["and"], [self._compare(op, *pair) for op, pair in pairs])
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return algebra["where"](*self._conditions(test), *self._numbers(body, orelse))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(name, arguments)
        raise ValueError(f"{ast.unparse(node)!r} is not available")

    def _numbers(self, *nodes: ast.expr) -> list[Operand]:
        return [self._of_kind(node, condition=False) for node in nodes]

    def _conditions(self, *nodes: ast.expr) -> list[Operand]:
        return [self._of_kind(node, condition=True) for node in nodes]

    def _of_kind(self, node: ast.expr, *, condition: bool) -> Operand:
        value = self.value(node)
        if self._algebra["is condition"](value) != condition:
            expected, found = ("condition", "number") if condition else ("number", "condition")
            raise ValueError(
                f"a {expected} is expected where '{ast.unparse(node)}' stands, which is a {found}"
            )
        return value

    def _call(self, name: str, arguments: list[ast.expr]) -> Operand:
        functions = self._algebra
        count = len(arguments)
        if name == "where" and count == 3:
            return functions[name](*self._conditions(arguments[0]), *self._numbers(*arguments[1:]))
        if name in ("min", "max") and count >= 2:
            return reduce(functions[name], self._numbers(*arguments))
        if name in _ONE_ARGUMENT and count == 1:
            return functions[name](*self._numbers(*arguments))
        raise ValueError(f"{name!r} of {count} argument{'s' * (count != 1)} is not available")

    def _compare(self, op: ast.cmpop, left_operand: ast.expr, right_operand: ast.expr) -> Operand:
        """Return a comparison with a tolerance for round-off; else a jump at a quadrature point
        would depend on how its position is computed.
        """
        if not isinstance(op, ast.Lt | ast.LtE | ast.Gt | ast.GtE):
            raise ValueError(f"comparison {type(op).__name__} is not available: use <, <=, >, >=")
        if isinstance(op, ast.Gt | ast.GtE):
            left_operand, right_operand = right_operand, left_operand
        a, b = self._numbers(left_operand, right_operand)
        absolute = self._algebra["abs"]
        size = absolute(a) + absolute(b)
        if isinstance(left_operand, ast.Subscript) or isinstance(right_operand, ast.Subscript):
            size = size + self._algebra["reach"](
                self._position
            )  # the round-off of a coordinate is that of the largest
        room = self._algebra["number"](SAME_NUMBER) * size
        return a <= b + room if isinstance(op, ast.LtE | ast.GtE) else a + room < b


@dataclass(frozen=True)
class Expression:
    """A scalar function of the position, written as text.

    Args:
        text: for example ``"where(x[0] < 1, 0, -20)"``; a condition counts as 1 where it holds and
            0 elsewhere.
        time: the value of t in it; None: none is known, and what depends on it is nan.
        allows_time: whether it may depend on t, as loads and prescribed displacements may.

    Raises:
        ValueError: the text is not a valid expression; the message says what is wrong and what is
            allowed.
    """

    text: str
    time: float | None = None
    allows_time: bool = field(default=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        try:
            with np.errstate(all="ignore"):
                _Evaluator(_NUMPY, np.zeros((3, 1)), self._present_time).value(self.tree)
            if self.timed and not self.allows_time:
                raise ValueError(
                    "t, the time, is for loads, prescribed displacements, gaps and friction"
                )
        except SyntaxError as error:
            raise ValueError(
                f"{self.text!r}: syntax error at column {error.offset}: {error.msg}. {_ALLOWED}"
            ) from None
        except (ValueError, MemoryError, RecursionError) as error:
            raise ValueError(
                f"{self.text!r}: {str(error) or 'nested too deeply'}. {_ALLOWED}"
            ) from None

    @cached_property
    def tree(self) -> ast.expr:
        """The syntax tree of the expression."""
        return ast.parse(self.text.strip(), mode="eval").body

    @cached_property
    def timed(self) -> bool:
        """Whether the expression depends on the time t."""
        return any(isinstance(node, ast.Name) and node.id == "t" for node in ast.walk(self.tree))

    def at_time(self, time: float) -> Self:
        """Return the function at a fixed time."""
        later = copy.copy(self)  # with its tree, which is not parsed and checked again
        object.__setattr__(later, "time", time)
        return later

    @property
    def coordinates(self) -> int:
        """The number of coordinates that a point must have: one plus the largest i of the x[i] in
        the expression, or 0.
        """
        nodes = [node.slice for node in ast.walk(self.tree) if isinstance(node, ast.Subscript)]
        return max(
            (int(node.value) + 1 for node in nodes if isinstance(node, ast.Constant)), default=0
        )

    def __call__(self, x: Array) -> Array:
        """Return the values at points ``x`` of shape (dim or 3, n), shape (n,); inf or nan where
        the expression is undefined.
        """
        return self.of_part(self.tree, x)

    def of_part(self, node: ast.expr, x: Array) -> Array:
        """Return the values of a node of its tree at points, see ``__call__``."""
        with np.errstate(all="ignore"):
            value = _Evaluator(_NUMPY, x, self._present_time).value(node)
        return np.broadcast_to(np.asarray(value, dtype=float), x.shape[1:]).copy()

    @property
    def _present_time(self) -> np.float64:
        return np.float64(math.nan if self.time is None else self.time)

    def ufl(self, mesh: Mesh, time: Expr | None = None) -> Expr:
        """Return the function as a UFL expression of ``SpatialCoordinate(mesh)``, with a
        ``Constant`` for t if it is given.
        """
        import ufl

        algebra = _ufl_algebra(mesh)
        instant = algebra["number"](float(self._present_time)) if time is None else time
        value = _Evaluator(algebra, ufl.SpatialCoordinate(mesh), instant).value(self.tree)
        return (
            ufl.conditional(value, 1.0, 0.0)
            if algebra["is condition"](value)
            else ufl.as_ufl(value)
        )


def sample(value: Value, x: Array) -> Array:
    """Return the values of a number, an ``Expression`` or a callable at points ``x`` of shape (3,
    n), shape (n,).

    Raises:
        ValueError: the values are not real, or neither one nor n of them.
    """
    if isinstance(value, int | float):
        return np.full(x.shape[1], float(value))
    result = real_numbers(value(x))
    if result.shape not in ((), (1,), (x.shape[1],)):
        raise ValueError(
            f"the values have the shape {result.shape}, and {(x.shape[1],)} is expected"
        )
    return np.broadcast_to(result, (x.shape[1],)).copy()


def number(value: Value) -> float:
    """Return a number, or the value of an ``Expression`` that depends on the time only."""
    return float(sample(value, np.zeros((3, 1)))[0])


def real_numbers(values: npt.ArrayLike) -> Array:
    """Return the values of a user's function as a real array.

    Raises:
        ValueError: the values are complex; NumPy would drop the imaginary parts.
    """
    if np.iscomplexobj(values):
        raise ValueError("the values are complex numbers, and real ones are expected")
    return np.asarray(values, dtype=float)


def in_space(x: Array) -> Array:
    """Return points of shape (n, 2) or (n, 3) in the shape (3, n) that expressions and callables
    take.

    dolfinx places nodes of x = 0 at -7e-18, where sqrt(x) is undefined and x is negative as a
    bound. So coordinates below one unit of round-off of the largest one are set to 0.
    """
    points = np.zeros((3, len(x)))
    points[: x.shape[1]] = x.T
    points[np.abs(points) < np.finfo(float).eps * np.abs(points).max(initial=0.0)] = 0.0
    return points
