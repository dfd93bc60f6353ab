"""What becomes of each keyword: the table, its page, and decks with each of its rows."""

import ast
import json
import sys
from pathlib import Path

import pytest
from deck_lines import STEEL, squares, stacked

import signorini_fx
from signorini_fx.addons.decks.draft import draft
from signorini_fx.addons.decks.keywords import PLAIN, RULES, Grade
from signorini_fx.errors import MeshError
from signorini_fx.quantities.answers import answers
from signorini_fx.scenes import cli

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent / "docs"))
import decks

PACKAGE = Path(signorini_fx.__file__).parent
BASE = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"])
STEP, END = BASE.index("*STEP"), BASE.index("*END STEP")
NODE = ["*NODE", "900, 5., 5."]
ELSEWHERE = (None, None)  # a row that another test is about
# By keyword and case: lines before the first step, or another first line of it; lines of the step.
SAID = {
    ("INCLUDE", ""): (["*INCLUDE, INPUT=more.inp"], []),
    ("EXPANSION", ""): (["*MATERIAL, NAME=STEEL", "*EXPANSION", "1e-5"], []),
    ("DENSITY", ""): (["*MATERIAL, NAME=STEEL", "*DENSITY", "1."], []),
    ("ORIENTATION", ""): (["*ORIENTATION, NAME=O", "1., 0., 0., 0., 1., 0."], []),
    ("TRANSFORM", "TYPE other than R, C"): (
        ["*TRANSFORM, NSET=UP_WALL, TYPE=S", "1., 0., 0., 0., 1., 0."],
        [],
    ),
    ("CYCLICSYMMETRYMODEL", ""): ELSEWHERE,
    ("CYCLICSYMMETRYMODEL", "CONTACT, without a contact pair of both sides"): ELSEWHERE,
    ("HYPERELASTIC", ""): ELSEWHERE,
    ("HYPERELASTIC", "another energy, or incompressible"): ELSEWHERE,
    ("HYPERELASTIC", "elsewhere"): ELSEWHERE,
    ("PLASTIC", ""): ELSEWHERE,
    ("PLASTIC", "HARDENING other than ISOTROPIC"): (
        ["*MATERIAL, NAME=STEEL", "*PLASTIC, HARDENING=KINEMATIC", "1., 0."],
        [],
    ),
    ("PLASTIC", "elsewhere"): ELSEWHERE,
    ("PLASTIC", "of rubber"): ELSEWHERE,
    ("SOLIDSECTION", "beside rubber"): ELSEWHERE,
    ("COUPLING", ""): (
        [*NODE, "*COUPLING, REF NODE=900, SURFACE=UP_TOP, CONSTRAINT NAME=C", "*DISTRIBUTING"],
        ["*CLOAD", "900, 2, -1."],
    ),
    ("KINEMATIC", ""): (
        [*NODE, "*COUPLING, REF NODE=900, SURFACE=UP_TOP, CONSTRAINT NAME=C", "*KINEMATIC", "1, 2"],
        [],
    ),
    ("DISTRIBUTING", ""): ELSEWHERE,
    ("KINEMATIC", "without some displacements"): (
        [*NODE, "*COUPLING, REF NODE=900, SURFACE=UP_TOP, CONSTRAINT NAME=C", "*KINEMATIC", "2, 2"],
        [],
    ),
    ("COUPLING", "of another surface"): (
        [*NODE, "*COUPLING, REF NODE=900, SURFACE=NOWHERE, CONSTRAINT NAME=C", "*KINEMATIC"],
        [],
    ),
    ("MPC", ""): (["*MPC", "STRAIGHT, 111, 115, 112, 113"], []),
    ("MPC", "of another type"): (["*MPC", "BEAM, 111, 115"], []),
    ("CHANGEFRICTION", ""): (
        [],
        ["*END STEP", "*STEP", "*STATIC", "*CHANGE FRICTION, INTERACTION=I", "*FRICTION", "0.2"],
    ),
    ("CHANGEFRICTION", "beside loads or displacements of a later step"): (
        [],
        [
            *("*END STEP", "*STEP", "*STATIC", "*CHANGE FRICTION, INTERACTION=I", "*FRICTION", "0.2"),
            *("*DSLOAD", "UP_TOP, P, 6.0"),
        ],
    ),
    ("EQUATION", ""): (["*EQUATION", "2", "111, 2, 1., 112, 2, -1."], []),
    ("TRANSFORM", ""): (["*TRANSFORM, NSET=UP_WALL", "1., 0., 0., 0., 1., 0."], []),
    ("AMPLITUDE", ""): (["*AMPLITUDE, NAME=A", "0., 0., 1., 1."], ["*DSLOAD, AMPLITUDE=A", "UP_TOP, P, 1."]),
    ("CLOAD", ""): ([], ["*CLOAD", "111, 2, -.5", "112, 2, -1.", "113, 2, -1.", "114, 2, -1.", "115, 2, -.5"]),
    ("DLOAD", ""): ([], ["*DLOAD", "LOW, BY, -1.", "UP, BY, -1."]),
    ("TEMPERATURE", ""): ([], ["*TEMPERATURE", "UP_HEAD, 5."]),
    ("INITIALCONDITIONS", ""): (["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "UP_HEAD, 5."], []),
    ("FRICTION", ""): (["*SURFACE INTERACTION, NAME=I", "*FRICTION", ".3"], []),
    ("PRE-TENSIONSECTION", ""): ELSEWHERE,
    ("MODELCHANGE", ""): ([], ["*MODEL CHANGE, TYPE=CONTACT PAIR, ADD", "UP_BOTTOM, LOW_TOP"]),
    ("MODELCHANGE", "of elements in a later step, or of rigid surfaces"): (
        [],
        ["*END STEP", "*STEP", "*STATIC", "*MODEL CHANGE, TYPE=ELEMENT, REMOVE", "UP"],
    ),
    ("CLEARANCE", ""): (["*CLEARANCE, MASTER=LOW_TOP, SLAVE=UP_BOTTOM, VALUE=0.001"], []),
    ("CLEARANCE", "of single nodes, or of no contact pair"): (
        ["*CLEARANCE, MASTER=LOW_TOP, SLAVE=UP_BOTTOM", "112, 0.001"],
        [],
    ),
    ("CHANGESURFACEBEHAVIOR", ""): (
        [],
        ["*CHANGE SURFACE BEHAVIOR, INTERACTION=I", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "1."],
    ),
    ("TIE", ""): ELSEWHERE,
    ("RIGIDBODY", ""): ELSEWHERE,
    ("ELASTIC", "several temperatures"): (["*MATERIAL, NAME=M", "*ELASTIC", "1., .3, 20.", "2., .3, 90."], []),
    ("EXPANSION", "several temperatures"): (["*MATERIAL, NAME=M", "*EXPANSION", "1., 20.", "2., 90."], []),
    ("ELASTIC", "within a step"): ([], ["*ELASTIC", "1., .3"]),
    ("HYPERELASTIC", "within a step"): ([], ["*HYPERELASTIC, NEO HOOKE", "1., .3"]),
    ("PLASTIC", "within a step"): ([], ["*PLASTIC", "1., 0."]),
    ("EXPANSION", "within a step"): ([], ["*EXPANSION", "1."]),
    ("FRICTION", "within a step"): ([], ["*FRICTION", ".3"]),
    ("SURFACEBEHAVIOR", "within a step"): ([], ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "1."]),
    ("SHELLSECTION", "of a plane mesh"): (["*SHELL SECTION, ELSET=UP, MATERIAL=STEEL", "1."], []),
    ("MEMBRANESECTION", "of a plane mesh"): (["*MEMBRANE SECTION, ELSET=UP, MATERIAL=STEEL", "1."], []),
    ("SHELLSECTION", "thin as nothing, on a side"): ELSEWHERE,
    ("BEAMSECTION", ""): (["*BEAM SECTION, ELSET=UP, MATERIAL=STEEL", "1., 1."], []),
    ("SHELLSECTION", "of no part of the mesh"): (["*SHELL SECTION, ELSET=ELSEWHERE, MATERIAL=STEEL", "1."], []),
    ("MEMBRANESECTION", "of no part of the mesh"): (["*MEMBRANE SECTION, ELSET=ELSEWHERE, MATERIAL=STEEL", "1."], []),
    ("NGEN", ""): (["*NGEN", "1, 2, 1"], []),
    ("SYSTEM", "of other axes"): (["*SYSTEM", "0., 0., 0., 0., 1., 0."], []),
    ("NODE", "SYSTEM other than R"): (["*NODE, SYSTEM=C", "900, 1., 1."], []),
    ("ELEMENT", "springs, gaps, connectors"): (["*ELEMENT, TYPE=SPRINGA, ELSET=S", "900, 1, 2"], []),
    ("ELEMENT", "CPE, CPS and CAX in one file"): ("CPS", []),
    ("STEP", "within another one"): ELSEWHERE,
    **{
        (key, "outside of steps"): ([f"*{keyword}", row], [])
        for key, keyword, row in (
            ("STATIC", "STATIC", "1., 1."),
            ("CLOAD", "CLOAD", "111, 2, 1."),
            ("DLOAD", "DLOAD", "UP, GRAV, 9.81, 0., -1., 0."),
            ("DSLOAD", "DSLOAD", "UP_TOP, P, 1."),
            ("TEMPERATURE", "TEMPERATURE", "UP_HEAD, 5."),
            ("MODELCHANGE", "MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE", "UP_BOTTOM, LOW_TOP"),
        )
    },
    ("BOUNDARY", "between steps"): ([], ["*END STEP", "*BOUNDARY", "UP_HEAD, 1", "*STEP", "*STATIC"]),
    ("INITIALCONDITIONS", "within a step"): ([], ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "UP_HEAD, 5."]),
    ("STEP", "NLGEOM; small rotations"): ("*STEP, NLGEOM", []),
    ("STEP", "NLGEOM; run finds rotations that matter"): ELSEWHERE,
    ("STEP", "NLGEOM; with what finite strains are not possible yet"): ELSEWHERE,
    ("STEP", "NLGEOM; solids of degree 2, ties; run finds that it matters little"): ELSEWHERE,
    ("STEP", "NLGEOM; run finds that it matters"): ELSEWHERE,
    ("STEP", "PERTURBATION"): ("*STEP, PERTURBATION", []),
    ("AMPLITUDE", "DEFINITION other than TABULAR, SMOOTH STEP"): (
        ["*AMPLITUDE, NAME=A, DEFINITION=PERIODIC", "1, 2., 0., 1."],
        ["*DSLOAD, AMPLITUDE=A", "UP_TOP, P, 1."],
    ),
    ("AMPLITUDE", "TIME=TOTAL TIME, of temperatures, bolts and loads on shells"): ELSEWHERE,
    ("BOUNDARY", "of other nodes"): ([*NODE, "*BOUNDARY", "900, 1"], []),
    ("BOUNDARY", "of tied other nodes"): ([*NODE, "*EQUATION", "2", "900,1,1.,111,1,1.", "*BOUNDARY", "900, 1"], []),
    ("DLOAD", "body force or weight on a part"): ([], ["*DLOAD", "LOW, BY, -1."]),
    ("CLOAD", "components 4 to 6"): ([], ["*CLOAD", "111, 6, 1."]),
    ("DSLOAD", "on another surface"): ([], ["*DSLOAD", "NOWHERE, P, 1."]),
    ("INITIALCONDITIONS", "neither TEMPERATURE nor VELOCITY"): (["*INITIAL CONDITIONS, TYPE=STRESS", "UP, 1."], []),
    ("INITIALCONDITIONS", "VELOCITY"): (["*INITIAL CONDITIONS, TYPE=VELOCITY", "UP, 1, 1."], []),
    ("SURFACEBEHAVIOR", "none of HARD, LINEAR, EXPONENTIAL, TABULAR, TIED"): (
        ["*SURFACE INTERACTION, NAME=J", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=MASSLESS", "1., 1."],
        [],
    ),
    ("SURFACEBEHAVIOR", "NO SEPARATION"): (["*SURFACE INTERACTION, NAME=J", "*SURFACE BEHAVIOR, NO SEPARATION"], []),
    ("FRICTION", "ROUGH"): (["*SURFACE INTERACTION, NAME=I", "*FRICTION, ROUGH"], []),
    ("CONTACTPAIR", "of another surface"): (["*CONTACT PAIR, INTERACTION=I", "NOWHERE, UP_TOP"], []),
    ("TIE", "of another surface"): (["*TIE, NAME=T", "NOWHERE, UP_TOP"], []),
    ("TIE", "CYCLIC SYMMETRY alone"): (["*TIE, CYCLIC SYMMETRY, NAME=T", "UP_TOP, LOW_BOTTOM"], []),
    ("RIGIDBODY", "of elements of the body"): ([*NODE, "*RIGID BODY, ELSET=UP, REF NODE=900"], []),
    ("NODEPRINT", ""): ([], ["*NODE PRINT, NSET=UP_HEAD", "U, RF"]),
    ("CONTACTPRINT", ""): ([], ["*CONTACT PRINT", "CDIS, CSTR"]),
    ("NODEPRINT", "other than U, RF"): ([], ["*NODE PRINT, NSET=UP_HEAD", "NT"]),
    ("CONTACTPRINT", "other than CDIS, CSTR"): ([], ["*CONTACT PRINT", "CF"]),
    ("NODEFILE", "other than U, RF"): ([], ["*NODE FILE", "NT"]),
    ("ELFILE", "other than S"): ([], ["*EL FILE", "E"]),
    ("ELPRINT", ""): ([], ["*EL PRINT, ELSET=UP", "S"]),
    ("FACEPRINT", ""): ([], ["*FACE PRINT, SURFACE=UP_TOP", "DRAG"]),
    ("SECTIONPRINT", ""): ([], ["*SECTION PRINT, SURFACE=UP_TOP, NAME=P", "SOF"]),
    ("NODEPRINT", "RF of a body of revolution"): ("CAX", ["*NODE PRINT, NSET=UP_HEAD", "RF"]),
    ("NODEFILE", "RF of a body of revolution"): ("CAX", ["*NODE FILE", "RF"]),
}
# These make sense with others around them, which the decks of other tests have.
AROUND = ("PART", "ENDPART", "ASSEMBLY", "ENDASSEMBLY", "INSTANCE", "ENDINSTANCE", "MATERIAL", "SURFACEINTERACTION")


def written(folder, before, within):
    """A deck with more lines, or another first line of its step, or other elements."""
    lines = [*BASE[:STEP], *(before if isinstance(before, list) else []), *BASE[STEP:END], *within, "*END STEP"]
    if before in ("CAX", "CPS"):
        at = [k for k, line in enumerate(lines) if "CPE4" in line]
        for k in at if before == "CAX" else at[:1]:
            lines[k] = lines[k].replace("CPE4", f"{before}4")
    elif isinstance(before, str):
        lines[lines.index("*STEP")] = before
    (folder / "more.inp").write_text("** nothing\n", encoding="utf-8")
    deck = folder / "deck.inp"
    deck.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return deck


def graded(deck):
    """The remarks of a draft that change the answer, and those that do not."""
    drafted = draft(deck, deck.with_suffix(".toml"))
    return drafted.lost, drafted.noted


@pytest.mark.parametrize("grade", Grade)
def test_grades(tmp_path, grade):
    """A deck with each row of the table has the grade of this row, and says so with the words of it."""
    wrong = []
    in_base = {line.partition(",")[0].lstrip("*").replace(" ", "") for line in BASE if line.startswith("*")}
    assert graded(written(tmp_path, [], [])) == ([], [])
    for rule in (rule for rule in RULES if rule.grade is grade):
        here = (rule.key, rule.case)
        if here not in SAID:
            if rule.key in in_base or rule.key in AROUND:
                continue
            assert not rule.case, rule
        before, within = SAID.get(here, ([], [f"*{rule.keyword}"]))  # a keyword that needs no data
        if before is None:
            continue
        if grade is Grade.REFUSED:
            with pytest.raises(MeshError, match=rule.effect):
                graded(written(tmp_path, before, within))
            continue
        lost, noted = graded(written(tmp_path, before, within))
        said = {Grade.LOST: lost, Grade.NOTED: noted, Grade.TAKEN: []}[grade]
        others = {Grade.LOST: [], Grade.NOTED: lost, Grade.TAKEN: [*lost, *noted]}[grade]
        if others or (grade is not Grade.TAKEN and not any(rule.effect in remark for remark in said)):
            wrong.append((here, lost, noted))
    assert not wrong


def test_rows_of_the_table(tmp_path):
    """Each is there once; what is not there changes the answer."""
    assert len(RULES) == len({(rule.key, rule.case, rule.effect) for rule in RULES})
    assert SAID.keys() <= {(rule.key, rule.case) for rule in RULES}
    assert "CREEP" not in PLAIN
    lost, _ = graded(written(tmp_path, ["*CREEP", "1., 0."], []))
    assert ["*CREEP: not known to scenes" in remark for remark in lost] == [True]


def named_in_code(path):
    """The keywords that a file of the package compares those of a deck with: ``.keyword == "X"``, ``case "X"``."""
    tree, names = ast.parse(path.read_text(encoding="utf-8")), set()
    constants = {
        node.targets[0].id: node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }

    def is_keyword(node):
        return isinstance(node, ast.Attribute) and node.attr == "keyword"

    def collect(node):
        local = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)} & constants.keys()
        for part in (node, *(constants[name] for name in local)):
            names.update(
                leaf.value for leaf in ast.walk(part) if isinstance(leaf, ast.Constant) and isinstance(leaf.value, str)
            )

    for node in ast.walk(tree):
        if isinstance(node, ast.Compare) and any(map(is_keyword, (node.left, *node.comparators))):
            collect(node)
        elif isinstance(node, ast.Match) and is_keyword(node.subject):
            for case in node.cases:
                collect(case.pattern)
        elif isinstance(node, ast.Subscript | ast.Call) and any(map(is_keyword, ast.walk(node))):
            collect(node.value if isinstance(node, ast.Subscript) else node.func)
    return names


