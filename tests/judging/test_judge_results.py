"""Verdicts on results of CalculiX and of our own: good ones agree, and what is spoiled is named."""

import json
import re
from pathlib import Path

import meshio
import numpy as np
import pytest
from scene_tables import fixed, rectangle_mesh
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

import signorini_fx as sfx
from signorini_fx import MeshError
from signorini_fx.addons.decks.results import read_dat
from signorini_fx.addons.judging.judge import AGREES, ANOTHER, UNDECIDED, VIOLATES, judge
from signorini_fx.addons.judging.judged_problem import SolutionOnMesh, judged_problem
from signorini_fx.scenes import cli

DATA = Path(__file__).parent / "data"
DEMOS = Path(__file__).parents[2] / "demos" / "scenes"


def displacements(name):
    """Of a .dat file, in the order of the nodes of the deck."""
    printed, names = read_dat(DATA / f"{name}.dat"), judged_problem(DATA / f"{name}.inp").names
    order = np.argsort(printed.numbers)
    return printed.displacement[order[np.searchsorted(printed.numbers, names, sorter=order)]]


def changed(name, folder, pattern, new):
    """The deck with another text, judged with its result."""
    text = (DATA / f"{name}.inp").read_text()
    deck = folder / f"{name}.inp"
    deck.write_text(re.sub(pattern, new, text))
    assert deck.read_text() != text
    return judge(deck, DATA / f"{name}.dat")


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(file.stem for file in DATA.glob("*.dat")))
def test_good_results_agree(name):
    """Of full, reduced and quadratic elements, in 2D, of revolution and in 3D."""
    judgement = judge(DATA / f"{name}.inp", DATA / f"{name}.dat")
    assert (judgement.word, judgement.exit_code) == (AGREES, 0), str(judgement)


def test_equal_elements_have_equal_solutions():
    """Far below the error of the mesh; in all ten lines there is no fault."""
    judgement = judge(DATA / "shelf_CPE4.inp", DATA / "shelf_CPE4.frd")
    distance = judgement.figures["distance"]
    assert distance["value"] < 1e-3 < 0.1 < distance["threshold"]
    assert judgement.theirs["digits"] == 6
    displacement = judgement.figures["displacement"]
    assert displacement["value"] < 1e-2 < displacement["threshold"]
    assert len(str(judgement).splitlines()) == 10


