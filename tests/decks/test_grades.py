"""What is not read: the table, and a deck with each of its rows."""

import re

import pytest
from deck_lines import stacked

from signorini_fx.addons.decks import unread_keywords
from signorini_fx.addons.decks.draft import draft
from signorini_fx.errors import MeshError
from signorini_fx.scenes import cli

HARD = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"
BASE = stacked([HARD])
STEP, END = BASE.index("*STEP"), BASE.index("*END STEP")
NODE = ["*NODE", "900, 5., 5."]
RUBBER = ["*MATERIAL, NAME=RUBBER", "*HYPERELASTIC, NEO HOOKE", "1., 0.01"]
PAIR = "*CONTACT PAIR, INTERACTION=I"
OTHER = "*SURFACE INTERACTION, NAME=J"
STEPS = ["*END STEP", "*STEP", "*STATIC"]
# Keywords that are read in part, or are errors: what is said, in which case, and of which keywords.
REFUSED = (
    (
        "nodes and elements are not generated here",
        "",
        "NGEN",
        "NFILL",
        "NCOPY",
        "NMAP",
        "ELGEN",
        "ELCOPY",
    ),
    ("coordinates are expected along x, y and z", "of other axes", "SYSTEM"),
    ("coordinates are expected along x, y and z", "SYSTEM other than R", "NODE"),
    (
        "only isotropic elasticity is read: state others in a scene, with material.orthotropic",
        "TYPE other than ISOTROPIC",
        "ELASTIC",
    ),
    (
        "only NEO HOOKE, MOONEY-RIVLIN and OGDEN with D1 above 0 are read",
        "another energy, or incompressible",
        "HYPERELASTIC",
    ),
    (
        "a nonlinear material is not possible yet",
        "with soft contact, preload, temperature and more",
        "HYPERELASTIC",
    ),
    (
        "the step has no procedure: write *STATIC into it; CalculiX solves nothing in such a step",
        "the first one without *STATIC",
        "STEP",
    ),
    ("has no *END STEP before this one", "within another one", "STEP"),
    (
        "is expected within a step",
        "outside of steps",
        "STATIC",
        "CLOAD",
        "DLOAD",
        "DSLOAD",
        "TEMPERATURE",
    ),
    ("is expected within a step", "between steps", "BOUNDARY"),
    ("is expected before the first step", "within a step", "INITIAL CONDITIONS"),
    (
        "some of its elements are in another section, too: give each of them one",
        "of elements of another one",
        "SOLID SECTION",
    ),
)
LOST = (
    (
        "constants that depend on temperature: the first line is taken",
        "several temperatures",
        "ELASTIC",
        "EXPANSION",
    ),
    (
        "a change within a step is not read: the first value holds",
        "within a step",
        "ELASTIC",
        "EXPANSION",
        "DENSITY",
        "HYPERELASTIC",
        "PLASTIC",
        "FRICTION",
        "SURFACE BEHAVIOR",
    ),
    (
        "hardening that is not isotropic is not read: elastic here",
        "HARDENING other than ISOTROPIC",
        "PLASTIC",
    ),
    (
        "a nonlinear material is not possible yet",
        "with soft contact, preload and more: it does not yield",
        "PLASTIC",
    ),
    ("a material with *HYPERELASTIC does not yield here", "of rubber", "PLASTIC"),
    ("no part of the body", "of no part of the mesh", "SHELL SECTION", "MEMBRANE SECTION"),
    ("no part of the body", "springs, gaps, connectors", "ELEMENT"),
    ("beside elements of another kind", "CPE, CPS and CAX in one file", "ELEMENT"),
    (
        "NLGEOM: displacements and rotations are taken as small",
        "NLGEOM, if finite strains are not possible yet",
        "STEP",
    ),
    (
        "NLGEOM: points in contact keep their partners",
        "NLGEOM, if solids of degree 2 touch, or with ADJUST",
        "STEP",
    ),
    (
        "PERTURBATION: contact may open and close here, and does not in such a step",
        "PERTURBATION",
        "STEP",
    ),
    (
        "only tabular amplitudes are read: the whole load is taken",
        "DEFINITION other than TABULAR",
        "AMPLITUDE",
    ),
    (
        "TIME=TOTAL TIME is read in decks of one step: the whole load is taken",
        "TIME=TOTAL TIME, if there are more steps",
        "AMPLITUDE",
    ),
    ("a part of the body", "body force or weight on a part", "DLOAD"),
    ("moments at nodes are not read", "components 4 to 6", "CLOAD"),
    ("is no boundary of the body", "on another surface", "DSLOAD"),
    (
        "temperatures that differ within a body are not read",
        "of some nodes of a body",
        "TEMPERATURE",
        "INITIAL CONDITIONS",
    ),
    ("not read", "neither TEMPERATURE nor VELOCITY", "INITIAL CONDITIONS"),
    ("behaviour of a subroutine is not read", "USER", "SURFACE INTERACTION"),
    (
        "soft contact is read as LINEAR or TIED only: this contact is hard",
        "EXPONENTIAL, TABULAR and others",
        "SURFACE BEHAVIOR",
    ),
    ("NO SEPARATION of sides 1 apart: closed here", "NO SEPARATION", "CONTACT PAIR"),
    ("ROUGH is not read: this contact has no friction", "ROUGH", "FRICTION"),
    (
        "ADJUST: a set with only some nodes of the dependent surface is not read",
        "ADJUST with a smaller set",
        "CONTACT PAIR",
    ),
    ("is no boundary of the body", "of another surface", "CONTACT PAIR", "TIE"),
    ("a constraint between nodes is not read", "CYCLIC SYMMETRY", "TIE"),
)
NOTED = (
    (
        "beside rubber: law = 'saint-venant-kirchhoff', linear in the strain of Green",
        "beside rubber",
        "SOLID SECTION",
    ),
    (
        "as a plane body under plane stress, without bending",
        "of a plane mesh",
        "SHELL SECTION",
        "MEMBRANE SECTION",
    ),
    ("as in the step before: this one names no procedure", "a later one without *STATIC", "STEP"),
    ("no part of the body", "of other nodes", "BOUNDARY"),
    ("without effect in static steps", "VELOCITY", "INITIAL CONDITIONS"),
)
# By keyword and case: lines before the first step, lines of the step, and lines that replace
# others.
SAID = {
    ("SYSTEM", "of other axes"): (["*SYSTEM", "0., 0., 0., 0., 1., 0."], []),
    ("NODE", "SYSTEM other than R"): (["*NODE, SYSTEM=C", "900, 1., 1."], []),
    ("NGEN", ""): (["*NGEN", "1, 2, 1"], []),
    ("ELASTIC", "TYPE other than ISOTROPIC"): (
        ["*MATERIAL, NAME=M", "*ELASTIC, TYPE=ORTHO", "1., 1."],
        [],
    ),
    ("ORIENTATION", ""): (["*ORIENTATION, NAME=O", "1., 0., 0., 0., 1., 0."], []),
    ("HYPERELASTIC", "another energy, or incompressible"): (
        ["*MATERIAL, NAME=M", "*HYPERELASTIC, YEOH", "1., 1."],
        [],
    ),
    ("HYPERELASTIC", "with soft contact, preload, temperature and more"): (
        *(RUBBER, []),
        {
            "*SOLID SECTION, ELSET=UP, MATERIAL=STEEL": "*SOLID SECTION, ELSET=UP, MATERIAL=RUBBER",
            "CPE4": "CPS4",
        },
    ),
    ("STEP", "the first one without *STATIC"): ([], [], {"*STATIC": "**"}),
    ("STEP", "within another one"): ([], ["*STEP", "*STATIC"]),
    ("STATIC", "outside of steps"): (["*STATIC"], []),
    ("CLOAD", "outside of steps"): (["*CLOAD", "111, 2, 1."], []),
    ("DLOAD", "outside of steps"): (["*DLOAD", "UP, GRAV, 9.81, 0., -1., 0."], []),
    ("DSLOAD", "outside of steps"): (["*DSLOAD", "UP_TOP, P, 1."], []),
    ("TEMPERATURE", "outside of steps"): (["*TEMPERATURE", "UP_HEAD, 5."], []),
    ("BOUNDARY", "between steps"): (
        [],
        ["*END STEP", "*BOUNDARY", "UP_HEAD, 1", "*STEP", "*STATIC"],
    ),
    ("INITIALCONDITIONS", "within a step"): (
        [],
        ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "UP_HEAD, 5."],
    ),
    ("ELASTIC", "several temperatures"): (
        ["*MATERIAL, NAME=M", "*ELASTIC", "1., .3, 20.", "2., .3, 90."],
        [],
    ),
    ("EXPANSION", "several temperatures"): (
        ["*MATERIAL, NAME=M", "*EXPANSION", "1., 20.", "2., 90."],
        [],
    ),
    ("ELASTIC", "within a step"): ([], ["*ELASTIC", "1., .3"]),
    ("DENSITY", "within a step"): ([], ["*DENSITY", "1."]),
    ("EXPANSION", "within a step"): ([], ["*EXPANSION", "1."]),
    ("HYPERELASTIC", "within a step"): ([], ["*HYPERELASTIC, NEO HOOKE", "1., .3"]),
    ("PLASTIC", "within a step"): ([], ["*PLASTIC", "1., 0."]),
    ("FRICTION", "within a step"): ([], ["*FRICTION", ".3"]),
    ("SURFACEBEHAVIOR", "within a step"): (
        [],
        ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "1."],
    ),
    ("CHANGEFRICTION", ""): ([], [*STEPS, "*CHANGE FRICTION, INTERACTION=I", "*FRICTION", "0.2"]),
    ("CHANGESURFACEBEHAVIOR", ""): ([], ["*CHANGE SURFACE BEHAVIOR, INTERACTION=I", HARD]),
    ("PLASTIC", "HARDENING other than ISOTROPIC"): (
        ["*MATERIAL, NAME=STEEL", "*PLASTIC, HARDENING=KINEMATIC", "1., 0."],
        [],
    ),
    ("PLASTIC", "with soft contact, preload and more: it does not yield"): (
        *(["*MATERIAL, NAME=STEEL", "*PLASTIC", "5., 0."], []),
        {"CPE4": "CPS4"},
    ),
    ("PLASTIC", "of rubber"): (
        *([*RUBBER, "*PLASTIC", "5., 0."], []),
        {"*SOLID SECTION, ELSET=UP, MATERIAL=STEEL": "*SOLID SECTION, ELSET=UP, MATERIAL=RUBBER"},
    ),
    ("SOLIDSECTION", "beside rubber"): (
        *(RUBBER, []),
        {"*SOLID SECTION, ELSET=UP, MATERIAL=STEEL": "*SOLID SECTION, ELSET=UP, MATERIAL=RUBBER"},
    ),
    **{
        (f"{kind}SECTION", "of a plane mesh"): (
            *([], []),
            {
                "*SOLID SECTION, ELSET=UP, MATERIAL=STEEL": f"*{kind} SECTION, ELSET=UP, "
                "MATERIAL=STEEL"
            },
        )
        for kind in ("SHELL", "MEMBRANE")
    },
    ("SOLIDSECTION", "of elements of another one"): (
        ["*SOLID SECTION, ELSET=UP, MATERIAL=STEEL"],
        [],
    ),
    ("BEAMSECTION", ""): (["*BEAM SECTION, ELSET=UP, MATERIAL=STEEL", "1., 1."], []),
    ("SHELLSECTION", "of no part of the mesh"): (
        ["*SHELL SECTION, ELSET=ELSEWHERE, MATERIAL=STEEL", "1."],
        [],
    ),
    ("MEMBRANESECTION", "of no part of the mesh"): (
        ["*MEMBRANE SECTION, ELSET=ELSEWHERE, MATERIAL=STEEL", "1."],
        [],
    ),
    ("ELEMENT", "springs, gaps, connectors"): (
        ["*ELEMENT, TYPE=SPRINGA, ELSET=S", "900, 1, 2"],
        [],
    ),
    ("ELEMENT", "CPE, CPS and CAX in one file"): (
        [],
        [],
        {"*ELEMENT, TYPE=CPE4, ELSET=UP": "*ELEMENT, TYPE=CPS4, ELSET=UP"},
    ),
    ("TRANSFORM", ""): (["*TRANSFORM, NSET=UP_WALL", "1., 0., 0., 0., 1., 0."], []),
    ("STEP", "a later one without *STATIC"): ([], ["*END STEP", "*STEP"]),
    ("STEP", "NLGEOM, if finite strains are not possible yet"): (
        [],
        [],
        {"*STEP": "*STEP, NLGEOM", "CPE4": "CPS4"},
    ),
    ("STEP", "NLGEOM, if solids of degree 2 touch, or with ADJUST"): (
        *([], []),
        {"*STEP": "*STEP, NLGEOM", PAIR: f"{PAIR}, ADJUST=0.01"},
    ),
    ("STEP", "PERTURBATION"): ([], [], {"*STEP": "*STEP, PERTURBATION"}),
    **{
        (keyword, ""): ([], ["*END STEP", "*STEP", f"*{keyword}"])
        for keyword, effect in unread_keywords.LOST.items()
        if effect == unread_keywords.OTHER_PROCEDURE
    },
    ("AMPLITUDE", "DEFINITION other than TABULAR"): (
        ["*AMPLITUDE, NAME=A, DEFINITION=PERIODIC", "1, 2., 0., 1."],
        ["*DSLOAD, AMPLITUDE=A", "UP_TOP, P, 1."],
    ),
    ("AMPLITUDE", "TIME=TOTAL TIME, if there are more steps"): (
        ["*AMPLITUDE, NAME=A, TIME=TOTAL TIME", "0., 0., 2., 1."],
        ["*TEMPERATURE, AMPLITUDE=A", "UP_ALL, 5.", *STEPS],
    ),
    ("BOUNDARY", "of other nodes"): ([*NODE, "*BOUNDARY", "900, 1"], []),
    ("DLOAD", "body force or weight on a part"): ([], ["*DLOAD", "LOW, BY, -1."]),
    ("CLOAD", "components 4 to 6"): ([], ["*CLOAD", "111, 6, 1."]),
    ("DSLOAD", "on another surface"): ([], ["*DSLOAD", "NOWHERE, P, 1."]),
    ("TEMPERATURE", "of some nodes of a body"): (
        ["*MATERIAL, NAME=STEEL", "*EXPANSION", "1."],
        ["*TEMPERATURE", "UP_HEAD, 5."],
    ),
    ("INITIALCONDITIONS", "of some nodes of a body"): (
        *(["*INITIAL CONDITIONS, TYPE=TEMPERATURE, FILE=other", "UP_HEAD, 5."], []),
    ),
    ("INITIALCONDITIONS", "neither TEMPERATURE nor VELOCITY"): (
        ["*INITIAL CONDITIONS, TYPE=STRESS", "UP, 1."],
        [],
    ),
    ("INITIALCONDITIONS", "VELOCITY"): (["*INITIAL CONDITIONS, TYPE=VELOCITY", "UP, 1, 1."], []),
    ("SURFACEINTERACTION", "USER"): ([f"{OTHER}, USER", "1., 2."], []),
    ("SURFACEBEHAVIOR", "EXPONENTIAL, TABULAR and others"): (
        [OTHER, "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL", "1., 1."],
        [],
    ),
    ("CONTACTPAIR", "NO SEPARATION"): (
        *([], []),
        {HARD: "*SURFACE BEHAVIOR, NO SEPARATION", "UP_BOTTOM, LOW_TOP": "UP_BOTTOM, LOW_BOTTOM"},
    ),
    ("FRICTION", "ROUGH"): ([], [], {HARD: "*FRICTION, ROUGH"}),
    ("CONTACTPAIR", "ADJUST with a smaller set"): ([], [], {PAIR: f"{PAIR}, ADJUST=UP_WALL"}),
    ("CONTACTPAIR", "of another surface"): ([PAIR, "NOWHERE, UP_TOP"], []),
    ("TIE", "of another surface"): (["*TIE, NAME=T", "NOWHERE, UP_TOP"], []),
    ("TIE", "CYCLIC SYMMETRY"): (["*TIE, CYCLIC SYMMETRY, NAME=T", "UP_TOP, LOW_BOTTOM"], []),
    ("CLEARANCE", ""): (["*CLEARANCE, MASTER=LOW_TOP, SLAVE=UP_BOTTOM, VALUE=0.001"], []),
    ("MODELCHANGE", ""): ([], ["*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE", "UP_BOTTOM, LOW_TOP"]),
    ("RIGIDBODY", ""): ([*NODE, "*RIGID BODY, ELSET=UP, REF NODE=900"], []),
    ("EQUATION", ""): (["*EQUATION", "2", "111, 2, 1., 112, 2, -1."], []),
    ("MPC", ""): (["*MPC", "STRAIGHT, 111, 115, 112, 113"], []),
    ("NODEPRINT", ""): ([], ["*NODE PRINT, NSET=UP_HEAD", "U, RF"]),
    ("CONTACTPRINT", ""): ([], ["*CONTACT PRINT", "CDIS, CSTR"]),
    ("SECTIONPRINT", ""): ([], ["*SECTION PRINT, SURFACE=UP_TOP, NAME=P", "SOF"]),
}


