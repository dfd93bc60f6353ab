"""Moduli that vary within a material, and the mixed element: exact states, and displacements alone."""

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, rectangle
from test_axisymmetric import section
from test_graded import cylinder
from test_mixed_materials import halves
from test_springs import PLANE, body

from signorini_fx import SceneError
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
MIXED = {"degree": 2, "volumetric": "mixed"}
YOUNG, PRESSURE = 5000.0, 3.0


@pytest.mark.mpi
@pytest.mark.parametrize("linear_algebra", ["full", "condensed"])
@pytest.mark.parametrize("cells", ["quadrilateral", "hexahedra"])
def test_bar_between_walls(cells, linear_algebra):
    """It shortens by the integral of p (1 + nu) (1 - 2 nu) / (E (1 - nu)), by the midpoint rule, and its stress does
    not depend on E.
    """
    nu = 0.3
    axes = "y" if cells in PLANE else "yz"
    sides = [("bottom", "top")] if cells in PLANE else [("front", "back"), ("bottom", "top")]
    walls = [{"boundary": side, axis: 0.0} for axis, both in zip(axes, sides, strict=True) for side in both]
    given = parse_scene(
        {
            "mesh": body(cells),
            "element": MIXED,
            "material": {"young": YOUNG, "poisson": nu, "grading": "1 / (1 + 0.5*x[0])"},
            "displacement": walls,
            "traction": {"boundary": "right", "pressure": PRESSURE},
            "contact": {"boundary": "left"},
            "solver": {"algorithm": "alm", "linear_algebra": linear_algebra},
        }
    )
    solution = solve(given, COMM)
    assert solution.certificate.worst < 1e-9
    x = solution.displacement.function_space.tabulate_dof_coordinates()
    end = np.isclose(x[:, 0], 2.0)
    shortened = PRESSURE / YOUNG * (1 + nu) * (1 - 2 * nu) / (1 - nu) * (2 + 0.25 * 4)
    assert -solution.displacement.x.array.reshape(len(x), -1)[end, 0] == pytest.approx(shortened, rel=1e-9)
    assert solution.contact.pressure == pytest.approx(PRESSURE, rel=1e-8)
    lateral = PRESSURE * nu / (1 - nu)
    assert solution.displacement.hydrostatic.x.array == pytest.approx(lateral, rel=1e-9)
    tensor = solution.stress.tensor.x.array.reshape(-1, 3, 3)
    expected = np.diag([-PRESSURE, -lateral, -lateral])
    np.testing.assert_allclose(tensor, np.broadcast_to(expected, tensor.shape), atol=1e-8)
    assert solution.certificate.strain_energy == pytest.approx(PRESSURE * shortened / 2, rel=1e-9)


def test_cylinder():
    """At nu = 0.3 the displacement of a cylinder under pressure is of the second order, as without a pressure."""
    errors = [cylinder(n, 1.5, **MIXED) for n in (8, 16)]
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] > 3.4


def rubber_tube(n, power, unit=1.0):
    """Relative errors of displacement and pressure of a tube of nu = 1/2 under a pressure inside.

    U = c / r, with the shear modulus mu = mu_b (r / b)^n and sigma_r = -p + 4 mu_b c (r^(n-2) - a^(n-2)) / ((n-2) b^n).
    """
    a, b, young = 1.0, 2.0, YOUNG * unit
    given = {
        "mesh": section(a, b, 0.25, counts=(n, 2), comm=MPI.COMM_SELF),
        "element": MIXED,
        "material": {
            "young": young,
            "poisson": 0.5,
            "hypothesis": "axisymmetric",
            "grading": lambda x: (x[0] / b) ** power,
        },
        "displacement": [{"boundary": side, "y": 0.0} for side in ("top", "bottom")],
        "traction": {"boundary": "inside", "pressure": PRESSURE * unit},
    }
    solution = alone(parse_scene(given))
    assert solution.certificate.worst < 1e-8
    r = solution.displacement.function_space.tabulate_dof_coordinates()[:, 0]

    def grown(at):
        return 4 * YOUNG / 3 * (at ** (power - 2) - a ** (power - 2)) / ((power - 2) * b**power)

    c = PRESSURE / grown(b)
    u = solution.displacement.x.array.reshape(len(r), -1)[:, 0]
    p = solution.displacement.hydrostatic
    at = p.function_space.tabulate_dof_coordinates()[:, 0]
    mu = YOUNG / 3 * (at / b) ** power
    exact = PRESSURE - c * grown(at) - 2 * mu * c / at**2
    return np.array([np.abs(u - c / r).max() / c, np.abs(p.x.array / unit - exact).max() / PRESSURE])