SPOILED = {
    "load x 1.3": ("shelf_CPE4", "BODY_TOP, P, 1.0", f"BODY_TOP, P, {1 / 1.3!r}", ANOTHER, r"on BODY_TOP is 1\.3"),
    "modulus": ("shelf_CPE4", r"\n1000.0, 0.3", r"\n700.0, 0.3", ANOTHER, r"moduli 1\.4\d* times"),
    "modulus of one body": ("stack_CPE8R", r"\n3000.0, 0.3", r"\n1500.0, 0.3", ANOTHER, "modulus of BASE is (2|1.9)"),
    "gap": ("shelf_CPE4", r"(?m), -0\.020*\d*$", ", -0.005", ANOTHER, r"gap of BODY_BOTTOM is "
                                                                      r"larger by 0\.01[45]"),
    "friction x 2": ("press_CPE4", r"FRICTION\n0.3", r"FRICTION\n0.15", ANOTHER, r"is 0\.(29|30?)\d*, not 0\.15"),
    "no friction": ("press_CPE4", r"\*FRICTION\n.*\n", "", ANOTHER, "coefficient of friction on "
                                                                    "BODY_BOTTOM"),
    "support": ("press_C3D8", "BODY_TOP_N, 1, 1, 0.01", "BODY_TOP_N, 1, 1, 0.012", VIOLATES + "supports", "along x"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("fault", SPOILED)
def test_what_is_another_problem_is_named(fault, tmp_path):
    """The deck is changed the other way round."""
    name, pattern, new, word, reason = SPOILED[fault]
    judgement = changed(name, tmp_path, pattern, new)
    assert judgement.word == word, str(judgement)
    assert re.search(reason, judgement.reason), str(judgement)
    assert judgement.exit_code == (5 if word == ANOTHER else 6)


@pytest.mark.slow
def test_units_and_single_nodes():
    """Displacements in millimetres, a node moved by a tenth of the largest displacement, and none
    that moves.
    """
    u = displacements("shelf_CPE4")
    deck = DATA / "shelf_CPE4.inp"
    judgement = judge(deck, 1000 * u)
    assert (judgement.word, judgement.exit_code) == (ANOTHER, 5)
    assert "1000 times the solution: it has other units" in judgement.reason
    moved = u.copy()
    moved[judged_problem(deck).names.tolist().index(22), 1] += 0.1 * np.abs(u).max()
    judgement = judge(deck, moved)
    assert judgement.word == VIOLATES + "equilibrium", str(judgement)
    assert "around node 22" in judgement.reason
    judgement = judge(deck, 0 * u)
    assert (judgement.word, judgement.reason, judgement.exit_code) == (
        UNDECIDED,
        "nothing moves at all",
        7,
    )


def test_nodes_within_the_error_of_the_mesh():
    """One that is moved a little is named, and so are two that are swapped."""
    deck = DATA / "shelf_CPE4.inp"
    u, names = displacements("shelf_CPE4"), judged_problem(deck).names.tolist()
    moved, swapped = u.copy(), u.copy()
    moved[names.index(22), 1] += 0.004 * np.abs(u).max()
    swapped[[names.index(3), names.index(22)]] = u[[names.index(22), names.index(3)]]
    for v, nodes in ((moved, (22,)), (swapped, (3, 22))):
        judgement = judge(deck, v)
        assert judgement.word == VIOLATES + "equilibrium", str(judgement)
        assert all(f"node {node} " in judgement.reason for node in nodes)
    assert (
        judge(deck, moved).figures["distance"]["value"]
        < 0.6
        < judgement.figures["distance"]["threshold"]
    )


@pytest.mark.slow
@pytest.mark.parametrize(("share", "condition"), [(-0.7, "penetration"), (0.7, "complementarity")])
def test_a_rigid_motion_has_no_strain(share, condition):
    """The upper body of a stack is moved along the gap: its energy norm is that of the good
    result.
    """
    u, deck = displacements("stack_CPE8R"), DATA / "stack_CPE8R.inp"
    stack = judged_problem(deck)
    upper = stack.names <= stack.names[stack.points[:, 1] > 0.1].max()
    u[upper, 1] += share * np.abs(u).max()
    judgement = judge(deck, u)
    assert (judgement.word, judgement.exit_code) == (VIOLATES + condition, 6), str(judgement)
    assert judgement.figures["distance"]["value"] < judgement.figures["distance"]["threshold"]


def test_what_a_result_lacks(tmp_path):
    """Digits, nodes, and time."""
    text = (DATA / "shelf_CPE4.dat").read_text()
    (tmp_path / "three.dat").write_text(re.sub(r"(-?\d\.\d\d)\d{4}(E[+-]\d\d)", r"\1\2", text))
    assert "3 digits" in judge(DATA / "shelf_CPE4.inp", tmp_path / "three.dat").reason
    (tmp_path / "some.dat").write_text(
        "\n".join(row for row in text.splitlines() if not row.startswith("        17"))
    )
    judgement = judge(DATA / "shelf_CPE4.inp", tmp_path / "some.dat")
    assert (judgement.word, judgement.exit_code) == (UNDECIDED, 7)
    assert "1 nodes have no displacement, such as node 17" in judgement.reason
    (tmp_path / "early.dat").write_text(text.replace("0.1000000E+01", "0.5000000E+00"))
    judgement = judge(DATA / "shelf_CPE4.inp", tmp_path / "early.dat")
    assert (judgement.word, judgement.reason) == (
        ANOTHER,
        "it ends at time 0.5, and the problem at 1",
    )


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda row: row.replace("17", "1x", 1), "a node and three components are expected"),
        (lambda row: "garbage", "a node and three components are expected"),
        (lambda row: row[:26], "a node and three components are expected"),
        (lambda row: row[:14] + "x" + row[15:], "numbers are expected"),
    ],
)
def test_rows_that_are_none(tmp_path, spoil, says):
    """One error with the line."""
    lines = (DATA / "shelf_CPE4.dat").read_text().splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith("        17"))
    lines[at] = spoil(lines[at])
    (tmp_path / "spoiled.dat").write_text("\n".join(lines) + "\n")
    with pytest.raises(MeshError, match=f"line {at + 1}: {says}"):
        judge(DATA / "shelf_CPE4.inp", tmp_path / "spoiled.dat")


