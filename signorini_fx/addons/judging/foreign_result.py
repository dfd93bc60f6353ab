"""A result of another program at the nodes of a problem: .dat and .frd of CalculiX, .csv with a heading, and .vtu."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.addons.judging.judged_problem import JudgedProblem
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import DIGITS_OF_FILES, JUDGED_SAME_PLACE

# Fortran writes D for E, and leaves out the letter before an exponent of three digits.
_WITHOUT_LETTER = re.compile(r"(?<=[\d.])(?:[dD]([-+]?)|([-+]))(?=\d+\s*$)")
_HEADING = re.compile(r"^ (\S.*?) for set \S+ and time\s+(\S+)\s*$")
_LARGEST = 2.0**53  # from there on not all whole numbers are floating point ones


@dataclass(frozen=True)
class ForeignResult:
    """A result.

    Attributes:
        name: of its file, or what it is.
        program: that made it; "": not known.
        displacement: length, NaN where there is none, shape (n, d).
        half_units: half a unit of the last digit of each component, length, shape (n, d).
        time: of the increment; None: not known.
        digits: with which it was printed; None: with all.
    """

    name: str
    program: str
    displacement: Floats
    half_units: Floats
    time: float | None = None
    digits: int | None = None


def read_result(result: object, problem: JudgedProblem) -> ForeignResult:
    """A result at the nodes of a problem.

    Args:
        result: the path of a .dat, .frd, .csv or .vtu file; or an array of shape (n, d), in the order of the nodes of
            the deck or of the mesh file.
        problem: the problem.

    Raises:
        MeshError: the file cannot be read, or the array has another shape.
    """
    if isinstance(result, str | Path):
        return _read(Path(result), problem)
    expected = problem.points.shape
    try:
        numbers = np.asarray(result)
        if np.iscomplexobj(numbers):
            raise ValueError
        values = np.where(np.ma.getmaskarray(result), np.nan, numbers.astype(np.float64))  # type: ignore[no-untyped-call]
    except (TypeError, ValueError):
        raise MeshError(f"the result: an array of real numbers of shape {expected} is expected") from None
    if values.ndim != 2 or len(values) != expected[0] or values.shape[1] not in (expected[1], 3):
        raise MeshError(f"the result: an array of shape {expected} is expected, not {values.shape}")
    values = _finite(values[:, : expected[1]])
    return ForeignResult("the result", "", values, np.zeros_like(values))


def _read(file: Path, problem: JudgedProblem) -> ForeignResult:
    """By the numbers of nodes where there are some, else by their positions."""
    kind = file.suffix.lower()
    if kind not in _READERS:
        raise MeshError(f"{file}: results are read from {', '.join(_READERS)}")
    printed = _READERS[kind](file)
    rows, held = _rows_at(file, printed, problem) if printed.numbers is None else _rows_of(file, printed, problem)
    displacement, half = np.full(problem.points.shape, np.nan), np.zeros(problem.points.shape)
    displacement[held] = _finite(printed.displacement[rows[held], : problem.arrays.dim])
    half[held] = printed.half_units[rows[held], : problem.arrays.dim]
    digits = _significant_digits(np.nan_to_num(displacement), half)
    return ForeignResult(file.name, printed.program, displacement, half, printed.time, digits)


def _finite(values: Floats) -> Floats:
    """Values of which those that are no numbers are infinite: NaN is where there are none."""
    return np.where(np.isnan(values), np.inf, values)


def _significant_digits(values: Floats, half_units: Floats) -> int | None:
    """How many digits the largest of some numbers was printed with; None: with all."""
    largest = int(np.argmax(np.abs(values)))
    value, half = float(np.abs(values).ravel()[largest]), float(half_units.ravel()[largest])
    return round(np.floor(np.log10(value)) - np.log10(2 * half)) + 1 if half > 0 else None


# --- nodes ------------------------------------------------------------------------------------------------------------


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


def _rows_of(file: Path, table: Printed, problem: JudgedProblem) -> tuple[Ints, npt.NDArray[np.bool_]]:
    """The row of the table with the number of each node, and which nodes have one."""
    assert table.numbers is not None
    order = np.argsort(table.numbers, kind="stable")
    again = order[1:][np.diff(table.numbers[order]) == 0]
    first = order[np.searchsorted(table.numbers[order], table.numbers[again])]
    other = (table.displacement[again] != table.displacement[first]).any(axis=1)
    if other.any():
        node = table.numbers[again[np.argmax(other)]]
        raise MeshError(f"{file}: node {node} is there several times, with different displacements")
    rows = order[np.minimum(np.searchsorted(table.numbers[order], problem.names), len(order) - 1)]
    held = table.numbers[rows] == problem.names
    if table.points is not None:
        dim = min(problem.arrays.dim, table.points.shape[1])
        away = np.linalg.norm(table.points[rows, :dim] - problem.points[:, :dim], axis=1)
        for row in np.flatnonzero(held & (away > JUDGED_SAME_PLACE * problem.size))[:1]:
            places = f"at {tuple(plain(table.points[rows[row], :dim]))}, in the problem at"
            where = f"node {problem.names[row]} is {places} {tuple(plain(problem.points[row]))}"
            raise MeshError(f"{file}: {where}: it is the result of another mesh")
    return rows, held


def _rows_at(file: Path, table: Printed, problem: JudgedProblem) -> tuple[Ints, npt.NDArray[np.bool_]]:
    """The row of the table at each node, and which nodes have one.

    Nodes at one place, as in contact, are told apart by the middles of their cells.
    """
    near = JUDGED_SAME_PLACE * problem.size
    if table.points is None:
        raise MeshError(f"{file}: has neither numbers nor positions of nodes: give columns node, or x and y")
    x = np.pad(problem.points, ((0, 0), (0, table.points.shape[1] - problem.arrays.dim)))
    nodes: Ints = np.arange(len(x))
    rows: Ints = np.arange(len(table.points))
    points = table.points
    if table.cells and _are_together(points, near) and _are_together(x, near):
        nodes, x = _in_cells(x, (problem.cells,))
        rows, points = _in_cells(points, table.cells)
    elif _are_together(points, near) and _are_together(x, near):
        cure = "give a table with a column node, the numbers of the problem"
        raise MeshError(f"{file}: several nodes are at one place, as in contact: {cure}")
    tree = cKDTree(points)
    away, nearest = tree.query(x)
    alike = DIGITS_OF_FILES * float(np.abs(table.displacement).max())
    for place, at_place in zip(plain(x), tree.query_ball_point(x, near), strict=True):
        if len(at_place) > 1 and not np.ptp(table.displacement[rows[at_place]], axis=0).max() <= alike:
            raise MeshError(f"{file}: several points are at {tuple(place[:3])}, with different displacements")
    row_of_node, held = np.zeros(len(problem.points), dtype=np.int64), np.zeros(len(problem.points), dtype=bool)
    row_of_node[nodes[away <= near]] = rows[nearest[away <= near]]
    held[nodes[away <= near]] = True
    return row_of_node, held


def _are_together(x: Floats, near: float) -> bool:
    """Whether some points are at the place of another one."""
    return len(cKDTree(x).query_pairs(near)) > 0


def _in_cells(x: Floats, tables: Sequence[Ints]) -> tuple[Ints, Floats]:
    """Of each point of each cell its number, shape (n,), and its place with the cell's middle, shape (n, 2 d)."""
    middles = [np.broadcast_to(x[cells].mean(axis=1)[:, None], x[cells].shape) for cells in tables]
    numbers = np.concatenate([cells.ravel() for cells in tables])
    return numbers, np.hstack((x[numbers], np.concatenate([middle.reshape(-1, x.shape[1]) for middle in middles])))


