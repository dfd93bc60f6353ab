"""Lines that are only numbers are read at once; what they say is what their words say one by one."""

import cProfile
import re

import numpy as np
import pytest
from deck_lines import STEEL, squares, stacked

from signorini_fx.addons.decks.mesh import read_model
from signorini_fx.addons.decks.text import read_keywords
from signorini_fx.errors import MeshError
from signorini_fx.scenes import cli

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


def test_numbers_are_exact(tmp_path):
    """The nearest floating point number to a decimal one, as Python takes it."""
    rng = np.random.default_rng(2)
    numbers = [repr(float(x)) for x in rng.normal(size=300) * 10.0 ** rng.integers(-30, 30, 300)]
    numbers += ["1", "+.5", "-3.", "0.1e+2", "12345678901234567890.123456789", "2.2250738585072011e-308"]
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


@pytest.mark.parametrize(
    ("again", "words"),
    [
        (["*NODE", "3, 0., 0."], "*NODE: node 3 is defined twice"),
        (["*ELEMENT, TYPE=CPE4", "2, 1, 2, 3, 4"], "*ELEMENT: element 2 is defined twice"),
        (["*ELEMENT, TYPE=CPE4", "77, 1, 2, 3, 400"], "*ELEMENT: element 77 has the node 400, which the file does not"),
    ],
)
def test_numbers_that_are_wrong(tmp_path, again, words):
    """The error has the line of the keyword."""
    lines = ["*HEADING", *squares(3, 2), *STEEL]
    with pytest.raises(MeshError, match=re.escape(f"line {len(lines) + 1}, {words}")):
        model_of(tmp_path, "\n".join([*lines, *again]) + "\n")


def test_lines_of_continued_elements(tmp_path):
    """An element may go on in the next line, and keywords may be continued before and after a table."""
    text = "\n".join(LINES) + "\n"
    broken = re.sub(r"(?m)^(\d+, \d+, \d+), (\d+, \d+)$", r"\1,\n\2", text)
    assert broken != text
    same(model_of(tmp_path, text), model_of(tmp_path, broken))


@pytest.mark.parametrize("end", ["", " ", "\t "])
def test_blanks_at_ends_of_lines(tmp_path, end):
    """They are no words, and lines of elements stay a table."""
    text = "\n".join(LINES) + "\n"
    broken = re.sub(r"(?m)^(\d+, \d+, \d+), (\d+, \d+)$", rf"\1,{end}\n\2,{end}", text)
    same(model_of(tmp_path, text), model_of(tmp_path, broken))


def test_an_empty_word_among_nodes_of_an_element(tmp_path):
    """It is no node, and no number of an element."""
    with pytest.raises(MeshError, match=r"\*ELEMENT: invalid literal"):
        model_of(tmp_path, "*NODE\n0, 0., 0.\n1, 1., 0.\n2, 1., 1.\n*ELEMENT, TYPE=CPE3\n1, 1, 2, \t, 3\n")


@pytest.mark.parametrize(("keyword", "row"), [("NODE", "{}, 0., 0."), ("ELEMENT, TYPE=CPE3", "1, 1, 2, {}")])
def test_numbers_of_many_digits(tmp_path, keyword, row):
    """No node has a number of 300 digits."""
    text = f"*NODE\n1, 0., 0.\n2, 1., 0.\n3, 1., 1.\n*{keyword}\n{row.format('1' * 300)}\n"
    with pytest.raises(MeshError, match=rf"line 5, \*{keyword.split(',')[0]}: a number is too large"):
        model_of(tmp_path, text)


def test_an_empty_coordinate_is_zero(tmp_path):
    """Blanks between two commas are no number."""
    text = "*NODE\n1, , 0.\n2, 1., \t, 0.\n3, 1., 1.\n4, ,1.\n*ELEMENT, TYPE=CPE4\n1, 1, 2, 3, 4\n"
    assert model_of(tmp_path, text).raw.points[:, :2].tolist() == [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]


def test_the_work_for_many_lines(tmp_path):
    """The number of calls does not depend on that of nodes and elements."""

    def calls(cells):
        deck = tmp_path / "deck.inp"
        deck.write_text("\n".join([*squares(cells, cells), *STEEL]) + "\n", encoding="utf-8")
        profile = cProfile.Profile()
        profile.runcall(read_model, deck)
        return sum(entry.callcount for entry in profile.getstats())

    calls(2)  # what is imported
    few, many = calls(8), calls(32)
    assert many < few + 8 * 24  # the faces of sides, of which each is a line of its own


def test_a_table_after_an_included_table(tmp_path):
    """The lines belong to the last keyword, that of the file which is included."""
    (tmp_path / "first.inp").write_text("*NODE\n1, 0., 0.\n2, 1., 0.\n", encoding="utf-8")
    text = "*NODE, INPUT=first.inp\n3, 1., 1.\n4, 0., 1.\n*ELEMENT, TYPE=CPE4\n1, 1, 2, 3, 4\n"
    assert model_of(tmp_path, text).raw.points.tolist() == [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]


@pytest.mark.parametrize(
    ("row", "words"), [("", "data line 2 has no word"), ("\u00b2, 1., 0.", "invalid literal for int")]
)
def test_wrong_lines_of_a_part(tmp_path, row, words):
    """They are an error of its keyword, where its instance is moved."""
    text = f"*PART, NAME=P\n*NODE\n1, 0., 0.\n{row or ' , '}\n*END PART\n*ASSEMBLY, NAME=A\n"
    with pytest.raises(MeshError, match=rf"line 2, \*NODE: {words}"):
        model_of(tmp_path, text + "*INSTANCE, NAME=Q, PART=P\n1., 0., 0.\n*END INSTANCE\n*END ASSEMBLY\n")


def test_an_included_file_before_a_table(tmp_path, capsys):
    """A keyword may include lines, and have others of its own."""
    (tmp_path / "first.inp").write_text("1, 0., 0.\n2, 1., 0.\n", encoding="utf-8")
    text = "*NODE, INPUT=first.inp\n3, 1., 1.\n4, 0., 1.\n*ELEMENT, TYPE=CPE4\n1, 1, 2, 3, 4\n"
    assert model_of(tmp_path, text).raw.points.tolist() == [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    assert cli.main(["convert", str(tmp_path / "deck.inp"), str(tmp_path / "draft.toml")]) in (0, 2, 4)
