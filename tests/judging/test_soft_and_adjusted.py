"""Soft contact by its law, and nodes that a deck moves onto the other surface, of results of CalculiX and of ours."""

import re
from pathlib import Path

import numpy as np
import pytest
from foreign_spoils import with_other_forces

import signorini_fx as sfx
from signorini_fx.addons.judging.judge import judge
from signorini_fx.addons.judging.judgement import CONTACT
from signorini_fx.addons.judging.own_solution import at_nodes_of
from signorini_fx.addons.judging.problems import judged_problem
from signorini_fx.addons.judging.soft_contact import SoftLaw

DATA = Path(__file__).parent / "data"
SOFT = ["shelf_linear", "press_linear"]
LENGTHS = {"shelf_adjusted": 0.032, "shelf_adjusted10": 0.032, "shelf_adjusted8": 0.06}
ADJUSTED = ["shelf_adjusted", "shelf_adjusted8", "shelf_adjusted10", "shelf_adjusted_set"]


def against(name, tmp_path, change):
    """The verdict on a result against a deck with another text."""
    text = (DATA / f"{name}.inp").read_text()
    changed = change(text)
    assert changed != text
    (tmp_path / f"{name}.inp").write_text(changed)
    return judge(tmp_path / f"{name}.inp", DATA / f"{name}.dat", compare=False)


def pressures_times(factor):
    """A law whose pressures are so many times as large."""

    def changed(text):
        at = text.index("PRESSURE-OVERCLOSURE=")
        head, rows, rest = re.fullmatch(r"(.*?\n)([^*]*)(.*)", text[at:], flags=re.DOTALL).groups()
        table = [[float(word) for word in row.split(",")] for row in rows.splitlines()]
        column = 1 if head.startswith("PRESSURE-OVERCLOSURE=EXP") else 0
        for row in table:
            row[column] *= factor
        return text[:at] + head + "".join(", ".join(map(repr, row)) + "\n" for row in table) + rest

    return changed


@pytest.mark.parametrize("factor", [0.5, *(pytest.param(value, marks=pytest.mark.slow) for value in (0.8, 1.25, 2.0))])
@pytest.mark.parametrize("name", SOFT)
def test_another_law(name, factor, tmp_path):
    """A law whose pressures are a quarter larger is another one: of the deck the result has half or twice as much."""
    judgement = against(name, tmp_path, pressures_times(factor))
    assert any(finding.key == "law" for finding in judgement.findings), str(judgement)
    assert judgement.word in (CONTACT + "law", CONTACT + "penetration")
    assert judgement.figures["unlawful"]["value"] > 0.1


@pytest.mark.parametrize("name", [name for name in SOFT if name.startswith("shelf")])
def test_a_gap_that_is_ignored(name, tmp_path):
    """The plate of the deck is lower by the largest part of the gap than that of the result."""
    judgement = against(name, tmp_path, lambda text: re.sub(r"(?m), -0\.020*\d*$", ", -0.035", text))
    assert judgement.word in (CONTACT + "apart", CONTACT + "law"), str(judgement)


FORCES = {
    "half": (lambda force, normal: -0.5 * (force * normal).sum(axis=1)[:, None] * normal, {"law"}),
    "pulls": (
        lambda force, normal: np.eye(len(force))[1][:, None] * 0.3 * np.linalg.norm(force, axis=1).sum() * normal,
        {"tension", "law"},
    ),
}


@pytest.mark.parametrize("fault", FORCES)
@pytest.mark.parametrize("name", [name for name in SOFT if not name.startswith("stack")])
def test_other_pressures(name, fault):
    """Half of the pressure, and a node that pulls: in equilibrium, but against the law."""
    change, keys = FORCES[fault]
    judgement = judge(DATA / f"{name}.inp", with_other_forces(DATA / f"{name}.inp", change), compare=False)
    assert judgement.figures["equilibrium"]["value"] < 1e-3
    assert judgement.word.startswith(CONTACT)
    assert keys <= {finding.key for finding in judgement.findings}, str(judgement)


def test_a_law_that_a_program_passes_over(tmp_path):
    """A soft law where the result is of hard contact, and the other way round."""
    soft, hard = "PRESSURE-OVERCLOSURE=LINEAR\n200.0", "PRESSURE-OVERCLOSURE=LINEAR\n100000.0"
    judgement = against("shelf_CPE4", tmp_path, lambda text: text.replace(hard, soft))
    assert judgement.word == CONTACT + "law", str(judgement)


