"""What steps take away: supports, elements, contact pairs; clearances; ties beside soft contact."""

import itertools
import tomllib

import numpy as np
import pytest
from deck_lines import POISSON, YOUNG, squares, stacked
from mpi4py import MPI

from signorini_fx.addons.decks.draft import draft
from signorini_fx.addons.decks.node_results import at_nodes
from signorini_fx.addons.decks.tables import dat
from signorini_fx.errors import MeshError
from signorini_fx.scenes.reading import read_scene
from signorini_fx.scenes.solver import solve


def drafted(folder, lines):
    """The draft of a deck, its scene as data, and a solution of it."""
    deck = folder / "deck.inp"
    deck.write_text("\n".join(lines) + "\n")
    made = draft(deck, folder / "deck.toml")
    for file, text in made.files.items():
        file.write_text(text)
    return made, tomllib.loads(made.text)


def solved(folder):
    """The results at the nodes of the deck, step by step, whose certificates hold."""
    solution = solve(read_scene(folder / "deck.toml"), MPI.COMM_SELF)
    assert solution.certificate.holds
    return solution


def moved(made, solution, node):
    """Its displacement in each step."""
    row = made.deck.names.tolist().index(node)
    return [moment.displacement[row, :2] for moment in at_nodes(solution, made.deck)]


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


@pytest.mark.parametrize("step", [1, 2])
def test_elements_that_a_step_removes(tmp_path, step):
    """In the first step they are not there at all; in a later one they stay, which is said."""
    lines = stacked([])
    column = ["*ELSET, ELSET=GONE", "104, 108"]  # the last of the upper block, on the other side than its wall
    at = lines.index("*STEP")
    lines[at:at] = column
    change = ["*MODEL CHANGE, TYPE=ELEMENT, REMOVE", "GONE"]
    lines = [*lines[:-1], *change, "*END STEP"] if step == 1 else [*lines, "*STEP", "*STATIC", *change, "*END STEP"]
    made, _ = drafted(tmp_path, lines)
    assert any("come or go" in remark for remark in made.lost) == (step == 2)
    assert len(made.deck.mesh.cells) == (14 if step == 1 else 16)
    if step == 1:
        solution = solved(tmp_path)
        force = solution.contact.pressure @ solution.contact.boundary.weight
        assert force == pytest.approx(5.0 * 0.75)


def test_a_side_of_removed_elements_alone(tmp_path):
    """Its contact is gone with it, and nothing is lost."""
    lines = stacked([])
    lines[-1:] = ["*MODEL CHANGE, TYPE=ELEMENT, REMOVE", "UP", "*END STEP"]
    lines[lines.index("*DSLOAD") + 1] = "LOW_TOP, P, 5.0"
    at = lines.index("*BOUNDARY")
    lines[at:] = [line for line in lines[at:] if line != "UP_WALL, 1"]
    made, data = drafted(tmp_path, lines)
    assert (made.lost, "contact" in data) == ([], False)


@pytest.mark.parametrize(("second", "there"), [("", False), ("ADD", True), ("REMOVE", False)])
def test_a_contact_pair_that_the_first_step_removes(tmp_path, second, there):
    """It is not there, unless a later step adds it again, and then from that one on."""
    change = "*MODEL CHANGE, TYPE=CONTACT PAIR, "
    lines = [*stacked([])[:-1], change + "REMOVE", "UP_BOTTOM, LOW_TOP", "*END STEP"]
    if second:
        lines += ["*STEP", "*STATIC", change + second, "UP_BOTTOM, LOW_TOP", "*END STEP"]
    made, data = drafted(tmp_path, lines)
    assert made.lost == ([] if there else made.lost)
    assert ("contact" in data) == there
    if there:
        assert data["contact"][0]["gap"].endswith("if t < 1.5 else 0.0")


