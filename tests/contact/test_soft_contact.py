"""Contact that gives way under its pressure: closed forms, other formulas of its laws, what it does
not go with.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scene_tables import coulomb_friction, fixed, rectangle_mesh

from signorini_fx import sensitivity
from signorini_fx.errors import SceneError
from signorini_fx.scenes.reading import as_scene
from signorini_fx.scenes.solver import solve

YOUNG = 1000.0
LAW = {"law": "linear", "stiffness": 100.0}


def block(law, pressure=-5.0, **more):
    """A square that is pressed on a foundation."""
    data = {
        "mesh": rectangle_mesh(4, 4, length=1.0, height=1.0),
        "material": {"young": YOUNG, "poisson": 0.0},
        "traction": [{"boundary": "top", "y": pressure}],
        "displacement": [fixed("left", "x")],
        "contact": [{"boundary": "bottom", "overclosure": law}],
    }
    return as_scene(data | more)


@pytest.mark.parametrize("gap", [0.0, 0.004, -0.004])
def test_uniform_pressure(gap):
    """The block sinks by what the law says of the pressure, the gap, and its own compression."""
    solution = solve(block(LAW, contact=[{"boundary": "bottom", "overclosure": LAW, "gap": gap}]))
    assert solution.certificate.holds
    assert_allclose(solution.contact.pressure, 5.0, rtol=1e-8)
    top = solution.displacement.x.array[1::2].min()
    assert top == pytest.approx(-0.05 - gap - 5.0 / YOUNG, rel=1e-7)


@pytest.mark.parametrize(
    "more", [{}, {"element": {"degree": 2}}, {"solver": {"linear_algebra": "krylov"}}]
)
def test_pressures_of_each_point(more):
    """Under a load that varies and friction each pressure is that of its own overclosure, and all
    together balance.
    """
    contact = [{"boundary": "bottom", "overclosure": LAW, "friction": coulomb_friction(0.2)}]
    solution = solve(block(LAW, "-20*x[0]*x[0]", contact=contact, **more))
    assert solution.certificate.holds
    state = solution.contact
    assert np.ptp(state.pressure) > 0.2
    h = state.u_n - state.gap
    assert_allclose(state.pressure, 100.0 * np.maximum(h, 0.0), rtol=1e-6, atol=1e-9)
    assert state.pressure @ state.boundary.weight == pytest.approx(20.0 / 3.0, rel=1e-8)


def test_two_stiffnesses():
    """Each contact has its own: two feet share a load that a stiff lid spreads as their stiffnesses
    do.
    """
    mesh = rectangle_mesh(1, 2, length=0.01, height=1.0)
    data = {
        "body": [{"name": "one", "mesh": mesh}, {"name": "two", "mesh": mesh, "shift": [1.0, 0.0]}],
        "material": [{"region": name, "young": 1e6, "poisson": 0.0} for name in ("one", "two")],
        "displacement": [
            {"boundary": f"{name}.{side}", axis: value}
            for name in ("one", "two")
            for side, axis, value in (("left", "x", 0.0), ("top", "y", -0.01))
        ],
        "contact": [
            {"boundary": "one.bottom", "overclosure": {"law": "linear", "stiffness": 100.0}},
            {"boundary": "two.bottom", "overclosure": {"law": "linear", "stiffness": 300.0}},
        ],
    }
    solution = solve(as_scene(data))
    state = solution.contact
    means = [state.pressure[state.boundary.part == part].mean() for part in (0, 1)]
    assert_allclose(means, [0.01 / (1 / k + 1e-6) for k in (100.0, 300.0)], rtol=1e-6)


def test_two_bodies():
    """The upper one sinks into the lower one by the law."""
    mesh = rectangle_mesh(4, 4, length=1.0, height=1.0)
    data = {
        "body": [{"name": "low", "mesh": mesh}, {"name": "up", "mesh": mesh, "shift": [0.0, 1.0]}],
        "material": [{"region": name, "young": YOUNG, "poisson": 0.0} for name in ("low", "up")],
        "contact": [{"boundary": "up.bottom", "against": "low.top", "overclosure": LAW}],
        "traction": [{"boundary": "up.top", "y": -5.0}],
        "displacement": [fixed("low.bottom", "y")]
        + [fixed(f"{name}.left", "x") for name in ("low", "up")],
    }
    solution = solve(as_scene(data))
    assert solution.certificate.holds
    top = solution.displacement.x.array[1::2].min()
    assert top == pytest.approx(-0.05 - 2 * 5.0 / YOUNG, rel=1e-6)


@pytest.mark.parametrize(
    ("law", "more", "said"),
    [
        (LAW, {"solver": {"algorithm": "alm"}}, "needs algorithm = 'ssn'"),
        (LAW, {"solver": {"algorithm": "path-following"}}, "needs algorithm = 'ssn'"),
        ({"law": "linear", "stiffness": 0.0}, {}, "greater than 0"),
        ({"law": "cubic", "stiffness": 1.0}, {}, "overclosure"),
        (
            LAW,
            {"material": {"law": "neo-hooke", "young": 1.0, "poisson": 0.3}},
            "is for linear materials",
        ),
    ],
)
def test_what_is_wrong(law, more, said):
    """It is named."""
    with pytest.raises(SceneError) as raised:
        block(law, **more)
    assert said in str(raised.value)


def test_no_bound_and_no_derivative():
    """What is about hard contact says so."""
    scene = block(LAW)
    assert "soft contact" in solve(scene).error_bound
    with pytest.raises(SceneError, match="overclosure"):
        sensitivity(scene, "mean top y", [])
