"""Decks that are broken somewhere: they are read, or refused with one error that names a line or a
place.
"""

import random
import re

import pytest
from deck_lines import STEEL, assembly, squares, stacked

from signorini_fx.addons.decks.reading import draft
from signorini_fx.errors import SignoriniError
from signorini_fx.scenes.reading import parse_scene_text

WORDS = (
    "",
    "x",
    "-1",
    "1e999",
    "nan",
    "0",
    "99999999",
    "*",
    "=",
    "1.5",
    "NOSUCH",
    "1,2,3",
    "\x00",
    "é",
)
CONTACT = stacked(
    ["*FRICTION", "0.2, 50.", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "100., 3."]
)
STEPS = [
    *(
        "*AMPLITUDE, NAME=A",
        "0., 0., 1., 1.",
        "*STEP",
        "*STATIC",
        "0.5, 1.",
        "*BOUNDARY, OP=NEW, AMPLITUDE=A",
    ),
    *(
        "LOW_FEET, 1, 2",
        "*CLOAD, OP=NEW",
        "UP_HEAD, 1, 2.",
        "*NODE PRINT, NSET=UP_HEAD",
        "U, RF",
        "*END STEP",
    ),
]

TIED = [
    *[
        *squares(4, 2, name="LOW"),
        *squares(6, 2, 101, (0.0, 1.0), name="UP"),
        "*NSET, NSET=SOME",
        "101, 103, 105",
    ],
    *(
        "*NODE",
        "900, 0.5, 3.",
        "*SOLID SECTION, ELSET=LOW, MATERIAL=STEEL",
        "*SOLID SECTION, ELSET=UP, MATERIAL=STEEL",
    ),
    *[
        *STEEL,
        "*SURFACE, NAME=NODES, TYPE=NODE",
        "SOME",
        "*TIE, NAME=T, POSITION TOLERANCE=.1",
        "NODES, LOW_TOP",
    ],
    *(
        "*EQUATION",
        "3",
        "103, 2, 2., 105, 2, -1.",
        "107, 1, .5",
        "2",
        "UP_WALL, 1, 1., LOW_WALL, 1, -1.",
    ),
    *("*MPC", "STRAIGHT, 115, 121, 116, 117", "PIN, 104, 13"),
    *(
        "*TRANSFORM, NSET=LOW_FEET, TYPE=C",
        "0., -9., 0., 0., -9., 1.",
        "*BOUNDARY",
        "LOW_FEET, 1",
        "3, 2, 2, .1",
    ),
    *(
        "*COUPLING, REF NODE=900, SURFACE=UP_TOP, CONSTRAINT NAME=C",
        "*DISTRIBUTING",
        "1, 2",
        "*STEP",
        "*STATIC",
    ),
    *("*CLOAD", "900, 2, -3.", "900, 6, 1.", "104, 1, .5", "104, 1, .5", "*END STEP"),
]


def mutilated(lines, chance):
    """The lines with one thing that is missing, doubled, exchanged or another one."""
    n, kind = chance.randrange(len(lines)), chance.randrange(9)
    if chance.random() < 0.6:
        n = chance.choice([k for k, line in enumerate(lines) if line.startswith("*")])
    line, words = lines[n], lines[n].split(",")
    place, letter = chance.randrange(len(line) + 1), chance.randrange(len(words))
    other = [*lines]
    match kind:
        case 0:
            return lines[:n]
        case 1:
            del other[n]
        case 2:
            other.insert(n, line)
        case 3:
            words[letter] = chance.choice(WORDS)
            other[n] = ",".join(words)
        case 4:
            other[n] = line[:place]
        case 5:
            other[n] = line[:place] + chance.choice("*,=.- xX9#\t") + line[place:]
        case 6:
            other[n] = ",".join(words[:letter] + words[letter + 1 :])
        case 7:
            m = chance.randrange(len(lines))
            other[n], other[m] = other[m], other[n]
        case 8:
            del other[n : n + chance.randrange(1, 6)]
    return other


@pytest.mark.one_quick("seed", range(3))
@pytest.mark.parametrize(
    "lines", [[*CONTACT, *STEPS], assembly(), TIED], ids=["contact", "assembly", "tied"]
)
def test_mutilated_decks(tmp_path, seed, lines):
    """450 in all."""
    chance = random.Random(seed)
    deck, scene, refused = tmp_path / "deck.inp", tmp_path / "scene.toml", 0
    for _ in range(50):
        deck.write_text("\n".join(mutilated(lines, chance)) + "\n")
        said = error_of(lambda: draft(deck, scene))
        refused += said is not None
        if said is not None:
            assert re.search(r"line \d+|the (first|most) at \(", said)
            assert "\n" not in said
        else:
            said = error_of(lambda: parse_scene_text(draft(deck, scene).text, scene))
            assert said is None or str(scene) in said
    assert 5 < refused < 45


def error_of(read):
    """The text of its error; None: it has none."""
    try:
        read()
    except SignoriniError as error:
        return str(error)
    return None
