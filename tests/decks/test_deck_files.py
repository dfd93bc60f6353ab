"""Input files as files: amplitudes that are none, byte-order marks, sizes, and the work for many
instances.
"""

import re

import pytest
from deck_lines import stacked

from signorini_fx.addons.decks.reading import draft

BASE = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"])
STEP = BASE.index("*STEP")


def written(folder, before, within=()):
    """A deck with more lines before its step, and in it."""
    deck = folder / "deck.inp"
    deck.write_text(
        "\n".join([*BASE[:STEP], *before, *BASE[STEP:-1], *within, BASE[-1]]) + "\n",
        encoding="utf-8",
    )
    return deck


def drafted(deck):
    return draft(deck, deck.with_suffix(".toml"))


@pytest.mark.parametrize(
    "parts", [("*NSET, NSET=MORE,", "GENERATE"), ("*NSET,", "NSET=MORE,", " generate, UNSORTED")]
)
def test_keywords_of_several_lines(tmp_path, parts):
    """A line that ends with a comma goes on with parameters of one word or of two, or with one that
    has no value.
    """
    within = ["*CLOAD", "MORE, 1, 2."]
    rigid = ["*NODE", "900, 0.5, 3.", "*RIGID BODY, ELSET=UP,"]
    lines = [*parts, "111, 115, 4", *rigid[:2], f"{rigid[2]} REF NODE=900"]
    text = drafted(written(tmp_path, lines, within)).text
    assert "[[point_force]]" in text
    lines = ["*NSET, NSET=MORE", "111, 115", *rigid, "  REF NODE = 900"]
    again = drafted(written(tmp_path, lines, within)).text
    assert [re.sub(r"line \d+", "", one).split("\n", 2)[2] for one in (again, text)] == [
        re.sub(r"line \d+", "", text).split("\n", 2)[2]
    ] * 2
    deck = written(tmp_path, [])
    deck.write_text(deck.read_text().replace("*STEP", "*STEP,\nNLGEOM"))
    assert "saint-venant-kirchhoff" in drafted(deck).text