def test_beside_our_own_solution():
    """Ours has the law, too, and is near; there is no bound."""
    judgement = judge(DATA / "shelf_linear.inp", DATA / "shelf_linear.dat")
    assert judgement.beside["displacement"] < 0.02, str(judgement)
    assert judgement.error["reason"] == "a guaranteed bound is for hard contact"


def test_nodes_have_the_tension_of_calculix():
    """A linear law of nodes is p = K h (1/2 + arctan(K h / (pi s)) / pi), which pulls by s far away."""
    law = SoftLaw(300.0, 0.02, apart=True)
    low, high = law.pressures(np.array([[-100.0], [0.01]]))
    near = 300 * 0.01 * (0.5 + np.arctan(3 / (0.02 * np.pi)) / np.pi)
    np.testing.assert_allclose(low[:, 0], [-0.02, near], rtol=1e-6)
    np.testing.assert_allclose(high[:, 0], [0.0, 3.0])


def softness(factor=1.0):
    """Of a scene, with pressures that are so many times as large."""
    return {"stiffness": 300.0 * factor}


BODIES = {
    "quadrilaterals": {"generator": "rectangle", "parameters": {"length": 2.0, "height": 0.5, "nx": 12, "ny": 4}},
    "triangles": {
        "generator": "rectangle",
        "parameters": {"length": 2.0, "height": 0.5, "nx": 12, "ny": 4, "cell": "triangle"},
    },
    "space": {
        "generator": "box",
        "parameters": {"length": 1.0, "width": 0.5, "height": 0.5, "nx": 5, "ny": 2, "nz": 2},
    },
}


@pytest.mark.parametrize(
    "body", ["quadrilaterals", *(pytest.param(name, marks=pytest.mark.slow) for name in ("triangles", "space"))]
)
def test_our_own_solution_of_soft_contact_agrees(body):
    """And does not against a law with other pressures."""
    axis = "z" if body == "space" else "y"
    held = dict.fromkeys("xyz" if body == "space" else "xy", 0.0)

    def scene(factor=1.0):
        return {
            "mesh": BODIES[body],
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [{"boundary": "left", **held}],
            "traction": [{"boundary": "top", axis: -2.0}],
            "contact": [{"boundary": "bottom", "gap": 0.005, "overclosure": softness(factor)}],
        }

    problem, reasons = judged_problem(scene())
    assert reasons == []
    v = at_nodes_of(sfx.solve(sfx.Scene(**scene())), problem)
    judgement = judge(scene(), v, compare=False)
    assert judgement.word == "agrees", str(judgement)
    assert judgement.figures["unlawful"]["value"] < 0.01
    for factor in (0.7, 1.4):
        judgement = judge(scene(factor), v, compare=False)
        assert any(finding.key == "law" for finding in judgement.findings), str(judgement)


def in_two(text):
    """The deck whose surface below is divided, so that the part near the clamped side is a contact that stays open."""
    head, rows = re.search(r"(\*SURFACE, NAME=BODY_BOTTOM\n)((?:\d+, S\d\n)+)", text).groups()
    faces = rows.splitlines(keepends=True)
    half = len(faces) // 2
    parts = head.replace("BODY_BOTTOM", "CLOSE") + "".join(faces[:half]) + head.replace("BODY_BOTTOM", "FAR")
    text = text.replace(head + rows, parts + "".join(faces[half:]))
    return text.replace("BODY_BOTTOM, BASE_TOP\n", "CLOSE, BASE_TOP\nFAR, BASE_TOP\n")


@pytest.mark.parametrize("name", ["shelf_CPE4", "shelf_CPE6", "shelf_CPE8R", "shelf_linear"])
def test_a_contact_that_is_open_beside_another_one(name, tmp_path):
    """What it has of forces is print round-off: no share of it pulls, or is friction, or is not by a law."""
    judgement = against(name, tmp_path, in_two)
    assert judgement.word == "agrees", str(judgement)
    for label in ("tension", "apart", "unlawful"):
        figure = judgement.figures[label]
        assert figure["value"] is None or figure["value"] < 0.3 * figure["threshold"]
    assert judgement.figures["cone_ratio"]["value"] == 1.0


BEHAVIOUR = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE="


