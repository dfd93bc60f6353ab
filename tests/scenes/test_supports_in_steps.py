"""Supports that hold in some load steps only."""

import numpy as np
import pytest
from scene_tables import coulomb_friction, fixed, floor, rectangle_mesh

from signorini_fx.errors import SceneError
from signorini_fx.scenes.reading import as_scene
from signorini_fx.scenes.solver import solve

FIRST = [{"boundary": "top", "x": 0.0, "y": -0.001}, fixed("left", "x")]
SECOND = [{"boundary": "right", "x": 0.01}, {"boundary": "top", "y": -0.002}]
TOOL = {
    "shape": "plane",
    "point": [0.5, 0.0],
    "normal": [0.0, 1.0],
    "pivot": [0.5, 0.0],
    "force": [0.0, 3.0],
}
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
        "mesh": rectangle_mesh(6, 6, length=1.0, height=1.0),
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


@pytest.mark.one_quick("kind", WITH)
def test_each_step_has_its_supports(kind):
    """Without friction nothing but the supports of a step counts in it."""
    more = WITH[kind]
    solution = solve(block(changing(FIRST, SECOND), **more))
    for step, supports in zip(solution.steps, (FIRST, SECOND), strict=True):
        alone = solve(block(supports, **more)).displacement.x.array
        np.testing.assert_allclose(
            step.displacement.x.array, alone, atol=1e-8 * np.abs(alone).max()
        )
        assert step.certificate.holds


def test_friction_remembers():
    """A block that was pushed and is set free goes back until friction holds it: shear and slip go
    on from the step before, and the sum of the friction balances nothing, as nothing else acts
    along it.
    """
    friction = {"contact": [{"boundary": "bottom", "friction": coulomb_friction(0.3)}]}
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
    supports = [
        {"boundary": "left", "x": 0.0, "factors": [1.0, 2.0]},
        {"boundary": "top", "x": 0.0, "holds": holds},
    ]
    if len(holds) == 3:
        more = more | {"load_steps": {"times": [1.0, 2.0]}}
    with pytest.raises(SceneError) as raised:
        block(supports, **more)
    assert said in str(raised.value)


PLANE = floor()
FEW = [
    {"boundary": "top", "x": 0.0, "y": -1e-5},
    {"boundary": "left", "x": 0.0, "holds": [True, False, True]},
    {"boundary": "right", "x": 5e-6, "holds": [False, True, False]},
]


def few(material, **more):
    """A square on a plane with friction, which other sides hold in each of three load steps, and
    strains of 1e-5.
    """
    contact = {"boundary": "bottom", "foundation": PLANE, "friction": coulomb_friction(0.3)}
    scene = block(FEW, **{"material": material, "contact": [contact]} | more)
    return scene.model_copy(update={"traction": ()})


@pytest.mark.one_quick("law", ["neo-hooke", "saint-venant-kirchhoff"])
def test_supports_of_nonlinear_bodies(law):
    """Each step has its supports, and at small strains it is that of the linear body."""
    linear, solution = (
        solve(few({"young": 1000.0, "poisson": 0.3} | named)) for named in ({}, {"law": law})
    )
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
                assert all(
                    row.boundary != entry["boundary"] or "support" not in row.acts for row in rows
                )


def test_supports_of_nonlinear_pairs_stay():
    """In contact of two nonlinear bodies supports that hold in some steps only are refused."""
    square = rectangle_mesh(2, 2, length=1.0, height=1.0)
    bodies = [
        {"name": "lower", "mesh": square},
        {"name": "upper", "mesh": square, "shift": [0.0, 1.0]},
    ]
    supports = [fixed("lower.bottom"), {"boundary": "upper.top", "y": -0.01}]
    supports.append({"boundary": "upper.left", "x": 0.0, "holds": [True, False]})
    rubber = {"law": "neo-hooke", "young": 1000.0, "poisson": 0.3}
    contact = {"boundary": "upper.bottom", "against": "lower.top"}
    with pytest.raises(SceneError, match=r"holds: is not possible yet"):
        solve(
            as_scene(
                {"body": bodies, "material": rubber, "displacement": supports, "contact": contact}
            )
        )
