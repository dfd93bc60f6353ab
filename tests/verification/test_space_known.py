"""Answers in 3D that are known without this package: Hertz, and torsion with a stick radius that moves in."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scene_tables import box_mesh, fixed
from scenes import alone
from spaces import box, disc, friction_of
from torsion_oracle import torsion

from signorini_fx.scenes.reading import parse_scene


def test_hertz():
    """A sphere (as a paraboloid) on a block: largest pressure and radius of contact for the force.

    A quarter of the block; finite size enters with the third power of a over it.
    """
    young, poisson, radius, n = 1000.0, 0.3, 1.0, 14
    tagged = box("hexahedra", (n, n, n), size=(1.0, 1.0, 1.0))
    tagged.mesh.geometry.x[:] = tagged.mesh.geometry.x**1.8
    scene = parse_scene(
        {
            "mesh": tagged,
            "material": {"young": young, "poisson": poisson},
            "displacement": [
                {"boundary": "left", "normal": 0.0},
                {"boundary": "front", "normal": 0.0},
                {"boundary": "top", "z": -0.012},
            ],
            "contact": {"boundary": "bottom", "gap": f"(x[0]**2 + x[1]**2) / (2 * {radius})"},
        }
    )
    solution = alone(scene)
    force = 4 * solution.contact.forces[0][2]
    modulus = young / (1 - poisson**2)
    a = (3 * force * radius / (4 * modulus)) ** (1 / 3)
    peak = 3 * force / (2 * np.pi * a**2)
    assert 0.08 < a < 0.2
    assert solution.table.columns["pressure"].max() == pytest.approx(peak, rel=0.02)
    columns = solution.table.columns
    r = np.hypot(columns["x"], columns["y"])
    # The mean distance of the force from the axis is 3 pi / 16 a; an area of whole nodes would be off by one of them.
    mean = np.average(r, weights=columns["weight"] * columns["pressure"])
    assert 16 / (3 * np.pi) * mean == pytest.approx(a, rel=0.02)
    expected = peak * np.sqrt(np.maximum(1 - (r / a) ** 2, 0.0))
    inside = r < 0.5 * a
    assert_allclose(columns["pressure"][inside], expected[inside], rtol=0, atol=0.03 * peak)


@pytest.mark.slow
def test_hertz_on_curved_quadratic_tetrahedra():
    """A quarter of half a sphere, pressed on a plane by its flat top; the cells follow the sphere."""
    young, poisson, radius = 1000.0, 0.3, 8.0
    parameters = {
        "radius": radius,
        "size": 3.0,
        "contact_size": 0.15,
        "part": "quarter",
        "order": 2,
    }
    scene = parse_scene(
        {
            "mesh": {"generator": "half_sphere", "parameters": parameters},
            "element": {"degree": 2},
            "material": {"young": young, "poisson": poisson},
            "displacement": [
                {"boundary": "symmetry_x", "normal": 0.0},
                {"boundary": "symmetry_y", "normal": 0.0},
                {"boundary": "top", "z": -0.1},
            ],
            "contact": {"boundary": "sphere", "gap": "x[2]", "direction": [0.0, 0.0, -1.0]},
        }
    )
    solution = alone(scene)
    columns = solution.table.columns
    force = 4 * columns["weight"] @ columns["pressure"]
    assert force == pytest.approx(4 * solution.contact.forces[0][2])
    a = (3 * force * radius * (1 - poisson**2) / (4 * young)) ** (1 / 3)
    peak = 3 * force / (2 * np.pi * a**2)
    r = np.hypot(columns["x"], columns["y"])
    mean = np.average(r, weights=columns["weight"] * columns["pressure"])
    assert 16 / (3 * np.pi) * mean == pytest.approx(a, rel=0.01)
    assert columns["pressure"].max() == pytest.approx(peak, rel=0.01)
    inside = r < 0.5 * a
    assert inside.sum() > 10
    expected = peak * np.sqrt(1 - (r[inside] / a) ** 2)
    assert_allclose(columns["pressure"][inside], expected, rtol=0, atol=0.02 * peak)


CURVATURE = 1e-3
CYLINDER = {
    "shape": "cylinder",
    "radius": 1 / CURVATURE,
    "centre": [0.0, 0.0, -1 / CURVATURE],
    "axis": [0.0, 1.0, 0.0],
}


@pytest.mark.parametrize(("law", "poisson"), [({}, 0.3), ({}, 0.0), ({"law": "neo-hooke"}, 0.3)])
def test_a_bent_block_presses_evenly_on_a_foundation_of_its_shape(law, poisson):
    """Pure bending and compression, which quadratic tetrahedra have exactly: the pressure is that of the compression.

    Without Poisson's effect the foundation is a cylinder.
    """
    young, pressure = 1000.0, 0.5
    press, bent = pressure / young, f"{CURVATURE / 2} * (x[0]**2 - {poisson} * x[1]**2)"
    moved = {
        "x": f"({CURVATURE} * x[2] + {poisson * press}) * x[0]",
        "y": f"{poisson} * (-{CURVATURE} * x[2] + {press}) * x[1]",
        "z": f"-{press} * x[2] - {bent} - {poisson * CURVATURE / 2} * x[2]**2",
    }
    parameters = {"nx": 3, "ny": 3, "nz": 2, "length": 1.0, "cell": "tetrahedron"}
    scene = parse_scene(
        {
            "mesh": box_mesh(**parameters),
            "element": {"degree": 2},
            "material": {"young": young, "poisson": poisson} | law,
            "displacement": [
                {"boundary": name, **moved} for name in ("left", "right", "front", "back", "top")
            ],
            "contact": {"boundary": "bottom"}
            | ({"gap": bent} if poisson else {"foundation": CYLINDER}),
            "solver": {"algorithm": "alm"},
        }
    )
    columns = alone(scene).table.columns
    inner = (np.abs(columns["x"] - 0.5) < 0.4) & (np.abs(columns["y"] - 0.5) < 0.4)
    assert_allclose(columns["pressure"][inner], pressure, rtol=5e-3)


@pytest.mark.parametrize(("left", "right"), [(0.0, 0.05), (0.05, 0.0)])
def test_a_step_of_the_foundation_presses_on_nothing_beside_it(left, right):
    """A gap that jumps within a row of quadratic tetrahedra: each point has that of its vertex, and
    a block at rest on the higher part is not pressed.
    """
    parameters = {"nx": 6, "ny": 3, "nz": 2, "length": 2.0, "cell": "tetrahedron"}
    scene = parse_scene(
        {
            "mesh": box_mesh(**parameters),
            "element": {"degree": 2},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": fixed("top", "xyz"),
            "contact": {"boundary": "bottom", "gap": f"{left} if x[0] < 1.1 else {right}"},
        }
    )
    columns = alone(scene).table.columns
    assert columns["pressure"].max() == 0.0
    assert_array_equal(columns["gap"], np.where(columns["x"] < 1.1, left, right))


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.9, 2.0])
def test_torsion(share):
    """M(phi) of a pressed cylinder whose stick radius moves in, to half a per cent of a scalar problem in (r, z).

    nu = 0, so that the press itself makes no shear; slip begins at phi = q H / (G a).
    """
    young, height, bound = 1000.0, 0.5, 3.0
    modulus = young / 2
    phi = share * bound * height / modulus
    scene = parse_scene(
        {
            "mesh": disc(n=20, height=height, layers=8),
            "material": {"young": young, "poisson": 0.0},
            "displacement": {
                "boundary": "top",
                "x": f"{-phi} * x[1]",
                "y": f"{phi} * x[0]",
                "z": -0.005,
            },
            "contact": {"boundary": "bottom", "friction": friction_of(bound=bound)},
        }
    )
    solution = alone(scene)
    torque = solution.contact.moments[1][2]
    assert abs(torque) == pytest.approx(torsion(modulus, height, bound, phi).torque, rel=5e-3)
    states = solution.table.columns["friction"]
    r = np.hypot(solution.table.columns["x"], solution.table.columns["y"])
    if share < 1:
        assert set(states) == {"stick"}
        assert abs(torque) == pytest.approx(np.pi / 2 * modulus * phi / height, rel=5e-3)
    else:
        assert r[states == "slip"].min() > r[states == "stick"].max() - 0.15
    assert abs(torque) < 2 / 3 * np.pi * bound * 1.01
