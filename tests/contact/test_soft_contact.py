"""Contact that gives way under its pressure: closed forms, other formulas of its laws, what it does not go with."""

import numpy as np
import pytest
from mpi4py import MPI

from signorini_fx import sensitivity
from signorini_fx.addons.bounds.error_bound import why_unbounded
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.overclosure import Overclosure
from signorini_fx.records import Status
from signorini_fx.scenes.reading import as_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.tuned import CERTIFICATE_TOLERANCE

YOUNG = 1000.0
LAW = {"law": "linear", "stiffness": 100.0}


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


@pytest.mark.parametrize("gap", [0.0, 0.004, -0.004])
def test_uniform_pressure(gap):
    """The block sinks by what the law says of the pressure, the gap, and its own compression."""
    solution = solve(block(LAW, contact=[{"boundary": "bottom", "overclosure": LAW, "gap": gap}]))
    assert solution.certificate.holds
    np.testing.assert_allclose(solution.contact.pressure, 5.0, rtol=1e-8)
    top = solution.displacement.x.array[1::2].min()
    assert top == pytest.approx(-0.05 - gap - 5.0 / YOUNG, rel=1e-7)


@pytest.mark.parametrize("more", [{}, {"element": {"degree": 2}}, {"solver": {"linear_algebra": "krylov"}}])
def test_pressures_of_each_point(more):
    """Under a load that varies and friction each pressure is that of its own overclosure, and all together balance."""
    contact = [{"boundary": "bottom", "overclosure": LAW, "friction": {"law": "coulomb", "coefficient": 0.2}}]
    solution = solve(block(LAW, "-20*x[0]*x[0]", contact=contact, **more))
    assert solution.certificate.holds
    state = solution.contact
    assert np.ptp(state.pressure) > 0.2
    h = state.u_n - state.gap
    np.testing.assert_allclose(state.pressure, 100.0 * np.maximum(h, 0.0), rtol=1e-6, atol=1e-9)
    assert state.pressure @ state.boundary.weight == pytest.approx(20.0 / 3.0, rel=1e-8)


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
    """Pressed and released: the way back is that of the law."""
    traction = [{"boundary": "top", "y": -1.0, "factors": [5.0, 0.3, 40.0]}]
    solution = solve(block(LAW, traction=traction))
    for step, pressure in zip(solution.steps, (5.0, 0.3, 40.0), strict=True):
        assert step.certificate.holds
        sunk = pressure / 100.0 + pressure / YOUNG
        assert step.displacement.x.array[1::2].min() == pytest.approx(-sunk, rel=1e-7)


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


@pytest.mark.mpi
def test_steps_that_need_fall_backs():
    """Nearly incompressible, between a floor and a wall, with steps that unload: on one rank as on two."""
    solution = solve(corner({"stiffness": 5e3}, 2, 0.499, factors=[0.5, 1, 0.3]))
    assert solution.status is Status.CONVERGED
    assert solution.certificate.holds


def test_two_bodies():
    """The upper one sinks into the lower one by the law."""
    mesh = {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 4, "ny": 4}}
    data = {
        "body": [{"name": "low", "mesh": mesh}, {"name": "up", "mesh": mesh, "shift": [0.0, 1.0]}],
        "material": [{"region": name, "young": YOUNG, "poisson": 0.0} for name in ("low", "up")],
        "contact": [{"boundary": "up.bottom", "against": "low.top", "overclosure": LAW}],
        "traction": [{"boundary": "up.top", "y": -5.0}],
        "displacement": [{"boundary": "low.bottom", "y": 0.0}]
        + [{"boundary": f"{name}.left", "x": 0.0} for name in ("low", "up")],
    }
    solution = solve(as_scene(data))
    assert solution.certificate.holds
    top = solution.displacement.x.array[1::2].min()
    assert top == pytest.approx(-0.05 - 2 * 5.0 / YOUNG, rel=1e-6)


def test_the_certificate_notices_another_law(monkeypatch):
    """With a law that is solved for and another one that is certified it does not hold."""
    solved_for = {0: Overclosure(stiffness=99.9)}
    monkeypatch.setattr("signorini_fx.solving.iterated_interfaces.overclosures.overclosures_of", lambda _: solved_for)
    solution = solve(block(LAW), MPI.COMM_WORLD, check=False)
    assert not solution.certificate.holds
    assert solution.certificate.entered > CERTIFICATE_TOLERANCE


@pytest.mark.parametrize(
    ("law", "more", "said"),
    [
        (LAW, {"solver": {"algorithm": "alm"}}, "is for 'ssn'"),
        (LAW, {"solver": {"algorithm": "path-following"}}, "is for 'ssn'"),
        ({"law": "linear", "stiffness": 0.0}, {}, "greater than 0"),
        ({"law": "exponential", "stiffness": 1.0}, {}, "was removed: use the stiffness"),
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
    assert "soft contact" in why_unbounded(solve(scene).model)
    with pytest.raises(SceneError, match="overclosure"):
        sensitivity(scene, "mean top y")


def test_what_the_law_gives_way_is_no_error():
    """An accuracy of the pressure is reached, and is that against a fine mesh; only sticking keeps a regularisation."""

    def loaded(cells, **more):
        size = {"length": 1.0, "height": 1.0, "nx": cells, "ny": cells}
        mesh = {"generator": "rectangle", "parameters": size}
        return solve(block(LAW, "-20*x[0]*x[0]", mesh=mesh, material={"young": YOUNG, "poisson": 0.3}, **more))

    solution, fine = loaded(4, accuracy={"target": 0.05, "of": "pressure"}), loaded(32)
    assert solution.status is Status.CONVERGED
    assert [level.pressure_regularisation for level in solution.levels] == [0.0] * len(solution.levels)
    reached, exact = solution.contact, fine.contact
    order = np.argsort(reached.boundary.x[:, 0])
    there = np.interp(exact.boundary.x[:, 0], reached.boundary.x[order, 0], reached.pressure[order])
    assert exact.points.norm(there - exact.pressure) < 0.05 * exact.points.norm(exact.pressure)
