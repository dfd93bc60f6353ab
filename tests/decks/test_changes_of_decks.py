"""Supports that end and begin with steps, lines that are mutilated, ties beside soft contact, and
several contacts.
"""

import tomllib

import numpy as np
import pytest
from deck_lines import POISSON, YOUNG, squares, stacked
from scenes import alone

from signorini_fx.addons.decks.reading import draft
from signorini_fx.scenes.reading import read_scene


def drafted(folder, lines):
    """The draft of a deck, its scene as data, and a solution of it."""
    deck = folder / "deck.inp"
    deck.write_text("\n".join(lines) + "\n")
    made = draft(deck, folder / "deck.toml")
    (folder / "deck.toml").write_text(made.text)
    return made, tomllib.loads(made.text)


def solved(folder):
    """The results at the nodes of the deck, step by step, whose certificates hold."""
    solution = alone(read_scene(folder / "deck.toml"))
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
    """The head of the upper block is held down in the first step, and set free by OP=NEW in the
    second, in which only the pressure is left: as if it had never been held.
    """
    lines = stacked([])
    lines[lines.index("*DSLOAD") : lines.index("*DSLOAD")] = ["*BOUNDARY", "UP_HEAD, 2, 2, -0.01"]
    lines += [
        "*STEP",
        "*STATIC",
        "*BOUNDARY, OP=NEW",
        "LOW_FEET, 2",
        "LOW_WALL, 1",
        "UP_WALL, 1",
        "*END STEP",
    ]
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
    """In the first step it is not there, and what it prescribes in the second is the place, not the
    way.
    """
    lines = [*stacked([]), "*STEP", "*STATIC", "*BOUNDARY", "UP_HEAD, 2, 2, -0.003", "*END STEP"]
    made, data = drafted(tmp_path, lines)
    assert made.lost == []
    assert [False, True] in [entry.get("holds") for entry in data["displacement"]]
    first, second = moved(made, solved(tmp_path), 115)
    assert first[1] != pytest.approx(-0.003, rel=1e-2)
    assert second[1] == pytest.approx(-0.003)


def tied_above_soft(slope, *more):
    """Three blocks above each other: soft contact below, a tie above."""
    lines = [
        line
        for name, y, first in (("LOW", 0.0, 1), ("UP", 1.0, 101), ("LID", 2.0, 201))
        for line in squares(4, 2, first, (0.0, y), name=name)
    ]
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in ("LOW", "UP", "LID")]
    lines += [
        "*MATERIAL, NAME=STEEL",
        "*ELASTIC",
        f"{YOUNG}, {POISSON}",
        "*SURFACE INTERACTION, NAME=I",
    ]
    lines += ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{slope}"]
    lines += [
        "*CONTACT PAIR, INTERACTION=I",
        "UP_BOTTOM, LOW_TOP",
        "*TIE, NAME=T",
        "LID_BOTTOM, UP_TOP",
        *more,
    ]
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