def written(folder, before, within, changes=()):
    """The deck with more lines, or with others."""
    lines = [
        *BASE[:STEP],
        "*NSET, NSET=UP_ALL, ELSET=UP",
        *before,
        *BASE[STEP:END],
        *within,
        "*END STEP",
    ]
    for old, new in dict(changes).items():
        lines = [
            line.replace("CPE4", new) if old == "CPE4" else new if line == old else line
            for line in lines
        ]
    deck = folder / "deck.inp"
    deck.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return deck, lines


def graded(deck):
    """The remarks of a draft that change the answer, and those that do not."""
    drafted = draft(deck, deck.with_suffix(".toml"))
    return drafted.lost, drafted.noted


def rows(*tables, partly=()):
    """Keyword, case and what is said, of keywords that are not read, and of those that are read in
    part.
    """
    whole = [(keyword, "", effect) for table in tables for keyword, effect in table.items()]
    return whole + [
        (keyword.replace(" ", ""), case, effect)
        for effect, case, *names in partly
        for keyword in names
    ]


def deck_of(folder, keyword, case):
    """The deck with a row, and the pattern of a remark of an effect."""
    default = (
        ([], [f"*{keyword}"]) if keyword != "CONNECTORFRICTION" else (["*CONNECTOR FRICTION"], [])
    )
    return written(folder, *SAID.get((keyword, case), default))


