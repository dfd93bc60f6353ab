"""Input files as files: amplitudes that are none, byte-order marks, sizes, and the work for many instances."""

import cProfile
import re

import pytest
from deck_lines import STEEL, squares, stacked

from signorini_fx.addons.decks.draft import draft
from signorini_fx.addons.decks.mesh import read_model
from signorini_fx.scenes import cli

BASE = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"])
STEP = BASE.index("*STEP")


def written(folder, before, within=()):
    """A deck with more lines before its step, and in it."""
    deck = folder / "deck.inp"
    deck.write_text("\n".join([*BASE[:STEP], *before, *BASE[STEP:-1], *within, BASE[-1]]) + "\n", encoding="utf-8")
    return deck


def drafted(deck):
    return draft(deck, deck.with_suffix(".toml"))


@pytest.mark.parametrize(
    ("rows", "word"),
    [
        (["0., 0., 1., 1., .5, 3."], "its times go back, from 1 to 0.5"),
        (["0., 0., 1."], "pairs of a time and a value are expected"),
        (["0., 0., 1., one"], "could not convert string to float: 'one'"),
    ],
)
def test_amplitudes_that_are_none(tmp_path, capsys, rows, word):
    """The error names the amplitude, not the load."""
    deck = written(tmp_path, ["*AMPLITUDE, NAME=A", *rows], ["*DSLOAD, AMPLITUDE=A", "UP_TOP, P, 1."])
    assert cli.main(["convert", str(deck), str(tmp_path / "draft.toml")]) == 2
    assert f"deck.inp: line {STEP + 1}, *AMPLITUDE: {word}" in capsys.readouterr().err


def test_an_amplitude_that_jumps(tmp_path):
    """At the end of the step its value is one of two."""
    before, within = ["*AMPLITUDE, NAME=A", "0., 0., 1., 1., 1., 2."], ["*DSLOAD, AMPLITUDE=A", "UP_TOP, P, 1."]
    (lost,) = drafted(written(tmp_path, before, within)).lost
    assert "the amplitude 'A' jumps at the end of the step" in lost


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_byte_order_marks(tmp_path, encoding):
    """An editor may write one; ends of lines are those of any system."""
    deck = written(tmp_path, [])
    text, points = drafted(deck).text, read_model(deck).raw.points
    deck.write_bytes(deck.read_text(encoding="utf-8").replace("\n", "\r\n").encode(encoding))
    assert drafted(deck).text == text
    assert (read_model(deck).raw.points == points).all()


@pytest.mark.parametrize("parts", [("*NSET, NSET=MORE,", "GENERATE"), ("*NSET,", "NSET=MORE,", " generate, UNSORTED")])
def test_keywords_of_several_lines(tmp_path, parts):
    """A line that ends with a comma goes on with parameters of one word or of two, or with one that has no value."""
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


def test_the_work_for_instances(tmp_path):
    """It is proportional to their number."""

    def calls(count):
        part = ["*PART, NAME=P", *squares(1, 1), "*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL", "*END PART"]
        lines = [*part, "*ASSEMBLY, NAME=A"]
        for k in range(count):
            lines += [f"*INSTANCE, NAME=P-{k}, PART=P", f"{2 * k}., 0., 0.", "*END INSTANCE"]
        lines += ["*END ASSEMBLY", *STEEL, "*BOUNDARY", *(f"P-{k}.BODY_FEET, 1, 2" for k in range(count))]
        deck = tmp_path / "deck.inp"
        deck.write_text("\n".join([*lines, "*STEP", "*STATIC", "*END STEP"]) + "\n", encoding="utf-8")
        profile = cProfile.Profile()
        profile.runcall(drafted, deck)
        return sum(entry.callcount for entry in profile.getstats())

    calls(2)  # what is imported
    few, more, many = calls(10), calls(20), calls(40)
    assert many - more < 2.1 * (more - few)