def test_the_table_has_all_keywords_of_the_code():
    """Whatever the reading of decks and of their meshes asks for has a row, and so a grade, on the page."""
    rooms = (PACKAGE / "addons" / "decks", PACKAGE / "mechanics" / "mesh" / "files")
    named = {name: path.name for room in rooms for path in room.glob("*.py") for name in named_in_code(path)}
    assert {"NGEN", "STEP", "GAP", "CONTACTPRINT", "BEAMSECTION", "ENDINSTANCE"} <= named.keys()
    keys = {rule.key for rule in RULES}
    assert {name: file for name, file in named.items() if name not in keys and name.isupper()} == {}


def test_page():
    """Run ./env python3 docs/decks.py where it is not."""
    assert decks.PAGE.read_text(encoding="utf-8") == decks.written()


def test_all_contact_is_lost(tmp_path):
    """That bodies do not touch at all is said, not only why one pair is lost."""
    lines = ["UP_BOTTOM, NOWHERE" if line == "UP_BOTTOM, LOW_TOP" else line for line in BASE]
    deck = tmp_path / "deck.inp"
    deck.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert "all of its contact: bodies do not touch in the scene" in graded(deck)[0]


def cantilever(tmp_path, length, kind):
    """A deck with NLGEOM, and its lines."""
    lines = [*squares(8, 1, size=(length, 1.0)), "*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL", *STEEL, "*BOUNDARY"]
    lines += ["BODY_WALL, 1, 2", "*STEP, NLGEOM", "*STATIC", "*DSLOAD", "BODY_TOP, P, .001", "*END STEP"]
    lines = [line.replace("CPE4", kind) for line in lines]
    deck = tmp_path / "deck.inp"
    deck.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return deck, lines


