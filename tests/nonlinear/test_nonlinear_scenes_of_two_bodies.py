"""Scenes of two nonlinear bodies: a closed form, gaps that depend on the time, and what is refused."""

import numpy as np
import pytest
from mpi4py import MPI
from support.nonlinear_bodies import LAME, MU, stress_of_block

from signorini_fx import Scene, SceneError, solve
from signorini_fx.scenes.checks import check_scene

POISSON = LAME / (2 * (LAME + MU))
LINEAR = {"young": 2 * MU * (1 + POISSON), "poisson": POISSON}
MODULI = {"law": "neo-hooke", **LINEAR}


def two_blocks(contact, depths=(0.4,), **settings):
    """A unit square on another one, both free to the right, pressed by these depths one after the other."""
    counts = {"lower": 3, "upper": 2}
    body = [
        {
            "name": name,
            "mesh": {"generator": "rectangle", "parameters": {"nx": count, "ny": count}},
            "shift": [0.0, float(number)],
        }
        for number, (name, count) in enumerate(counts.items())
    ]
    largest = max(depths)
    displacement = [
        {"boundary": "lower.bottom", "y": 0.0},
        {"boundary": "upper.top", "y": -largest, "factors": [depth / largest for depth in depths]},
        {"boundary": "lower.left", "x": 0.0},
        {"boundary": "upper.left", "x": 0.0},
    ]
    entry = {"boundary": "upper.bottom", "against": "lower.top"} | contact
    return Scene(body=body, material=MODULI, displacement=displacement, contact=entry, **settings)


@pytest.mark.parametrize(
    "contact",
    [{}, {"sliding": "small"}, {"sliding": "small", "distance": "nominal"}, {"sliding": "small", "adjust": 0.1}],
)
def test_blocks(contact):
    """Each is compressed by a fifth: the pressure of a block in plane strain, in closed form."""
    solution = solve(two_blocks(contact), MPI.COMM_SELF)
    assert solution.certificate.holds
    assert solution.contact.pressure == pytest.approx(-stress_of_block(0.8, 1), rel=1e-4)


@pytest.mark.parametrize("sliding", [True, "small"])
def test_forces_act_where_a_body_has_slid_to(sliding):
    """What acts on each body balances with its moment about any point, after it has slid by its length, or by a facet
    with partners that it keeps: then the moments on both bodies differ, as a warning says.
    """
    sizes = {"lower": (1.6, 0.4, 8), "upper": (0.6, 0.3, 4)}
    way = 0.3 if sliding is True else 0.05
    meshes = {
        name: {"generator": "rectangle", "parameters": {"length": length, "height": height, "nx": count, "ny": 2}}
        for name, (length, height, count) in sizes.items()
    }
    scene = Scene(
        body=[
            {"name": "lower", "mesh": meshes["lower"]},
            {"name": "upper", "mesh": meshes["upper"], "shift": [0.2, 0.4]},
        ],
        material=MODULI,
        displacement=[
            {"boundary": "lower.bottom", "x": 0.0, "y": 0.0},
            {"boundary": "upper.top", "x": f"{way}*(t - 1)", "y": -0.02},
        ],
        contact={
            "boundary": "upper.bottom",
            "against": "lower.top",
            "friction": {"law": "coulomb", "coefficient": 0.3},
        }
        | ({} if sliding is True else {"sliding": sliding}),
        load_steps={"times": [1.0, 2.0, 3.0]},
    )
    solution = solve(scene, MPI.COMM_SELF)
    rows = {row.boundary: row for row in solution.resultants.every()}
    held = rows["upper.top"]
    for contact, support in (("upper.bottom", "upper.top"), ("lower.top", "lower.bottom")):
        assert rows[contact].force == pytest.approx(-rows[support].force, abs=1e-7 * abs(held.force[1]))
        assert rows[contact].moment == pytest.approx(-rows[support].moment, rel=1e-5)
    if sliding is True:
        assert 0.8 < rows["upper.bottom"].acts_at[0] < 1.4
        return
    (warning,) = [found.message for found in solution.findings if "keep their partners" in found.message]
    told = float(warning.partition("differ by ")[2].partition(";")[0])
    apart = abs(rows["upper.bottom"].moment + rows["lower.top"].moment)
    assert apart > 0.1 * abs(rows["upper.bottom"].moment)
    assert told == pytest.approx(apart, rel=0.05)


def test_bonds():
    """Tied sides of the same blocks, which pull, too."""
    solution = solve(two_blocks({"kind": "bonded", "sliding": "small"}, depths=(-0.4,)), MPI.COMM_SELF)
    assert solution.certificate.holds
    assert solution.contact.pressure == pytest.approx(-stress_of_block(1.2, 1), rel=1e-4)


