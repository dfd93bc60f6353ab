"""Results of CalculiX: the tables of a .dat file and the fields of a .frd file, of the last increment."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from signorini_fx.addons.judging.printed_digits import last_digit, printed_number
from signorini_fx.errors import MeshError

# The end of a number whose exponent lacks digits: CalculiX prints two at least.
_CUT = re.compile(r"[eEdD][-+]?\d?$")
_NUMERIC = re.compile(r"[-+.\d]")
# Values by numbers of nodes, each with half a unit of its last digit.
Table = dict[int, tuple[list[float], list[float]]]
_HEADING = re.compile(
    r"^ (displacements|forces|total force)\b.*? for set (\S+) and time\s+([-+.\dEe]+)\s*$", re.IGNORECASE
)


@dataclass
class NodeTables:
    """Results at nodes by their numbers.

    Attributes:
        displacement: three components of each, length, each with half a unit of its last digit.
        positions: of the nodes, length; none in tables.
        time: of the increment.
        program: that wrote them; "": it does not say.
    """

    displacement: Table = field(default_factory=dict)
    positions: dict[int, list[float]] = field(default_factory=dict)
    time: float | None = None
    program: str = ""


def read_dat(file: Path) -> NodeTables:
    """The displacements of the last increment of a .dat file.

    Raises:
        MeshError: it cannot be read, a row is none, or no table has displacements.
    """
    tables = NodeTables(program="CalculiX")
    of_sets: dict[str, Table] = {}
    rows: Table | None = None
    apart = True  # whether the last line was empty
    for row, line in _lines(file):
        if match := _HEADING.match(line):
            time = _number(file, row, match[3])
            if tables.time is not None and time != tables.time:
                of_sets = {}
            tables.time = time
            # Increments that are nearer to each other than times are printed have the same: the last one counts.
            rows, apart = None, True
            if match[1].lower() == "displacements":
                rows = of_sets[match[2].upper()] = {}
            continue
        words = line.split()
        if rows is None or not words:
            apart = True
        elif apart and _begins_table(words):
            rows = None
        else:
            node = _node(file, row, words[0])
            rows[node] = _row(file, row, words[1:4])
            apart = False
    tables.displacement = {node: values for table in of_sets.values() for node, values in table.items()}
    return _with_displacements(file, tables)


def _begins_table(words: list[str]) -> bool:
    """Whether a line after an empty one is no row: it begins with a word, and has not only numbers after it."""
    return words[0][0].isalpha() and not (len(words) > 2 and all(map(_NUMERIC.match, words[1:])))


def read_frd(file: Path) -> NodeTables:
    """The displacements of the last increment of a .frd file.

    Raises:
        MeshError: it cannot be read, a row is none, or no field has displacements.
    """
    tables = NodeTables()
    rows: Table | None = None
    places = False
    increment: list[str] = []
    for row, line in _lines(file):
        head = line[:5]
        if line.startswith("    1PSTEP"):
            if increment != (increment := line.split()[2:]):
                tables.displacement = {}
        elif line.startswith("    1UPGM"):
            tables.program = line[9:].strip() or tables.program
        elif head == "    2":
            places, rows = True, None
        elif line.startswith("  100C"):
            time = _number(file, row, line[12:24])
            if tables.time is not None and time != tables.time:
                tables.displacement = {}
            tables.time = time
        elif line.startswith(" -4"):
            rows = tables.displacement if line[5:13].strip() == "DISP" else None
            places = False
        elif line.startswith(" -3"):
            rows, places = None, False
        elif line.startswith(" -1") and (rows is not None or places):
            node = _node(file, row, line[3:13])
            words = [line[k : k + 12] for k in range(13, len(line.rstrip("\n")), 12)][:3]
            if places:
                tables.positions[node] = [_number(file, row, word) for word in words]
            elif rows is not None:
                rows[node] = _row(file, row, words)
    tables.program = tables.program or "a program that writes .frd"
    return _with_displacements(file, tables)


def _lines(file: Path) -> Iterator[tuple[int, str]]:
    try:
        with file.open(encoding="utf-8", errors="replace") as stream:
            for row, line in enumerate(stream, start=1):
                if "\0" in line:
                    cure = "print it as text: *NODE FILE in place of *NODE OUTPUT"
                    raise MeshError(f"{file}: line {row}: is binary: {cure}")
                yield row, line
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror}") from None


def _number(file: Path, line: int, word: str) -> float:
    try:
        return printed_number(word)
    except ValueError:
        raise MeshError(f"{file}: line {line}: a number is expected, not {word.strip()!r}") from None


def _node(file: Path, line: int, word: str) -> int:
    if not word.strip().isdecimal():
        raise MeshError(f"{file}: line {line}: the number of a node is expected, not {word.strip()!r}")
    return int(word)


def _row(file: Path, line: int, words: list[str]) -> tuple[list[float], list[float]]:
    if len(words) < 3:
        raise MeshError(f"{file}: line {line}: three components are expected, not {len(words)}")
    if _CUT.search(words[-1].rstrip()):
        raise MeshError(f"{file}: line {line}: ends within the number {words[-1].strip()!r}")
    return [_number(file, line, word) for word in words], [last_digit(word) / 2 for word in words]


def _with_displacements(file: Path, tables: NodeTables) -> NodeTables:
    if not tables.displacement:
        cure = "print them: *NODE PRINT, NSET=ALL with U, or *NODE FILE with U"
        raise MeshError(f"{file}: has no displacements: {cure}")
    return tables
