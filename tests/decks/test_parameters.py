"""Parameters of keywords: those that are read, and the others, which are lost by their names."""

import pytest
from deck_lines import STEEL, assembly, squares, stacked

from signorini_fx.addons.decks import reading
from signorini_fx.addons.decks.reading import draft
from signorini_fx.addons.decks.text import KNOWN, OUTPUT
from signorini_fx.addons.judging.judge import judge
from signorini_fx.addons.judging.judged_problem import SolutionOnMesh, judged_problem
from signorini_fx.scenes import cli

HARD = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"
BASE = stacked([HARD, "*FRICTION", "0.3"])
PAIR = "*CONTACT PAIR, INTERACTION=I"
# Lines before the first step, and within it, of keywords that the deck does not have.
BEFORE = {
    "HEADING": ["*HEADING", "Two blocks"],
    "SYSTEM": ["*SYSTEM"],
    "INCLUDE": ["*INCLUDE, INPUT=other.txt"],
    "SHELLSECTION": ["*SHELL SECTION, ELSET=NONE, MATERIAL=STEEL", "1."],
    "MEMBRANESECTION": ["*MEMBRANE SECTION, ELSET=NONE, MATERIAL=STEEL", "1."],
    "DENSITY": ["*MATERIAL, NAME=M", "*DENSITY", "1."],
    "MASS": ["*MASS, ELSET=M", "1."],
    "EXPANSION": ["*MATERIAL, NAME=M", "*EXPANSION", "1."],
    "HYPERELASTIC": ["*MATERIAL, NAME=M", "*HYPERELASTIC, NEO HOOKE", "1., 0.01"],
    "PLASTIC": ["*MATERIAL, NAME=M", "*ELASTIC", "1., .3", "*PLASTIC", "1., 0."],
    "TIE": ["*TIE, NAME=T", "NOWHERE, UP_TOP"],
    "AMPLITUDE": ["*AMPLITUDE, NAME=A", "0., 0., 1., 1."],
    "PRE-TENSIONSECTION": ["*PRE-TENSION SECTION, SURFACE=NOWHERE, NODE=900"],
    "INITIALCONDITIONS": ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "UP_HEAD, 5."],
}
WITHIN = {
    "CLOAD": ["*CLOAD", "111, 2, 1."],
    "DLOAD": ["*DLOAD", "UP, BX, 1."],
    "TEMPERATURE": ["*TEMPERATURE", "UP_HEAD, 5."],
    "RESTART": ["*RESTART, WRITE"],
}


def written(folder, lines):
    """A deck, and a file that it may include."""
    (folder / "other.txt").write_text("** nothing\n")
    deck = folder / "deck.inp"
    deck.write_text("\n".join(lines) + "\n")
    return deck


def with_lines(before=(), within=(), **changes):
    """The deck with more lines, and with others in place of some."""
    start, end = BASE.index("*STEP"), BASE.index("*END STEP")
    lines = [*BASE[:start], *before, *BASE[start:end], *within, "*END STEP"]
    return [changes.get(line.partition(",")[0].strip("*").replace(" ", ""), line) for line in lines]


def test_each_keyword_that_is_read_has_its_parameters():
    """One table for both: what is read, and what is known of it."""
    read = {*reading._READERS, *reading._READ_ELSEWHERE} - {*OUTPUT}
    assert read == {*KNOWN}


@pytest.mark.parametrize("keyword", sorted(KNOWN))
def test_an_invented_parameter_is_lost(keyword, tmp_path):
    """By its name and its line, whatever the keyword."""
    lines = with_lines(BEFORE.get(keyword, ()), WITHIN.get(keyword, ()))
    names = [line.partition(",")[0].strip("*").replace(" ", "") for line in lines]
    if keyword not in names:
        lines = assembly()
        names = [line.partition(",")[0].strip("*").replace(" ", "") for line in lines]
    at = len(names) - 1 - names[::-1].index(keyword)
    before = draft(written(tmp_path, lines), tmp_path / "s.toml").lost
    lines[at] += ", INVENTED=1"
    lost = draft(written(tmp_path, lines), tmp_path / "s.toml").lost
    new = [remark for remark in lost if remark not in before]
    name = lines[at].partition(",")[0]
    assert f"line {at + 1}, {name}: INVENTED=1 is not read" in new


