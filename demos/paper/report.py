"""How results are shown: tables as text with the printed numbers beside them."""

from __future__ import annotations

import math
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
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
        return [[item if isinstance(item, Entry) else Entry(item) for item in row[1:]] for row in self.rows]

    @property
    def labels(self) -> list[str]:
        """The labels of the rows."""
        return [str(row[0]) for row in self.rows]

    @property
    def comparable(self) -> list[Entry]:
        """The entries that the paper prints."""
        return [entry for row in self.entries for entry in row if entry.printed is not None]

    @property
    def verdict(self) -> str:
        """How many of the printed entries we have, empty where nothing is printed."""
        if not self.comparable:
            return ""
        equal = sum(not entry.differs for entry in self.comparable)
        return f"{equal} of {len(self.comparable)} printed numbers equal"

    def _printed(self) -> tuple[list[str], list[list[str]]]:
        """Headings and entries of the columns in which the paper prints anything."""
        columns = zip(*self.entries, strict=True)
        kept = [k for k, column in enumerate(columns) if any(entry.printed is not None for entry in column)]
        return [self.columns[k + 1] for k in kept], [[row[k].printed_text for k in kept] for row in self.entries]

    def text(self) -> str:
        """The table for a terminal: computed on the left, printed on the right."""
        computed = [[entry.text + "*" * entry.differs for entry in row] for row in self.entries]
        blocks = [_block(self.columns, self.labels, computed, "computed" if self.comparable else "")]
        if self.comparable:
            columns, printed = self._printed()
            blocks.append(_block(["", *columns], ["" for _ in self.rows], printed, "printed"))
        body = ["   |".join(parts).rstrip() for parts in zip(*blocks, strict=True)]
        lines = [self.title, *textwrap.wrap(self.caption, _WIDTH), "", *body]
        if self.comparable:
            differing = "; * differs from the printed number" if any(e.differs for e in self.comparable) else ""
            lines += ["", f"{self.verdict}{differing}"]
        for note in self.notes:
            lines += textwrap.wrap(note, _WIDTH, initial_indent="- ", subsequent_indent="  ")
        return "\n".join(lines) + "\n"

    def write(self, folder: Path) -> None:
        """As text."""
        (folder / f"{self.name}.txt").write_text(self.text(), encoding="utf-8")


def _block(columns: Sequence[str], labels: list[str], cells: list[list[str]], heading: str) -> list[str]:
    """A heading and right-aligned columns; the labels are left-aligned."""
    rows = [list(columns), *([label, *row] for label, row in zip(labels, cells, strict=True))]
    # A mark does not push the digits out of line.
    rows = [[row[0], *(item if item.endswith("*") else item + " " for item in row[1:])] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join([row[0].ljust(widths[0]), *(item.rjust(w) for item, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    ]
    width = max(map(len, lines))
    return [*([heading.center(width)] if heading else []), *(line.ljust(width) for line in lines)]
