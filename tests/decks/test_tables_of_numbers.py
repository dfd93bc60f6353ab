"""Lines that are only numbers are read at once; what they say is what their words say one by
one.
"""

import re

import numpy as np
import pytest
from deck_lines import stacked

from signorini_fx.addons.decks.mesh import read_model
from signorini_fx.addons.decks.text import read_keywords

LINES = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"])


def model_of(folder, text):
    deck = folder / "deck.inp"
    deck.write_text(text, encoding="utf-8")
    return read_model(deck)


def numbers_of(folder, text, kind=np.float64):
    """The numbers of the first keyword of a text, if they are read at once; else None."""
    (folder / "lines.inp").write_text(text, encoding="utf-8")
    found = read_keywords(folder / "lines.inp")[0][0].numbers(kind)
    return None if found is None else found[0]


def spelt(line):
    """A line with exponents as Fortran writes them, which is no table."""
    return re.sub(r"(\d\.\d*)", r"\1D0", line)


def same(one, other):
    assert (one.raw.points == other.raw.points).all()
    for (kind, nodes), (other_kind, other_nodes) in zip(
        one.raw.blocks, other.raw.blocks, strict=True
    ):
        assert kind == other_kind
        assert (nodes == other_nodes).all()
    for first, second in ((one.raw.sets, other.raw.sets),):
        assert first.keys() == second.keys()
        assert all(
            (a == b).all() for name in first for a, b in zip(first[name], second[name], strict=True)
        )
    assert one.raw.node_sets.keys() == other.raw.node_sets.keys()
    assert all(
        (nodes == other.raw.node_sets[name]).all() for name, nodes in one.raw.node_sets.items()
    )
    assert one.places.numbers.tolist() == other.places.numbers.tolist()


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(
            lambda text: re.sub(r"(?m)^(\d+, [-\d.e]+, [-\d.e]+)$", lambda m: spelt(m[1]), text),
            id="D0",
        ),
        pytest.param(
            lambda text: re.sub(r"(?m)^(\d+, .*)$", r"\1,", text), id="a comma at the end"
        ),
        pytest.param(
            lambda text: re.sub(r"(?m)^(\d+, .*)$", "\\1\n** comment", text), id="comments between"
        ),
        pytest.param(lambda text: re.sub(r"(?m)^(\d+, .*)$", "\\1\n  \n", text), id="empty lines"),
        pytest.param(
            lambda text: re.sub(r"(?m)^(\d+, .*)$", "\\1, ,", text), id="an empty word at the end"
        ),
    ],
)
def test_words_one_by_one(tmp_path, change):
    text = "\n".join(LINES) + "\n"
    same(model_of(tmp_path, text), model_of(tmp_path, change(text)))


def test_numbers_are_exact(tmp_path):
    """The nearest floating point number to a decimal one, as Python takes it."""
    rng = np.random.default_rng(2)
    numbers = [repr(float(x)) for x in rng.normal(size=300) * 10.0 ** rng.integers(-30, 30, 300)]
    numbers += [
        "1",
        "+.5",
        "-3.",
        "0.1e+2",
        "12345678901234567890.123456789",
        "2.2250738585072011e-308",
    ]
    lines = [f"{7 * k + 3} ,\t{x},  {x}" for k, x in enumerate(numbers)]
    values = numbers_of(tmp_path, "*NODE, NSET=ALL\n" + "\n".join(lines) + "\n*STEP\n")
    assert values[1::3].tolist() == [float(x) for x in numbers]


@pytest.mark.parametrize(
    "row",
    ["1, 0.,, 0.", "1, 0. 0., 1.", "1, 1e999, 0.", "1, 0., x", "1, 0., 1e", "1_0, 0., 0.", ", 1., 1.", "1, , 0.",
     "1,\t, 0.", " , 1., 1."],
)  # fmt: skip
def test_other_lines_are_read_word_by_word(tmp_path, row):
    """Python would not take them for the same numbers."""
    assert numbers_of(tmp_path, f"*NODE\n2, 0., 0.\n{row}\n3, 1., 1.\n*STEP\n") is None
    assert len(numbers_of(tmp_path, "*NODE\n2, 0., 0.\n3, 1., 1.\n*STEP\n")) == 6