@pytest.mark.parametrize("material", ["neo-hooke", "linear"])
def test_contact_in_some_steps(material):
    """Where a gap is too large in a step nothing touches, and where it is zero all does."""
    scene = two_blocks({"sliding": "small", "gap": "9.0 if t < 1.5 else 0.0"}, depths=(0.01, 0.01, 0.01))
    if material == "linear":
        scene = Scene(**{key: getattr(scene, key) for key in scene.model_fields_set} | {"material": LINEAR})
    solution = solve(scene, MPI.COMM_SELF)
    pressures = [solution.at(step).contact.pressure for step in solution.steps]
    assert np.abs(pressures[0]).max() == 0.0
    for pressure in pressures[1:]:
        assert pressure == pytest.approx(-stress_of_block(0.995, 1), rel=0.02)
    assert any(
        "distances are those of each load step" in finding.message for finding in check_scene(scene).findings
    ) == (material == "linear")


def test_what_is_refused():
    """By the key; between linear bodies nothing slides."""
    with pytest.raises(SceneError, match="sliding: is for contact against another boundary"):
        two_blocks({"against": None, "sliding": "small"})
    for key, value in {"kind": "bonded", "distance": "nominal", "adjust": 0.1}.items():
        with pytest.raises(SceneError, match=rf"contact\[0\].{key}: .* where sides slide.* give sliding = \"small\""):
            solve(two_blocks({key: value}), MPI.COMM_SELF)


def test_what_check_says():
    """Nothing of a rigid foundation: the other side moves."""
    for contact in ({}, {"sliding": "small"}):
        assert not [found for found in check_scene(two_blocks(contact)).findings if "foundation" in found.message]


@pytest.mark.parametrize("path", [(0.0, 1.0), (1.0,)])
def test_a_side_that_ends_over_the_other(path):
    """A square on a block three times as wide is pressed, then moved, or both at once: points on the block see past its
    corner, with the same force as by the other way, and nearly that of points on the square; a note names the key of a
    scene with which they are there.
    """
    wide = {"length": 3.0, "height": 1.0, "nx": 18, "ny": 6}
    body = [
        {"name": "lower", "mesh": {"generator": "rectangle", "parameters": wide}, "shift": [-1.0, -1.0]},
        {"name": "upper", "mesh": {"generator": "rectangle", "parameters": wide | {"length": 1.0, "nx": 8}}},
    ]
    displacement = [
        {"boundary": "lower.bottom", "x": 0.0, "y": 0.0},
        {"boundary": "upper.top", "x": 0.2, "factors": list(path)},
        {"boundary": "upper.top", "y": -0.1},
    ]
    forces = []
    for points in ("boundary", "against"):
        contact = {"boundary": "upper.bottom", "against": "lower.top", "points": points}
        solution = solve(
            Scene(body=body, material=MODULI, displacement=displacement, contact=contact), MPI.COMM_SELF, check=False
        )
        assert solution.certificate.holds
        forces.append(np.linalg.norm(np.sum(solution.steps[-1].contact.forces, axis=0)))
        assert ("in a scene by its key points" in str(solution.findings)) == (points == "against")
    assert forces[1] == pytest.approx(forces[0], rel=0.005)


TURN = {
    "boundary": "upper.top",
    "x": "x[0]*(cos(0.3*t) - 1) - (x[1] - 1)*sin(0.3*t)",
    "y": "x[0]*sin(0.3*t) + (x[1] - 1)*(cos(0.3*t) - 1) + 0.5*t",
}


@pytest.mark.parametrize(
    ("depths", "turn", "touches"),
    [((-0.1, -0.3), None, False), ((0.1, -0.1), None, True), ((-0.1, -0.3), TURN, False)],
    ids=["never", "at first", "turned"],
)
def test_a_body_that_supports_carry_off(depths, turn, touches):
    """It is without stress, as is the one that it has left: no digit is lost where there is none."""
    scene = two_blocks({}, depths)
    supports = [*scene.displacement, *({"boundary": f"{name}.right", "x": 0.0} for name in ("lower", "upper"))]
    if turn is not None:
        supports = [{"boundary": "lower.bottom", "x": 0.0, "y": 0.0}, turn]
    solution = solve(Scene.model_validate(scene.model_dump() | {"displacement": supports}), MPI.COMM_SELF)
    assert np.any(solution.steps[0].contact.in_contact) == touches
    assert not np.any(solution.contact.in_contact)
    said = [finding.message for finding in solution.findings]
    assert not any("round-off" in message for message in said)
    assert any("nothing is in contact" in message for message in said) is not touches
