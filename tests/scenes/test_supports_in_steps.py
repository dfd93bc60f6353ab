"""Supports that hold in some load steps only."""

import numpy as np
import pytest
from deck_lines import squares

from signorini_fx.errors import SceneError
from signorini_fx.records import Status
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.scenes import nonlinear
from signorini_fx.scenes.reading import as_scene
from signorini_fx.scenes.solver import solve

FIRST = [{"boundary": "top", "x": 0.0, "y": -0.001}, {"boundary": "left", "x": 0.0}]
SECOND = [{"boundary": "right", "x": 0.01}, {"boundary": "top", "y": -0.002}]
TOOL = {"shape": "plane", "point": [0.5, 0.0], "normal": [0.0, 1.0], "pivot": [0.5, 0.0], "force": [0.0, 3.0]}
TOOL |= {"prescribed": {"rotation": 0.0, "x": 0.0}}
WITH = {
    "ssn": {},
    "alm": {"solver": {"algorithm": "alm"}},
    "multigrid": {"solver": {"linear_algebra": "krylov"}},
    "degree 2": {"element": {"degree": 2}},
    "axisymmetric": {"material": {"young": 1000.0, "poisson": 0.3, "hypothesis": "axisymmetric"}},
    "bilateral": {"contact": [{"boundary": "bottom", "kind": "bilateral"}]},
    "tool": {"traction": [], "contact": [{"boundary": "bottom", "foundation": TOOL}]},
}


def block(supports, **more):
    """A square on a foundation, pressed from above."""
    data = {
        "mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 6, "ny": 6}},
        "material": {"young": 1000.0, "poisson": 0.3},
        "traction": [{"boundary": "top", "y": -5.0}],
        "contact": [{"boundary": "bottom"}],
        "displacement": supports,
    }
    return as_scene(data | more)


def changing(*lists):
    """Lists of supports, one for each load step."""
    return [
        entry | {"holds": [step == number for step in range(len(lists))]}
        for number, entries in enumerate(lists)
        for entry in entries
    ]


@pytest.mark.parametrize("kind", WITH)
def test_each_step_has_its_supports(kind):
    """Without friction nothing but the supports of a step counts in it."""
    more = WITH[kind]
    solution = solve(block(changing(FIRST, SECOND), **more))
    for step, supports in zip(solution.steps, (FIRST, SECOND), strict=True):
        alone = solve(block(supports, **more)).displacement.x.array
        np.testing.assert_allclose(step.displacement.x.array, alone, atol=1e-8 * np.abs(alone).max())
        assert step.certificate.holds


@pytest.mark.slow
def test_what_follows_from_a_solution():
    """Forces at supports and the guaranteed bound are those of the supports of the step."""
    solution = solve(block(changing(FIRST, SECOND)))
    for step, supports in zip(solution.steps, (FIRST, SECOND), strict=True):
        moment, alone = solution.at(step), solve(block(supports))
        assert str(moment.error_bound)[:40] == str(alone.error_bound)[:40]
        for name in ("left", "right", "top"):
            force = moment.resultants.of(name).force
            np.testing.assert_allclose(force, alone.resultants.of(name).force, rtol=1e-6, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["supports", "soft contact"])
