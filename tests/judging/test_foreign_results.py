"""Verdicts on results of CalculiX: good ones agree, and what is spoiled is named."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from foreign_spoils import displacements, with_node_entering, with_other_forces

from signorini_fx import MeshError
from signorini_fx.addons.judging.judge import judge
from signorini_fx.addons.judging.judgement import CONTACT, OTHER_LOAD, OTHER_PENALTY
from signorini_fx.addons.judging.problems import judged_problem
from signorini_fx.scenes import cli

DATA = Path(__file__).parent / "data"
NAMES = sorted(file.stem for file in DATA.glob("*.inp"))
# Where contact of the deck is hard CalculiX has its own penalty.
AGREEING = {"shelf_hard": OTHER_PENALTY, "press_capped": OTHER_PENALTY}


def verdict(name, tmp_path=None, change=None, displacement=None, kind=".dat", **options):
    """On a result against its deck, after changes of the text of the deck or of the displacements."""
    deck = DATA / f"{name}.inp"
    if change is not None:
        text = change(deck.read_text())
        assert text != deck.read_text()
        deck = tmp_path / deck.name
        deck.write_text(text)
    result = DATA / f"{name}{kind}"
    if displacement is not None:
        numbers, v = displacements(result)
        result = dict(zip(numbers, displacement(v).tolist(), strict=True))
    return judge(deck, result, **{"compare": False, **options})


def replaced(old, new):
    """A change of a deck."""
    return lambda text: re.sub(old, new, text)


def test_there_are_results_of_each_kind():
    """Of plane strain and stress, revolution and space, with linear and quadratic elements."""
    assert len(NAMES) >= 15
    assert {name.partition("_")[0] for name in NAMES} == {"press", "rings", "shelf", "stack"}


@pytest.mark.parametrize("name", NAMES)
def test_a_good_result_agrees(name):
    """With its own deck."""
    judgement = verdict(name)
    assert judgement.word == AGREEING.get(name, "agrees"), str(judgement)
    assert ("hourglassing is not known" in str(judgement)) == (name == "shelf_CAX4R")
    assert judgement.agrees
    assert judgement.exit_code == 0
    for label, figure in judgement.figures.items():
        known = judgement.figures["equilibrium"]["value"] < 1e-3
        if figure.get("threshold") is not None and label not in ("penalty_energy", "cone_ratio") and known:
            assert figure["value"] < 0.3 * figure["threshold"], label


@pytest.mark.parametrize("name", ["shelf_CPE4", "shelf_C3D20R", "stack_CPE8R"])
def test_both_files_of_calculix(name):
    """Six digits and seven."""
    tables, fields = verdict(name), verdict(name, kind=".frd")
    assert tables.word == fields.word == "agrees"
    assert (tables.theirs["digits"], fields.theirs["digits"]) == (7, 6)
    assert fields.theirs["program"].startswith("CalculiX")
    assert fields.figures["printed"]["value"] > 3 * tables.figures["printed"]["value"]


def test_another_element(tmp_path):
    """Incompatible modes where the deck has plain bricks, and reduced integration where it has full one."""
    for name, old, new, words in (
        ("shelf_C3D8I", "C3D8I", "C3D8", "incompatible modes"),
        ("shelf_CPE8R", "CPE8R", "CPE8", "reduced integration"),
        ("press_CPE4", "CPE4", "CPE4R", "full integration"),
    ):
        judgement = verdict(name, tmp_path, replaced(old, new))
        assert judgement.word == "agrees with another element", str(judgement)
        assert judgement.theirs["formulation"] == words


# A result against a deck that says something else: the result is spoiled the other way round.
SPOILED = {
    "load x 1.02": ("shelf_CPE4", replaced("BODY_TOP, P, 1.0", f"BODY_TOP, P, {1 / 1.02!r}"), OTHER_LOAD),
    "load x 1.02 of a layer": ("shelf_CPS4", replaced("BODY_TOP, P, 1.0", f"BODY_TOP, P, {1 / 1.02!r}"), OTHER_LOAD),
    "load x 1.02 in space": ("shelf_C3D20R", replaced("BODY_TOP, P, 1.0", f"BODY_TOP, P, {1 / 1.02!r}"), OTHER_LOAD),
    "half the push": ("stack_CPE8R", replaced("BODY_RIGHT, P, 0.5", "BODY_RIGHT, P, 1.0"), OTHER_LOAD),
    "modulus": ("shelf_CPE6", replaced(r"\n1000.0, 0.3", r"\n900.0, 0.3"), OTHER_LOAD),
    "modulus of one body": ("stack_CPE8R", replaced(r"\n3000.0, 0.3", r"\n2700.0, 0.3"), OTHER_LOAD),
    "materials exchanged": ("stack_CPE8R", replaced("MATERIAL=(.)", lambda match: f"MATERIAL={'MW'[match[1] == 'M']}"),
                            OTHER_LOAD),
    "nu": ("shelf_CPE4", replaced(r"\n1000.0, 0.3", r"\n1000.0, 0.2"), "not in equilibrium"),
    "support released": ("shelf_CPE4", replaced("BODY_LEFT_N, 1, 2", r"BODY_LEFT_N, 1, 2\nBODY_RIGHT_N, 1"),
                         "violates supports"),
    "prescribed motion": ("press_C3D8", replaced("BODY_TOP_N, 1, 1, 0.01", "BODY_TOP_N, 1, 1, 0.012"),
                          "violates supports"),
    "penalty / 100": ("press_CPE4", replaced(r"LINEAR\n100000.0", r"LINEAR\n1e7"), CONTACT + "penetration"),
    "penalty / 3": ("press_C3D8", replaced(r"LINEAR\n100000.0", r"LINEAR\n3e5"), CONTACT + "penalty"),
    "gap": ("shelf_CPE4", replaced(r"(?m), -0\.020*\d*$", ", -0.005"), CONTACT + "penetration"),
    "friction x 2": ("press_CPE4", replaced(r"FRICTION\n0.3", r"FRICTION\n0.15"), CONTACT + "cone"),
    "friction x 2 in space": ("press_C3D8", replaced(r"FRICTION\n0.2", r"FRICTION\n0.1"), CONTACT + "cone"),
    "friction / 2": ("press_CPE4", replaced(r"FRICTION\n0.3", r"FRICTION\n0.6"), CONTACT + "slip"),
    "friction where is none": ("press_CPE4", replaced(r"\*FRICTION\n.*\n", ""), CONTACT + "cone"),
}  # fmt: skip


@pytest.mark.parametrize("fault", SPOILED)
def test_a_result_of_another_problem(fault, tmp_path):
    """Each is named by its word."""
    name, change, word = SPOILED[fault]
    judgement = verdict(name, tmp_path, change)
    assert judgement.word == word, str(judgement)
    assert judgement.exit_code == (5 if word == OTHER_LOAD else 6)


def test_factors_are_named(tmp_path):
    """Of the load that differs, and of all loads where a modulus may be meant."""
    judgement = verdict("shelf_CPE4", tmp_path, SPOILED["load x 1.02"][1])
    assert judgement.factors == {"pressure on BODY_TOP": pytest.approx(1.02, rel=1e-4)}
    assert "its pressure on BODY_TOP is 1.02 times the problem's" in str(judgement)
    judgement = verdict("shelf_CPE6", tmp_path, SPOILED["modulus"][1])
    assert list(judgement.factors.values()) == [pytest.approx(0.9, rel=1e-4)] * 2
    assert "or its moduli are 1.111 times" in str(judgement)
    judgement = verdict("stack_CPE8R", tmp_path, SPOILED["modulus of one body"][1])
    assert any("by action and reaction" in finding.text for finding in judgement.findings)


MOVED = {
    "units": (lambda v: 1000.0 * v, "another problem: units", 5),
    "nothing moves": (lambda v: 0.0 * v, "not a result", 7),
    "not finite": (lambda v: np.where(v == v.max(), np.nan, v), "not a result", 7),
}


@pytest.mark.parametrize("fault", MOVED)
@pytest.mark.parametrize("name", ["shelf_CPE4", "press_CPS8R", "shelf_C3D4", "stack_CPE4"])
def test_displacements_that_are_none(name, fault):
    """Named by their words."""
    change, word, code = MOVED[fault]
    judgement = verdict(name, displacement=change)
    assert (judgement.word, judgement.exit_code) == (word, code), str(judgement)


def test_half_of_everything():
    """Half the displacement is that of half the loads, or of other supports where they move."""
    assert verdict("shelf_CPE4", displacement=lambda v: v / 2).word == OTHER_LOAD
    assert verdict("press_CPE4", displacement=lambda v: v / 2).findings[0].key in ("supports", "factors")


@pytest.mark.parametrize("name", ["shelf_CPE4", "shelf_CPS4", "shelf_CAX4", "shelf_C3D20R", "stack_CPE4"])
def test_one_node_moved(name):
    """By a tenth of the largest displacement: it is named, and how far it must go back."""
    from signorini_fx.addons.judging.problems import judged_problem

    problem, _ = judged_problem(DATA / f"{name}.inp")
    node = int(np.flatnonzero(problem.free.all(axis=1))[3])

    def moved(v):
        away = v.copy()
        away[node, 1] += 0.1 * np.abs(v).max()
        return away

    judgement = verdict(name, displacement=moved)
    assert judgement.word == "not in equilibrium"
    assert judgement.findings[0].node == problem.mesh.names[node]


@pytest.mark.parametrize("name", ["press_CPE4", "shelf_CPE8R", "stack_CPE4", "press_C3D8"])
def test_one_node_enters(name):
    """The contact, and not another thing, is said to be violated, or the equilibrium around it."""
    judgement = judge(DATA / f"{name}.inp", with_node_entering(DATA / f"{name}.inp"), compare=False)
    assert any(finding.key == "penetration" for finding in judgement.findings)
    assert judgement.exit_code == 6


FORCES = {
    "turned": lambda force, normal: -2 * (force - (force * normal).sum(axis=1)[:, None] * normal),
    "pulls": lambda force, normal: np.eye(len(force))[1][:, None] * 0.3 * np.linalg.norm(force, axis=1).sum() * normal,
    "moved": lambda force, normal: (np.eye(len(force))[0] - np.eye(len(force))[-1])[:, None] * 0.5 * force[-1],
}


@pytest.mark.parametrize(("fault", "keys"), [
    ("turned", {"wrong way", "slip"}), ("pulls", {"tension"}), ("moved", {"apart", "penetration", "cone", "slip"}),
])  # fmt: skip
@pytest.mark.parametrize("name", ["press_CPE4", "press_C3D8"])
def test_other_contact_forces(name, fault, keys):
    """Friction turned round, a corner that pulls, a force that moves: in equilibrium, against the law of contact."""
    judgement = judge(DATA / f"{name}.inp", with_other_forces(DATA / f"{name}.inp", FORCES[fault]), compare=False)
    assert judgement.figures["equilibrium"]["value"] < 1e-3
    assert judgement.word.startswith(CONTACT)
    assert keys & {finding.key for finding in judgement.findings}, str(judgement)


def test_what_cannot_be_judged(tmp_path):
    """Three digits, nodes that are missing, a time before the end of the step."""
    text = (DATA / "shelf_CPE4.dat").read_text()
    three = re.sub(r"(-?\d\.\d\d)\d{4}(E[+-]\d\d)", r"\1\2", text)
    (tmp_path / "three.dat").write_text(three)
    judgement = judge(DATA / "shelf_CPE4.inp", tmp_path / "three.dat", compare=False)
    assert (judgement.word, judgement.exit_code) == ("cannot be judged", 7)
    assert "3 digits" in str(judgement)
    (tmp_path / "some.dat").write_text(
        "\n".join(line for line in text.splitlines() if not line.startswith("        17"))
    )
    judgement = judge(DATA / "shelf_CPE4.inp", tmp_path / "some.dat", compare=False)
    assert judgement.word == "cannot be judged"
    assert "1 of 36 nodes have no displacement, such as node 17" in str(judgement)
    (tmp_path / "early.dat").write_text(text.replace("0.1000000E+01", "0.5000000E+00"))
    judgement = judge(DATA / "shelf_CPE4.inp", tmp_path / "early.dat", compare=False)
    assert judgement.word == "not a result"
    cell, halves = "2, 2, 5, 6, 3\n", "2, 2, 5, 6\n999, 2, 6, 3\n"
    deck = (DATA / "shelf_CPE4.inp").read_text()
    assert cell in deck
    element = "*ELEMENT, TYPE=CPE{}, ELSET=BODY\n"
    (tmp_path / "mixed.inp").write_text(deck.replace(cell, element.format(3) + halves + element.format(4)))
    judgement = judge(tmp_path / "mixed.inp", DATA / "shelf_CPE4.dat")
    assert (judgement.word, judgement.exit_code) == ("cannot be judged", 7)
    assert "quad, triangle" in str(judgement)


def test_sections_of_thin_rings(tmp_path):
    """CalculiX prints mean radial displacements over its sector, of corners other ones than of nodes between them: to
    the digits of the file they are in equilibrium by full integration once that is undone.  What is in no file of
    CalculiX moves as it says.
    """
    judgement = judge(DATA / "rings_CAX8.inp", DATA / "rings_CAX8.dat", compare=False)
    assert judgement.word == "agrees"
    assert "full" in judgement.theirs["formulation"]
    assert judgement.figures["equilibrium"]["value"] < 3 * judgement.figures["printed"]["value"]
    numbers, v = displacements(DATA / "rings_CAX8.dat")
    as_printed = judge(DATA / "rings_CAX8.inp", dict(zip(numbers, v.tolist(), strict=True)), compare=False)
    assert as_printed.word == "not in equilibrium"


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda row: row.replace("17", "1x", 1), "the number of a node is expected, not '1x'"),
        (lambda row: row.replace("        17", "     seven", 1), "the number of a node is expected, not 'seven'"),
        (lambda row: row.replace("        17", "       -17", 1), "the number of a node is expected, not '-17'"),
        (lambda row: "garbage", "the number of a node is expected, not 'garbage'"),
        (lambda row: row[:26], "three components are expected, not 2"),
        (lambda row: row[:14] + "x" + row[15:], "a number is expected"),
    ],
)
def test_rows_that_are_none(tmp_path, spoil, says):
    """One error with the line; no row ends a table without a word."""
    lines = (DATA / "shelf_CPE4.dat").read_text().splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith("        17"))
    lines[at] = spoil(lines[at])
    (tmp_path / "spoiled.dat").write_text("\n".join(lines) + "\n")
    with pytest.raises(MeshError, match=f"line {at + 1}: {says}"):
        judge(DATA / "shelf_CPE4.inp", tmp_path / "spoiled.dat", compare=False)


@pytest.mark.parametrize("name", ["press_CPE4", "press_slender", "press_CPS8R", "press_capped"])
def test_which_coefficients_fit(tmp_path, name):
    """Between two limits another coefficient of friction is not seen, as the answer says: below, where no shear reaches
    its bound, and above, where too little slips; outside it is seen.
    """

    def with_coefficient(factor):
        def changed(text):
            at = re.search(r"(?m)^\*FRICTION.*\n([^,\n]+)", text)
            return f"{text[: at.start(1)]}{factor * float(at[1])!r}{text[at.end(1) :]}** changed\n"

        return verdict(name, tmp_path, changed, compare=False)

    said = with_coefficient(1.0)
    low, high = (said.figures[f"coefficient_{end}"] for end in ("from", "to"))
    assert 0.0 < low["value"] <= 1.0
    fitting = [1.02 * low["value"], 4.0 if high["value"] is None else 0.98 * high["value"]]
    for factor in fitting:
        assert not {"cone", "slip"} & {finding.key for finding in with_coefficient(factor).findings}
    less = with_coefficient(0.97 * low["value"])
    assert "cone" in {finding.key for finding in less.findings}
    assert less.figures["coefficient_from"] == {"value": None, "reason": "shear exceeds its bound"}
    fits = r"times (it on may|the coefficient) fit"
    assert re.search(fits, str(said))
    assert not re.search(fits, str(less))
    if high["value"] is None:
        assert "nearly all sticks: friction cannot be told" in str(said)
    else:
        assert "slip" in {finding.key for finding in with_coefficient(1.1 * high["value"]).findings}


# The width of the first component in both files of CalculiX.
FIRST_COLUMN = {".dat": 14, ".frd": 12}


@pytest.mark.parametrize("word", ["1e400", "inf", "NaN"])
@pytest.mark.parametrize("kind", [".dat", ".frd", ".csv"])
def test_numbers_that_are_not_finite(tmp_path, kind, word):
    """The word says so, of whatever file."""
    if kind == ".csv":
        numbers, v = displacements(DATA / "shelf_CPE4.dat")
        rows = [f"{node}, {x!r}, {y!r}" for node, (x, y, *_) in zip(numbers, v.tolist(), strict=True)]
        text = "\n".join(["node, ux, uy", *rows[:11], f"12, {word}, 0.1", *rows[12:], ""])
    else:
        text = (DATA / f"shelf_CPE4{kind}").read_text()
        at = text.index("displacements" if kind == ".dat" else "DISP")
        start = text.index("        12", at) + len("        12")
        text = text[:start] + f"{word:>{FIRST_COLUMN[kind]}}" + text[start + FIRST_COLUMN[kind] :]
    (tmp_path / f"result{kind}").write_text(text)
    judgement = judge(DATA / "shelf_CPE4.inp", tmp_path / f"result{kind}", compare=False)
    assert (judgement.word, judgement.exit_code) == ("not a result", 7), str(judgement)


def test_increments_of_one_printed_time(tmp_path):
    """The last one counts, and where it is cut off what the one before had at its nodes does not."""
    name = "shelf_CPE8R"
    text = (DATA / f"{name}.dat").read_text()
    tables = re.split(r"(?m)^(?= displacements)", text)
    assert len(tables) == 3  # two increments end at a time that is 1 as it is printed
    (tmp_path / "cut.dat").write_text("".join(tables[:2]) + tables[2][: len(tables[2]) // 4])
    judgement = judge(DATA / f"{name}.inp", tmp_path / "cut.dat", compare=False)
    assert judgement.word == "cannot be judged", str(judgement)
    assert "nodes have no displacement" in str(judgement)
    # Tables of two sets of nodes belong together.
    head, *rows = tables[2].partition(" forces")[0].splitlines()
    parts = [f"{head.replace('ALL', label)}\n\n" + "\n".join(rows[k::2]) + "\n" for k, label in enumerate("AB")]
    (tmp_path / "sets.dat").write_text("\n" + "\n".join(parts))
    assert judge(DATA / f"{name}.inp", tmp_path / "sets.dat", compare=False).word == "agrees"
    name = "stack_CPE8R"
    text = (DATA / f"{name}.frd").read_text()
    first, *_ = re.split(r"(?m)^(?= {4}1PSTEP)", text)[1:]
    again = first.replace("1           1           1", "3           2           1", 1)
    (tmp_path / "cut.frd").write_text(text.replace(" 9999", "") + again[: len(again) // 2].rpartition("\n")[0] + "\n")
    judgement = judge(DATA / f"{name}.inp", tmp_path / "cut.frd", compare=False)
    assert judgement.word == "cannot be judged", str(judgement)


def test_bad_files_are_one_error(tmp_path):
    """With the place and what is expected."""
    deck, dat = DATA / "shelf_CPE4.inp", (DATA / "shelf_CPE4.dat").read_text()
    frd = (DATA / "shelf_CPE4.frd").read_text()
    for name, text, message in (
        ("none.dat", "nothing\n", "has no displacements: print them"),
        ("word.dat", re.sub(r"(?m)^(         1  )\S+", r"\1 x", dat, count=1), "line 4: a number is expected"),
        (
            "short.dat",
            re.sub(r"(?m)^(         1 .{28}).*", r"\1", dat, count=1),
            "three components are expected, not 2",
        ),
        ("node.frd", frd.replace(" -1        12", " -1       NaN"), "the number of a node is expected, not 'NaN'"),
        ("time.dat", dat.replace("0.1000000E+01", "1.0E+0.1"), "a number is expected, not '1.0E+0.1'"),
        ("moved.frd", frd.replace(" 2.00000E+00 0.00000E+00", " 3.00000E+00 0.00000E+00"), "another mesh"),
        ("empty.csv", "", "columns ux, uy"),
        ("word.csv", "node,ux,uy\n1,0,x\n", "row 1: a number is expected in 'uy'"),
        ("where.csv", "ux,uy\n1,0\n", "neither numbers nor positions"),
        ("no.vtu", "nothing", "no .vtu file"),
        ("double.csv", "node,ux,uy,ux\n1,0,0,1\n", "has several columns 'ux'"),
        ("twice.csv", "node,ux,uy\n1,0,0\n2,0,0\n1,0,1\n", "node 1 is there several times, with different"),
        ("half.csv", "node,ux,uy\n1,0,0\n2.5,0,0\n", "row 2: a whole number is expected in 'node', not 2.5"),
        ("large.csv", "node,ux,uy\n1,0,0\n1e30,0,0\n", "row 2: a whole number is expected in 'node', not 1e+30"),
        ("beside.csv", "x,y,ux,uy\n0,0,0,0\n0,0,0,1\n", "several points are at (0.0, 0.0), with different"),
        ("cut.dat", dat[: dat.index(" forces")].rstrip()[:-1], "line 43: ends within the number '0.000000E+0'"),
        ("cut.frd", frd[: frd.index(" -3", frd.index("DISP"))].rstrip()[:-1], "ends within the number '0.00000E+0'"),
        ("binary.frd", frd[: frd.index("DISP") + 200] + "\0\1", "is binary: print it as text: *NODE FILE in place of"),
        ("other.txt", "", "results are read from .dat, .frd, .csv, .vtu"),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(MeshError, match=re.escape(message)):
            judge(deck, tmp_path / name, compare=False)
    with pytest.raises(MeshError, match="cannot be read"):
        judge(deck, tmp_path / "absent.dat", compare=False)
    with pytest.raises(MeshError, match=r"an array of shape \(40, 2\) is expected, not \(3, 2\)"):
        judge(deck, np.zeros((3, 2)), compare=False)
    for values, message in (
        (np.ones((40, 2)) * 1j, r"an array of real numbers of shape \(40, 2\)"),
        ([[0.0, 1.0], [0.0]], r"an array of real numbers of shape \(40, 2\)"),
        ({1: [0.0]}, "node 1 has 1 of 2 components"),
        ({1: 0.0}, "2 components of each are expected, not 1: 0.0"),
        ({"first": [0.0, 0.0]}, "numbers of nodes and 2 components"),
        ({1: ["x", 0.0]}, "2 components of each are expected, not 1"),
    ):
        with pytest.raises(MeshError, match=message):
            judge(deck, values, compare=False)


def test_values_that_are_masked(tmp_path):
    """They are none."""
    numbers, v = displacements(DATA / "shelf_CPE4.dat")
    names = dict(zip(numbers, v[:, :2], strict=True))
    deck = DATA / "shelf_CPE4.inp"
    values = np.array([names[number] for number in judged_problem(deck)[0].mesh.names.tolist()])
    hidden = np.ma.masked_array(values, mask=np.zeros_like(values, dtype=bool))
    assert judge(deck, hidden, compare=False).word == "agrees"
    hidden[3] = np.ma.masked
    assert judge(deck, hidden, compare=False).word == "not a result"


def test_a_deck_that_lost_something_agrees_as_it_is_read(tmp_path):
    """The word says so, and so does the exit code."""
    judgement = verdict("shelf_CPE4", tmp_path, replaced(r"\*STEP", "*GAP\n*STEP"))
    assert judgement.agrees
    assert judgement.exit_code == 4
    assert "agrees (of the problem as read)" in str(judgement)


CUBE = """*NODE, NSET=NALL
1, 0, 0, 0
2, 1, 0, 0
3, 1, 1, 0
4, 0, 1, 0
5, 0, 0, 1
6, 1, 0, 1
7, 1, 1, 1
8, 0, 1, 1
*ELEMENT, TYPE=C3D8, ELSET=E
1, 1, 2, 3, 4, 5, 6, 7, 8
*MATERIAL, NAME=M
*ELASTIC
1000., 0.
*SOLID SECTION, ELSET=E, MATERIAL=M
*NSET, NSET=FEET
1, 2, 3, 4
*BOUNDARY
FEET, 1, 3
*STEP
*STATIC
*CLOAD
5, 3, 1.
6, 3, 1.
7, 3, 1.
8, 3, 1.
8, 3, 1.
*END STEP
"""
# Of CalculiX 2.20, which adds up what a step gives twice.
OF_CALCULIX = """
 displacements (vx,vy,vz) for set NALL and time  0.1000000E+01

         1  0.000000E+00  0.000000E+00  0.000000E+00
         2  0.000000E+00  0.000000E+00  0.000000E+00
         3  0.000000E+00  0.000000E+00  0.000000E+00
         4  0.000000E+00  0.000000E+00  0.000000E+00
         5  1.785714E-03 -2.214286E-03  3.071429E-03
         6  1.785714E-03 -1.785714E-03  2.928571E-03
         7  2.214286E-03 -1.785714E-03  3.071429E-03
         8  2.214286E-03 -2.214286E-03  1.092857E-02
