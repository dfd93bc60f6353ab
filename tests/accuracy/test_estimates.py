"""What is estimated on one mesh, piece by piece: loads, kinks of the pressure, and sums."""

import numpy as np
import pytest
from scene_tables import fixed, rectangle_mesh, tresca_friction
from scenes import alone, prepared, table_of
from scipy.integrate import quad

from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.kinematics import AXISYMMETRIC
from signorini_fx.results.accuracy.error_estimates import estimate_errors, missed_loads
from signorini_fx.results.accuracy.pressure_error import interval_squares
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.tuned import POLLUTION

NX = 4


def block(bound=5.0, gap=0.0, **traction):
    """A block of 3 x 1 in cells of 0.75, pressed on its foundation and pushed aside."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(NX, 2),
            "material": {"young": 5000.0, "poisson": 0.3},
            "traction": [{"boundary": "top", "y": -20.0}, {"boundary": "left", **traction}],
            "displacement": fixed("right", "x"),
            "contact": {"boundary": "bottom", "gap": gap, "friction": tresca_friction(bound)},
        }
    )


def gauss(count, f):
    """The integral over [0, 1] of a function by so many points."""
    x, w = np.polynomial.legendre.leggauss(count)
    return np.dot(w, f((x + 1) / 2)) / 2


def test_loads_that_the_quadrature_misses():
    """What a jump within a facet is worth in each load step, and nothing for loads that are
    integrated exactly.
    """
    scene = block(x="3 if x[1] < 0.3 else 1 + x[1]", factors=[1.0, -2.0])
    d = prepared(scene)
    missed, twice = (missed_loads(d, step) for step in range(2))
    side = lambda x: np.where(x / 2 < 0.3, 3.0, 1 + x / 2) / 2  # noqa: E731
    expected = abs(gauss(31, side) - gauss(11, side))
    assert expected > 1e-3
    assert np.sort(missed)[-2:] == pytest.approx([0.0, expected], abs=1e-12)
    np.testing.assert_allclose(twice, 2 * missed, rtol=1e-12, atol=1e-14)


def test_what_is_missed_is_part_of_the_estimates():
    """The error of the displacement has the loads in it, and the cells know what they are to be
    divided for.
    """
    solution = alone(block(x="3 if x[1] < 0.3 else 1"))
    energy = solution.steps[-1].strain_energy
    errors = estimate_errors(
        solution.mechanics, solution.displacement, energy, table_of(solution), 0
    )
    assert errors.loads > 1e-4
    total = {name: squares.sum() for name, squares in errors.squares.items()}
    body = total["energy"] - errors.loads**2
    assert errors.energy == pytest.approx(np.sqrt(body) + errors.loads)
    boundary = (errors.pressure - errors.loads) ** 2 - body**2
    assert total["pressure"] == pytest.approx(boundary + POLLUTION**2 * body**2 + errors.loads**2)


def straight(s, pressure):
    """A straight boundary with these pressures."""
    s, pressure = np.asarray(s, dtype=float), np.asarray(pressure, dtype=float)
    return ContactTable(
        {"s": s, "pressure": pressure, "weight": np.full(s.size, 1.0)}, [range(s.size)]
    )


def test_kinks_of_a_smooth_pressure():
    """In sum 120 / 33 times the squared error of the interpolant, which is h^4 |p''|^2 / 120."""
    s = np.linspace(-1.0, 1.0, 65)
    [squares] = interval_squares(straight(s, (1 - s**2) ** 3))
    curvature, _ = quad(lambda x: (-6 + 36 * x**2 - 30 * x**4) ** 2, -1, 1)
    assert squares.sum() == pytest.approx((2 / 64) ** 4 * curvature / 33, rel=0.02)


def test_rings():
    """In a body of revolution the integral of an estimate is over rings, whatever the unit of
    length is: that of a pressure on a plane, and that of a solution.
    """
    r = np.linspace(0.0, 1.0, 65)
    table = straight(r, (1 - r**2) ** 3)
    table.columns.update(x=r, y=0 * r)
    [squares] = interval_squares(table, AXISYMMETRIC)
    curvature, _ = quad(lambda r: 2 * np.pi * r * (-6 + 36 * r**2 - 30 * r**4) ** 2, 0, 1)
    assert squares.sum() == pytest.approx((1 / 64) ** 4 * curvature / 33, rel=0.03)
    errors = []
    for unit in (1.0, 1e3):
        data = {
            "mesh": rectangle_mesh(12, 6, length=unit, height=unit / 2),
            "material": {"young": 1000.0, "poisson": 0.3, "hypothesis": "axisymmetric"},
            "displacement": [fixed("left", "x"), {"boundary": "top", "x": 0.0, "y": -0.03 * unit}],
            "contact": {
                "boundary": "bottom",
                "gap": f"x[0]**2 / {4 * unit} + where(abs(x[0] - {0.22 * unit}) < {0.01 * unit}, "
                f"{1e-3 * unit}, 0)",
                "friction": tresca_friction(f"20 + 10*sin(40*x[0]/{unit})"),
            },
        }
        solution = alone(parse_scene(data))
        energy = solution.steps[-1].strain_energy
        d = solution.mechanics
        errors.append(estimate_errors(d, solution.displacement, energy, table_of(solution), 0))
    for name in ("energy", "pressure"):
        assert getattr(errors[0], name) == pytest.approx(getattr(errors[1], name), rel=1e-6), name
    for name, squares in errors[0].squares.items():
        np.testing.assert_allclose(
            squares, errors[1].squares[name], rtol=1e-5, atol=1e-9 * squares.max()
        )


@pytest.mark.parametrize("count", [6, 41])
@pytest.mark.parametrize("end", [0.2, 0.7])
def test_a_pressure_of_bending(end, count):
    """A pressure that falls along a line up to the end of the boundary is no singularity there: no
    error is told.
    """
    r = 0.1 * np.arange(count)
    [squares] = interval_squares(straight(r, 1.0 - (1.0 - end) * r / r[-1]))
    assert squares.max() < 1e-20


def projected(pressure, count):
    """The projection in L2 of a pressure on (0, 1) onto ``count`` intervals, its squared error, and
    its square.
    """
    nodes, weights = np.polynomial.legendre.leggauss(16)
    ends = (
        np.append(2.0 ** -np.arange(120.0, 0.0, -1.0), np.arange(1.0, count + 1)) / count
    )  # ever closer to the corner
    ends = np.unique(np.append(0.0, ends))
    r = (ends[:-1, None] + np.diff(ends)[:, None] * (nodes + 1) / 2).ravel()
    w = (np.diff(ends)[:, None] * weights / 2).ravel()
    hats = np.maximum(0.0, 1.0 - np.abs(r * count - np.arange(count + 1)[:, None]))
    values, p = pressure(r), np.linalg.solve((hats * w) @ hats.T, (hats * w) @ pressure(r))
    return p, w @ (values - p @ hats) ** 2, w @ values**2


def estimated(p):
    """The squared error of nodal values on (0, 1)."""
    return interval_squares(straight(np.linspace(0.0, 1.0, len(p)), p))[0].sum()


@pytest.mark.parametrize("count", [8, 40])
@pytest.mark.parametrize("power", [0.1, 0.3, 0.45])
def test_a_pressure_without_bound_at_a_corner(power, count):
    """Of a power of the distance the estimate is within a factor of three of the error."""
    p, missed, _ = projected(lambda r: r**-power, count)
    assert 1 / 3 < np.sqrt(estimated(p) / missed) < 3


@pytest.mark.slow
def test_any_number_of_loads_and_supports():
    """Seventy equal loads, and the same support said seventy times, are one load and one support in
    every estimate.
    """
    one, many = block(x=3.0), block(x=3.0)
    _, push = one.traction
    (held,) = one.displacement
    update = {
        "traction": (one.traction[0], *[push.model_copy(update={"x": 3.0 / 70})] * 70),
        "displacement": (held,) * 70,
    }
    many = one.model_copy(update=update)
    errors = [alone(scene).stress.error for scene in (one, many)]
    assert errors[1] == pytest.approx(errors[0], rel=1e-9)
