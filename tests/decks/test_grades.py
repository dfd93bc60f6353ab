"""What is not read: the table, and a deck with each of its rows."""

import re

import pytest
from deck_lines import stacked

from signorini_fx.addons.decks import text as keywords
from signorini_fx.addons.decks.reading import draft
from signorini_fx.errors import MeshError
from signorini_fx.scenes import cli

HARD = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"
BASE = stacked([HARD])
STEP, END = BASE.index("*STEP"), BASE.index("*END STEP")
NODE = ["*NODE", "900, 5., 5."]
RUBBER = ["*MATERIAL, NAME=RUBBER", "*HYPERELASTIC, NEO HOOKE", "1., 0.01"]
SECTION = "*SOLID SECTION, ELSET=UP, MATERIAL=STEEL"
PAIR = "*CONTACT PAIR, INTERACTION=I"
OTHER = "*SURFACE INTERACTION, NAME=J"
STEPS = ["*END STEP", "*STEP", "*STATIC"]
# Of keywords that are read in part, or are errors: what is said, and decks of which it is: lines
# before the first step, lines of the step, and lines that replace others.
REFUSED = {
    "nodes and elements are not generated here": [
        (["*NGEN", "1, 2, 1"],),
        ([], ["*NFILL"]),
        ([], ["*NCOPY"]),
        ([], ["*NMAP"]),
        ([], ["*ELGEN"]),
        ([], ["*ELCOPY"]),
    ],
    "coordinates are expected along x, y and z": [
        (["*SYSTEM", "0., 0., 0., 0., 1., 0."],),
        (["*NODE, SYSTEM=C", "900, 1., 1."],),
    ],
    "only isotropic elasticity is read: state others in a scene, with material.orthotropic": [
        (["*MATERIAL, NAME=M", "*ELASTIC, TYPE=ORTHO", "1., 1."],)
    ],
    "only NEO HOOKE, MOONEY-RIVLIN and OGDEN with D1 above 0 are read": [
        (["*MATERIAL, NAME=M", "*HYPERELASTIC, YEOH", "1., 1."],)
    ],
    "a nonlinear material is not possible yet": [
        (RUBBER, [], {SECTION: "*SOLID SECTION, ELSET=UP, MATERIAL=RUBBER", "CPE4": "CPS4"})
    ],
    "the step has no procedure: write *STATIC into it; CalculiX solves nothing in such a step": [
        ([], [], {"*STATIC": "**"})
    ],
    "has no *END STEP before this one": [([], ["*STEP", "*STATIC"])],
    "is expected within a step": [
        (["*STATIC"],),
        (["*CLOAD", "111, 2, 1."],),
        (["*DLOAD", "UP, GRAV, 9.81, 0., -1., 0."],),
        (["*DSLOAD", "UP_TOP, P, 1."],),
        (["*TEMPERATURE", "UP_HEAD, 5."],),
        ([], ["*END STEP", "*BOUNDARY", "UP_HEAD, 1", "*STEP", "*STATIC"]),
    ],
    "is expected before the first step": [
        ([], ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "UP_HEAD, 5."])
    ],
    "some of its elements are in another section, too: give each of them one": [([SECTION],)],
}

