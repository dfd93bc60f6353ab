"""Test cases of CalculiX: what is whole, what is lost, and that no case ends the others."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from deck_lines import stacked

from signorini_fx.addons.decks.draft import draft
from signorini_fx.addons.gauntlet import gauntlet as runs
from signorini_fx.addons.gauntlet import solved_drafts
from signorini_fx.addons.gauntlet.calculix import DeckRun
from signorini_fx.addons.gauntlet.compared_tables import compared, with_exact
from signorini_fx.addons.gauntlet.gauntlet import gauntlet, run_case
from signorini_fx.addons.gauntlet.outcomes import (
    CRASHED,
    LOST,
    OTHER_KIND,
    REFUSED,
    SLOW,
    WHOLE,
    ComparedQuantity,
    Gauntlet,
    GauntletCase,
    commit_of,
)
from signorini_fx.addons.gauntlet.page import page, short_table
from signorini_fx.addons.gauntlet.printed_tables import by_time, read_tables
from signorini_fx.addons.gauntlet.sources import decks_of
from signorini_fx.errors import MeshError
from signorini_fx.scenes import cli

DATA = Path(__file__).parents[1] / "judging" / "data"


def case_of(folder, name, change=lambda text: text, printed=lambda text: text):
    """A deck with what CalculiX 2.20 has printed, both of the tests of ``judge``, perhaps changed."""
    deck = folder / f"{name}.inp"
    deck.write_text(change((DATA / f"{name}.inp").read_text()))
    deck.with_suffix(".dat.ref").write_text(printed((DATA / f"{name}.dat").read_text()))
    return deck


def scaled(factor):
    """Displacements times a factor."""

    def change(text):
        lines, within = [], False
        for line in text.splitlines():
            if " for " in line:
                within = line.startswith(" displacements")
            words = line.split()
            if within and words and words[0].isdigit():
                line = f"{words[0]:>10s}" + "".join(f" {factor * float(word):13.6E}" for word in words[1:])
            lines.append(line)
        return "\n".join(lines) + "\n"

    return change


def outcome(deck):
    """Of a case that is run in this process; what it tells on the way has the same name."""
    told = []
    folder = deck.with_suffix(".out")
    folder.mkdir()
    case = DeckRun(deck, folder, told.append).outcome()
    assert {one.name for one in told} <= {case.name}
    return case


def test_a_case_that_agrees(tmp_path):
    """The same elements: all digits that print and penalty leave, and nothing is to be explained."""
    case = outcome(case_of(tmp_path, "shelf_CPE4"))
    assert (case.state, case.why, case.reasons) == (WHOLE, "", ())
    assert {quantity.name.partition(" ")[0] for quantity in case.quantities} >= {"displacement"}
    assert 1e-9 < case.difference < 2e-3


def test_a_case_that_differs(tmp_path):
    """A result of 1.05 times the load: found, named by the verdict of ``judge``, and both are beside our finer one."""
    case = outcome(case_of(tmp_path, "shelf_CPE4", printed=scaled(1.05)))
    assert case.state == WHOLE
    (displacement,) = [quantity for quantity in case.quantities if quantity.name.startswith("displacement")]
    assert displacement.difference == pytest.approx(0.05 / 1.05, rel=0.05)
    assert displacement.theirs / displacement.ours == pytest.approx(1.05, rel=5e-3)
    verdict, finer = case.reasons
    assert verdict.startswith("judge says of theirs: ")
    assert "agrees" not in verdict
    assert "with sides half as long ours moves by" in finer


@pytest.mark.parametrize(
    ("lines", "state", "why"),
    [
        (
            lambda lines: lines.replace("*STATIC", "*FREQUENCY\n5"),
            OTHER_KIND,
            "*FREQUENCY: only static steps are taken",
        ),
        (
            lambda lines: lines.replace("CPE4", "F3D8").replace("*STATIC", "*CFD, STEADY STATE"),
            OTHER_KIND,
            "*CFD: only static steps are taken",
        ),
        (lambda lines: f"*NGEN\n1, 2\n{lines}", REFUSED, "nodes and elements are not generated here"),
        (lambda lines: lines.replace("*BOUNDARY", "*FRICTION, ROUGH\n*BOUNDARY", 1), LOST, "rough friction"),
    ],
)
def test_states(tmp_path, lines, state, why):
    """What a scene has not is a row with its name."""
    deck = tmp_path / "deck.inp"
    text = "\n".join(stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"]))
    deck.write_text(lines(text) + "\n")
    deck.with_suffix(".dat.ref").write_text("\n")
    case = outcome(deck)
    assert case.state == state
    assert why in case.why
    assert str(tmp_path) not in case.why


def test_a_result_that_cannot_be_read(tmp_path):
    """It is a row, too."""
    case = outcome(case_of(tmp_path, "shelf_CPE4", printed=lambda text: text.replace("         1 ", "       1.5 ")))
    assert case.state == REFUSED
    assert "the number of a node is expected" in case.why


def test_a_case_that_hangs(tmp_path):
    """It ends when its time is over, and the next one is run."""
    case = run_case(case_of(tmp_path, "shelf_CPE4"), 0.05)
    assert (case.state, case.why, case.quantities) == (SLOW, "more than 0.05 s", ())


def test_a_case_that_crashes(tmp_path, monkeypatch):
    """Its last line is told."""
    monkeypatch.setattr(runs, "_WORKER", "signorini_fx.addons.gauntlet.nothing")
    case = run_case(case_of(tmp_path, "shelf_CPE4"), 300.0)
    assert case.state == CRASHED
    assert "nothing" in case.why


def test_what_is_a_case(tmp_path):
    """Contact or a tie, and something printed; folders below count as well."""
    below = tmp_path / "below"
    below.mkdir()
    one, two = case_of(tmp_path, "shelf_CPE4"), case_of(below, "stack_CPE4")
    case_of(tmp_path, "press_CPE4", lambda text: text.replace("*CONTACT PAIR", "** CONTACT PAIR"))
    (tmp_path / "alone.inp").write_text((DATA / "shelf_CPE4.inp").read_text())
    assert list(decks_of(tmp_path)) == [two, one]


@pytest.mark.parametrize("only", [["nothing*"], []])
def test_folders_without_cases(tmp_path, only):
    """Each is an error with its name."""
    if only:
        case_of(tmp_path, "shelf_CPE4")
    with pytest.raises(MeshError, match=r"has no NAME\.inp with contact"):
        gauntlet([tmp_path], only=only)
    with pytest.raises(MeshError, match="is no folder"):
        gauntlet([tmp_path / "elsewhere"])


# --- tables ----------------------------------------------------------------------------------------------------------

PRINTED = """
 displacements (vx,vy,vz) for set NALL and time  0.5000000E+00

         1  1.000000E+00  2.000000E+00  0.000000E+00

 displacements (vx,vy,vz) for set Nall and time  0.1000000E+01

         1  1.000000E+00  4.000000E+00  0.000000E+00
         2  1.000000-101 -2.00000E+00  0.000000E+00

 forces (fx,fy,fz) for set LOW and time  0.1000000E+01

         1  1.000000E+00  5.000000E+00  0.000000E+00
         2  1.000000E+00 -3.000000E+00  0.000000E+00

 total force (fx,fy,fz) for set LOW and time  0.1000000E+01

        2.000000E+00  2.000000E+00  0.000000E+00

 contact stress (slave element+face,press,tang1,tang2) for all contact elements and time 0.1000000E+01

         1          4  1.000000E+00  0.000000E+00  0.000000E+00
         1          4  2.000000E+00  0.000000E+00  0.000000E+00

 contact stress (slave node,press,tang1,tang2) for all contact elements and time 0.2000000E+01

         1  3.000000E+00  0.000000E+00  0.000000E+00
