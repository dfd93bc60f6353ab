"""Guaranteed bounds against closed forms: the r^(3/2) where contact and stick end, a receding layer, a cylinder on a
layer.
"""

import sys
from pathlib import Path

import error_bounds
import numpy as np
import pytest
from scenes import alone

from signorini_fx.addons.bounds.error_bound import Bounded
from signorini_fx.scenes.reading import parse_scene

sys.path.insert(0, str(Path(__file__).parents[2] / "demos" / "studies"))

import bounds_of_closed_forms as study

# Derived independently, to their last digits: strain energy and force.
KNOWN = {"contact ends": (0.06465904, 6.666667), "stick ends": (0.30537150, 39.2)}
FIELDS = pytest.mark.parametrize("name", study.FIELDS)


@FIELDS
def test_the_fields_are_in_equilibrium_and_their_tractions_are_theirs(name):
    """The divergence vanishes, expressions of the scene have the stress, and contact has its conditions."""
    field = study.FIELDS[name]
    chance = np.random.default_rng(0)
    x, y, h = chance.uniform(-1, 1, 50), chance.uniform(0.1, 1, 50), 1e-5
    by_x, by_y = (
        (field.stress(x + a * h, y + b * h) - field.stress(x - a * h, y - b * h)) / (2 * h) for a, b in ((1, 0), (0, 1))
    )
    np.testing.assert_allclose(by_x[0] + by_y[2], 0, atol=1e-6)
    np.testing.assert_allclose(by_x[2] + by_y[1], 0, atol=1e-6)
    points = {"x": [x, y], "sqrt": np.sqrt, "max": np.maximum}
    for text, stress in zip(field.tractions, field.stress(x, y)[[0, 1, 2]], strict=True):
        np.testing.assert_allclose(eval(text, {}, points), stress, rtol=1e-12)
    open_side, closed = (field.stress(side * chance.uniform(0.1, 1, 20), np.zeros(20)) for side in (-1, 1))
    if name == "contact ends":
        assert (closed[1] < 0).all()
        np.testing.assert_allclose(open_side[1:], 0, atol=1e-12)
        np.testing.assert_allclose(closed[2], 0, atol=1e-12)
    else:
        assert (np.abs(closed[2]) < study.BOUND).all()
        np.testing.assert_allclose(open_side[2], study.BOUND)
        assert max(open_side[1].max(), closed[1].max()) < 0


@pytest.mark.one_quick
@FIELDS
@pytest.mark.parametrize(("degree", "largest"), [(1, (1.15, 1.07)), (2, (1.6, 1.5))])
def test_a_bound_over_the_true_error(name, degree, largest):
    """It holds, is so little larger that one with a tenth (degree 2: a third) less is refuted, and encloses the energy;
    errors decrease with the rate of r^(3/2).
    """
    coarse, fine = (study.row_of(name, n, degree) for n in (4, 8))
    energy, force = KNOWN[name]
    for row, most in zip((coarse, fine), largest, strict=True):
        assert 1 < row.ratio < most
        assert row.least_energy < energy < row.greatest_energy
        assert row.energy == pytest.approx(energy, rel=1e-6)
        assert row.force == pytest.approx(force, rel=1e-6)
    rate = np.log2(coarse.true / fine.true)
    assert rate == pytest.approx({1: 1.0, 2: 1.5}[degree], abs=0.06)


# Half of a layer of height 1 under P / 2 on x < b; b: half width of the contact, p(0) / P, mean of x^2 under p.
RECEDING = {0.5: (1.007782, 0.789588, 0.1990711), 1.0: (1.402159, 0.523389, 0.4085977)}


def receding(b, *, nx, ny, degree):
    return parse_scene(
        {
            "mesh": {
                "generator": "rectangle",
                "parameters": {"length": 6.0, "height": 1.0, "nx": nx, "ny": ny, "cell": "triangle"},
            },
            "element": {"degree": degree},
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": {"boundary": "left", "x": 0.0},
            "traction": {"boundary": "top", "pressure": f"{0.5 / b} if x[0] <= {b} else 0"},
            "contact": {"boundary": "bottom"},
            "solver": {"algorithm": "alm"},
        }
    )


def moments(solution):
    """Of the contact pressure over x > 0: its force, the mean of x^2, its largest value."""
    c = solution.table.columns
    force = np.dot(c["weight"], c["pressure"])
    return force, np.dot(c["weight"], c["pressure"] * c["x"] ** 2) / force, c["pressure"].max()