# --- numbers as they are printed --------------------------------------------------------------------------------------


def _number(file: Path, line: int, word: str) -> float:
    try:
        return float(_WITHOUT_LETTER.sub(r"E\1\2", word))
    except ValueError:
        raise MeshError(f"{file}: line {line}: a number is expected, not {word.strip()!r}") from None


def _half_units(words: Sequence[str], values: Floats) -> Floats:
    """Half a unit of the last digit of each number of a column, of which some may end in zeros that are not printed.

    Without exponents all have as many decimals as the longest one; with exponents as many digits.  Zero is exact.
    """
    parts = [re.split(r"[-+eEdD]", word.strip().lstrip("-+"))[0].partition(".") for word in words]
    known = np.isfinite(values) & (values != 0)
    if not any(letter in word for word in words for letter in "eEdD"):
        return np.where(known, 0.5 * 10.0 ** -max(len(decimals) for *_, decimals in parts), 0.0)
    digits = max(len((whole + decimals).lstrip("0")) for whole, _, decimals in parts)
    powers = np.floor(np.log10(np.where(known, np.abs(values), 1.0)))
    return np.where(known, 0.5 * 10.0 ** (powers - digits + 1), 0.0)


def _columns(file: Path, rows: Sequence[tuple[int, Sequence[str]]]) -> tuple[Floats, Floats]:
    """The values of rows of words, each with its line, and half a unit of the last digit of each."""
    values = np.array([[_number(file, line, word) for word in words] for line, words in rows])
    columns = zip(zip(*(words for _, words in rows), strict=True), values.T, strict=True)
    return values, np.stack([_half_units(words, column) for words, column in columns], axis=1)