"""


def tables(text=PRINTED):
    """As they are compared."""
    return by_time(read_tables(text, "theirs.dat"))


def test_printed_tables():
    """By title, set and time; rows of points of a face are told from those of nodes."""
    found = tables()
    assert [table.time for table in found["displacements", "NALL"]] == [0.5, 1.0]
    assert found["displacements", "NALL"][1].rows == {1: [1.0, 4.0, 0.0], 2: [1e-101, -2.0, 0.0]}
    assert [table.repeated for table in found["contact stress", ""]] == [True, False]
    assert found["total force", "LOW"][0].rows == {0: [2.0, 2.0, 0.0]}


def test_compared_tables():
    """The last time of both; differences are relative to the largest value; sums of forces to those of magnitudes."""
    ours = PRINTED.replace("4.000000E+00  0", "4.100000E+00  0").replace("-3.000000E+00", "-2.000000E+00")
    ours = ours.replace("  3.000000E+00", "  2.000000E+00").replace("2.000000E+00  2.000000E+00  0", "2.0 1.5 0")
    found = {entry.name: entry for entry in compared(tables(), tables(ours))}
    displacement = found["displacement of NALL, y at node 1"]
    assert (displacement.theirs, displacement.ours) == (4.0, 4.1)
    assert displacement.difference == pytest.approx(0.025)
    assert found["sum of the forces of LOW along x"].difference == pytest.approx(1.0 / 8.0)
    assert found["total force of LOW, x"].difference == pytest.approx(0.25)
    assert found["contact pressure, at node 1"].difference == pytest.approx(1.0 / 3.0)


def test_nothing_in_common():
    """Tables of other times, or of points of faces, are not compared."""
    ours = PRINTED.replace("0.2000000E+01", "0.3000000E+01").replace("0.5000000E+00", "0.6000000E+00")
    ours = ours.replace("0.1000000E+01", "0.1100000E+01")
    assert list(compared(tables(), tables(ours))) == []


@pytest.mark.parametrize(
    ("exact", "finer", "nearer"),
    [
        (1.2, None, "theirs"),
        (0.9, (0.0, 1.0), "ours"),
        (None, (0.1, 0.2), "theirs"),
        (None, (0.2, 0.1), "ours"),
        (None, None, ""),
        (1.05, None, "both"),
    ],
)
def test_nearer(exact, finer, nearer):
    """An exact value counts before a finer mesh."""
    assert ComparedQuantity("u", 1.1, 1.0, 0.1, exact, finer).nearer == nearer


def test_exact_values(tmp_path):
    """Of a file beside the deck."""
    file = tmp_path / "deck.exact.csv"
    file.write_text("node,component,value\n1,y,4.05\n")
    theirs, ours = {1: [0.0, 4.0, 0.0]}, {1: [0.0, 4.04, 0.0]}
    (quantity,) = with_exact(file, theirs, ours)
    assert (quantity.exact, quantity.nearer) == (4.05, "ours")
    for wrong in ("node,component,value\n7,y,1.\n", "node,component,value\n1,w,1.\n", "node,value\n1,1.\n"):
        file.write_text(wrong)
        with pytest.raises(MeshError, match="line 2"):
            list(with_exact(file, theirs, ours))


# --- page ------------------------------------------------------------------------------------------------------------


def test_page():
    """Whole cases first; what is in a cell does not end it."""
    one = GauntletCase("one", "CalculiX", WHOLE, "", (ComparedQuantity("u", 1.0, 1.1, 0.1),), ("a | b *C",))
    two = GauntletCase("two", "CalculiX", SLOW, "more than 3 s")
    result = Gauntlet((two, one), (("test", "0123456789abcdef"),), 3.0, "2026-11-26")
    text = page(result, "signorini-fx gauntlet test --out gauntlet.md")
    assert "| one | u | 1 | 1.1 |  | 10 % |  | a \\| b \\*C |" in text
    assert text.index("| one |") < text.index("| two (out of time) |")
    assert "`test` at 0123456789" in text
    assert "2026-11-26" in text
    assert short_table(result) == "2 cases: 1 whole, 1 out of time; 0 whole within 1 %"


def test_outcomes_are_plain_data(tmp_path):
    """What a process writes is what the other one reads."""
    quantity = ComparedQuantity("u", 1.0, 1.1, 0.1, None, (0.1, 0.2))
    case = GauntletCase("one", "CalculiX", WHOLE, "", (quantity, ComparedQuantity("v", 1.0, 1.0, 0.0)), ("why",), 2.0)
    case.write(tmp_path / "outcome.json")
    assert GauntletCase.read(tmp_path / "outcome.json") == case


def test_commit_without_git(tmp_path):
    """A branch, a packed one, and one that is checked out by itself."""
    git = tmp_path / ".git"
    (git / "refs" / "heads").mkdir(parents=True)
    (git / "HEAD").write_text("ref: refs/heads/main\n")
    (git / "refs" / "heads" / "main").write_text("abc\n")
    assert commit_of(tmp_path) == "abc"
    (git / "refs" / "heads" / "main").unlink()
    (git / "packed-refs").write_text("# pack-refs\ndef refs/heads/main\n")
    assert commit_of(tmp_path) == "def"
    (git / "HEAD").write_text("123\n")
    assert commit_of(tmp_path) == "123"


def test_command(tmp_path, capsys):
    """A line for each case, the page, and an exit code that says whether all agree; JSON in place of text."""
    cases = tmp_path / "cases"
    cases.mkdir()
    case_of(cases, "shelf_CPE4")
    out = tmp_path / "page.md"
    assert cli.main(["gauntlet", str(cases), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("shelf_CPE4")
    assert "1 cases: 1 whole; 1 whole within 1 %" in said
    assert "signorini-fx gauntlet cases --seconds 120 --out page.md" in out.read_text()
    assert cli.main(["gauntlet", str(cases), "--out", str(out)]) == 2
    assert "already exists" in capsys.readouterr().err
    assert cli.main(["gauntlet", str(cases), "--seconds", "0"]) == 2
    assert cli.main(["gauntlet", str(cases), "--seconds", "0.05", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["cases"][0]["state"] == SLOW


@pytest.mark.parametrize("fails", [True, False])
def test_files_of_a_draft_that_has_no_solution(tmp_path, monkeypatch, fails):
    """Where finite strains are tried in vain, the files are those of the solution that there is."""
    first = draft(case_of(tmp_path, "shelf_CPE4"), file := tmp_path / "scene.toml")
    other = replace(first, files={file: "title = 'other'\n", tmp_path / "links.csv": "link\n"})
    tried, kept = [], solved_drafts.SolvedDraft(None, [], None)

    def solved(case, drafted, path, plainly):
        solved_drafts._write(drafted)
        tried.append(drafted)
        return case if fails and drafted is other else kept

    monkeypatch.setattr(solved_drafts, "_solved", solved)
    monkeypatch.setattr(solved_drafts, "lacks_finite_strains", lambda solution: True)
    monkeypatch.setattr(solved_drafts, "finite_draft", lambda deck, path: other)
    case = GauntletCase("shelf", "case", REFUSED)
    assert solved_drafts.solved_draft(case, first, file, str, tmp_path / "shelf_CPE4.inp") == kept
    assert tried == [first, other]
    assert (file.read_text() == first.text) is fails
    assert (tmp_path / "links.csv").exists() is not fails