@pytest.mark.slow
@pytest.mark.parametrize("b", RECEDING)
def test_a_receding_layer(b):
    """A zone that no load changes; the bound holds against a nested reference."""
    wide, peak, mean = RECEDING[b]
    fine = alone(receding(b, nx=96, ny=16, degree=2))
    force, found, largest = moments(fine)
    assert force == pytest.approx(0.5, rel=1e-6)
    assert found == pytest.approx(mean, rel=2e-3)
    assert largest == pytest.approx(peak, rel=5e-3)
    c = fine.table.columns
    assert c["x"][c["pressure"] > 0].max() == pytest.approx(wide, abs=6 / 192)
    for degree in (1, 2):
        found = error_bounds.effectivity(receding(b, nx=24, ny=4, degree=degree))
        assert not isinstance(found, str), found
        assert 1 < found[0] < 2


# A parabola x^2 / (2 R) on a layer of height h that is bonded to its base, nu = 0.3: the half width over h,
# P R / (E* h^2) and p(0) R / (E* h).
ON_LAYER = {1.0: (1.221797, 0.804884), 2.0: (7.912153, 2.756023)}


def on_layer(deep, *, nx, ny, degree):
    return parse_scene(
        {
            "mesh": {
                "generator": "rectangle",
                "parameters": {"length": 6.0, "height": 1.0, "nx": nx, "ny": ny, "cell": "triangle"},
            },
            "element": {"degree": degree},
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": [{"boundary": "bottom", "x": 0.0, "y": 0.0}, {"boundary": "left", "x": 0.0}],
            "contact": {"boundary": "top", "gap": f"x[0]**2 / 200 - {deep}"},
            "solver": {"algorithm": "alm"},
        }
    )


@pytest.mark.slow
@pytest.mark.parametrize("wide", ON_LAYER)
def test_a_cylinder_on_a_layer(wide):
    """The force that belongs to the width, the pressure in the middle; the bound holds against a nested reference."""
    force, peak = ON_LAYER[wide]
    unit = 100 / (1 - 0.3**2) / 100  # E* h / R

    def beyond(deep):
        return 2 * moments(alone(on_layer(deep, nx=72, ny=12, degree=2)))[0] / unit - force

    first, second = wide**2 / 300, wide**2 / 250
    values = beyond(first), beyond(second)
    for _ in range(4):
        third = second - values[1] * (second - first) / (values[1] - values[0])
        first, second, values = second, third, (values[1], beyond(third))
    fine = alone(on_layer(second, nx=72, ny=12, degree=2))
    assert values[1] == pytest.approx(0, abs=1e-4 * force)
    c = fine.table.columns
    assert c["pressure"].max() / unit == pytest.approx(peak, rel=5e-3)
    assert c["x"][c["pressure"] > 0].max() == pytest.approx(wide, abs=6 / 72)
    for degree in (1, 2):
        found = error_bounds.effectivity(on_layer(second, nx=24, ny=4, degree=degree))
        assert not isinstance(found, str), found
        assert 1 < found[0] < 2.5


def test_coulomb_has_the_second_field_without_a_change_of_volume():
    """Mixed elements come to its force, shear and slip; without a change of volume they have no bound."""
    solution = alone(study.scene_of(study.COULOMB, 8, 2))
    c = solution.table.columns
    assert np.dot(c["weight"], c["pressure"]) == pytest.approx(40.0, rel=1e-6)
    assert abs(np.dot(c["weight"], c["shear"])) == pytest.approx(8.0, rel=1e-4)
    assert np.abs(c["slip"])[np.argmin(c["x"])] == pytest.approx(0.003, rel=5e-3)
    assert c["x"][c["state"] == "stick"].min() == pytest.approx(0.0, abs=1 / 8)
    assert "cannot change its volume" in solution.error_bound


def test_problem_of_the_study():
    """Of the triangles of a degree 2 the error is that of the whole displacement."""
    field = study.FIELDS["contact ends"]
    solution = alone(study.scene_of(field, 2, 2))
    problem = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    error, size = study.true_error(field, problem)
    flat = study.true_error(field, _without_bubbles(problem))[0]
    assert size**2 / 2 == pytest.approx(0.06465904, rel=1e-5)
    assert error < flat


def _without_bubbles(problem):
    problem.middle = problem.y[problem.t.edges].mean(axis=1)
    return problem
