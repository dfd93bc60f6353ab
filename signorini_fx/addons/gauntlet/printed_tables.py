"""The tables that CalculiX prints into a .dat file.  No dolfinx here."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from signorini_fx.addons.judging.printed_digits import printed_number
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.shape import Floats

_HEADING = re.compile(
    r"^ (?P<title>[a-z][a-z ]*?)\s*\((?P<columns>[^)]*)\)\s*for (?:set (?P<set>\S+)|all (?:active )?contact elements)"
    r" and time\s+(?P<time>\S+)\s*$"
)


@dataclass
class PrintedTable:
    """A table of one time.

    Attributes:
        title: such as displacements.
        columns: the words in parentheses.
        where: the set of nodes, in capitals; "": all contact.
        time: of the increment.
        rows: values by the number of the node, or of the element; of a total by 0.
        repeated: whether a number has several rows, as those of points of a face have.
    """

    title: str
    columns: str
    where: str
    time: float
    rows: dict[int, list[float]] = field(default_factory=dict)
    repeated: bool = False

    def values(self, numbers: list[int], count: int) -> Floats:
        """The first components at some nodes, shape (n, count)."""
        return np.array([self.rows[number][:count] for number in numbers]).reshape(len(numbers), count)


def read_tables(text: str, name: str) -> dict[tuple[str, str, float], PrintedTable]:
    """All tables of a .dat file by title, set and time; of several of a time the last one.

    Raises:
        MeshError: a row is none.
    """
    tables: dict[tuple[str, str, float], PrintedTable] = {}
    table: PrintedTable | None = None
    for number, line in enumerate(text.splitlines(), 1):
        if match := _HEADING.match(line):
            where, time = (match["set"] or "").upper(), float(f"{printed_number(match['time']):.6g}")
            table = PrintedTable(match["title"], match["columns"], where, time)
            tables[table.title, where, time] = table
            continue
        words = line.split()
        if table is None or not words:
            continue
        try:
            values = [printed_number(word) for word in words]
        except ValueError:
            table = None
            continue
        total = table.title.startswith("total")
        if not total and not words[0].isdigit():
            raise MeshError(f"{name}: line {number}: the number of a node is expected, not {words[0]!r}")
        row = 0 if total else int(words[0])
        table.repeated |= row in table.rows
        table.rows[row] = values if total else values[1:]
    return tables


def last_tables(file: Path) -> dict[tuple[str, str], list[PrintedTable]]:
    """The tables of a file by title and set, in the order of their times.

    Raises:
        MeshError: it cannot be read, or a row is none.
    """
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror}") from None
    return by_time(read_tables(text, file.name))


def by_time(tables: dict[tuple[str, str, float], PrintedTable]) -> dict[tuple[str, str], list[PrintedTable]]:
    """Tables by title and set, in the order of their times."""
    grouped: dict[tuple[str, str], list[PrintedTable]] = {}
    for (title, where, _), table in sorted(tables.items(), key=lambda entry: entry[0][2]):
        grouped.setdefault((title, where), []).append(table)
    return grouped