UNREAD = {
    "RIKS": with_lines(STATIC="*STATIC, RIKS"),
    "INTERACTON=I": with_lines(CONTACTPAIR="*CONTACT PAIR, INTERACTON=I"),
    "VALUE=ABSOLUTE": with_lines(
        ["*AMPLITUDE, NAME=A, VALUE=ABSOLUTE", "0., 0., 1., 5."],
        ["*DSLOAD, AMPLITUDE=A", "UP_TOP, P, 5."],
    ),
    "ANISOTROPIC": with_lines(FRICTION="*FRICTION, ANISOTROPIC"),
    "ORIENTATION=O": with_lines(DSLOAD="*DSLOAD, ORIENTATION=O"),
    "OP=NEU": with_lines(DSLOAD="*DSLOAD, OP=NEU"),
    "NLGEOM=MAYBE": with_lines(STEP="*STEP, NLGEOM=MAYBE"),
    "MODULI=INSTANTANEOUS": with_lines(ELASTIC="*ELASTIC, MODULI=INSTANTANEOUS"),
    "READ": with_lines((), ["*RESTART, READ, STEP=1"]),
    "COMBINE=UNION": with_lines(["*SURFACE, NAME=S, COMBINE=UNION"]),
}


@pytest.mark.parametrize("parameter", UNREAD)
def test_what_changes_the_answer_is_named(parameter, tmp_path):
    """Parameters and values of Abaqus that no scene has."""
    deck = written(tmp_path, UNREAD[parameter])
    lost = draft(deck, tmp_path / "s.toml").lost
    assert any(remark.endswith(f": {parameter} is not read") for remark in lost), lost


def test_the_command_ends_with_code_4(tmp_path, capsys):
    """`new` and `solve` alike."""
    deck = written(tmp_path, UNREAD["RIKS"])
    assert cli.main(["new", str(tmp_path / "s.toml"), "--from", str(deck)]) == 4
    assert "RIKS is not read" in capsys.readouterr().out


def test_parameters_without_effect(tmp_path):
    """Controls of the solver, and an empty word at the end of the line, are no loss."""
    lines = with_lines(
        STEP="*STEP, INC=100, UNSYMM=YES,",
        STATIC="*STATIC, DIRECT",
        FRICTION="*FRICTION, SLIP TOLERANCE=0.005",
        ELASTIC="*ELASTIC, MODULI=LONG TERM, TYPE=ISO",
        CONTACTPAIR=f"{PAIR}, TYPE=SURFACE TO SURFACE, SMALL SLIDING, NO THICKNESS",
    )
    assert draft(written(tmp_path, lines), tmp_path / "s.toml").lost == []


def contact_of(folder, lines):
    """The contact of a draft, and what it has lost."""
    deck = written(folder, lines)
    found = draft(deck, folder / "s.toml")
    return judged_problem(deck).scene.contact[0], found.lost


def test_anisotropic_friction_has_no_stiffness(tmp_path):
    """Its second number is a coefficient, not the stiffness of sticking."""
    lines = with_lines(FRICTION="*FRICTION, ANISOTROPIC")
    lines[lines.index("0.3")] = "0.3, 0.1"
    text = draft(written(tmp_path, lines), tmp_path / "s.toml").text
    assert "gamma_t" not in text
    assert "coefficient = 0.3" in text


def test_a_curve_at_a_rate_leaves_the_static_one(tmp_path):
    """The static curve holds, and the other one is lost."""
    static = ["*PLASTIC", "100., 0.", "200., 1."]
    lines = with_lines([*STEEL, *static, "*PLASTIC, RATE=10.", "300., 0.", "400., 1."])
    found = draft(written(tmp_path, lines), tmp_path / "s.toml")
    assert "yield_stress = 100.0" in found.text
    assert any("RATE=10. is not read" in remark for remark in found.lost)


def test_a_tied_pair_is_a_bond(tmp_path):
    """`judge` reads it as well: the result of a bond agrees."""
    tied = with_lines(CONTACTPAIR=f"{PAIR}, TIED, ADJUST=0.01", DSLOAD="*DSLOAD")
    pulled = [line.replace("UP_TOP, P, 5.0", "UP_TOP, P, -5.0") for line in tied]
    contact, lost = contact_of(tmp_path, pulled)
    assert (contact.kind, lost) == ("bonded", [])
    problem = judged_problem(tmp_path / "deck.inp")
    ours = SolutionOnMesh.of(problem, problem.arrays).displacement
    assert judge(tmp_path / "deck.inp", ours[: len(problem.names)]).exit_code == 0