def place(effect):
    """The pattern of a remark."""
    return f"line [0-9]+( and [0-9]+ more)?, [*]?.*{re.escape(effect)}"


@pytest.mark.one_quick("grade", ["lost", "noted"])
def test_grades(tmp_path, grade):
    """A deck with each row of the tables is graded so, and the remark names the line and the
    keyword.
    """
    said = {
        "lost": rows(
            unread_keywords.LOST, {"GAP": "not read", "CONNECTORFRICTION": "not read"}, partly=LOST
        ),
        "noted": rows(unread_keywords.NOTED, partly=NOTED),
    }
    wrong = []
    for keyword, case, effect in said[grade]:
        deck, lines = deck_of(tmp_path, keyword, case)
        lost, noted = graded(deck)
        remarks = [
            text for text in (lost if grade == "lost" else noted) if re.search(place(effect), text)
        ]
        numbers = [int(re.match(r"line (\d+)", text)[1]) for text in remarks]
        named = any(lines[number - 1].startswith("*") for number in numbers)
        if not named or (grade == "noted" and lost):
            wrong.append(((keyword, case), lost, noted))
    assert not wrong


@pytest.mark.one_quick(("keyword", "case", "effect"), rows(partly=REFUSED))
def test_errors(tmp_path, keyword, case, effect):
    """A deck with each row ends in an error that names the line."""
    deck, _ = deck_of(tmp_path, keyword, case)
    with pytest.raises(MeshError, match=place(effect)):
        draft(deck, deck.with_suffix(".toml"))