LOST = {
    "constants that depend on temperature: the first line is taken": [
        (["*MATERIAL, NAME=M", "*ELASTIC", "1., .3, 20.", "2., .3, 90."],),
        (["*MATERIAL, NAME=M", "*EXPANSION", "1., 20.", "2., 90."],),
    ],
    "a change within a step is not read: the first value holds": [
        ([], ["*ELASTIC", "1., .3"]),
        ([], ["*EXPANSION", "1."]),
        ([], ["*DENSITY", "1."]),
        ([], ["*HYPERELASTIC, NEO HOOKE", "1., .3"]),
        ([], ["*PLASTIC", "1., 0."]),
        ([], ["*FRICTION", ".3"]),
        ([], ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "1."]),
    ],
    "hardening that is not isotropic is not read: elastic here": [
        (["*MATERIAL, NAME=STEEL", "*PLASTIC, HARDENING=KINEMATIC", "1., 0."],)
    ],
    "a nonlinear material is not possible yet": [
        (["*MATERIAL, NAME=STEEL", "*PLASTIC", "5., 0."], [], {"CPE4": "CPS4"})
    ],
    "a material with *HYPERELASTIC does not yield here": [
        (
            [*RUBBER, "*PLASTIC", "5., 0."],
            [],
            {SECTION: "*SOLID SECTION, ELSET=UP, MATERIAL=RUBBER"},
        )
    ],
    "no part of the body": [
        (["*SHELL SECTION, ELSET=ELSEWHERE, MATERIAL=STEEL", "1."],),
        (["*MEMBRANE SECTION, ELSET=ELSEWHERE, MATERIAL=STEEL", "1."],),
        (["*ELEMENT, TYPE=SPRINGA, ELSET=S", "900, 1, 2"],),
    ],
    "beside elements of another kind": [
        ([], [], {"*ELEMENT, TYPE=CPE4, ELSET=UP": "*ELEMENT, TYPE=CPS4, ELSET=UP"})
    ],
    "NLGEOM: displacements and rotations are taken as small": [
        ([], [], {"*STEP": "*STEP, NLGEOM", "CPE4": "CPS4"})
    ],
    "NLGEOM: points in contact keep their partners": [
        ([], [], {"*STEP": "*STEP, NLGEOM", PAIR: f"{PAIR}, ADJUST=0.01"})
    ],
    "PERTURBATION: contact may open and close here, and does not in such a step": [
        ([], [], {"*STEP": "*STEP, PERTURBATION"})
    ],
    "only tabular amplitudes are read: the whole load is taken": [
        (
            ["*AMPLITUDE, NAME=A, DEFINITION=PERIODIC", "1, 2., 0., 1."],
            ["*DSLOAD, AMPLITUDE=A", "UP_TOP, P, 1."],
        )
    ],
    "TIME=TOTAL TIME is read in decks of one step: the whole load is taken": [
        (
            ["*AMPLITUDE, NAME=A, TIME=TOTAL TIME", "0., 0., 2., 1."],
            ["*TEMPERATURE, AMPLITUDE=A", "UP_ALL, 5.", *STEPS],
        )
    ],
    "a part of the body": [([], ["*DLOAD", "LOW, BY, -1."])],
    "moments at nodes are not read": [([], ["*CLOAD", "111, 6, 1."])],
    "is no boundary of the body": [
        ([], ["*DSLOAD", "NOWHERE, P, 1."]),
        ([PAIR, "NOWHERE, UP_TOP"],),
        (["*TIE, NAME=T", "NOWHERE, UP_TOP"],),
    ],
    "temperatures that differ within a body are not read": [
        (["*MATERIAL, NAME=STEEL", "*EXPANSION", "1."], ["*TEMPERATURE", "UP_HEAD, 5."]),
        (["*INITIAL CONDITIONS, TYPE=TEMPERATURE, FILE=other", "UP_HEAD, 5."],),
    ],
    "not read": [(["*INITIAL CONDITIONS, TYPE=STRESS", "UP, 1."],)],
    "behaviour of a subroutine is not read": [([f"{OTHER}, USER", "1., 2."],)],
    "soft contact is read as LINEAR or TIED only: this contact is hard": [
        ([OTHER, "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL", "1., 1."],)
    ],
    "NO SEPARATION of sides 1 apart: closed here": [
        (
            [],
            [],
            {
                HARD: "*SURFACE BEHAVIOR, NO SEPARATION",
                "UP_BOTTOM, LOW_TOP": "UP_BOTTOM, LOW_BOTTOM",
            },
        )
    ],
    "ROUGH is not read: this contact has no friction": [([], [], {HARD: "*FRICTION, ROUGH"})],
    "ADJUST: a set with only some nodes of the dependent surface is not read": [
        ([], [], {PAIR: f"{PAIR}, ADJUST=UP_WALL"})
    ],
    "a constraint between nodes is not read": [
        (["*TIE, CYCLIC SYMMETRY, NAME=T", "UP_TOP, LOW_BOTTOM"],)
    ],
}

