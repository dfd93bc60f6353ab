"""Bolts beside supports and without contact, one dependent surface in several pairs, contact that
may not open.
"""

import tomllib

import numpy as np
import pytest
from deck_lines import POISSON, YOUNG, squares, stacked
from scenes import alone

from signorini_fx.addons.decks.reading import draft
from signorini_fx.scenes.reading import read_scene

LENGTH, TENSION = 2.0, 3.0
BAR = [
    *squares(8, 2, size=(LENGTH, 1.0)),
    *(
        "*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL",
        "*MATERIAL, NAME=STEEL",
        "*ELASTIC",
        f"{YOUNG}, {POISSON}",
    ),
    *(
        "*SURFACE, NAME=CUT",
        "4, S2",
        "12, S2",
        "*NSET, NSET=END, GENERATE",
        "9, 27, 9",
        "*NODE",
        "900, 9., 9.",
    ),
    *(
        "*PRE-TENSION SECTION, SURFACE=CUT, NODE=900",
        "*NSET, NSET=ALL, GENERATE",
        "1, 27",
        "*BOUNDARY",
    ),
]
TIGHTENED = ["*STEP", "*STATIC", "*CLOAD", f"900, 1, {TENSION}", "*END STEP"]


def solved(folder, lines, lost=()):
    """The scene of a deck as data, and its solution, whose certificate holds."""
    deck, scene = folder / "deck.inp", folder / "deck.toml"
    deck.write_text("\n".join(lines) + "\n", encoding="utf-8")
    made = draft(deck, scene)
    assert [remark for remark in made.lost if not any(word in remark for word in lost)] == []
    scene.write_text(made.text, encoding="utf-8")
    solution = alone(read_scene(scene))
    assert solution.certificate.holds
    return tomllib.loads(made.text), solution


@pytest.mark.parametrize("held", [["BODY_FEET, 2"], ["ALL, 2"]])
def test_a_tightened_bar_without_contact(tmp_path, held):
    """Between walls its stress is uniform; a set of supported nodes may have the section inside."""
    _, solution = solved(tmp_path, [*BAR, "BODY_WALL, 1", "END, 1", *held, *TIGHTENED])
    assert abs(solution.resultants.of("END").force[0]) == pytest.approx(TENSION, rel=1e-8)
    (section,) = solution.preloads
    held_flat = held == ["ALL, 2"]
    strain = TENSION / YOUNG * (1 - POISSON**2)
    if held_flat:
        strain = TENSION / YOUNG * (1 + POISSON) * (1 - 2 * POISSON) / (1 - POISSON)
    assert section.shortening == pytest.approx(LENGTH * strain, rel=1e-8)


def on_two_plates(pair=("UP_BOTTOM, A_TOP", "UP_BOTTOM, B_TOP"), more=()):
    """A block on two plates side by side, under pressure."""
    lines = [
        *squares(2, 1, name="A", size=(0.5, 1.0)),
        *squares(2, 1, 101, (0.5, 0.0), name="B", size=(0.5, 1.0)),
        *squares(4, 2, 201, (0.0, 1.0), name="UP"),
    ]
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in ("A", "B", "UP")]
    lines += [
        "*MATERIAL, NAME=STEEL",
        "*ELASTIC",
        f"{YOUNG}, 0.",
        "*SURFACE INTERACTION, NAME=I",
        *more,
    ]
    lines += [line for names in pair for line in ("*CONTACT PAIR, INTERACTION=I", names)]
    lines += ["*BOUNDARY", "A_FEET, 1, 2", "B_FEET, 1, 2", "UP_WALL, 1"]
    return [*lines, "*STEP", "*STATIC", "*DSLOAD", "UP_TOP, P, 5.0", "*END STEP"]


def test_one_dependent_surface_in_several_pairs(tmp_path):
    """The other surfaces have the contact points, and the state is uniform."""
    data, solution = solved(tmp_path, on_two_plates())
    assert [(entry["boundary"], entry["against"]) for entry in data["contact"]] == [
        ("A_TOP", "UP_BOTTOM"),
        ("B_TOP", "UP_BOTTOM"),
    ]
    np.testing.assert_allclose(solution.table.columns["pressure"], 5.0, rtol=1e-4)


def test_rough_friction(tmp_path):
    """It is named."""
    deck = tmp_path / "other.inp"
    deck.write_text("\n".join(stacked(["*FRICTION, ROUGH"])) + "\n", encoding="utf-8")
    made = draft(deck, tmp_path / "other.toml")
    (lost,) = made.lost
    assert lost.startswith(
        f"line {stacked(['*FRICTION, ROUGH']).index('*FRICTION, ROUGH') + 1}, *FRICTION: ROUGH"
    )
