"""Supports that end and begin with steps, lines that are mutilated, ties beside soft contact, and several contacts."""

import tomllib

import numpy as np
import pytest
from deck_lines import POISSON, YOUNG, squares, stacked
from mpi4py import MPI

from signorini_fx.addons.decks.draft import draft
from signorini_fx.errors import MeshError
from signorini_fx.scenes.reading import read_scene
from signorini_fx.scenes.solver import solve


def drafted(folder, lines):
    """The draft of a deck, its scene as data, and a solution of it."""
    deck = folder / "deck.inp"
    deck.write_text("\n".join(lines) + "\n")
    made = draft(deck, folder / "deck.toml")
    (folder / "deck.toml").write_text(made.text)
    return made, tomllib.loads(made.text)


def solved(folder):
    """The results at the nodes of the deck, step by step, whose certificates hold."""
    solution = solve(read_scene(folder / "deck.toml"), MPI.COMM_SELF)
    assert solution.certificate.holds
    return solution


def moved(made, solution, node):
    """The displacement of a node of the deck in each step."""
    at = made.deck.mesh.points[made.deck.names.tolist().index(node)]
    steps = [solution.at(step).displacement for step in solution.shown_steps]
    x = steps[0].function_space.tabulate_dof_coordinates()[:, :2]
    (row,) = np.flatnonzero(np.linalg.norm(x - at, axis=1) < 1e-12)
    return [step.x.array.reshape(-1, 2)[row] for step in steps]


def test_a_support_that_ends(tmp_path):
    """The head of the upper block is held down in the first step, and set free by OP=NEW in the second, in which only
    the pressure is left: as if it had never been held.
    """
    lines = stacked([])
    lines[lines.index("*DSLOAD") : lines.index("*DSLOAD")] = ["*BOUNDARY", "UP_HEAD, 2, 2, -0.01"]
    lines += ["*STEP", "*STATIC", "*BOUNDARY, OP=NEW", "LOW_FEET, 2", "LOW_WALL, 1", "UP_WALL, 1", "*END STEP"]
    made, data = drafted(tmp_path, lines)
    assert made.lost == []
    holds = [entry.get("holds") for entry in data["displacement"]]
    assert sorted(filter(None, holds)) == [[True, False]]
    first, second = moved(made, solved(tmp_path), 115)
    assert first[1] == pytest.approx(-0.01)
    free = tmp_path / "free"
    free.mkdir()
    other, _ = drafted(free, stacked([]))
    np.testing.assert_allclose(second, moved(other, solved(free), 115)[0], rtol=1e-6)


def test_a_support_that_begins(tmp_path):
    """In the first step it is not there, and what it prescribes in the second is the place, not the way."""
    lines = [*stacked([]), "*STEP", "*STATIC", "*BOUNDARY", "UP_HEAD, 2, 2, -0.003", "*END STEP"]
    made, data = drafted(tmp_path, lines)
    assert made.lost == []
    assert [False, True] in [entry.get("holds") for entry in data["displacement"]]
    first, second = moved(made, solved(tmp_path), 115)
    assert first[1] != pytest.approx(-0.003, rel=1e-2)
    assert second[1] == pytest.approx(-0.003)


def test_sides_inside_a_body_are_in_the_order_of_the_deck(tmp_path):
    """And not in one that differs between runs of Python, in which a draft would differ, too."""
    names = [f"MIDDLE_{letter}" for letter in "HBFDGACE"]
    lines = stacked([])
    at = lines.index("*STEP")
    lines[at:at] = [line for name in names for line in (f"*SURFACE, NAME={name}", "LOW_LOW, S3")]
    made, _ = drafted(tmp_path, lines)
    assert list(made.deck.mesh.inside.items()) == [(name, 4) for name in names]


