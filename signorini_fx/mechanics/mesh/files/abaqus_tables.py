"""Data lines of Abaqus input files that hold nothing but numbers, those of *NODE and *ELEMENT: all at once, as arrays.

They are nearly all of a large file.  Lines that are written in another way, such as with exponents of Fortran, empty
words or comments between them, are no such table: then each is split into words.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, overload

import numpy as np

from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

# Keywords with such lines; one that is continued on the next line is none of them.
_HEADING = re.compile(r"[ \t]*\*[ \t]*(NODE|ELEMENT)[ \t]*(?:,[^\n]*[^,\s][ \t]*)?", re.IGNORECASE)
_INTEGERS, _DECIMALS = b"0123456789, \t\n", b"0123456789+-.eE, \t\n"
_BLANK_ENDS = re.compile(r"[ \t]+\n")
# Larger whole numbers are not exact as floating point numbers.
_LARGEST_INTEGER = 2**53
# A longer first word is no number of a node.
_LONGEST_WORD = 40


def split_words(line: str) -> list[str]:
    """The words of a data line; empty ones at its end are none."""
    words = [*map(str.strip, line.rstrip(", \t").split(","))]
    if '"' in line:
        words = [word.strip('"') for word in words]
    return words if any(words) else []


@dataclass(frozen=True, eq=False)
class NumberTable(Sequence[list[str]]):
    """Data lines that are numbers.  As a sequence they are the words of each line, which are split when asked for.

    Attributes:
        text: the lines, none of which is empty.
        values: of *NODE one row for each line, shape (lines, numbers); of *ELEMENT all numbers one after the other.
    """

    text: str
    values: Floats | Ints

    @cached_property
    def _rows(self) -> list[list[str]]:
        return [split_words(line.strip()) for line in self.text.split("\n")]

    def __len__(self) -> int:
        return self.text.count("\n") + 1

    def __iter__(self) -> Iterator[list[str]]:
        return iter(self._rows)

    @overload
    def __getitem__(self, index: int) -> list[str]: ...
    @overload
    def __getitem__(self, index: slice) -> list[list[str]]: ...
    def __getitem__(self, index: int | slice) -> list[str] | list[list[str]]:
        return self._rows[index]


def table_after(text: str, start: int, end: int) -> tuple[int, NumberTable] | None:
    """The numbers between a keyword and the next one.

    Args:
        text: a file.
        start: where the line of the keyword begins.
        end: where the next line with a keyword or comment begins.

    Returns:
        Where the line of the keyword ends, and its table; None: it has none.
    """
    stop = text.find("\n", start, end)
    match = _HEADING.fullmatch(text, start, stop) if stop > 0 else None
    if match is None:
        return None
    lines = text[stop + 1 : end].rstrip()
    table = _elements(lines) if match[1].upper() == "ELEMENT" else _nodes(lines)
    return None if table is None else (stop, table)


def _plain(lines: str, characters: bytes) -> bytes | None:
    """Lines as bytes; None: there are none, or they have other characters."""
    if not lines or not lines.isascii():
        return None
    plain = lines.encode("ascii")
    return None if plain.translate(None, characters) else plain


def _parsed(lines: str, kind: type[np.float64 | np.int64]) -> Floats | Ints | None:
    """All numbers of lines; None: a word is none, or empty.

    Args:
        lines: of characters that ``_plain`` accepts.
        kind: of the numbers.
    """
    # Of a word that is made of blanks numpy makes the number 0, or -1.
    words = lines.encode("ascii").translate(None, b" \t").replace(b"\n", b",")
    if words.startswith(b",") or b",," in words:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # what numpy does with a word that is no number
        try:
            numbers: Any = np.fromstring(lines.replace("\n", ","), dtype=kind, sep=" ,")
        except (DeprecationWarning, ValueError):
            return None
    values: Floats | Ints = numbers
    return values if np.isfinite(values).all() else None


def _elements(lines: str) -> NumberTable | None:
    """Whole numbers; a line that ends in a comma is continued, which makes no difference here."""
    if _plain(lines, _INTEGERS) is None:
        return None
    without_blanks = _BLANK_ENDS.sub("\n", lines) if " \n" in lines or "\t\n" in lines else lines
    values = _parsed(without_blanks.rstrip(", \t").replace(",\n", "\n"), np.int64)
    return None if values is None or values.max(initial=0) >= _LARGEST_INTEGER else NumberTable(lines, values)


def _nodes(lines: str) -> NumberTable | None:
    """Lines with as many numbers each, of which the first one is whole."""
    if (plain := _plain(lines, _DECIMALS)) is None:
        return None
    characters = np.frombuffer(plain, dtype=np.uint8)
    ends = np.flatnonzero((characters == ord(",")) | (characters == ord("\n")))
    count = lines.count("\n") + 1
    width, remainder = divmod(len(ends) + 1, count)
    if remainder or (characters[ends[width - 1 :: width]] != ord("\n")).any():
        return None  # they differ
    first = np.concatenate(([0], ends[width - 1 :: width] + 1))
    last = np.append(ends, len(plain) - 1)[::width]
    if (longest := int((last - first).max()) + 1) > _LONGEST_WORD:
        return None
    for offset in range(longest):
        words = characters[np.minimum(first + offset, last)]  # the end of a shorter word is a comma or a new line
        if not ((words <= ord(",")) | (words == ord("-")) | ((words >= ord("0")) & (words <= ord("9")))).all():
            return None
    values = _parsed(lines, np.float64)
    if values is None or values.size != width * count or np.abs(values[::width]).max() >= _LARGEST_INTEGER:
        return None
    return NumberTable(lines, values.reshape(count, width))
