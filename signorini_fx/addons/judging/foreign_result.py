"""A result of another program at the nodes of a problem."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.addons.judging.judged_problem import JudgedProblem
from signorini_fx.addons.judging.printed_results import (
    NodeTables,
    PointTable,
    Table,
    read_csv,
    read_dat,
    read_frd,
    read_vtu,
    significant_digits,
)
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import DIGITS_OF_FILES, HALF_SECTOR_OF_CALCULIX, JUDGED_SAME_PLACE


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
        further: how many values it has at points that are no nodes of the problem.
    """

    name: str
    program: str
    displacement: Floats
    half_units: Floats
    time: float | None = None
    digits: int | None = None
    further: int = 0


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
    tables: dict[str, Any] = {".dat": read_dat, ".frd": read_frd}
    points: dict[str, Any] = {".csv": read_csv, ".vtu": read_vtu}
    kind = file.suffix.lower()
    if kind in tables:
        return _of_tables(file.name, tables[kind](file), problem)
    if kind in points:
        return _of_points(file, points[kind](file), problem)
    raise MeshError(f"{file}: results are read from {', '.join([*tables, *points])}")


def _of_tables(name: str, tables: NodeTables, problem: JudgedProblem) -> ForeignResult:
    """By the numbers of the nodes."""
    displacement, half = _rows(tables.displacement, problem)
    if tables.positions and (away := _misplaced(tables, problem)):
        raise MeshError(f"{name}: {away}: it is the result of another mesh")
    digits = significant_digits(np.nan_to_num(displacement), half)
    if tables.program.startswith("CalculiX") and problem.scene.statement.kinematics.words == "axisymmetric":
        # It prints means over a sector.
        half += np.abs(np.nan_to_num(displacement)) * (1 - np.cos(HALF_SECTOR_OF_CALCULIX))
    return ForeignResult(name, tables.program, displacement, half, tables.time, digits)


def _finite(values: Floats) -> Floats:
    """Values of which those that are no numbers are infinite: NaN is where there are none."""
    return np.where(np.isnan(values), np.inf, values)


def _rows(table: Table, problem: JudgedProblem) -> tuple[Floats, Floats]:
    values, half = np.full(problem.points.shape, np.nan), np.zeros(problem.points.shape)
    for row, name in enumerate(plain(problem.names)):
        if name in table:
            components, units = table[name]
            values[row] = _finite(np.array(components[: problem.arrays.dim]))
            half[row] = units[: problem.arrays.dim]
    return values, half


def _misplaced(tables: NodeTables, problem: JudgedProblem) -> str:
    """A node that is somewhere else than in the problem, in words; "": none is."""
    for name, x in zip(plain(problem.names), plain(problem.points), strict=True):
        at = tables.positions.get(name)
        if (
            at is not None
            and np.linalg.norm(np.subtract(at[: problem.arrays.dim], x)) > JUDGED_SAME_PLACE * problem.size
        ):
            return f"node {name} is at {tuple(at[: problem.arrays.dim])}, in the problem at {tuple(x)}"
    return ""


def _of_points(file: Path, table: PointTable, problem: JudgedProblem) -> ForeignResult:
    """By the numbers of nodes where there are some, else by their positions."""
    shape = problem.points.shape
    displacement, half = np.full(shape, np.nan), np.zeros(shape)
    if table.numbers is not None:
        order = np.argsort(table.numbers, kind="stable")
        again = order[1:][np.diff(table.numbers[order]) == 0]
        first = order[np.searchsorted(table.numbers[order], table.numbers[again])]
        other = (table.displacement[again] != table.displacement[first]).any(axis=1)
        if other.any():
            node = table.numbers[again[np.argmax(other)]]
            raise MeshError(f"{file}: node {node} is there several times, with different displacements")
        at = np.minimum(np.searchsorted(table.numbers[order], problem.names), len(order) - 1)
        rows = order[at]
        held = table.numbers[rows] == problem.names
    else:
        rows, held = _rows_at(file, table, problem)
    displacement[held] = _finite(table.displacement[rows[held], : problem.arrays.dim])
    half[held] = table.half_units[rows[held], : problem.arrays.dim]
    digits = significant_digits(np.nan_to_num(displacement), half)
    further = 0 if table.cells else len(table.displacement) - len(np.unique(rows[held]))
    return ForeignResult(file.name, "", displacement, half, None, digits, further)


def _rows_at(
    file: Path, table: PointTable, problem: JudgedProblem
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """The row of the table at each node, and which nodes have one."""
    near = JUDGED_SAME_PLACE * problem.size
    if table.points is None:
        raise MeshError(f"{file}: has neither numbers nor positions of nodes: give columns node, or x and y")
    x = np.pad(problem.points, ((0, 0), (0, table.points.shape[1] - problem.arrays.dim)))
    tree = cKDTree(table.points)
    away, rows = tree.query(x)
    held = away <= near
    together = tree.query_ball_point(x, near)
    several = [len(rows) for rows in together]
    at_nodes = [len(rows) for rows in cKDTree(x).query_ball_point(x, near)]
    if max(at_nodes) > 1 and max(several) > 1:
        if table.cells:
            return _rows_by_cells(file, table, problem, near)
        node = int(np.argmax(at_nodes))
        cure = "give a column node with the numbers of the problem"
        raise MeshError(f"{file}: several nodes are at {tuple(plain(problem.points[node]))}, as in contact: {cure}")
    alike = DIGITS_OF_FILES * float(np.abs(table.displacement).max())
    for place, at_place in zip(plain(x), together, strict=True):
        if len(at_place) > 1 and not np.ptp(table.displacement[at_place], axis=0).max() <= alike:
            raise MeshError(f"{file}: several points are at {tuple(place)}, with different displacements")
    return rows.astype(np.int64), held


def _rows_by_cells(
    file: Path, table: PointTable, problem: JudgedProblem, near: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """``_rows_at`` where several nodes are at one place: cells with the same middle are the same, with their points.

    Raises:
        MeshError: a node has points with different displacements, or no cell has the middle of one of the problem.
    """
    assert table.points is not None
    x = np.pad(problem.points, ((0, 0), (0, table.points.shape[1] - problem.arrays.dim)))
    tree, nodes, rows = cKDTree(x[problem.cells].mean(axis=1)), [], []
    for block in table.cells:
        away, cells = tree.query(table.points[block].mean(axis=1))
        same, of_cells = block[away <= near], problem.cells[cells[away <= near]]
        for points in same.T:
            distance = np.linalg.norm(x[of_cells] - table.points[points][:, None], axis=2)
            at = np.argmin(distance, axis=1)
            met = distance[np.arange(len(at)), at] <= near
            nodes.append(of_cells[np.arange(len(at)), at][met])
            rows.append(points[met])
    node, row = np.concatenate(nodes), np.concatenate(rows)
    if not node.size:
        cure = "give a table with a column node, numbers of the problem"
        raise MeshError(f"{file}: several nodes are at one place, as in contact, and its cells are others: {cure}")
    numbers, first = np.unique(node, return_index=True)
    chosen = np.zeros(len(x), dtype=np.int64)
    chosen[numbers] = row[first]
    alike = DIGITS_OF_FILES * float(np.abs(table.displacement).max())
    differ = np.abs(table.displacement[row] - table.displacement[chosen[node]]).max(axis=1) > alike
    if differ.any():
        place = tuple(plain(problem.points[node[np.argmax(differ)]]))
        raise MeshError(f"{file}: several points are at {place}, with different displacements")
    return chosen, np.isin(np.arange(len(x)), numbers)