@pytest.mark.parametrize(("name", "second"), [("shelf_linear", "LINEAR\n3e5")])
def test_the_last_of_two_laws_counts(name, second, tmp_path):
    """In the scene and for the verdict, which says that there are two."""
    judgement = against(name, tmp_path, lambda text: text.replace("*CONTACT", f"{BEHAVIOUR}{second}\n*CONTACT"))
    assert judgement.word.startswith("violates contact: "), str(judgement)
    assert "a second behaviour of the interaction 'S'" in "".join(judgement.lost)
    text = (tmp_path / f"{name}.inp").read_text()
    (tmp_path / "last.inp").write_text(re.sub(rf"{re.escape(BEHAVIOUR)}[^*]*(?={re.escape(BEHAVIOUR)})", "", text))
    alone = judge(tmp_path / "last.inp", DATA / f"{name}.dat", compare=False)
    assert alone.lost == ()
    assert (alone.word, alone.figures) == (judgement.word, judgement.figures)


def test_numbers_that_no_law_reads_are_lost(tmp_path):
    """As of a parameter that is misspelled."""
    judgement = against("shelf_linear", tmp_path, lambda text: text.replace("PRESSURE-", "PRESSURE "))
    assert "*SURFACE BEHAVIOR: its numbers are not read: contact is hard" in "".join(judgement.lost)


BAD_PAIRS = {
    "PRESSURE-OVERCLOSURE=LINEAR": ("PRESSURE-OVERCLOSURE=LINEAR\nabc", "could not convert string to float: 'abc'"),
    "INTERACTION=S": ("INTERACTION=Q", "there is no *SURFACE INTERACTION, NAME=Q"),
    "INTERACTION=S,": ("INTERACTION=S, ADJUST=NOWHERE,", "ADJUST=NOWHERE: a length or the name of a set of nodes"),
    "TYPE=SURFACE": ("ADJUST=BODY_BOTTOM, TYPE=SURFACE", "ADJUST=BODY_BOTTOM: a length or the name of a set of nodes"),
    "TYPE=SURFACE TO": ("ADJUST, TYPE=SURFACE TO", "ADJUST=: a length or the name of a set of nodes"),
    "INTERACTION=S, TYPE": ("INTERACTION=S, ADJUST=nan, TYPE", "ADJUST=nan: a length or the name of a set of nodes"),
}


@pytest.mark.parametrize("old", BAD_PAIRS)
def test_what_a_pair_refers_to_must_be_there(old, tmp_path):
    """An interaction, a set of nodes, all numbers of a law."""
    new, words = BAD_PAIRS[old]
    with pytest.raises(sfx.MeshError, match=re.escape(words)):
        against("shelf_linear", tmp_path, lambda text: text.replace(old, new))


@pytest.mark.parametrize("name", ADJUSTED)
def test_nodes_are_moved(name, tmp_path):
    """Those within the length, or of the set, lie on the plate, along its normal, and no others move."""
    problem, _ = judged_problem(DATA / f"{name}.inp")
    text = re.sub(r", ADJUST=[^,\n]*", "", (DATA / f"{name}.inp").read_text())
    (tmp_path / "deck.inp").write_text(text)
    plain, _ = judged_problem(tmp_path / "deck.inp")
    x = plain.mesh.points
    # The plate is at -0.02 - 0.01 (x + 0.5).
    normal = np.zeros(problem.mesh.dim)
    normal[0], normal[-1] = 0.01, 1.0
    normal /= np.linalg.norm(normal)
    distance = (x[:, -1] + 0.02 + 0.01 * (x[:, 0] + 0.5)) * normal[-1]
    slave = np.isin(np.arange(len(x)), problem.contacts[0].facets)
    near = slave & (distance <= (LENGTHS.get(name, np.inf)))
    assert 3 <= near.sum() < len(x) / 2
    assert near.sum() < slave.sum() or name in ("shelf_adjusted8", "shelf_adjusted_set")
    moved = x - np.where(near, distance, 0.0)[:, None] * normal
    np.testing.assert_allclose(problem.mesh.points, moved, atol=1e-12)
    # The mesh that our own solution has is the same one, and its contact closes nothing more.
    np.testing.assert_allclose(problem.deck.mesh.points[: len(x)], moved, atol=1e-12)
    assert problem.contacts[0].entry.adjust is None
    cells = problem.deck.mesh.cells
    if cells.shape[1] == 9:
        full = problem.deck.mesh.points[cells]
        middle = full[:, 4:8].sum(axis=1) / 2 - full[:, :4].sum(axis=1) / 4
        np.testing.assert_allclose(full[:, 8], middle, atol=1e-12)