"""


@pytest.mark.parametrize(("force", "agrees"), [("8, 3, 1.", True), ("8, 3, 1.1", False), ("7, 3, 1.", False)])
def test_forces_at_nodes(tmp_path, force, agrees):
    """A cube that is pulled unevenly at its corners: another force, or at another node, is another problem."""
    deck, result = tmp_path / "cube.inp", tmp_path / "cube.dat"
    deck.write_text(CUBE.replace("8, 3, 1.\n*END", f"{force}\n*END"))
    result.write_text(OF_CALCULIX)
    assert judge(deck, result, compare=False).agrees == agrees


def test_command(capsys):
    """Text of ten lines, JSON, and exit codes."""
    deck, result = str(DATA / "shelf_CPE4.inp"), str(DATA / "shelf_CPE4.dat")
    assert cli.main(["judge", deck, result]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "shelf_CPE4.dat: agrees"
    labels = ["theirs", "supports", "balance", "contact", "penetration", "friction", "error", "beside ours", "effort"]
    assert [line[2:14].strip() for line in lines[1:]] == labels
    assert cli.main(["judge", deck, str(DATA / "shelf_CPS4R.dat"), "--json", "--alone"]) == 6
    found = json.loads(capsys.readouterr().out)
    keys = ["word", "agrees", "exit_code", "findings", "theirs", "figures", "factors", "error", "beside"]
    keys += ["judged_with", "lost"]
    assert list(found) == keys
    assert min(found["judged_with"]["formulations"].values()) == found["figures"]["equilibrium"]["value"]
    assert set(found["findings"][0]) == {"key", "text", "value", "threshold", "share", "node", "at"}
    assert cli.main(["judge", deck, "absent.dat"]) == 2


def test_cells_of_both_degrees(tmp_path):
    """A file with such cells cannot be judged yet: the edges of some have got nodes that no result has."""
    lines = ["*NODE", "1, 0, 0", "2, 1, 0", "3, 1, 1", "4, 0, 1", "5, .5, 0", "6, 1, .5", "7, .5, 1", "8, 0, .5"]
    lines += [
        "11, 0, 1",
        "12, 1, 1",
        "13, 1, 2",
        "14, 0, 2",
        "*ELEMENT, TYPE=CPE8, ELSET=A",
        "1, 1, 2, 3, 4, 5, 6, 7, 8",
    ]
    lines += ["*ELEMENT, TYPE=CPE4, ELSET=B", "2, 11, 12, 13, 14", "*SURFACE, NAME=UP", "1, S3", "*SURFACE, NAME=LOW"]
    lines += ["2, S1", "*MATERIAL, NAME=M", "*ELASTIC", "100., .3", "*SOLID SECTION, ELSET=A, MATERIAL=M"]
    lines += ["*SOLID SECTION, ELSET=B, MATERIAL=M", "*SURFACE INTERACTION, NAME=I", "*CONTACT PAIR, INTERACTION=I"]
    lines += ["UP, LOW", "*BOUNDARY", "1, 1, 2", "2, 1, 2", "5, 1, 2", "13, 1, 1", "14, 1, 1", "*STEP", "*STATIC"]
    lines += ["*BOUNDARY", "13, 2, 2, -.1", "14, 2, 2, -.1", "*END STEP"]
    deck = tmp_path / "both.inp"
    deck.write_text("\n".join(lines) + "\n")
    result = {node: [0.0, -0.05] for node in (*range(1, 9), *range(11, 15))}
    judgement = judge(deck, result, compare=False)
    assert (judgement.word, judgement.exit_code) == ("cannot be judged", 7)
    assert "quad, quad8" in str(judgement)
