"""Lines of numbers, however they are written."""

import re

import pytest
from deck_lines import stacked

from signorini_fx.addons.decks.mesh import read_model

LINES = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"])


def model_of(folder, text):
    deck = folder / "deck.inp"
    deck.write_text(text, encoding="utf-8")
    return read_model(deck)


def spelt(line):
    """A line with exponents as Fortran writes them, which is no table."""
    return re.sub(r"(\d\.\d*)", r"\1D0", line)


def same(one, other):
    assert (one.raw.points == other.raw.points).all()
    for (kind, nodes), (other_kind, other_nodes) in zip(one.raw.blocks, other.raw.blocks, strict=True):
        assert kind == other_kind
        assert (nodes == other_nodes).all()
    for first, second in ((one.raw.sets, other.raw.sets),):
        assert first.keys() == second.keys()
        assert all((a == b).all() for name in first for a, b in zip(first[name], second[name], strict=True))
    assert one.raw.node_sets.keys() == other.raw.node_sets.keys()
    assert all((nodes == other.raw.node_sets[name]).all() for name, nodes in one.raw.node_sets.items())
    assert one.places.numbers.tolist() == other.places.numbers.tolist()


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda text: re.sub(r"(?m)^(\d+, [-\d.e]+, [-\d.e]+)$", lambda m: spelt(m[1]), text), id="D0"),
        pytest.param(lambda text: re.sub(r"(?m)^(\d+, .*)$", r"\1,", text), id="a comma at the end"),
        pytest.param(lambda text: re.sub(r"(?m)^(\d+, .*)$", "\\1\n** comment", text), id="comments between"),
        pytest.param(lambda text: re.sub(r"(?m)^(\d+, .*)$", "\\1\n  \n", text), id="empty lines"),
        pytest.param(lambda text: re.sub(r"(?m)^(\d+, .*)$", "\\1, ,", text), id="an empty word at the end"),
    ],
)
def test_words_one_by_one(tmp_path, change):
    text = "\n".join(LINES) + "\n"
    same(model_of(tmp_path, text), model_of(tmp_path, change(text)))