@pytest.mark.parametrize(
    ("line", "others", "keyword", "says"),
    [
        ("UP_WALL, 1", ["UP_WALLS, 1"], "*BOUNDARY", "set 'UP_WALLS' does not exist"),
        ("UP_WALL, 1", ["UP_WALL, 1", "1.2, 1"], "*BOUNDARY", "set '1.2' does not exist"),
        ("*DSLOAD", ["*TEMPERATURE", "UP_HEADS, 5.", "*DSLOAD"], "*TEMPERATURE", "set 'UP_HEADS' does not exist"),
        ("*STATIC", ["*STATIC", "1., 1.", "UP_TOP, 4."], "*STATIC", "data line 2, 'UP_TOP, 4.', is one too many"),
        (
            "*END STEP",
            ["*NODE PRINT, NSET=UP_HEAD", "U", "112, 2, -1.", "*END STEP"],
            "*NODE PRINT",
            "112 is no result",
        ),
        ("*NODE", ["*SURFACE BEHAVIOR", "*NODE"], "*SURFACE BEHAVIOR", "no .SURFACE INTERACTION is before it"),
        ("*NODE", ["*FRICTION", "0.3", "*NODE"], "*FRICTION", "no .SURFACE INTERACTION is before it"),
        ("*NODE", ["*ELASTIC", "1., 0.3", "*NODE"], "*ELASTIC", "no .MATERIAL is before it"),
        ("*BOUNDARY", ["*NSET, NSET=SOME", "1, O.5", "*BOUNDARY"], "*NSET", "set 'O.5' does not exist"),
        ("*BOUNDARY", ["*NSET, NSET=SOME", "1", ",", "*BOUNDARY"], "*NSET", "data line 2 has no word"),
    ],
)
def test_what_is_mutilated(tmp_path, line, others, keyword, says):
    """Names that are misspelt, and data lines whose keyword is missing, are errors with the line of their keyword."""
    lines = stacked([])
    at = lines.index(line)
    lines[at : at + 1] = others
    number = next(k for k, text in enumerate(lines, 1) if text.startswith(keyword) and k > at - 8)
    with pytest.raises(MeshError, match=f"deck.inp: line {number}, .{keyword[1:]}: {says}"):
        drafted(tmp_path, lines)


@pytest.mark.parametrize(
    ("line", "others", "lost"),
    [
        ("*STATIC", ["*STATIC, SOLVER=SPOOLES,", "DIRECT", "0.5, 1."], []),
        ("*END STEP", ["*EL PRINT, ELSET=UP", "1, 5", "S", "*EL FILE", "1", "S", "*END STEP"], []),
        ("*END STEP", ["*SECTION PRINT, SURFACE=UP_TOP, AXES=LOCAL", "0., 1.", "SOF, SOM", "*END STEP"], []),
        (
            "*BOUNDARY",
            ["*SURFACE INTERACTION, NAME=O, USER, PROPERTIES=9", "1, 2, 3, 4, 5, 6, 7, 8", "9", "*BOUNDARY"],
            ["behaviour of a subroutine is not read: contact is hard"],
        ),
    ],
)
def test_what_only_looks_mutilated(tmp_path, line, others, lost):
    """Keywords of Abaqus that go on in the next line, or have more data lines: numbers of section points, places, and
    constants of a subroutine."""
    lines = stacked([])
    plain, expected = drafted(tmp_path, lines)
    at = lines.index(line)
    lines[at : at + 1] = others
    made, data = drafted(tmp_path, lines)
    assert {**data, "incomplete": None} == {**expected, "incomplete": None}
    assert [said.rpartition("*SURFACE INTERACTION: ")[2] for said in made.lost] == [*plain.lost, *lost]


@pytest.mark.parametrize("keyword", ["*GAP, ELSET=UP", "*CONNECTOR FRICTION"])
@pytest.mark.parametrize("before", ["*NODE", "*BOUNDARY"])
def test_friction_of_elements(tmp_path, keyword, before):
    """That of gaps and connectors is lost with them, and neither an error nor the friction of a contact."""
    lines = stacked(["*FRICTION", "0.2"])
    at = lines.index(before)
    lines[at:at] = [keyword, "0.1, 0., 1.", "*FRICTION", "0.5"]
    made, data = drafted(tmp_path, lines)
    assert data["contact"][0]["friction"]["coefficient"] == 0.2
    assert len(made.lost) == 1


