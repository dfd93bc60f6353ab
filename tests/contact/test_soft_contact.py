"""Contact that gives way under its pressure: closed forms, other formulas of its laws, what it does not go with."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from signorini_fx import sensitivity
from signorini_fx.addons.bounds.error_bound import why_unbounded
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.overclosure import (
    ExponentialOverclosure,
    LinearOverclosure,
    TabularOverclosure,
)
from signorini_fx.records import Status
from signorini_fx.scenes.reading import as_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.tuned import CERTIFICATE_TOLERANCE

YOUNG = 1000.0
LAWS = {
    "linear": {"law": "linear", "stiffness": 100.0},
    "exponential": {"law": "exponential", "clearance": 0.01, "pressure": 0.2},
    "tabular": {"law": "tabular", "rows": [[0.0, -0.01], [2.0, 0.01], [10.0, 0.02]]},
}
SUNK = {"linear": 0.05, "exponential": 0.01 * np.log(25.0) / np.log(100.0), "tabular": 0.01 + 0.01 * 3.0 / 8.0}


def block(law, pressure=-5.0, **more):
    """A square that is pressed on a foundation."""
    data = {
        "mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 4, "ny": 4}},
        "material": {"young": YOUNG, "poisson": 0.0},
        "traction": [{"boundary": "top", "y": pressure}],
        "displacement": [{"boundary": "left", "x": 0.0}],
        "contact": [{"boundary": "bottom", "overclosure": law}],
    }
    return as_scene(data | more)


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("gap", [0.0, 0.004, -0.004])
def test_uniform_pressure(kind, gap):
    """The block sinks by what the law says of the pressure, the gap, and its own compression."""
    solution = solve(block(LAWS[kind], contact=[{"boundary": "bottom", "overclosure": LAWS[kind], "gap": gap}]))
    assert solution.certificate.holds
    np.testing.assert_allclose(solution.contact.pressure, 5.0, rtol=1e-8)
    top = solution.displacement.x.array[1::2].min()
    assert top == pytest.approx(-SUNK[kind] - gap - 5.0 / YOUNG, rel=1e-7)


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("more", [{}, {"element": {"degree": 2}}, {"solver": {"linear_algebra": "krylov"}}])
def test_pressures_of_each_point(kind, more):
    """Under a load that varies and friction each pressure is that of its own overclosure, and all together balance."""
    contact = [{"boundary": "bottom", "overclosure": LAWS[kind], "friction": {"law": "coulomb", "coefficient": 0.2}}]
    solution = solve(block(LAWS[kind], "-20*x[0]*x[0]", contact=contact, **more))
    assert solution.certificate.holds
    state, law = solution.contact, solution.statement.contact[0].overclosure
    assert np.ptp(state.pressure) > 0.2
    h = state.u_n - state.gap
    meant = [_pressure(kind, overclosure) for overclosure in h]
    np.testing.assert_allclose(state.pressure, meant, rtol=1e-6, atol=1e-9)
    assert state.pressure @ state.boundary.weight == pytest.approx(20.0 / 3.0, rel=1e-8)
    assert law.law == kind


def _pressure(kind, h):
    """By formulas of this file."""
    if kind == "linear":
        return max(100.0 * h, 0.0)
    if kind == "tabular":
        return float(np.interp(h, [-0.01, 0.01, 0.02, 0.12], [0.0, 2.0, 10.0, 90.0]))
    rate = np.log(100.0) / 0.01
    return 0.2 * np.exp(rate * h) if h > -0.01 else max(0.002 * (1 + rate * (h + 0.01)), 0.0)


def test_two_stiffnesses():
    """Each contact has its own: two feet share a load that a stiff lid spreads as their stiffnesses do."""
    mesh = {"generator": "rectangle", "parameters": {"length": 0.01, "height": 1.0, "nx": 1, "ny": 2}}
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
    np.testing.assert_allclose(means, [0.01 / (1 / k + 1e-6) for k in (100.0, 300.0)], rtol=1e-6)


def test_soft_beside_hard():
    """The other contact stays as hard as gamma_n."""
    law = {"law": "linear", "stiffness": 50.0}
    contact = [{"boundary": "bottom", "overclosure": law}, {"boundary": "right", "gap": 0.0}]
    solution = solve(
        block(
            law,
            contact=contact,
            traction=[{"boundary": "left", "x": 3.0}, {"boundary": "top", "y": -5.0}],
            displacement=[],
        )
    )
    state = solution.contact
    sunk, pushed = (np.abs((state.u_n - state.gap)[state.boundary.part == part]).max() for part in (0, 1))
    assert sunk == pytest.approx(0.1, rel=1e-3)
    assert pushed < 1e-6


def test_load_steps():
    """Pressed and released: the way back is that of the law, and tangents go on from the last step."""
    law = LAWS["exponential"]
    traction = [{"boundary": "top", "y": -1.0, "factors": [5.0, 0.3, 40.0]}]
    solution = solve(block(law, traction=traction))
    for step, pressure in zip(solution.steps, (5.0, 0.3, 40.0), strict=True):
        assert step.certificate.holds
        meant = brentq(lambda h, p=pressure: _pressure("exponential", h) - p, -0.02, 0.1, xtol=1e-15)
        assert step.displacement.x.array[1::2].min() == pytest.approx(-meant - pressure / YOUNG, rel=1e-7)


def corner(law, degree, poisson, **traction):
    """A body that is pressed on a floor with friction and into a wall, both soft."""
    walls = [
        {"boundary": "bottom", "overclosure": law, "friction": {"law": "coulomb", "coefficient": 0.3}},
        {"boundary": "right", "overclosure": law, "gap": 0.0005},
    ]
    size = {"length": 2.0, "height": 1.0, "nx": 8, "ny": 4, "cell": "quadrilateral"}
    return block(
        law,
        mesh={"generator": "rectangle", "parameters": size},
        material={"young": YOUNG, "poisson": poisson},
        element={"degree": degree},
        traction=[{"boundary": "top", "x": 6.0, "y": -10.0} | traction],
        contact=walls,
    )


def test_a_point_that_its_tangent_left_open():
    """The steep line of a table leaves a point of the wall open that is closed by the flat one."""
    solution = solve(corner({"law": "tabular", "rows": [[0, 0], [5, 0.001], [50, 0.004]]}, 1, 0.499))
    assert solution.status is Status.CONVERGED
    assert solution.certificate.holds
    assert any("solved again" in event for event in solution.history.events)


@pytest.mark.mpi
def test_steps_that_need_fall_backs():
    """Nearly incompressible, between a floor and a wall, with steps that unload: on one rank as on two."""
    solution = solve(
        corner({"law": "exponential", "clearance": 0.002, "pressure": 3.0}, 2, 0.499, factors=[0.5, 1, 0.3])
    )
    assert solution.status is Status.CONVERGED
    assert solution.certificate.holds


def test_two_bodies():
    """The upper one sinks into the lower one by the law."""
    mesh = {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 4, "ny": 4}}
    data = {
        "body": [{"name": "low", "mesh": mesh}, {"name": "up", "mesh": mesh, "shift": [0.0, 1.0]}],
        "material": [{"region": name, "young": YOUNG, "poisson": 0.0} for name in ("low", "up")],
        "contact": [{"boundary": "up.bottom", "against": "low.top", "overclosure": LAWS["exponential"]}],
        "traction": [{"boundary": "up.top", "y": -5.0}],
        "displacement": [{"boundary": "low.bottom", "y": 0.0}]
        + [{"boundary": f"{name}.left", "x": 0.0} for name in ("low", "up")],
    }
    solution = solve(as_scene(data))
    assert solution.certificate.holds
    top = solution.displacement.x.array[1::2].min()
    assert top == pytest.approx(-SUNK["exponential"] - 2 * 5.0 / YOUNG, rel=1e-6)


def test_the_certificate_notices_another_law(monkeypatch):
    """It asks for the pressure at the overclosure, which is not what tangents are made of: with another slope of one of
    both it does not hold.
    """
    right = ExponentialOverclosure.pressure_at
    monkeypatch.setattr(ExponentialOverclosure, "pressure_at", lambda law, h: right(law, 1.0001 * h))
    solution = solve(block(LAWS["exponential"]), MPI.COMM_WORLD, check=False)
    assert not solution.certificate.holds
    assert solution.certificate.entered > CERTIFICATE_TOLERANCE


@pytest.mark.parametrize(
    "law",
    [
        LinearOverclosure(stiffness=7.0),
        ExponentialOverclosure(clearance=0.02, pressure=3.0),
        TabularOverclosure(rows=[(0.0, -0.1), (1.0, 0.0), (3.0, 0.05), (9.0, 0.07)]),
    ],
)
def test_both_opinions(law):
    """Each is the inverse of the other, and the derivative is that of the overclosure."""
    p = np.array([0.0, 1e-4, 0.02, 0.03, 0.5, 2.0, 5.0, 20.0])
    h, slope = law.tangent(p)
    np.testing.assert_allclose(law.pressure_at(h), p, rtol=1e-12, atol=1e-12)
    step = 1e-7 * np.maximum(p, 1e-2)
    np.testing.assert_allclose((law.tangent(p + step)[0] - h) / step, slope, rtol=1e-4)
    assert law.pressure_at(np.array([-1.0])) == 0


@pytest.mark.parametrize(
    ("law", "more", "said"),
    [
        (LAWS["linear"], {"solver": {"algorithm": "alm"}}, "is for 'ssn'"),
        (LAWS["linear"], {"solver": {"algorithm": "path-following"}}, "is for 'ssn'"),
        ({"law": "linear", "stiffness": 0.0}, {}, "greater than 0"),
        ({"law": "tabular", "rows": [[0.0, 0.0], [1.0, 0.0]]}, {}, "rows must increase"),
        ({"law": "tabular", "rows": [[1.0, 0.0], [2.0, 1.0]]}, {}, "from the pressure 0 on"),
        ({"law": "cubic"}, {}, "overclosure"),
        (
            LAWS["linear"],
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
    scene = block(LAWS["linear"])
    assert "soft contact" in why_unbounded(solve(scene).model)
    with pytest.raises(SceneError, match="overclosure"):
        sensitivity(scene, "mean top y")


@pytest.mark.parametrize("law", ["linear", pytest.param("tabular", marks=pytest.mark.slow)])
def test_what_the_law_gives_way_is_no_error(law):
    """An accuracy of the pressure is reached, and is that against a fine mesh; only sticking keeps a regularisation."""

    def loaded(cells, **more):
        size = {"length": 1.0, "height": 1.0, "nx": cells, "ny": cells}
        mesh = {"generator": "rectangle", "parameters": size}
        return solve(block(LAWS[law], "-20*x[0]*x[0]", mesh=mesh, material={"young": YOUNG, "poisson": 0.3}, **more))

    solution, fine = loaded(4, accuracy={"target": 0.05, "of": "pressure"}), loaded(32)
    assert solution.status is Status.CONVERGED
    assert [level.pressure_regularisation for level in solution.levels] == [0.0] * len(solution.levels)
    reached, exact = solution.contact, fine.contact
    order = np.argsort(reached.boundary.x[:, 0])
    there = np.interp(exact.boundary.x[:, 0], reached.boundary.x[order, 0], reached.pressure[order])
    assert exact.points.norm(there - exact.pressure) < 0.05 * exact.points.norm(exact.pressure)