@pytest.mark.parametrize("name", ADJUSTED)
def test_the_mesh_of_the_file_is_another_one(name, tmp_path):
    """What was adjusted is in no equilibrium on the mesh without, and what was not is in none with."""
    judgement = against(name, tmp_path, lambda text: re.sub(r", ADJUST=[^,\n]*", "", text))
    assert judgement.word == "not in equilibrium", str(judgement)
    judgement = against(name, tmp_path, lambda text: re.sub(r"ADJUST=[^,\n]*", "ADJUST=0.022", text))
    assert not judgement.agrees


def test_beside_ours_on_the_adjusted_mesh():
    """Ours is solved on the mesh that was adjusted, of which there is a bound, too."""
    judgement = judge(DATA / "shelf_adjusted3.inp", DATA / "shelf_adjusted3.dat")
    assert judgement.error["guaranteed"], str(judgement)
    assert judgement.error["distance"] < 0.02
    assert judgement.beside["displacement"] < 0.03


def test_a_set_of_nodes_in_the_plane(tmp_path):
    """CalculiX moves none of them: its plane elements have other nodes."""
    judgement = against("shelf_adjusted", tmp_path, lambda text: text.replace("ADJUST=0.032", "ADJUST=BODY_BOTTOM_N"))
    assert (judgement.word, judgement.exit_code) == ("cannot be judged", 7)
    assert "ADJUST=BODY_BOTTOM_N: of plane elements CalculiX moves no nodes of a set" in str(judgement)


def test_a_node_at_the_very_distance(tmp_path):
    """Round-off decides whether a program moves it."""
    judgement = against("shelf_adjusted3", tmp_path, lambda text: text.replace("ADJUST=0.032", "ADJUST=0.02"))
    assert judgement.word == "cannot be judged"
    assert "ADJUST=0.02: node 1 is at this very distance" in str(judgement)


ROOF = """*NODE
1, -1, -1
2, 0, -1
3, 1, -1
4, -1, -0.05
5, 0, 0
6, 1, -0.05
11, -1.2, 0.0
12, 0, 0.1
13, 0.5, 0.02
14, -1.2, 1
15, 0, 1
16, 0.5, 1
*ELEMENT, TYPE=CPE4, ELSET=BASE
1, 1, 2, 5, 4
2, 2, 3, 6, 5
*ELEMENT, TYPE=CPE4, ELSET=BODY
3, 11, 12, 15, 14
4, 12, 13, 16, 15
*SURFACE, NAME=ROOF
1, S3
2, S3
*SURFACE, NAME=FOOT
3, S1
4, S1
*MATERIAL, NAME=M
*ELASTIC
1000., 0.3
*SOLID SECTION, ELSET=BASE, MATERIAL=M
*SOLID SECTION, ELSET=BODY, MATERIAL=M
*SURFACE INTERACTION, NAME=S
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD
*CONTACT PAIR, INTERACTION=S, ADJUST=0.2
FOOT, ROOF
*NSET, NSET=ALL
1, 2, 3, 14, 15, 16
*BOUNDARY
ALL, 1, 2
*STEP
*STATIC
*END STEP
"""


def test_the_ridge_and_the_end_of_a_surface(tmp_path):
    """A node above a ridge, opposite to neither of its facets, is moved along the normal of one of them; one beyond the
    end of the surface stays.
    """
    (tmp_path / "roof.inp").write_text(ROOF)
    problem, _ = judged_problem(tmp_path / "roof.inp")
    at = dict(zip(problem.mesh.names.tolist(), problem.mesh.points.tolist(), strict=True))
    assert at[11] == [-1.2, 0.0]
    steep = np.hypot(1, 0.05)
    # 12 and 13 are (0.1, 0.045) below their places along normals (-+0.05, 1) / steep.
    assert abs(at[12][0]) == pytest.approx(0.05 / steep * 0.1 / steep, rel=1e-9)
    assert at[12][1] == pytest.approx(0.1 - 0.1 / steep**2, rel=1e-9)
    assert at[13] == pytest.approx([0.5 - 0.05 * 0.045 / steep**2, 0.02 - 0.045 / steep**2], rel=1e-9)