def test_the_nodes_of_a_set_of_elements(tmp_path):
    """A set of nodes may be those of elements, as in Abaqus: what it holds is held."""
    lines = stacked([])
    at = lines.index("*BOUNDARY")
    named, listed = ["*NSET, NSET=SOME, ELSET=LOW_TOP_ROW"], ["*NSET, NSET=SOME", "6, 7, 8, 11, 12, 13"]
    found = []
    for given in (named, listed):
        elements = ["*ELSET, ELSET=LOW_TOP_ROW", "5, 6"]
        made, data = drafted(tmp_path, [*lines[:at], *elements, *given, "*BOUNDARY", "SOME, 1", *lines[at:]])
        found.append((made.lost, data["displacement"]))
        assert not any("SOME" in said for said in made.noted)
    assert found[0] == found[1]
    with pytest.raises(MeshError, match="set 'NONE' does not exist"):
        drafted(tmp_path, [*lines[:at], "*NSET, NSET=SOME, ELSET=NONE", *lines[at:]])


def tied_above_soft(slope, *more):
    """Three blocks above each other: soft contact below, a tie above."""
    lines = [
        line
        for name, y, first in (("LOW", 0.0, 1), ("UP", 1.0, 101), ("LID", 2.0, 201))
        for line in squares(4, 2, first, (0.0, y), name=name)
    ]
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in ("LOW", "UP", "LID")]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{YOUNG}, {POISSON}", "*SURFACE INTERACTION, NAME=I"]
    lines += ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{slope}"]
    lines += ["*CONTACT PAIR, INTERACTION=I", "UP_BOTTOM, LOW_TOP", "*TIE, NAME=T", "LID_BOTTOM, UP_TOP", *more]
    lines += ["*BOUNDARY", "LOW_FEET, 2", "LOW_WALL, 1", "UP_WALL, 1", "LID_WALL, 1"]
    return [*lines, "*STEP", "*STATIC", "*DSLOAD", "LID_TOP, P, 5.0", "*END STEP"]


def test_a_tie_beside_soft_contact(tmp_path):
    """It stays stiff: the lid sinks by the pressure over the slope, once, and by the blocks."""
    slope = 200.0
    made, data = drafted(tmp_path, tied_above_soft(slope))
    assert made.lost == []
    assert [entry.get("kind") for entry in data["contact"]] == ["bonded", None]
    assert data["contact"][1]["overclosure"]["stiffness"] == slope
    (sunk,) = moved(made, solved(tmp_path), 211)
    assert sunk[1] == pytest.approx(-5.0 / slope - 3 * 5.0 * (1 - POISSON**2) / YOUNG, rel=1e-4)


def test_a_tie_beside_hard_contact(tmp_path):
    """It is a bond."""
    _, data = drafted(tmp_path, tied_above_soft(1e4 * YOUNG))
    assert sorted(str(entry.get("kind")) for entry in data["contact"]) == ["None", "bonded"]


def test_contacts_of_several_stiffnesses(tmp_path):
    """Each has its own, and hard contact beside them stays hard."""
    lines = tied_above_soft(200.0)
    at = lines.index("*TIE, NAME=T")
    lines[at : at + 2] = [
        *("*SURFACE INTERACTION, NAME=J", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "500."),
        *("*CONTACT PAIR, INTERACTION=J", "LID_BOTTOM, UP_TOP"),
    ]
    made, data = drafted(tmp_path, lines)
    assert made.lost == []
    assert [contact["overclosure"]["stiffness"] for contact in data["contact"]] == [200.0, 500.0]
    assert "gamma_n" not in data.get("solver", {})
    (sunk,) = moved(made, solved(tmp_path), 213)
    assert sunk[1] == pytest.approx(-5.0 / 200 - 5.0 / 500 - 3 * 5.0 * (1 - POISSON**2) / YOUNG, rel=1e-4)
    lines[lines.index("500.") - 1 : lines.index("500.") + 1] = ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"]
    made, data = drafted(tmp_path, lines)
    assert made.lost == []
    assert [contact.get("overclosure", {}).get("stiffness") for contact in data["contact"]] == [200.0, None]
