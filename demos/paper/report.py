"""How results are shown: tables as text with the printed numbers that differ."""

from __future__ import annotations

import math
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

_WIDTH = 110


def progress(text: str) -> None:
    """What is being computed, on one line of a terminal; silent elsewhere."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)


def power(value: float) -> str:
    """1e4 for 10000.0."""
    return f"1e{round(math.log10(value))}"


@dataclass(frozen=True)
class Entry:
    """A number that we computed, and the one that the paper prints, None where it prints none.

    Attributes:
        computed: a number, or text.
        printed: the like.
        form: format specification for both; they are equal if they look equal in it.
    """

    computed: Any
    printed: Any = None
    form: str = ""

    @property
    def differs(self) -> bool:
        """Whether the printed number is another one."""
        return self.printed is not None and self.text != self.printed_text

    @property
    def text(self) -> str:
        """The computed number."""
        return shown(self.computed, self.form)

    @property
    def printed_text(self) -> str:
        """The printed number, empty where there is none."""
        return "" if self.printed is None else shown(self.printed, self.form)


def shown(value: Any, form: str) -> str:
    """A value as the tables show it."""
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    text = format(value, form)
    if "e" in form:  # 6.85e-1, as the paper writes it
        digits, power = text.split("e")
        text = f"{digits}e{int(power)}"
    return text


@dataclass(frozen=True)
class Table:
    """A table, its first column the labels of the rows.

    Attributes:
        name: stem of its files.
        title: one line.
        columns: headings, that of the labels first.
        rows: as many items each: label, then ``Entry`` or plain text.
        caption: what it shows.
        notes: where and why it differs from the paper, and what else is to be said.
        numbers: the same in the layout of ``printed.json``, or whatever JSON can hold.
    """

    name: str
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    caption: str = ""
    notes: Sequence[str] = ()
    numbers: dict[str, Any] = field(default_factory=dict)

    @property
    def entries(self) -> list[list[Entry]]:
        """The rows without their labels."""
        return [
            [item if isinstance(item, Entry) else Entry(item) for item in row[1:]]
            for row in self.rows
        ]

    @property
    def comparable(self) -> list[Entry]:
        """The entries that the paper prints."""
        return [entry for row in self.entries for entry in row if entry.printed is not None]

    def text(self) -> str:
        """The table for a terminal; a printed number that is another one follows in parentheses."""
        cells = [
            [f"{e.text} ({e.printed_text})" if e.differs else e.text for e in row]
            for row in self.entries
        ]
        rows = [
            list(self.columns),
            *([str(row[0]), *items] for row, items in zip(self.rows, cells, strict=True)),
        ]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        body = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        lines = [self.title, *textwrap.wrap(self.caption, _WIDTH), "", *body]
        if self.comparable:
            equal = sum(not entry.differs for entry in self.comparable)
            lines += [
                "",
                f"{equal} of {len(self.comparable)} printed numbers equal; others follow in "
                "parentheses",
            ]
        for note in self.notes:
            lines += textwrap.wrap(note, _WIDTH, initial_indent="- ", subsequent_indent="  ")
        return "\n".join(lines) + "\n"