def test_rubber_tube():
    """The displacement is of the second order; the pressure is of the first, as moduli are constant in cells."""
    errors = [rubber_tube(n, 1.5) for n in (8, 16)]
    assert (np.divide(*errors) > [3.4, 1.9]).all()
    assert (errors[1] < [2e-3, 0.03]).all()
    np.testing.assert_allclose(rubber_tube(8, 1.5, 1e-6), errors[0], rtol=1e-6)


@pytest.mark.one_quick
@pytest.mark.parametrize("poisson", [0.3, 0.5])
def test_a_constant_is_a_smaller_modulus(poisson):
    """Half of E and of nu by grading, in one region of two, heated, with friction, is half of them."""
    half = {"grading": "0.5 + 0*x[0]", "poisson_grading": "0.5 + 0*x[0]"}

    def of(**second):
        given = {
            "mesh": halves("quadrilateral", MPI.COMM_SELF),
            "element": MIXED,
            "material": [
                {"young": 10.0, "poisson": poisson, "expansion": 0.004, "region": "left"},
                {"expansion": 0.001, "region": "right", **second},
            ],
            "displacement": [{"boundary": "low0", "x": 0.0}, {"boundary": "high1", "y": -0.05}],
            "temperature": {"change": "2 + x[1]"},
            "contact": {"boundary": "low1", "friction": {"law": "coulomb", "coefficient": 0.3}},
        }
        return alone(parse_scene(given))

    graded, plain = of(young=8.0, poisson=0.4, **half), of(young=4.0, poisson=0.2)
    assert graded.certificate.worst < 1e-6
    for name in ("displacement", "hydrostatic"):
        one, other = (s.displacement if name == "displacement" else s.displacement.hydrostatic for s in (graded, plain))
        assert one.x.array == pytest.approx(other.x.array, rel=1e-8, abs=1e-10)
    assert graded.last_step.strain_energy == pytest.approx(plain.last_step.strain_energy, rel=1e-9)
    for name in ("tensor", "von_mises"):
        ours, theirs = (getattr(one.stress.recovered, name).x.array for one in (graded, plain))
        assert ours == pytest.approx(theirs, abs=1e-5 * np.abs(theirs).max())
    assert graded.stress.error == pytest.approx(plain.stress.error, rel=1e-6)


def test_refused():
    """A Poisson's ratio of zero somewhere: its pressure is not one of the unknowns."""
    given = {
        "mesh": rectangle(MPI.COMM_SELF, length=2.0, height=1.0, nx=2, ny=2),
        "element": MIXED,
        "material": {"young": 1.0, "poisson": 0.4, "poisson_grading": "where(x[0] < 1, 0, 1)"},
        "displacement": {"boundary": "top", "x": 0.0, "y": 0.0},
    }
    with pytest.raises(SceneError, match=r"poisson_grading.*must be above 0 and at most 1"):
        alone(parse_scene(given))


@pytest.mark.mpi
def test_enclosed():
    """A body that is held all around is refused where nu = 1/2 in all of its cells, and solved where in some."""

    def held(grading):
        tagged = rectangle(COMM, length=2.0, height=1.0, nx=4, ny=2)
        return parse_scene(
            {
                "mesh": tagged,
                "element": MIXED,
                "material": {"young": 10.0, "poisson": 0.5, "poisson_grading": grading},
                "displacement": [{"boundary": side, "x": 0.0, "y": 0.0} for side in ("left", "right", "bottom", "top")],
                "body_force": {"x": 1.0},
            }
        )

    with pytest.raises(SceneError, match="nothing determines the pressure"):
        solve(held("1 + 0*x[0]"), COMM)
    assert solve(held("where(x[0] < 1, 1, 0.8)"), COMM).certificate.worst < 1e-9