def test_contact_pairs_that_come_and_go(tmp_path):
    """A block whose head is pushed down by a depth in each of four steps touches the one below in the second and third:
    by formula, its pressure is that of the depth, and the last step ends without any.
    """
    lines, change = stacked([])[:-2], "*MODEL CHANGE, TYPE=CONTACT PAIR, "
    lines[-1:] = ["*BOUNDARY", "UP_HEAD, 2, 2, -.01", change + "REMOVE", "UP_BOTTOM, LOW_TOP", "*END STEP"]
    for depth, word in ((0.02, "ADD"), (0.03, ""), (0.04, "REMOVE")):
        lines += ["*STEP", "*STATIC", "*BOUNDARY", f"UP_HEAD, 2, 2, -{depth}"]
        lines += [*([change + word, "UP_BOTTOM, LOW_TOP"] if word else []), "*END STEP"]
    made, data = drafted(tmp_path, lines)
    assert made.lost == []
    assert data["contact"][0]["gap"].count(" if t < ") == 2
    solution = solved(tmp_path)
    stiffness = YOUNG / (1 - POISSON**2) / 2  # of two blocks of height 1, free to the side
    for step, depth in zip(solution.steps, (0.0, 0.02, 0.03, 0.0), strict=True):
        np.testing.assert_allclose(solution.at(step).contact.pressure, stiffness * depth, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("clearance", [0.004, -0.004])
def test_clearance(tmp_path, clearance):
    """The distance is that of the file, wherever the meshes are: two blocks whose far ends are held are compressed by
    an overlap in equal parts, and a gap stays open.
    """
    lines = stacked([], gap=0.1)
    at = lines.index("*STEP")
    lines[at:at] = [f"*CLEARANCE, MASTER=LOW_TOP, SLAVE=UP_BOTTOM, VALUE={clearance}"]
    lines[lines.index("*DSLOAD") :] = ["*BOUNDARY", "UP_HEAD, 2", "*END STEP"]
    made, data = drafted(tmp_path, lines)
    assert made.lost == []
    (contact,) = data["contact"]
    assert (contact["distance"], contact["gap"]) == ("nominal", clearance)
    solution = solved(tmp_path)
    pressure = YOUNG / (1 - POISSON**2) * max(-clearance, 0.0) / 2  # of two blocks of height 1, free to the side
    np.testing.assert_allclose(solution.contact.pressure, pressure, rtol=1e-4, atol=1e-9)


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
            ["behaviour of a subroutine: contact is hard"],
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


def test_a_clearance_of_no_contact(tmp_path):
    """It is lost with the names of its sides."""
    lines = stacked([])
    at = lines.index("*STEP")
    lines[at:at] = ["*CLEARANCE, MASTER=LOW_BOTTOM, SLAVE=UP_TOP, VALUE=0.1"]
    made, _ = drafted(tmp_path, lines)
    assert made.lost == ["clearance of LOW_BOTTOM and UP_TOP: no such contact of two bodies here"]


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
    """Its nodes are linked: the lid sinks by the pressure over the slope, once, and by the blocks."""
    slope = 200.0
    made, data = drafted(tmp_path, tied_above_soft(slope))
    assert made.lost == []
    assert [entry.get("kind") for entry in data["contact"]] == [None]
    assert data["solver"]["gamma_n"] == slope
    (sunk,) = moved(made, solved(tmp_path), 211)
    assert sunk[1] == pytest.approx(-5.0 / slope - 3 * 5.0 * (1 - POISSON**2) / YOUNG, rel=1e-4)


def test_a_tie_beside_hard_contact(tmp_path):
    """It is a bond."""
    _, data = drafted(tmp_path, tied_above_soft(1e4 * YOUNG))
    assert sorted(str(entry.get("kind")) for entry in data["contact"]) == ["None", "bonded"]


def test_slips_count_from_the_beginning(tmp_path):
    """In .dat, as CalculiX has them: pushed to the right and back, a node has its own place."""
    lines = stacked(["*FRICTION", "0.2"])
    at = lines.index("*BOUNDARY")
    lines[at:] = [line for line in lines[at:] if line != "UP_WALL, 1"]
    steps = itertools.chain.from_iterable(
        ["*STEP", "*STATIC", "*BOUNDARY", f"UP_HEAD, 1, 1, {x}", "UP_HEAD, 2, 2, -0.01", "*END STEP"]
        for x in (0.1, 0.05)
    )
    lines = [*lines[: lines.index("*STEP")], *steps]
    made, _ = drafted(tmp_path, lines)
    pushed, back = at_nodes(solved(tmp_path), made.deck)
    middle = made.deck.names.tolist().index(103)
    for moment, x in ((pushed, 0.1), (back, 0.05)):
        slip = abs(moment.contact[middle, 1])
        assert slip == pytest.approx(abs(moment.displacement[middle, 0]), abs=0.02)
        assert slip == pytest.approx(x, rel=0.2)


def pushed_and_back(*last):
    """A block that slides to the right with a coefficient of 0.6, and goes back a little in the last steps."""
    lines = stacked(["*FRICTION", "0.6"])
    at = lines.index("*BOUNDARY")
    lines[at:] = [line for line in lines[at:] if line != "UP_WALL, 1"]
    asked = ["*NODE PRINT, NSET=LOW_FEET", "U, RF"]
    pushed = ["*STEP", "*STATIC", "*BOUNDARY", "UP_HEAD, 2, 2, -0.01", "UP_HEAD, 1, 1, 0.02", *asked, "*END STEP"]
    return [*lines[: lines.index("*STEP")], *pushed, *last]


FRICTION_CHANGES = ["*CHANGE FRICTION, INTERACTION=I", "*FRICTION", "0.1"]
GOES_BACK = ["*BOUNDARY", "UP_HEAD, 1, 1, 0.016"]


def test_friction_that_changes_before_displacements(tmp_path):
    """Another coefficient beside displacements of a step holds before them: as if the file had a step for it, but the
    tables and the times are those of the file.

    CalculiX 2.20 agrees as its first increment becomes small.
    """
    step = ["*STEP", "*STATIC"]
    folders = [tmp_path / "together", tmp_path / "apart"]
    for folder in folders:
        folder.mkdir()
    together, data = drafted(
        folders[0], pushed_and_back(*step, *GOES_BACK[:2], *FRICTION_CHANGES, *GOES_BACK[2:], "*END STEP")
    )
    apart, other = drafted(
        folders[1], pushed_and_back(*step, *FRICTION_CHANGES, "*END STEP", *step, *GOES_BACK, "*END STEP")
    )
    assert together.lost == apart.lost == apart.noted == []
    assert [note.partition(": ")[2].partition(" of ")[0] for note in together.noted] == [
        "the coefficient changes before the loads"
    ]
    assert data["load_steps"].pop("names") == ["step 1", "step 2, friction", "step 2"]
    other["load_steps"].pop("names")
    assert data.pop("title") == other.pop("title")
    assert {**data, "mesh": None} == {**other, "mesh": None}
    moments = [
        list(at_nodes(solved(folder), made.deck)) for folder, made in zip(folders, (together, apart), strict=True)
    ]
    slid, free, back = (np.nansum(moment.contact[:, 4]) for moment in moments[0])
    assert abs(slid) > 3 * abs(free)  # a sixth of the coefficient holds less
    assert free * slid > 0 > back * slid  # what is left of it turns round
    printed, printed_apart = (
        "".join(dat(made.deck, given)) for made, given in zip((together, apart), moments, strict=True)
    )
    assert [line.split()[-1] for line in printed.splitlines() if "S T E P" in line] == ["1", "2"]
    assert [line.split()[-1] for line in printed_apart.splitlines() if "S T E P" in line] == ["1", "2", "3"]
    times = [line.split()[-1] for line in printed.splitlines() if "forces" in line]
    assert times == ["0.1000000E+01", "0.2000000E+01"]
    last, last_apart = (text[text.rindex(" forces") :].partition("\n")[2] for text in (printed, printed_apart))
    assert last == last_apart


def test_friction_that_changes_with_loads_of_an_amplitude(tmp_path):
    """Loads of earlier steps that follow their amplitude change in the step, too; in the first one there are none."""
    lines = pushed_and_back("*STEP", "*STATIC", *FRICTION_CHANGES, "*END STEP")
    made, data = drafted(tmp_path, lines)
    assert made.noted == []
    assert data["load_steps"]["names"] == ["step 1", "step 2"]
    at = lines.index("*STEP")
    lines[at:at] = ["*AMPLITUDE, NAME=A, TIME=TOTAL TIME", "0., 0., 1., 1., 2., 0.5"]
    lines = [f"{line}, AMPLITUDE=A" if line == "*BOUNDARY" and k > at else line for k, line in enumerate(lines)]
    made, data = drafted(tmp_path, lines)
    assert data["load_steps"]["names"] == ["step 1", "step 2, friction", "step 2"]
    assert {tuple(entry["factors"]) for entry in data["displacement"] if "factors" in entry} == {(1.0, 1.0, 0.5)}
    lines = pushed_and_back()
    at = lines.index("*STATIC") + 1
    lines[at:at] = FRICTION_CHANGES
    made, data = drafted(tmp_path, lines)
    assert made.noted == made.lost == []
    assert data["contact"][0]["friction"]["coefficient"] == 0.1


BEHAVIOURS = {
    "EXPONENTIAL": (["1e-2, 0.2"], {"law": "exponential", "clearance": 0.01, "pressure": 0.2}),
    "TABULAR": (
        ["0., -0.01", "2., 0.01", "10., 0.02"],
        {"law": "tabular", "rows": [[0, -0.01], [2, 0.01], [10, 0.02]]},
    ),
}


@pytest.mark.parametrize("kind", BEHAVIOURS)
def test_soft_contact_of_other_laws(tmp_path, kind):
    """The head sinks by the overclosure at the pressure, and by both blocks."""
    rows, law = BEHAVIOURS[kind]
    made, data = drafted(tmp_path, stacked([f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE={kind}", *rows]))
    assert made.lost == []
    assert data["contact"][0]["overclosure"] == law
    (sunk,) = moved(made, solved(tmp_path), 113)
    h = 0.01 * np.log(25.0) / np.log(100.0) if kind == "EXPONENTIAL" else 0.01 + 0.01 * 3 / 8
    assert sunk[1] == pytest.approx(-h - 2 * 5.0 * (1 - POISSON**2) / YOUNG, rel=1e-4)


def test_a_table_that_begins_above_zero(tmp_path):
    """It goes on to the pressure zero as its first line does; one that does not increase is an error."""
    behaviour = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR"
    _, data = drafted(tmp_path, stacked([behaviour, "1., 0.", "3., 0.01"]))
    assert data["contact"][0]["overclosure"]["rows"] == [[0.0, -0.005], [1.0, 0.0], [3.0, 0.01]]
    for rows in (["1., 0."], ["1., 0.", "1., 1."], ["1., 1.", "2., 0."]):
        with pytest.raises(MeshError, match="SURFACE BEHAVIOR"):
            drafted(tmp_path, stacked([behaviour, *rows]))


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
