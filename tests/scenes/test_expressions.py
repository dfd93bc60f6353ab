"""Expressions of the position: what they mean, in NumPy and in UFL, and what they refuse."""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from numpy.testing import assert_allclose, assert_array_equal

from signorini_fx.machine.compat import interpolation_points
from signorini_fx.mechanics.statement.expressions import Expression, sample

X = np.array([[-1.5, 0.0, 0.25, 1.0, 2.0], [0.5, -2.0, 0.25, 1.0, 3.0], [0.0] * 5])
x0, x1 = X[0], X[1]

MEANINGS = {
    "3": np.full(5, 3.0),
    "-x[0] + 2*x[1] - 1/4": -x0 + 2 * x1 - 0.25,
    "0.003*(x[0] - 1.5)**2 + 0.001": 0.003 * (x0 - 1.5) ** 2 + 0.001,
    "2**-2 * x[1]": x1 / 4,
    "pi": np.full(5, np.pi),
    "-20 if 1 <= x[0] <= 2 else 0": np.where((x0 >= 1) & (x0 <= 2), -20.0, 0.0),
    "where(x[0] < x[1], x[0], x[1])": np.minimum(x0, x1),
    "1 if x[0] < 1 and x[1] > 0 else 2": np.where((x0 < 1) & (x1 > 0), 1.0, 2.0),
    "1 if x[0] < 0 or not x[1] < 1 else 2": np.where((x0 < 0) | (x1 >= 1), 1.0, 2.0),
    "1 if (x[0] < 1) & (x[1] > 0) | (x[0] >= 2) else 2": np.where(
        ((x0 < 1) & (x1 > 0)) | (x0 >= 2), 1.0, 2.0
    ),
    "max(0.0015, x[0], x[1])": np.maximum(np.maximum(x0, x1), 0.0015),
    "min(x[0], 1)": np.minimum(x0, 1),
    "abs(x[0]) + sign(x[1])": np.abs(x0) + np.sign(x1),
    "sqrt(abs(x[0]))": np.sqrt(np.abs(x0)),
    "exp(x[0]) + log(4 + x[1])": np.exp(x0) + np.log(4 + x1),
    "sin(x[0]) - cos(x[1])": np.sin(x0) - np.cos(x1),
    "tan(x[0]) * tanh(x[1])": np.tan(x0) * np.tanh(x1),
    "abs(abs(x[0]))": np.abs(x0),
    "2**x[0] + (4 + x[0])**x[1]": 2**x0 + (4 + x0) ** x1,
    "1 if pi < 2*pi else 2": np.ones(5),
    "x[0] < x[1]": np.where(x0 < x1, 1.0, 0.0),
}


@pytest.mark.parametrize("text", MEANINGS)
def test_meaning(text):
    """NumPy evaluation gives one float a point and leaves the points alone."""
    points = X.copy()
    values = Expression(text)(points)
    assert values.dtype == float
    assert_allclose(values, MEANINGS[text], rtol=1e-15)
    assert_array_equal(points, X)


@pytest.mark.parametrize(("text", "at"), [("x[0]", 1.0), ("x[0]", 0.0), ("x[0]**2 + 3", 4.0)])
@pytest.mark.parametrize("away", [-3e-16, 0.0, 3e-16])
def test_comparisons_at_round_off(text, at, away):
    """A point that is on a jump but for round-off is on it, wherever its position was computed."""
    place = 1.0 if at == 4.0 else at
    points = np.array([[place + away, 5.0], [0.0, 0.0], [0.0, 0.0]])
    for op, turned, holds in (
        ("<=", ">=", True),
        (">=", "<=", True),
        ("<", ">", False),
        (">", "<", False),
    ):
        assert Expression(f"{text} {op} {at}")(points)[0] == holds
        assert Expression(f"{at} {turned} {text}")(points)[0] == holds


def test_numpy_and_compiled_ufl_agree():
    """Each expression, compiled by FFCx and evaluated at the nodes of P2, has the values of
    NumPy.
    """
    square = mesh.create_rectangle(
        MPI.COMM_SELF, [np.array([-1.0, -1.3]), np.array([2.1, 1.7])], [3, 4]
    )
    space = fem.functionspace(square, ("DG", 2, (len(MEANINGS),)))
    function = fem.Function(space)
    together = ufl.as_vector([Expression(text).ufl(square) for text in MEANINGS])
    function.interpolate(fem.Expression(together, interpolation_points(space.element)))
    points = space.tabulate_dof_coordinates().T
    for values, text in zip(function.x.array.reshape(-1, len(MEANINGS)).T, MEANINGS, strict=True):
        assert_allclose(values, Expression(text)(points), rtol=1e-13, atol=1e-13, err_msg=text)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1 +",
        "y",
        "x",
        "x[3]",
        "x[-1]",
        "x[1.0]",
        "x[True]",
        "x[0:1]",
        "x[0][0]",
        "x.shape",
        "'a'",
        "True",
        "1j",
        "[1, 2]",
        "(1, 2)",
        "lambda: 1",
        "x[0] = 1",
        "f'{1}'",
        "1e999",
        "x[0] == 1",
        "x[0] % 2",
        "x[0] @ x[1]",
        "min()",
        "sin",
        "where(x[0] < 1, sin, cos)",
        "sin(x[0], x[1])",
        "sin(x[0], out=x[1])",
        "where(x[0] < 1)",
        "1 if x[0] else 2",
        "where(x[0], 1, 2)",
        "not x[0]",
        "5 and 3",
        "1 if (x[0] & 1) else 2",
        "20 * (x[0] < 1)",
        "open('/etc/passwd')",
        "__import__('os').system('true')",
        "import os",
        "().__class__",
        "(" * 300 + "1" + ")" * 300,
        "-" * 1900 + "1",
        "x[0]" + " + x[0]" * 2000,
    ],
)
def test_refused(text):
    """No expression of the allowed syntax: a ValueError, before any of it runs."""
    with pytest.raises(ValueError, match=r"(?i)allowed|syntax error"):
        Expression(text)


def test_refusal_says_what_is_allowed():
    """The message names the mistake and the functions there are."""
    with pytest.raises(
        ValueError, match=r"'sinh' of 1 argument is not available.*Allowed are .*x\[0\].*tanh"
    ):
        Expression("sinh(x[0])")


def test_undefined_values():
    """What is not defined somewhere is inf or nan there, never an exception: who uses it says
    where.
    """
    assert np.isinf(Expression("1/0")(X)).all()
    assert np.isnan(Expression("(-1)**0.5")(X)).all()
    assert np.isnan(Expression("sqrt(x[0])")(X)).tolist() == [True, False, False, False, False]


def test_sample():
    """Numbers, expressions and callables become one value a point."""
    for value, expected in (
        (2.0, np.full(5, 2.0)),
        (Expression("x[1]"), x1),
        (lambda x: x[0] ** 2, x0**2),
        (lambda x: 3, np.full(5, 3.0)),
    ):
        assert_array_equal(sample(value, X), expected)
