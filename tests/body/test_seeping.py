"""A fluid that seeps into contact: by forces of one's own, a lifted strip, pockets, ways back."""

import subprocess
import sys

import pytest
from numpy.testing import assert_allclose
from scene_tables import box_mesh, fixed, rectangle_mesh

from signorini_fx import sensitivity, solve
from signorini_fx.errors import SceneError
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene

BLOCK = {
    "mesh": rectangle_mesh(8, 4, length=2.0),
    "material": {"young": 1000.0, "poisson": 0.3},
    "displacement": fixed("left", "x"),
    "traction": {"boundary": "top", "y": -2.0},
    "contact": {
        "boundary": "bottom",
        "gap": "where(x[0] < 0.6, 0.01, 0)",
        "seeping": {"pressure": 1.5, "side": "left"},
    },
}
BOX = {
    "mesh": box_mesh(8, 2, 2, length=2.0, width=1.0),
    "displacement": [fixed("left", "x"), fixed("front", "y")],
    "traction": {"boundary": "top", "z": -2.0},
}
PAIR = {
    "mesh": [],
    "body": [
        {"name": "up", "mesh": rectangle_mesh(8, 4, length=2.0), "shift": [0.0, 1.0]},
        {"name": "low", "mesh": rectangle_mesh(6, 3, length=2.0)},
    ],
    "displacement": [fixed("low.bottom"), fixed("up.left", "x")],
    "traction": {"boundary": "up.top", "y": -2.0},
    "contact": {
        **BLOCK["contact"],
        "boundary": "up.bottom",
        "against": "low.top",
        "points": "boundary",
        "seeping": {"pressure": 1.5, "side": "up.left"},
    },
}
KINDS = {"plane": {}, "quadratic": {"element": {"degree": 2}}, "space": BOX, "pair": PAIR}


def scene(**more):
    return parse_scene({key: value for key, value in {**BLOCK, **more}.items() if value != []})


@pytest.mark.mpi
@pytest.mark.parametrize("more", KINDS.values(), ids=KINDS)
def test_bears(more):
    """What the fluid pushes contact does not bear, and certificate and balance count it."""
    solution = solve(scene(**more))
    figures = solution.steps[0].figures
    assert solution.certificate.holds
    area = 0.5 + 0.25 / (6 if "element" in more else 2)
    assert figures["fluid_area"] == pytest.approx(area, rel=1e-9)
    assert figures["fluid_force"] == pytest.approx(1.5 * area, rel=1e-9)
    assert solution.contact.forces[0][-1] == pytest.approx(4.0 - 1.5 * area, rel=1e-9)
    assert_allclose(sum(each.force for each in solution.resultants.every()), 0.0, atol=1e-9)


def test_by_forces():
    """It is the problem with the forces of the fluid at its nodes."""
    pushed = [
        {"at": [x, 0.0], "y": 1.5 * weight}
        for x, weight in ((0.0, 0.125), (0.25, 0.25), (0.5, 0.25))
    ]
    contact = {key: BLOCK["contact"][key] for key in ("boundary", "gap")}
    expected = solve(scene(contact=contact, point_force=pushed))
    found = solve(scene())
    assert_allclose(found.displacement.x.array, expected.displacement.x.array, atol=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.75])
def test_lifted_strip(share):
    """A strip of weight q whose end is lifted leaves the floor over a = (24 E I y / (q - p))^(1/4)
    and needs the force (q - p) a / 2; let down again it lies dry.
    """
    strip = {
        "mesh": rectangle_mesh(80, 1, length=40.0, height=1.0),
        "element": {"degree": 2},
        "material": {"young": 1e4, "poisson": 0.0, "hypothesis": "plane stress"},
        "displacement": [
            fixed("right", "x"),
            {"at": [0.0, 1.0], "y": 0.0104, "factors": [0.5, 1.0, -0.01]},
        ],
        "traction": {"boundary": "top", "y": -0.01},
        "contact": {"boundary": "bottom", "seeping": {"pressure": 0.01 * share, "side": "left"}},
    }
    solution = solve(parse_scene(strip))
    left = 0.01 * (1 - share)
    for step, lifted in zip(solution.steps, (0.0052, 0.0104), strict=False):
        a = (24 * 1e4 / 12 * lifted / left) ** 0.25
        assert step.figures["fluid_area"] == pytest.approx(a, abs=1.0)
        force = 0.01 * 40.0 - step.contact.forces[0][1] - step.figures["fluid_force"]
        assert force == pytest.approx(left * a / 2, rel=0.03)
    assert solution.steps[2].figures["fluid_area"] == 0.0
    assert all(step.certificate.holds for step in solution.steps)


@pytest.mark.mpi
def test_pocket():
    """An open pocket stays dry until what opens reaches it."""
    gap = "where(x[0] < 0.3, 0.01, where(x[0] > 0.6 and x[0] < 1.4, 0.01, 0))"
    contact = {**BLOCK["contact"], "gap": gap}
    dry = solve(scene(contact=contact)).table.columns
    assert dry["wet"].tolist() == [1.0, 1.0, *(7 * [0.0])]
    assert (dry["pressure"][3:6] == 0).all()
    lifted = {"boundary": "left", "x": 0.0, "y": 0.02}
    wet = solve(scene(contact=contact, displacement=lifted)).table.columns
    assert (wet["wet"][:6] == 1).all()


def test_in_time():
    """The pressure is that of the end of each step."""
    fluid = {"pressure": "t", "side": "left"}
    solution = solve(
        scene(contact={**BLOCK["contact"], "seeping": fluid}, load_steps={"times": [0.5, 1.5]})
    )
    forces = [step.figures["fluid_force"] for step in solution.steps]
    assert forces == pytest.approx([0.5 * 0.625, 1.5 * 0.625])
    said = [one.message for one in solution.findings if one.path == "contact[0].seeping"]
    assert said == ["fluid on 0.625, pushes with 0.9375"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"side": "top"}, r"contact\[0\].seeping.side: 'top' has no node of 'bottom'"),
        ({"side": "nowhere"}, r"contact\[0\].seeping.side: 'nowhere' has no node of"),
        ({"pressure": "x"}, r"contact.*seeping.pressure"),
    ],
)
def test_bad_input(changes, message):
    contact = {**BLOCK["contact"], "seeping": {**BLOCK["contact"]["seeping"], **changes}}
    for ask in (check_scene, solve):
        with pytest.raises(SceneError, match=message):
            ask(scene(contact=contact))


def test_what_it_does_not_go_with():
    with pytest.raises(SceneError, match="is for contact that opens, not 'bilateral'"):
        scene(contact={**BLOCK["contact"], "kind": "bilateral"})
    with pytest.raises(SceneError, match="accuracy: is not possible yet with a fluid"):
        scene(accuracy={"target": 0.1})
    with pytest.raises(SceneError, match="not possible yet with a fluid that seeps in"):
        sensitivity(scene(), of="energy", by="traction[0].y")


def test_import_closure():
    """Without it nothing of it is imported."""
    code = (
        "import sys; from signorini_fx import solve; "
        "solve('demos/scenes/example1_tresca.toml'); "
        "sys.exit(any(name.endswith('.seeping') for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
