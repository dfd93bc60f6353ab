"""Results of other programs as they are printed: .dat and .frd of CalculiX, .csv with a heading, and .vtu."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

# Fortran leaves out the letter before an exponent of three digits.
_NUMBER = re.compile(r"\s*[-+]?(\d*)\.?(\d*)(?:[eEdD]?([-+]\d+)|[eEdD](\d+))?\s*")
_WITHOUT_LETTER = re.compile(r"(?<=[\d.])(?:[dD]([-+]?)|([-+]))(?=\d+\s*$)")
# The end of a number whose exponent lacks digits: CalculiX prints two at least.
_CUT = re.compile(r"[eEdD][-+]?\d?$")
_NUMERIC = re.compile(r"[-+.\d]")
# Values by numbers of nodes, each with half a unit of its last digit.
Rows = dict[int, tuple[list[float], list[float]]]
_HEADING = re.compile(
    r"^ (displacements|forces|total force)\b.*? for set (\S+) and time\s+([-+.\dEe]+)\s*$", re.IGNORECASE
)
_LARGEST = 2.0**53  # from there on not all whole numbers are floating point ones


def printed_number(word: str) -> float:
    """A number as Fortran and C print it.

    Raises:
        ValueError: it is none.
    """
    return float(_WITHOUT_LETTER.sub(r"E\1\2", word))


def last_digit(word: str) -> float:
    """The unit of the last digit of a number as it was printed; 0 for none, for one that is too large to be finite, and
    for zero, which is exact.
    """
    match = _NUMBER.fullmatch(word)
    if match is None or not (match[1] + match[2]).strip("0") or math.isinf(printed_number(word)):
        return 0.0
    return float(f"1e{int(match[3] or match[4] or 0) - len(match[2])}")


def units_of_column(words: Sequence[str]) -> Floats:
    """The unit of the last digit of each number of a column, of which some may end in zeros that are not printed.

    Without exponents all have as many decimals as the longest one; with exponents as many digits, shape (n,).
    """
    units = np.array([last_digit(word) for word in words])
    if not units.any():
        return units
    if not any(letter in word for word in words for letter in "eEdD"):
        return np.where(units > 0, units[units > 0].min(), 0.0)
    values = np.array([abs(printed_number(word)) for word in words])
    powers = np.floor(np.log10(np.where(units > 0, values, 1.0)))
    digits = (powers - np.round(np.log10(np.where(units > 0, units, 1.0))))[units > 0].max()
    return np.where(units > 0, 10.0 ** (powers - digits), 0.0)


def significant_digits(values: Floats, half_units: Floats) -> int | None:
    """How many digits the largest of some numbers was printed with; None: more than are needed to know it.

    Args:
        values: any shape.
        half_units: half a unit of the last digit of each.
    """
    row = int(np.argmax(np.abs(values)))
    value, half = float(np.abs(values).ravel()[row]), float(half_units.ravel()[row])
    if not half > 0 or not value > 0:
        return None
    return int(np.floor(np.log10(value))) - int(np.round(np.log10(2 * half))) + 1


@dataclass(frozen=True)
class Printed:
    """Displacements at nodes or points.

    Attributes:
        displacement: length, shape (n, 2 or 3).
        half_units: half a unit of the last digit of each, shape (n, 2 or 3).
        numbers: of the nodes, shape (n,); None: not known.
        points: positions, length, shape (n, 2 or 3); None: not known.
        cells: points of the cells of each kind, shape (m, k); none where only points are known.
        time: of the last increment; None: not known.
        program: that wrote them; "": it does not say.
    """

    displacement: Floats
    half_units: Floats
    numbers: Ints | None = None
    points: Floats | None = None
    cells: tuple[Ints, ...] = ()
    time: float | None = None
    program: str = ""


# --- CalculiX, the last increment -------------------------------------------------------------------------------------


def read_dat(file: Path) -> Printed:
    """The displacements of the last increment of a .dat file.

    Raises:
        MeshError: it cannot be read, a row is none, or no table has displacements.
    """
    last: float | None = None
    of_sets: dict[str, Rows] = {}
    rows: Rows | None = None
    apart = True  # whether the last line was empty
    for row, line in _lines(file):
        if match := _HEADING.match(line):
            time = _number(file, row, match[3])
            if last is not None and time != last:
                of_sets = {}
            last = time
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
    rows = {node: values for rows_of_set in of_sets.values() for node, values in rows_of_set.items()}
    return _of_nodes(file, rows, {}, last, "CalculiX")


def _begins_table(words: list[str]) -> bool:
    """Whether a line after an empty one is no row: it begins with a word, and has not only numbers after it."""
    return words[0][0].isalpha() and not (len(words) > 2 and all(map(_NUMERIC.match, words[1:])))


def read_frd(file: Path) -> Printed:
    """The displacements of the last increment of a .frd file.

    Raises:
        MeshError: it cannot be read, a row is none, or no field has displacements.
    """
    displacements: Rows = {}
    positions: dict[int, list[float]] = {}
    rows: Rows | None = None
    last: float | None = None
    program, places = "a program that writes .frd", False
    increment: list[str] = []
    for row, line in _lines(file):
        head = line[:5]
        if line.startswith("    1PSTEP"):
            if increment != (increment := line.split()[2:]):
                displacements = {}
        elif line.startswith("    1UPGM"):
            program = line[9:].strip() or program
        elif head == "    2":
            places, rows = True, None
        elif line.startswith("  100C"):
            time = _number(file, row, line[12:24])
            if last is not None and time != last:
                displacements = {}
            last = time
        elif line.startswith(" -4"):
            rows = displacements if line[5:13].strip() == "DISP" else None
            places = False
        elif line.startswith(" -3"):
            rows, places = None, False
        elif line.startswith(" -1") and (rows is not None or places):
            node = _node(file, row, line[3:13])
            words = [line[k : k + 12] for k in range(13, len(line.rstrip("\n")), 12)][:3]
            if places:
                positions[node] = [_number(file, row, word) for word in words]
            elif rows is not None:
                rows[node] = _row(file, row, words)
    return _of_nodes(file, displacements, positions, last, program)


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


def _of_nodes(file: Path, rows: Rows, positions: dict[int, list[float]], time: float | None, program: str) -> Printed:
    if not rows:
        cure = "print them: *NODE PRINT, NSET=ALL with U, or *NODE FILE with U"
        raise MeshError(f"{file}: has no displacements: {cure}")
    values, half = (np.array(table) for table in zip(*rows.values(), strict=True))
    points = np.array([positions.get(node, [np.nan] * 3) for node in rows]) if positions else None
    return Printed(values, half, np.array(list(rows)), points, time=time, program=program)


# --- points -----------------------------------------------------------------------------------------------------------


def read_csv(file: Path) -> Printed:
    """A table with a heading.

    Raises:
        MeshError: it cannot be read, has no columns of displacements, or a word is no number.
    """
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            lines = list(csv.reader(line for line in stream if not line.startswith("#")))
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error):
        raise MeshError(f"{file}: is no table of text") from None
    rows = [row for row in lines[1:] if row]
    heading = [word.strip().lower() for word in lines[0]] if lines else []
    at = {word: column for column, word in enumerate(heading)}
    if double := [word for word in at if word and heading.count(word) > 1]:
        raise MeshError(f"{file}: has several columns {double[0]!r}")
    moved, places = ([at[name] for name in names if name in at] for names in (("ux", "uy", "uz"), ("x", "y", "z")))
    if not {"ux", "uy"} <= at.keys() or not rows:
        raise MeshError(
            f"{file}: columns ux, uy (and uz) are expected, with x, y (and z) or node; there are: {heading}"
        )
    number = at.get("node")

    def values(columns: list[int]) -> Floats:
        table = np.empty((len(rows), len(columns)))
        for line, row in enumerate(rows):
            for k, column in enumerate(columns):
                try:
                    table[line, k] = printed_number(row[column])
                except (ValueError, IndexError):
                    raise MeshError(f"{file}: row {line + 1}: a number is expected in {heading[column]!r}") from None
        return table

    moved_values = values(moved)
    half = np.stack([units_of_column([row[column] for row in rows]) / 2 for column in moved], axis=1)
    numbers = None if number is None else _whole(file, heading[number], values([number])[:, 0])
    return Printed(moved_values, half, numbers, values(places) if places else None)


def _whole(file: Path, name: str, values: Floats) -> Ints:
    """The numbers of nodes."""
    wrong = ~(np.abs(values) < _LARGEST) | (values != np.rint(values))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise MeshError(f"{file}: row {row + 1}: a whole number is expected in {name!r}, not {values[row]:g}")
    return np.asarray(values.astype(np.int64))


def read_vtu(file: Path) -> Printed:
    """A field of vectors at the points of a .vtu file.

    Raises:
        MeshError: it cannot be read, or has no such field.
    """
    import meshio.vtu

    try:
        mesh = meshio.vtu.read(file)  # ``meshio.read`` prints what is wrong, and ends the process
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror or error}") from None
    except (Exception, SystemExit) as error:
        raise MeshError(f"{file}: is no .vtu file that meshio reads: {str(error) or type(error).__name__}") from None
    vectors = {name: data for name, data in mesh.point_data.items() if data.ndim == 2 and data.shape[1] in (2, 3)}
    chosen = next((name for name in ("displacement", "u") if name in vectors), None)
    if chosen is None:
        raise MeshError(f"{file}: a field of vectors called displacement is expected; there are: {sorted(vectors)}")
    values = np.asarray(vectors[chosen], dtype=np.float64)
    half = np.zeros_like(values)
    if vectors[chosen].dtype == np.float32:
        half = np.abs(values) * np.finfo(np.float32).eps / 2
    points = np.asarray(mesh.points, dtype=np.float64)
    cells = tuple(block.data.astype(np.int64) for block in mesh.cells if block.dim > 0)
    return Printed(values, half, None, points, cells)