LEFT = {
    "*EQUATION": (["*EQUATION", "2", "111, 2, 1., 112, 2, -1."], []),
    "*COUPLING": (
        [*NODE, "*COUPLING, REF NODE=900, SURFACE=UP_TOP", "*DISTRIBUTING"],
        ["*CLOAD", "900, 2, -1."],
    ),
    "*TRANSFORM": (["*TRANSFORM, NSET=UP_WALL", "1., 0., 0., 0., 1., 0."], []),
    "*MODEL CHANGE": ([], ["*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE", "UP_BOTTOM, LOW_TOP"]),
    "*SURFACE BEHAVIOR": (
        [OTHER, "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL", "1., 1."],
        [],
    ),
    "*CHANGE FRICTION": ([], [*STEPS, "*CHANGE FRICTION, INTERACTION=I", "*FRICTION", "0.2"]),
}


@pytest.mark.parametrize("keyword", LEFT)
def test_new_ends_with_4(tmp_path, capsys, keyword):
    """What is not read and changes the answer is named with its line and keyword."""
    deck, lines = written(tmp_path, *LEFT[keyword])
    assert cli.main(["new", str(tmp_path / "scene.toml"), "--from", str(deck)]) == 4
    said = " ".join(capsys.readouterr().out.split())
    number = max(k for k, line in enumerate(lines, 1) if line.startswith(keyword))
    assert f"changes the answer: line {number}, {keyword}" in said