def shelf(degree=1, **changes):
    """A body that is held on the left, and bent down onto a foundation."""
    stated = {
        "mesh": rectangle_mesh(12, 4, length=2.0, height=0.5),
        "element": {"degree": degree},
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": fixed("left"),
        "traction": {"boundary": "top", "y": "-1 - 0.5*x[0]"},
        "contact": {"boundary": "bottom", "gap": 0.005},
    }
    return sfx.Scene(**stated | changes)


def solved(scene):
    """Positions and displacements of the nodes of a scene."""
    problem = judged_problem(scene)
    return problem.points, SolutionOnMesh.of(problem, problem.arrays).displacement


def test_formats(tmp_path):
    """An array, tables with positions or numbers, and .vtu: the same verdict."""
    scene = shelf()
    x, v = solved(scene)
    rows = np.hstack((x, v))[::-1].tolist()
    (tmp_path / "xy.csv").write_text(
        "x,y,ux,uy\n" + "\n".join(",".join(map(repr, row)) for row in rows)
    )
    numbered = [f"{n},{a:.8e},{b:.8e}" for n, (a, b) in enumerate(v.tolist(), start=1)]
    (tmp_path / "node.csv").write_text("node,ux,uy\n" + "\n".join(numbered))
    at, u = (np.pad(values, ((0, 0), (0, 1))) for values in (x, v))
    meshio.Mesh(at, [("vertex", np.arange(len(x))[:, None])], point_data={"u": u}).write(
        tmp_path / "u.vtu"
    )
    files = [tmp_path / name for name in ("xy.csv", "node.csv", "u.vtu")]
    for result in (v, *files):
        judgement = judge(scene, result)
        assert judgement.agrees, str(judgement)
        assert judgement.figures["distance"]["value"] < 1e-6


def test_values_between_all_nodes(tmp_path):
    """Elements of degree 2 judged by a scene of degree 1: they agree at its nodes."""
    x, v = solved(shelf(2))
    rows = np.hstack((x, v)).tolist()
    (tmp_path / "xy.csv").write_text(
        "x,y,ux,uy\n" + "\n".join(",".join(map(repr, row)) for row in rows)
    )
    judgement = judge(shelf(), tmp_path / "xy.csv")
    assert judgement.agrees, str(judgement)
    assert judge(shelf(2), tmp_path / "xy.csv").figures["distance"]["value"] < 1e-8


def from_other_elements(**changes):
    """The solution of a shelf with elements of degree 2 at the corners of its cells."""
    points, displacement = solved(shelf(2, **changes))
    return displacement[cKDTree(points).query(judged_problem(shelf()).points)[1]]


@pytest.mark.parametrize(
    ("changes", "word", "reason"),
    [
        ({}, AGREES, ""),
        (
            {"traction": {"boundary": "top", "y": "-1.05 - 0.525*x[0]"}},
            ANOTHER,
            r"loads are 1\.0[3-8]",
        ),
        ({"contact": {"boundary": "bottom", "gap": 0.006}}, ANOTHER, r"gap of bottom .* by 0\.001"),
    ],
)
def test_each_measure_must_agree(changes, word, reason):
    """Far below the error in energy: the contact force or the displacement are not ours."""
    judgement = judge(shelf(), from_other_elements(**changes))
    assert judgement.word == word, str(judgement)
    assert re.search(reason, judgement.reason), str(judgement)
    distance, *others = (judgement.figures[name] for name in ("distance", "displacement", "force"))
    assert distance["value"] < 0.5 * distance["threshold"]
    assert all(one["value"] <= one["threshold"] for one in others) == judgement.agrees