def test_what_a_tie_does_not_reach(tmp_path):
    """Nodes beyond the tolerance are tied in the scene alone, which is lost."""
    for gap, ties in ((0.01, False), (0.001, True)):
        base = stacked([HARD], gap, "*TIE, NAME=T, POSITION TOLERANCE=0.005")
        lost = draft(written(tmp_path, base), tmp_path / "s.toml").lost
        assert (lost == []) is ties, lost


@pytest.mark.parametrize(("gap", "closed"), [(0.0, True), (0.01, False)])
def test_no_separation_is_bilateral(gap, closed, tmp_path):
    """Exact where both sides touch from the beginning."""
    contact, lost = contact_of(tmp_path, stacked(["*SURFACE BEHAVIOR, NO SEPARATION"], gap))
    assert contact.kind == "bilateral"
    assert (lost == []) is closed
    assert closed or "NO SEPARATION of sides 0.01 apart: closed here" in lost[0]


def test_masses_with_weight(tmp_path):
    """They matter where gravity acts, and only there."""
    mass = ["*NODE", "900, 1., 2.", "*ELEMENT, TYPE=MASS, ELSET=M", "901, 900", "*MASS, ELSET=M"]
    mass += ["5.", "*MATERIAL, NAME=STEEL", "*DENSITY", "1."]
    assert draft(written(tmp_path, with_lines(mass)), tmp_path / "s.toml").lost == []
    for targets, weighs in (([""], True), (["UP", "LOW"], False), (["UP", "LOW", "M"], True)):
        rows = [f"{target}, GRAV, 9.81, 0., -1., 0." for target in targets]
        lost = draft(
            written(tmp_path, with_lines(mass, ["*DLOAD", *rows])), tmp_path / "s.toml"
        ).lost
        said = "masses at nodes, on which weight or rotation acts, are not read"
        assert any(said in remark for remark in lost) is weighs, lost


def test_tractions_of_finite_strains(tmp_path):
    """They turn with the body in Abaqus, unless both parameters say that they do not."""
    fixed = "*DSLOAD, FOLLOWER=NO, CONSTANT RESULTANT=YES"
    for step, load, kept in (
        ("*STEP, NLGEOM", "*DSLOAD", False),
        ("*STEP, NLGEOM", fixed, True),
        ("*STEP", "*DSLOAD", True),
    ):
        lines = with_lines(STEP=step, DSLOAD=load)
        lines[lines.index("UP_TOP, P, 5.0")] = "UP_TOP, TRVEC, 5.0, 0., -1., 0."
        lost = draft(written(tmp_path, lines), tmp_path / "s.toml").lost
        assert (lost == []) is kept, lost


@pytest.mark.parametrize("singly", [False, True])
def test_forces_on_two_bodies_are_tractions(singly, tmp_path):
    """One *CLOAD for both, each with the forces of a uniform traction."""
    shares = [0.125, 0.25, 0.25, 0.25, 0.125]
    lines = squares(4, 2, name="A") + squares(4, 2, 101, (3.0, 0.0), name="B") + STEEL
    loads = ["*CLOAD"]
    for name, first, value in (("A", 11, -1.0), ("B", 111, -2.0)):
        lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL"]
        lines += [f"*NSET, NSET={name}_ENDS", f"{first}, {first + 4}"]
        lines += [f"*NSET, NSET={name}_REST, GENERATE", f"{first + 1}, {first + 3}"]
        if singly:
            loads += [f"{first + k}, 2, {value * share}" for k, share in enumerate(shares)]
        else:
            loads += [f"{name}_ENDS, 2, {0.125 * value}", f"{name}_REST, 2, {0.25 * value}"]
    lines += ["*BOUNDARY", "A_FEET, 1, 2", "B_FEET, 1, 2", "*STEP", "*STATIC", *loads, "*END STEP"]
    found = draft(written(tmp_path, lines), tmp_path / "s.toml")
    scene = judged_problem(tmp_path / "deck.inp").scene
    assert (found.lost, scene.point_force) == ([], ())
    assert [(entry.boundary, round(entry.y, 9)) for entry in scene.traction] == [
        ("A_HEAD", -1.0),
        ("B_HEAD", -2.0),
    ]