def test_slender_in_plane_strain(tmp_path, capsys):
    """Where rotations matter a deck is solved once more with finite strains, without contact as well."""
    deck, _ = cantilever(tmp_path, 40.0, "CPE4")
    assert cli.main(["run", str(deck), "--out", str(tmp_path / "out"), "--no-pictures", "--no-fields"]) == 0
    assert "solved once more with finite strains" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(("length", "code"), [(1.0, 0), (40.0, 4)])
def test_rotations_that_matter(tmp_path, capsys, length, code):
    """NLGEOM changes the answer where rotations matter beside strains: of a slender cantilever, not of a short one; in
    plane stress finite strains are not known.

    The summary has the grade, too: what the results lack, or a note, and the first answer of the report keeps to it.
    """
    deck, lines = cantilever(tmp_path, length, "CPS4")
    assert cli.main(["run", str(deck), "--out", str(tmp_path / "out"), "--no-pictures", "--no-fields"]) == code
    said = " ".join(capsys.readouterr().out.split())
    grade = "changes the answer: " if code else "does not change it: "
    at = lines.index("*STEP, NLGEOM") + 1
    assert f"{grade}line {at}, *STEP: NLGEOM: displacements and rotations are taken as small: they are up to" in said
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    lacks = [remark for remark in summary["incomplete"] if "NLGEOM" in remark]
    notes = [finding["message"] for finding in summary["findings"] if "NLGEOM" in finding["message"]]
    assert (len(lacks), len(notes)) == ((1, 0) if code else (0, 1))
    assert all(note.endswith("it does not change the answer") for note in notes)
    assert ("not known" in next(answer.text for answer in answers(summary))) == bool(code)