def test_contact_that_is_ignored():
    """The body goes through its foundation, which another gap explains, or it enters."""
    free = solved(shelf(contact=()))[1]
    judgement = judge(shelf(), free)
    assert judgement.word == VIOLATES + "penetration" or "gap of bottom" in judgement.reason, str(
        judgement
    )


def test_a_gap_that_is_an_expression():
    """Another one is found, as of a number, on one mesh or on nested ones."""
    given = {"boundary": "bottom", "gap": "0.005 + 0.001*x[0]"}
    other = solved(shelf(contact=given | {"gap": "0.007 + 0.001*x[0]"}))[1]
    judgement = judge(shelf(contact=given, solver={"levels": 2}), other)
    assert judgement.word == ANOTHER, str(judgement)
    assert judgement.reason == "its gap of bottom is larger by 0.002"


def test_friction_turned_round():
    """In equilibrium, with the opposite of the friction there is: along the slip."""
    problem = judged_problem(DATA / "press_CPE4.inp")
    ours = SolutionOnMesh.of(problem, problem.arrays)
    state = ours.solution.contact
    shear = (
        np.einsum("nij,nj->ni", state.boundary.tangents, state.shear)
        * state.boundary.weight[:, None]
    )
    forces = ours.points_of_contact.T @ shear.ravel()
    free = np.flatnonzero(~ours.held.ravel())
    v = ours.displacement.ravel().copy()
    v[free] += splu(ours.stiffness[free][:, free].tocsc()).solve(2 * forces[free])
    judgement = judge(DATA / "press_CPE4.inp", v.reshape(-1, 2)[: len(problem.names)])
    assert judgement.word == VIOLATES + "friction", str(judgement)
    assert judgement.figures["equilibrium"]["value"] < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", ["press_fit", "two_cylinders"])
def test_solutions_of_demos_agree(name, tmp_path):
    """Of two bodies, with friction and load steps; the end of an earlier load step is named."""
    scene = sfx.read_scene(DEMOS / f"{name}.toml")
    solution = sfx.solve(scene)
    sfx.write_results(solution, tmp_path / "out", pictures=False)
    judgement = judge(scene, max((tmp_path / "out").rglob("*.vtu")))
    assert judgement.agrees, str(judgement)
    assert judgement.figures["distance"]["value"] < 1e-6
    problem = judged_problem(scene)
    steps = SolutionOnMesh.of(problem, problem.arrays).steps
    for number, step in enumerate(steps, start=1):
        if np.abs(step).any():
            other = judge(scene, step)
            assert other.word == VIOLATES + "supports" or f"load step {number}" in other.reason, (
                str(other)
            )


def test_materials_that_are_not_linear_are_refused():
    """By their name."""
    scene = shelf(material={"law": "neo-hooke", "young": 1.0, "poisson": 0.3})
    judgement = judge(scene, np.ones((65, 2)))
    assert (judgement.word, judgement.exit_code) == (UNDECIDED, 7)
    assert judgement.reason == "materials that are not linear are not judged"


@pytest.mark.one_quick(
    ("result", "code"), [("shelf_CPE4.dat", 0), ("press_CPE4.dat", 6), ("absent.dat", 2)]
)
def test_the_command(result, code, capsys):
    """Its exit code, and JSON."""
    assert cli.main(["judge", str(DATA / "shelf_CPE4.inp"), str(DATA / result), "--json"]) == code
    printed = capsys.readouterr()
    if code == 2:
        assert "cannot be read" in printed.err
    else:
        assert json.loads(printed.out)["exit_code"] == code
