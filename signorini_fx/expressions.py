"""Expressions of the position in scenes: parsed by simpleeval, evaluated with NumPy or turned into UFL.

A scene says ``gap = "0.003*(x[0] - 1.5)**2 + 0.001"``.  Nothing of it is ever executed by Python: simpleeval walks the
syntax tree, and of the syntax only numbers, ``x[0]``, ``x[1]``, arithmetic, comparisons, ``and``/``or``/``not``,
``A if C else B`` and the functions below are let through.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt
from simpleeval import InvalidExpression, SimpleEval

_SYNTAX = (
    ast.Expr,
    ast.Name,
    ast.Constant,
    ast.UnaryOp,
    ast.BinOp,
    ast.BoolOp,
    ast.Compare,
    ast.IfExp,
    ast.Call,
    ast.Subscript,
)
_COMPARISONS: dict[type, Callable[..., Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_MAX_LENGTH = 2000
_MAX_EXPONENT = 100


@dataclass(frozen=True)
class _Backend:
    """What an expression means in one algebra."""

    functions: dict[str, Callable[..., Any]]
    where: Callable[[Any, Any, Any], Any]
    both: Callable[[Any, Any], Any]
    either: Callable[[Any, Any], Any]
    negate: Callable[[Any], Any]
    number: Callable[[float], Any]


_NUMPY = _Backend(
    functions={
        **{name: getattr(np, name) for name in ("sqrt", "exp", "sin", "cos", "tan", "tanh", "abs", "sign")},
        "log": np.log,
        "min": lambda *values: reduce(np.minimum, values),
        "max": lambda *values: reduce(np.maximum, values),
        "where": np.where,
    },
    where=np.where,
    both=np.logical_and,
    either=np.logical_or,
    negate=np.logical_not,
    number=float,
)


def _ufl_backend(mesh: Any) -> _Backend:
    """Numbers become ``fem.Constant``: forms that differ in a number only are compiled once."""
    import ufl
    from dolfinx import default_scalar_type, fem

    return _Backend(
        functions={
            **{name: getattr(ufl, name) for name in ("sqrt", "exp", "sin", "cos", "tan", "tanh", "sign")},
            "abs": abs,
            "log": ufl.ln,
            "min": lambda *values: reduce(ufl.min_value, values),
            "max": lambda *values: reduce(ufl.max_value, values),
            "where": ufl.conditional,
        },
        where=ufl.conditional,
        both=ufl.And,
        either=ufl.Or,
        negate=ufl.Not,
        number=lambda value: fem.Constant(mesh, default_scalar_type(value)),
    )


class _Evaluator(SimpleEval):  # type: ignore[misc]
    """simpleeval restricted to the syntax above, with element-wise logic."""

    nodes: dict[type, Callable[..., Any]]

    def __init__(self, backend: _Backend, position: Any) -> None:
        super().__init__(functions=dict(backend.functions), names={"x": position, "pi": math.pi})
        self._backend = backend
        self._position = position
        for kind in self.nodes.keys() - set(_SYNTAX):
            del self.nodes[kind]
        self.nodes[ast.Constant] = self._constant
        self.nodes[ast.Subscript] = self._component
        self.nodes[ast.BoolOp] = self._logic
        self.nodes[ast.Compare] = self._comparison
        self.nodes[ast.IfExp] = lambda node: backend.where(*map(self._eval, (node.test, node.body, node.orelse)))
        self.operators = {
            ast.Add: operator.add,
            ast.Sub: operator.sub,
            ast.Mult: operator.mul,
            ast.Div: operator.truediv,
            ast.Pow: operator.pow,
            ast.USub: operator.neg,
            ast.UAdd: operator.pos,
            ast.Not: backend.negate,
            ast.BitAnd: backend.both,
            ast.BitOr: backend.either,
        }

    def _constant(self, node: ast.Constant) -> Any:
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            raise InvalidExpression(f"only numbers are allowed, not {node.value!r}")
        if not math.isfinite(float(node.value)):
            raise InvalidExpression("a number is too large")
        return self._backend.number(node.value)

    def _component(self, node: ast.Subscript) -> Any:
        index = node.slice
        if not (isinstance(node.value, ast.Name) and node.value.id == "x" and isinstance(index, ast.Constant)):
            raise InvalidExpression("only x[0] and x[1] can be indexed")
        if index.value not in (0, 1) or isinstance(index.value, bool):
            raise InvalidExpression(f"x[{index.value!r}] is not a coordinate: use x[0] or x[1]")
        return self._position[index.value]

    def _logic(self, node: ast.BoolOp) -> Any:
        combine = self._backend.both if isinstance(node.op, ast.And) else self._backend.either
        return reduce(combine, map(self._eval, node.values))

    def _comparison(self, node: ast.Compare) -> Any:
        values = [self._eval(part) for part in (node.left, *node.comparators)]
        unknown = next((op for op in node.ops if type(op) not in _COMPARISONS), None)
        if unknown is not None:
            raise InvalidExpression(f"comparison {type(unknown).__name__} is not available: use <, <=, >, >=")
        tests = [_COMPARISONS[type(op)](a, b) for op, a, b in zip(node.ops, values, values[1:], strict=False)]
        return reduce(self._backend.both, tests)


@dataclass(frozen=True)
class Expression:
    """A scalar function of the position, written as text.

    Args:
        text: for example ``"where(x[0] < 1, 0, -20)"``.

    Raises:
        ValueError: the text is no expression of the allowed syntax; the message says what is wrong and what is allowed.
    """

    text: str

    def __post_init__(self) -> None:
        if len(self.text) > _MAX_LENGTH:
            raise ValueError(f"expression of {len(self.text)} characters: at most {_MAX_LENGTH} are allowed")
        try:
            tree = ast.parse(self.text.strip(), mode="eval")
            for node in ast.walk(tree):
                if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
                    self._check_exponent(node.right)
            with np.errstate(all="ignore"):
                probe = self._evaluate(_NUMPY, np.array([[0.1, 0.7], [0.3, 0.9]]))
            if np.broadcast_shapes(np.shape(probe), (2,)) != (2,):
                raise InvalidExpression("the value is no scalar: use x[0] and x[1], not x")
        except SyntaxError as error:
            raise ValueError(f"{self.text!r}: syntax error at column {error.offset}: {error.msg}") from None
        except (InvalidExpression, TypeError, ValueError, ArithmeticError, AttributeError, RecursionError) as error:
            message = str(error) or type(error).__name__
            raise ValueError(
                f"{self.text!r}: {message}. Allowed are numbers, pi, x[0], x[1], + - * / **, < <= > >=, and, or, not, "
                f"A if C else B, and the functions {', '.join(sorted(_NUMPY.functions))}"
            ) from None

    @staticmethod
    def _check_exponent(node: ast.expr) -> None:
        """Towers of powers would take unbounded time with Python's integers."""
        if isinstance(node, ast.UnaryOp):
            node = node.operand
        if not isinstance(node, ast.Constant) or isinstance(node.value, str | complex):
            raise InvalidExpression("an exponent must be a number")
        if abs(node.value) > _MAX_EXPONENT:
            raise InvalidExpression(f"an exponent must not exceed {_MAX_EXPONENT}")

    def _evaluate(self, backend: _Backend, position: Any) -> Any:
        evaluator = _Evaluator(backend, position)
        return evaluator.eval(self.text, previously_parsed=ast.parse(self.text.strip(), mode="eval").body)

    def __call__(self, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Values at points ``x`` of shape (dim or 3, n), shape (n,)."""
        with np.errstate(all="ignore"):
            value = self._evaluate(_NUMPY, x)
        return np.broadcast_to(np.asarray(value, dtype=float), x.shape[1:]).copy()

    def ufl(self, mesh: Any) -> Any:
        """The same function as a UFL expression of ``SpatialCoordinate(mesh)``."""
        import ufl

        return self._evaluate(_ufl_backend(mesh), ufl.SpatialCoordinate(mesh))


def sample(value: Any, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Values of a number, an ``Expression`` or a callable at points ``x`` of shape (3, n), shape (n,)."""
    if isinstance(value, int | float):
        return np.full(x.shape[1], float(value))
    result = np.asarray(value(x), dtype=float)
    return np.broadcast_to(result, (x.shape[1],)).copy()