# --- CalculiX, the last increment -------------------------------------------------------------------------------------

# By the number of a node the line and the words of its row.
_Rows = dict[int, tuple[int, list[str]]]


def read_dat(file: Path) -> Printed:
    """The displacements of the last increment of a .dat file.

    Raises:
        MeshError: it cannot be read, a row is none, or no table has displacements.
    """
    last: float | None = None
    rows: _Rows = {}
    within, apart = False, True  # whether a table of displacements is read, and the last line was empty
    for number, line in _lines(file):
        words = line.split()
        if match := _HEADING.match(line):
            within, apart = match[1].lower().startswith("displacements"), True
            if within and (time := _number(file, number, match[2])) != last:
                last, rows = time, {}
        elif not words:
            apart = True
        elif apart and not words[0].isdecimal():
            within = False
        elif within:
            node = _node(file, number, words[0])
            rows[node] = _row(file, number, words[1:4])
            apart = False
    return _of_nodes(file, rows, {}, last, "CalculiX")


def read_frd(file: Path) -> Printed:
    """The displacements of the last increment of a .frd file.

    Raises:
        MeshError: it cannot be read, a row is none, or no field has displacements.
    """
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
        elif line.startswith("  100C") and (time := _number(file, number, line[12:24])) != last:
            last, displacements = time, {}
        elif line.startswith(" -4"):
            rows = displacements if line[5:13].strip() == "DISP" else None
        elif line.startswith(" -3"):
            rows = None
        elif line.startswith(" -1") and rows is not None:
            node = _node(file, number, line[3:13])
            rows[node] = _row(file, number, [line[k : k + 12] for k in range(13, len(line.rstrip("\n")), 12)][:3])
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


def _node(file: Path, line: int, word: str) -> int:
    if not word.strip().isdecimal():
        raise MeshError(f"{file}: line {line}: the number of a node is expected, not {word.strip()!r}")
    return int(word)


def _row(file: Path, line: int, words: list[str]) -> tuple[int, list[str]]:
    if len(words) < 3:
        raise MeshError(f"{file}: line {line}: three components are expected, not {len(words)}")
    return line, words


def _of_nodes(file: Path, rows: _Rows, positions: _Rows, time: float | None, program: str) -> Printed:
    if not rows:
        cure = "print them: *NODE PRINT, NSET=ALL with U, or *NODE FILE with U"
        raise MeshError(f"{file}: has no displacements: {cure}")
    values, half = _columns(file, list(rows.values()))
    points = None
    if positions:
        absent = 0, ["nan"] * 3
        points = _columns(file, [positions.get(node, absent) for node in rows])[0]
    return Printed(values, half, np.array(list(rows)), points, time=time, program=program)


# --- points -----------------------------------------------------------------------------------------------------------


def read_csv(file: Path) -> Printed:
    """A table with a heading.

    Raises:
        MeshError: it cannot be read, has no columns of displacements, or a word is no number.
    """
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            numbered = enumerate(stream, start=1)
            kept = [(number, line) for number, line in numbered if line.strip() and not line.startswith("#")]
            lines = list(zip((number for number, _ in kept), csv.reader(line for _, line in kept), strict=True))
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error, ValueError):
        raise MeshError(f"{file}: is no table of text") from None
    heading = [word.strip().lower() for word in lines[0][1]] if lines else []
    at = {word: column for column, word in enumerate(heading)}
    if double := [word for word in at if word and heading.count(word) > 1]:
        raise MeshError(f"{file}: has several columns {double[0]!r}")
    if not {"ux", "uy"} <= at.keys() or len(lines) < 2:
        raise MeshError(
            f"{file}: columns ux, uy (and uz) are expected, with x, y (and z) or node; there are: {heading}"
        )

    def columns(*names: str) -> tuple[Floats, Floats]:
        present = [at[name] for name in names if name in at]
        return _columns(file, [(line, [(*row, *[""] * len(at))[k] for k in present]) for line, row in lines[1:]])

    values, half = columns("ux", "uy", "uz")
    points = columns("x", "y", "z")[0] if at.keys() & {"x", "y", "z"} else None
    numbers: Ints | None = None
    if "node" in at:
        given = columns("node")[0][:, 0]
        wrong = ~(np.abs(given) < _LARGEST) | (given != np.rint(given))
        if wrong.any():
            row = int(np.argmax(wrong))
            raise MeshError(f"{file}: line {lines[1 + row][0]}: {given[row]:g} is not the number of a node")
        numbers = given.astype(np.int64)
    return Printed(values, half, numbers, points)


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


_READERS = {".dat": read_dat, ".frd": read_frd, ".csv": read_csv, ".vtu": read_vtu}
