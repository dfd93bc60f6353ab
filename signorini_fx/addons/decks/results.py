"""Displacements that other programs have written: .dat and .frd files of CalculiX, .csv files with
a heading, and .vtu files.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from signorini_fx.arrays import Array, Ints
from signorini_fx.errors import MeshError

# Fortran writes D for E, and leaves out the letter before an exponent of three digits.
_WITHOUT_LETTER = re.compile(r"(?<=[\d.])(?:[dD]([-+]?)|([-+]))(?=\d+\s*$)")
_HEADING = re.compile(r"^ (\S.*?) for set \S+ and time\s+(\S+)\s*$")
_DIGITS_OF_SINGLE = 7


@dataclass(frozen=True)
class ForeignResult:
    """Displacements at the points of a file, or at the nodes of a problem."""

    displacement: Array  # length, shape (n, 2 or 3); at nodes NaN where there is none, shape (n, d)
    digits: int | None = None  # with which they were printed; None: with all
    numbers: Ints | None = None  # of the nodes in the file, shape (n,); None: not known
    points: Array | None = None  # positions in the file, length, shape (n, 2 or 3); None: not known
    cells: tuple[
        Ints, ...
    ] = ()  # points of the cells of each kind, shape (m, k); none where only points are known
    time: float | None = None  # of the last increment; None: not known
    program: str = ""  # that wrote them; "": it does not say
    name: str = "the result"  # of the file, or what it is

    @property
    def half_unit(self) -> float:
        """Half a unit of the last printed digit of the largest component, length; 0 if all digits
        are printed.
        """
        largest = float(np.abs(np.nan_to_num(self.displacement)).max())
        if self.digits is None or not largest > 0:
            return 0.0
        return float(0.5 * 10.0 ** (np.floor(np.log10(largest)) - self.digits + 1))


# By the number of a node the line it is on, and its components.
_Rows = dict[int, tuple[int, list[str]]]


def _numbers(file: Path, rows: Iterable[tuple[int, Sequence[str]]]) -> tuple[Array, int]:
    """Return the words of lines as numbers, shape (lines, words), and the largest number of
    digits.
    """
    values = []
    digits = 0
    for line, words in rows:
        try:
            values.append([float(_WITHOUT_LETTER.sub(r"E\1\2", word)) for word in words])
        except ValueError:
            raise MeshError(
                f"{file}: line {line}: numbers are expected, not {' '.join(words)!r}"
            ) from None
        mantissas = (re.split(r"[-+eEdD]", word.strip().lstrip("-+"))[0] for word in words)
        digits = max(
            digits, *(len(mantissa.replace(".", "").lstrip("0")) for mantissa in mantissas)
        )
    return np.array(values), digits


def _add_node(file: Path, line: int, rows: _Rows, node: str, words: list[str]) -> None:
    if not node.strip().isdecimal() or len(words) < 3:
        raise MeshError(f"{file}: line {line}: a node and three components are expected")
    rows[int(node)] = line, words[:3]


def read_dat(file: Path) -> ForeignResult:
    """Return the displacements of the last increment of a .dat file of CalculiX."""
    last: float | None = None
    rows: _Rows = {}
    within, apart = (
        False,
        True,
    )  # whether a table of displacements is read, and the last line was empty
    for number, line in _lines(file):
        words = line.split()
        if match := _HEADING.match(line):
            within = match[1].lower().startswith("displacements")
            apart = True
            if within and (time := _numbers(file, [(number, [match[2]])])[0].item()) != last:
                last = time
                rows = {}
        elif not words:
            apart = True
        elif apart and not words[0].isdecimal():
            within = False
        elif within:
            _add_node(file, number, rows, words[0], words[1:])
            apart = False
    return _of_nodes(file, rows, {}, last, "CalculiX")


def read_frd(file: Path) -> ForeignResult:
    """Return the displacements of the last increment of a .frd file of CalculiX."""
    displacements: _Rows = {}
    positions: _Rows = {}
    rows: _Rows | None = None
    last: float | None = None
    program = "a program that writes .frd"
    for number, line in _lines(file):
        if line.startswith("    1UPGM"):
            program = line[9:].strip() or program
        elif line.startswith("    2"):
            rows = positions
        elif (
            line.startswith("  100C")
            and (time := _numbers(file, [(number, [line[12:24]])])[0].item()) != last
        ):
            last = time
            displacements = {}
        elif line.startswith((" -3", " -4")):
            rows = displacements if line[5:13].strip() == "DISP" else None
        elif line.startswith(" -1") and rows is not None:
            words = [line[k : k + 12] for k in range(13, len(line.rstrip("\n")), 12)]
            _add_node(file, number, rows, line[3:13], words)
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


def _of_nodes(
    file: Path, rows: _Rows, positions: _Rows, time: float | None, program: str
) -> ForeignResult:
    if not rows:
        cure = "print them: *NODE PRINT, NSET=ALL with U, or *NODE FILE with U"
        raise MeshError(f"{file}: has no displacements: {cure}")
    values, digits = _numbers(file, rows.values())
    points = (
        _numbers(file, [positions.get(node, (0, ["nan"] * 3)) for node in rows])[0]
        if positions
        else None
    )
    return ForeignResult(values, digits, np.array(list(rows)), points, time=time, program=program)


def read_csv(file: Path) -> ForeignResult:
    """Return the displacements of a table with a heading."""
    numbered = [
        (number, line) for number, line in _lines(file) if line.strip() and not line.startswith("#")
    ]
    rows = list(csv.reader(line for _, line in numbered))
    heading = [word.strip().lower().lstrip("\ufeff") for word in rows[0]] if rows else []
    at = {word: column for column, word in enumerate(heading)}
    if (
        len(rows) != len(numbered)
        or len(rows) < 2
        or len(at) < len(heading)
        or not {"ux", "uy"} <= at.keys()
    ):
        raise MeshError(
            f"{file}: columns ux, uy (and uz) are expected, with x, y (and z) or node, each once; "
            f"there are: {heading}"
        )

    def columns(*names: str) -> tuple[Array, int]:
        present = [at[name] for name in names if name in at]
        table = [[(*row, *[""] * len(at))[k] for k in present] for row in rows[1:]]
        return _numbers(file, zip([line for line, _ in numbered[1:]], table, strict=True))

    values, digits = columns("ux", "uy", "uz")
    points = columns("x", "y", "z")[0] if at.keys() & {"x", "y", "z"} else None
    numbers: Ints | None = None
    if "node" in at:
        given = columns("node")[0][:, 0]
        numbers = given.astype(np.int64)
        if (numbers != given).any():
            raise MeshError(f"{file}: the column node has numbers that are not those of nodes")
    return ForeignResult(values, digits, numbers, points)


def read_vtu(file: Path) -> ForeignResult:
    """Return the vector field ``displacement`` or ``u`` at the points of a .vtu file."""
    import meshio.vtu

    try:
        mesh = meshio.vtu.read(file)  # ``meshio.read`` prints what is wrong, and ends the process
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror or error}") from None
    except (Exception, SystemExit) as error:
        raise MeshError(
            f"{file}: is no .vtu file that meshio reads: {str(error) or type(error).__name__}"
        ) from None
    vectors = {
        name: data
        for name, data in mesh.point_data.items()
        if data.ndim == 2 and data.shape[1] in (2, 3)
    }
    chosen = next((name for name in ("displacement", "u") if name in vectors), None)
    if chosen is None:
        raise MeshError(
            f"{file}: a field of vectors called displacement is expected; there are: "
            f"{sorted(vectors)}"
        )
    values = np.asarray(vectors[chosen], dtype=np.float64)
    digits = _DIGITS_OF_SINGLE if vectors[chosen].dtype == np.float32 else None
    points = np.asarray(mesh.points, dtype=np.float64)
    cells = tuple(block.data.astype(np.int64) for block in mesh.cells if block.dim > 0)
    return ForeignResult(values, digits, None, points, cells)


READERS = {".dat": read_dat, ".frd": read_frd, ".csv": read_csv, ".vtu": read_vtu}
