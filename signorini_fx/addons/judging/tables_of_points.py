"""Results at points: .csv with columns of positions or numbers of nodes and of displacements, and .vtu."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from signorini_fx.addons.judging.printed_digits import printed_number, units_of_column
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

_LARGEST = 2.0**53  # from there on not all whole numbers are floating point ones


@dataclass(frozen=True)
class PointTable:
    """Displacements at points.

    Attributes:
        numbers: of the nodes, shape (n,); None: not known.
        points: positions, length, shape (n, 2 or 3); None: not known.
        displacement: length, shape (n, 2 or 3).
        half_units: half a unit of the last digit of each, shape (n, 2 or 3).
        cells: points of the cells of each kind, shape (m, k); none where only points are known.
    """

    numbers: Ints | None
    points: Floats | None
    displacement: Floats
    half_units: Floats
    cells: tuple[Ints, ...] = ()


def read_csv(file: Path) -> PointTable:
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
    return PointTable(numbers, values(places) if places else None, moved_values, half)


def _whole(file: Path, name: str, values: Floats) -> Ints:
    """The numbers of nodes.

    Raises:
        MeshError: one is no whole number, or too large to be the number of a node.
    """
    wrong = ~(np.abs(values) < _LARGEST) | (values != np.rint(values))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise MeshError(f"{file}: row {row + 1}: a whole number is expected in {name!r}, not {values[row]:g}")
    return np.asarray(values.astype(np.int64))


def read_vtu(file: Path) -> PointTable:
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
    return PointTable(None, points, values, half, cells)
