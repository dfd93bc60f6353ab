"""Abaqus input files as text: keywords with their parameters and data lines, and the words in them."""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from signorini_fx.mechanics.mesh.files.abaqus_tables import NumberTable, split_words, table_after

# Keywords whose data lines name nodes, elements, sets or surfaces, and how many words each has at least.
_LEAST_WORDS = {
    **dict.fromkeys(("NODE", "NSET", "ELSET", "SURFACE", "CONTACTPAIR", "TIE", "MODELCHANGE", "KINEMATIC", "DLOAD"), 1),
    **dict.fromkeys(("BOUNDARY", "CLOAD", "DSLOAD", "TEMPERATURE", "INITIALCONDITIONS"), 2),
}
# Keywords that have so many data lines at most: more are those of a keyword that is missing.
_MOST_ROWS = {"STATIC": 1, "SURFACEINTERACTION": 1, "ENDSTEP": 0, "MATERIAL": 0, "CHANGEFRICTION": 0}


@dataclass
class DeckBlock:
    """A keyword with its parameters, its line in the file, and its data lines split at commas.

    A word that is empty is "", but for those at the end of a line: of numbers it is zero, see ``real``.

    Attributes:
        keyword: in capitals and without blanks, which the programs ignore.
        parameters: in capitals -> value.
        line: in the file, from 1.
        number: of the keyword, counted over all files.
        file: the file that another one includes, by its name there; empty: the one that is read.
        rows: the data lines.
        name: the keyword as it is written, in capitals.
    """

    keyword: str
    parameters: dict[str, str]
    line: int
    rows: Sequence[list[str]] = field(default_factory=list)
    name: str = ""
    file: str = ""
    number: int = 0

    @property
    def place(self) -> str:
        """Where it is, in words."""
        return f"line {self.line}" + (f" of {self.file}" if self.file else "")

    @property
    def origin(self) -> str:
        """Where it is and what it is, in words."""
        return f"{self.place}, *{self.name}"


class DeckError(ValueError):
    """What is wrong with a keyword, and the keyword."""

    def __init__(self, block: DeckBlock, why: str) -> None:
        self.block = block
        super().__init__(why)

    @property
    def text(self) -> str:
        """What is wrong, and where."""
        return f"{self.block.origin}: {self}"


# The end of a line that the next one continues: with a parameter that has a value, of one word or several such as REF
# NODE, or with one that is no name of a set.
_CONTINUED = re.compile(
    r",[ \t]*\r?\n(?=[ \t]*\*?(?:[A-Za-z]+(?:[ \t]+[A-Za-z]+)*[ \t]*=|"
    r"(?:NLGEOM|GENERATE|PERTURBATION|DIRECT|REMOVE|NO[ \t]*SEPARATION|CYCLIC[ \t]*SYMMETRY|LINTEMP)[ \t]*(?:,|\r?$)))",
    re.IGNORECASE | re.MULTILINE,
)


def joined_lines(text: str) -> Iterator[tuple[int, str | NumberTable]]:
    """The lines of a file that are no comments, with their numbers; a keyword that is continued is one line, and so are
    all numbers after *NODE or *ELEMENT.
    """
    begin, following = 0, 1
    for start, end in itertools.pairwise([*_starred(text), len(text)]):
        if (found := table_after(text, start, end)) is None:
            continue
        stop, table = found
        yield from _plain_lines(text[begin:stop], following)
        following += text.count("\n", begin, stop) + 1
        yield following, table
        table_end = stop + 1 + len(table.text)
        begin, following = end, following + len(table) - 1 + text.count("\n", table_end, end)
    yield from _plain_lines(text[begin:], following)


def _starred(text: str) -> Iterator[int]:
    """Where lines begin whose first character is a star: keywords and comments."""
    position = text.find("*")
    while position >= 0:
        begin = text.rfind("\n", 0, position) + 1
        if not text[begin:position].strip():
            yield begin
        position = text.find("*", (text.find("\n", position) + 1) or len(text))


def _plain_lines(text: str, following: int) -> Iterator[tuple[int, str]]:
    """Some lines of a file that are no comments, with their numbers, of which the first one is given."""
    for joined_line in _CONTINUED.sub(",\0", text).split("\n"):
        number, following = following, following + 1 + joined_line.count("\0")
        line = joined_line.replace("\0", "").strip()
        if line and not line.startswith("**"):
            yield number, line