NOTED = {
    "beside rubber: law = 'saint-venant-kirchhoff', linear in the strain of Green": [
        (RUBBER, [], {SECTION: "*SOLID SECTION, ELSET=UP, MATERIAL=RUBBER"})
    ],
    "as a plane body under plane stress, without bending": [
        *(
            ([], [], {SECTION: f"*{kind} SECTION, ELSET=UP, MATERIAL=STEEL"})
            for kind in ("SHELL", "MEMBRANE")
        )
    ],
    "as in the step before: this one names no procedure": [([], ["*END STEP", "*STEP"])],
    "no part of the body": [([*NODE, "*BOUNDARY", "900, 1"],)],
    "without effect in static steps": [(["*INITIAL CONDITIONS, TYPE=VELOCITY", "UP, 1, 1."],)],
}
# Decks of keywords that are not read and need more than their name.
WHOLE = {
    "ORIENTATION": (["*ORIENTATION, NAME=O", "1., 0., 0., 0., 1., 0."],),
    "CHANGEFRICTION": ([], [*STEPS, "*CHANGE FRICTION, INTERACTION=I", "*FRICTION", "0.2"]),
    "CHANGESURFACEBEHAVIOR": ([], ["*CHANGE SURFACE BEHAVIOR, INTERACTION=I", HARD]),
    "BEAMSECTION": (["*BEAM SECTION, ELSET=UP, MATERIAL=STEEL", "1., 1."],),
    "TRANSFORM": (["*TRANSFORM, NSET=UP_WALL", "1., 0., 0., 0., 1., 0."],),
    "CLEARANCE": (["*CLEARANCE, MASTER=LOW_TOP, SLAVE=UP_BOTTOM, VALUE=0.001"],),
    "MODELCHANGE": ([], ["*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE", "UP_BOTTOM, LOW_TOP"]),
    "RIGIDBODY": ([*NODE, "*RIGID BODY, ELSET=UP, REF NODE=900"],),
    "EQUATION": (["*EQUATION", "2", "111, 2, 1., 112, 2, -1."],),
    "MPC": (["*MPC", "STRAIGHT, 111, 115, 112, 113"],),
    "NODEPRINT": ([], ["*NODE PRINT, NSET=UP_HEAD", "U, RF"]),
    "CONNECTORFRICTION": (["*CONNECTOR FRICTION"],),
    "CONTACTPRINT": ([], ["*CONTACT PRINT", "CDIS, CSTR"]),
    "SECTIONPRINT": ([], ["*SECTION PRINT, SURFACE=UP_TOP, NAME=P", "SOF"]),
}


def written(folder, before, within=(), changes=()):
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


def decks_of(*tables, partly):
    """What is said, and a deck of which it is: of keywords that are not read, and of those that are
    read in part.
    """
    for table in tables:
        for keyword, effect in table.items():
            other = effect == keywords.OTHER_PROCEDURE
            before = ["*END STEP", "*STEP"] if other else []
            yield effect, WHOLE.get(keyword, ([], [*before, f"*{keyword}"]))
    for effect, decks in partly.items():
        for deck in decks:
            yield effect, deck


def place(effect):
    """The pattern of a remark."""
    return f"line [0-9]+( and [0-9]+ more)?, [*]?.*{re.escape(effect)}"


@pytest.mark.one_quick("grade", ["lost", "noted"])
def test_grades(tmp_path, grade):
    """A deck with each row of the tables is graded so, and the remark names the line and the
    keyword.
    """
    elements = {"GAP": "not read", "CONNECTORFRICTION": "not read"}
    decks = {
        "lost": decks_of(keywords.LOST, elements, partly=LOST),
        "noted": decks_of(keywords.NOTED, partly=NOTED),
    }
    wrong = []
    for effect, changes in decks[grade]:
        deck, lines = written(tmp_path, *changes)
        lost, noted = graded(deck)
        remarks = [
            text for text in (lost if grade == "lost" else noted) if re.search(place(effect), text)
        ]
        numbers = [int(re.match(r"line (\d+)", text)[1]) for text in remarks]
        named = any(lines[number - 1].startswith("*") for number in numbers)
        if not named or (grade == "noted" and lost):
            wrong.append((effect, changes, lost, noted))
    assert not wrong


@pytest.mark.one_quick(("effect", "changes"), list(decks_of(partly=REFUSED)))
def test_errors(tmp_path, effect, changes):
    """A deck with each row ends in an error that names the line."""
    deck, _ = written(tmp_path, *changes)
    with pytest.raises(MeshError, match=place(effect)):
        draft(deck, deck.with_suffix(".toml"))


LEFT = {
    "*EQUATION": WHOLE["EQUATION"],
    "*COUPLING": (
        [*NODE, "*COUPLING, REF NODE=900, SURFACE=UP_TOP", "*DISTRIBUTING"],
        ["*CLOAD", "900, 2, -1."],
    ),
    "*TRANSFORM": WHOLE["TRANSFORM"],
    "*MODEL CHANGE": WHOLE["MODELCHANGE"],
    "*SURFACE BEHAVIOR": (
        [OTHER, "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL", "1., 1."],
    ),
    "*CHANGE FRICTION": WHOLE["CHANGEFRICTION"],
}


@pytest.mark.parametrize("keyword", LEFT)
def test_new_ends_with_4(tmp_path, capsys, keyword):
    """What is not read and changes the answer is named with its line and keyword."""
    deck, lines = written(tmp_path, *LEFT[keyword])
    assert cli.main(["new", str(tmp_path / "scene.toml"), "--from", str(deck)]) == 4
    said = " ".join(capsys.readouterr().out.split())
    number = max(k for k, line in enumerate(lines, 1) if line.startswith(keyword))
    assert f"changes the answer: line {number}, {keyword}" in said