def test_restart(tmp_path, kind):
    """A run that ended after its first step goes on from there, to the same end."""
    more = {"contact": [{"boundary": "bottom", "overclosure": {"law": "linear", "stiffness": 1e3}}]}
    scene = block(changing(FIRST, SECOND), **({} if kind == "supports" else more))
    whole = solve(scene)

    def stop(record):
        if getattr(record, "step", 0) == 2 and hasattr(record, "name"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve(scene, observers=[stop], checkpoint=tmp_path)
    again = solve(scene, checkpoint=tmp_path, restart=True)
    for step, other in zip(again.steps, whole.steps, strict=True):
        assert step.certificate.holds
        np.testing.assert_allclose(step.displacement.x.array, other.displacement.x.array, atol=1e-12)


@pytest.mark.slow
def test_skew_supports():
    """Those along the normal of a slanted side, too: nodes are turned in the step in which it holds."""
    more = {"mesh": {"generator": "wedge", "parameters": {"nx": 4, "ny": 6}}, "contact": [{"boundary": "tip"}]}
    first, second = [{"boundary": "left", "x": 0.0}], [{"boundary": "right", "normal": 0.001}]
    solution = solve(block(changing(first, second, first), **more))
    for step, supports in zip(solution.steps, (first, second, first), strict=True):
        alone = solve(block(supports, **more)).displacement.x.array
        np.testing.assert_allclose(step.displacement.x.array, alone, atol=1e-7 * np.abs(alone).max())


def test_friction_remembers():
    """A block that was pushed and is set free goes back until friction holds it: shear and slip go on from the step
    before, and the sum of the friction balances nothing, as nothing else acts along it.
    """
    friction = {"contact": [{"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.3}}]}
    pushed = [{"boundary": "left", "x": 0.02}]
    scene = block([{"boundary": "top", "y": -0.003}, *changing(pushed, [])], **friction)
    solution = solve(scene)
    first, last = solution.steps
    weight = last.contact.boundary.weight
    pressure, shear = last.contact.pressure, last.contact.shear[:, 0]
    assert abs(first.contact.shear[:, 0] @ weight) > 0.25 * (first.contact.pressure @ weight)
    assert abs(shear @ weight) < 1e-6 * (pressure @ weight)
    never = solve(block([{"boundary": "top", "y": -0.003}], **friction))
    assert np.abs(last.displacement.x.array - never.displacement.x.array).max() > 0.01


def test_two_bodies():
    """The upper one, which is held in the first step, is pressed on the lower one in the second."""
    mesh = {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 4, "ny": 4}}
    bodies = [{"name": "low", "mesh": mesh}, {"name": "up", "mesh": mesh, "shift": [0.0, 1.0]}]
    data = {
        "body": bodies,
        "material": [{"region": name, "young": 1000.0, "poisson": 0.0} for name in ("low", "up")],
        "contact": [{"boundary": "up.bottom", "against": "low.top"}],
        "traction": [{"boundary": "up.top", "y": -5.0}],
        "displacement": [
            {"boundary": "low.bottom", "y": 0.0},
            *({"boundary": f"{name}.left", "x": 0.0} for name in ("low", "up")),
            {"boundary": "up.top", "y": -0.001, "holds": [True, False]},
        ],
    }
    held, free = solve(as_scene(data)).steps
    np.testing.assert_allclose(held.contact.pressure, 1000.0 * 0.001 / 2, rtol=1e-4)
    np.testing.assert_allclose(free.contact.pressure, 5.0, rtol=1e-6)
    assert free.displacement.x.array.min() == pytest.approx(-2 * 5.0 / 1000.0, rel=1e-4)


@pytest.mark.parametrize(
    ("holds", "more", "said"),
    [
        ([True, False, True], {}, "has 3 entries, one for each of 2 load steps"),
        ([False, False], {}, "is false in all load steps"),
        ([True, False], {"contact": []}, "is for scenes with contact"),
    ],
)
def test_what_is_wrong(holds, more, said):
    """It is named with what is to be done."""
    supports = [{"boundary": "left", "x": 0.0, "factors": [1.0, 2.0]}, {"boundary": "top", "x": 0.0, "holds": holds}]
    if len(holds) == 3:
        more = more | {"load_steps": {"times": [1.0, 2.0]}}
    with pytest.raises(SceneError) as raised:
        block(supports, **more)
    assert said in str(raised.value)


@pytest.mark.parametrize("friction", [None, {"law": "coulomb", "coefficient": 0.3}, {"law": "tresca", "bound": 0.5}])
@pytest.mark.parametrize("order", [(True, False), (False, True)])
def test_planes_of_symmetry_that_come_and_go(tmp_path, order, friction):
    """A support of the side below along the contact: with that of the body above, the corner lies in a plane of
    symmetry while both hold, across which there is neither slip nor shear, nor any from the step before.
    """
    lines = [*squares(4, 2, name="LOW"), *squares(4, 2, 101, (0.0, 1.0), name="UP")]
    (tmp_path / "two.inp").write_text("\n".join(lines) + "\n", encoding="utf-8")
    fixed = [{"boundary": "LOW_FEET", "x": 0.0, "y": 0.0}, {"boundary": "UP_WALL", "x": 0.0}]
    changing_support = {"boundary": "LOW_TOP", "x": 0.0}

    def solved(supports):
        data = {
            "mesh": {"file": str(tmp_path / "two.inp")},
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": [{"boundary": "UP_HEAD", "y": -5.0, "factors": [1.0, 1.0]}],
            "contact": [{"boundary": "UP_BOTTOM", "against": "LOW_TOP"} | ({"friction": friction} if friction else {})],
            "displacement": supports,
        }
        return solve(as_scene(data))

    solution = solved([*fixed, changing_support | {"holds": list(order)}])
    assert solution.converged
    assert all(step.certificate.holds for step in solution.steps)
    if friction is None:  # what came before does not count
        for step, holds in zip(solution.steps, order, strict=True):
            alone = solved([*fixed, *([changing_support] if holds else [])]).displacement.x.array
            np.testing.assert_allclose(step.displacement.x.array, alone, atol=1e-8 * np.abs(alone).max())


PLANE = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
FEW = [
    {"boundary": "top", "x": 0.0, "y": -1e-5},
    {"boundary": "left", "x": 0.0, "holds": [True, False, True]},
    {"boundary": "right", "x": 5e-6, "holds": [False, True, False]},
]


def few(material, **more):
    """A square on a plane with friction, which other sides hold in each of three load steps, and strains of 1e-5."""
    contact = {"boundary": "bottom", "foundation": PLANE, "friction": {"law": "coulomb", "coefficient": 0.3}}
    scene = block(FEW, **{"material": material, "contact": [contact]} | more)
    return scene.model_copy(update={"traction": ()})


@pytest.mark.parametrize("law", ["neo-hooke", "saint-venant-kirchhoff"])
def test_supports_of_nonlinear_bodies(law):
    """Each step has its supports, and at small strains it is that of the linear body."""
    linear, solution = (solve(few({"young": 1000.0, "poisson": 0.3} | named)) for named in ({}, {"law": law}))
    for number, (step, other) in enumerate(zip(solution.steps, linear.steps, strict=True)):
        forces, expected = (np.concatenate(one.contact.forces) for one in (step, other))
        assert np.allclose(forces, expected, atol=1e-3 * np.abs(expected).max())
        u, y = step.displacement.x.array, other.displacement.x.array
        assert np.allclose(u, y, atol=1e-3 * np.abs(y).max())
        x, moved = step.displacement.function_space.tabulate_dof_coordinates(), u[::2]
        at = {"left": np.isclose(x[:, 0], 0.0), "right": np.isclose(x[:, 0], 1.0)}
        for entry in FEW[1:]:
            inside = at[entry["boundary"]] & (x[:, 1] < 0.9)
            assert np.allclose(moved[inside], entry["x"], atol=1e-15) == entry["holds"][number]
        rows = solution.at(step).resultants.every()
        assert np.allclose(sum(row.force for row in rows), 0.0, atol=1e-9 * np.abs(forces).max())
        for entry in FEW[1:]:
            if not entry["holds"][number]:
                assert all(row.boundary != entry["boundary"] or "support" not in row.acts for row in rows)


def test_a_nonlinear_body_with_supports_of_another_step_is_refused(monkeypatch):
    """A solver that keeps those of the first step converges in each step, and the certificate of the second one, which
    asks the scene, does not hold.
    """
    monkeypatch.setattr(nonlinear, "held_at", lambda model, step: model)
    with pytest.raises(ConvergenceError, match="supports") as refused:
        solve(few({"young": 1000.0, "poisson": 0.3, "law": "neo-hooke"}))
    solution = refused.value.solution
    assert solution.status is Status.NOT_CERTIFIED
    assert len(solution.steps) == 1
    assert solution.steps[0].certificate.holds


def test_supports_of_nonlinear_pairs_stay():
    """In contact of two nonlinear bodies supports that hold in some steps only are refused."""
    square = {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 2, "ny": 2}}
    bodies = [{"name": "lower", "mesh": square}, {"name": "upper", "mesh": square, "shift": [0.0, 1.0]}]
    supports = [{"boundary": "lower.bottom", "x": 0.0, "y": 0.0}, {"boundary": "upper.top", "y": -0.01}]
    supports.append({"boundary": "upper.left", "x": 0.0, "holds": [True, False]})
    rubber = {"law": "neo-hooke", "young": 1000.0, "poisson": 0.3}
    contact = {"boundary": "upper.bottom", "against": "lower.top"}
    with pytest.raises(SceneError, match=r"holds: is not possible yet"):
        solve(as_scene({"body": bodies, "material": rubber, "displacement": supports, "contact": contact}))