def heading(line: str) -> tuple[str, dict[str, str]]:
    """A keyword as it is written, in capitals, and its parameters."""
    first, *words = (word.strip() for word in line[1:].split(","))
    pairs = (word.partition("=") for word in words)
    parameters = {"".join(key.split()).upper(): value.strip().strip('"') for key, _, value in pairs}
    return " ".join(first.upper().split()), parameters


def blocks(lines: Iterable[tuple[int, str, str | NumberTable]]) -> Iterator[DeckBlock]:
    """The keywords one after the other, from lines with their numbers and files."""
    block: DeckBlock | None = None
    rows: list[list[str]] = []
    for number, file, line in lines:
        if isinstance(line, str) and line.startswith("*"):
            if block is not None:
                yield block
            name, parameters = heading(line)
            block = DeckBlock(name.replace(" ", ""), parameters, number, rows := [], name=name, file=file)
        elif block is not None:
            if block.rows is not rows:  # a table, which a comment ends, or the end of a file that is included
                rows.extend(block.rows)
                block.rows = rows
            if isinstance(line, str):
                rows.append(split_words(line))
            elif rows:  # of a file that its keyword includes
                rows.extend(line)
            else:
                block.rows = line
    if block is not None:
        yield block


def check_rows(block: DeckBlock) -> None:
    """Check that data lines which name a node, an element, a set or a surface do so, and say something of it.

    Raises:
        ValueError: one is empty or too short, or there are too many.
    """
    if isinstance(block.rows, NumberTable):
        return
    count = len(block.rows)
    limit = count if "USER" in block.parameters else _MOST_ROWS.get(block.keyword, count)  # constants of a subroutine
    if count > limit:
        text = ", ".join(block.rows[limit])
        raise ValueError(f"data line {limit + 1}, {text!r}, is one too many: of which keyword is it?")
    least = _LEAST_WORDS.get(block.keyword, 0)
    for number, row in enumerate(block.rows, start=1):
        if len(row) < least:
            expected = "a name or number, and what is said of it, are" if least > 1 else "a name or number is"
            written = f"only {row[0]!r}" if row else "no word"
            raise ValueError(f"data line {number} has {written}: {expected} expected")


def real(word: str) -> float:
    """A number of a data line, perhaps as Fortran writes it; an empty word is zero, as in both programs.

    Raises:
        ValueError: it is none, or not finite.
    """
    if not word:
        return 0.0
    try:
        number = float(word)
    except ValueError:
        number = float(re.sub("[dD]", "E", word))
    if not math.isfinite(number):
        raise ValueError(f"a finite number is expected, got {word!r}")
    return number


def real_or_none(word: str) -> float | None:
    """The same; None: it is no number."""
    try:
        return real(word)
    except ValueError:
        return None


def parameter(block: DeckBlock, key: str) -> float:
    """The number that a parameter of a keyword has.

    Raises:
        KeyError: there is no such parameter.
        ValueError: it is no number, or not finite.
    """
    if not (word := block.parameters[key]):
        raise ValueError(f"{key} has no value")
    return real(word)


_LABELS = {
    **{"ENCASTRE": "123456", "PINNED": "123", "XSYMM": "156", "YSYMM": "246", "ZSYMM": "345"},
    **{"XASYMM": "234", "YASYMM": "135", "ZASYMM": "126"},
}


ROTATIONS = range(4, 7)


def components(words: Sequence[str]) -> dict[int, float]:
    """The components that a row of *BOUNDARY prescribes: 1 to 3 are displacements, 4 to 6 rotations.

    Args:
        words: the row without its node or set.

    Raises:
        ValueError: a number is none.
        IndexError: nothing is prescribed.
    """
    if (held := _LABELS.get(words[0].upper())) is not None:
        return {int(component): 0.0 for component in held}
    first, last, value = (*words, "", "")[:3]
    return dict.fromkeys(range(int(first), int(last or first) + 1), real(value) if value else 0.0)


def quoted(text: str) -> str:
    """A text as a scene has it."""
    return json.dumps(text, ensure_ascii=False)
