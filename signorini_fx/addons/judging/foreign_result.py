"""A result of another program at the nodes of a problem."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.addons.judging.judged_problem import JudgedProblem
from signorini_fx.addons.judging.printed_results import (
    Printed,
    read_csv,
    read_dat,
    read_frd,
    read_vtu,
    significant_digits,
)
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import DIGITS_OF_FILES, JUDGED_SAME_PLACE


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


_READERS = {".dat": read_dat, ".frd": read_frd, ".csv": read_csv, ".vtu": read_vtu}


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
    digits = significant_digits(np.nan_to_num(displacement), half)
    # Programs print nodes of their own, too; a table has those that are asked for.
    own = printed.program or printed.cells
    further = 0 if own else len(printed.displacement) - len(np.unique(rows[held]))
    return ForeignResult(file.name, printed.program, displacement, half, printed.time, digits, further)


def _finite(values: Floats) -> Floats:
    """Values of which those that are no numbers are infinite: NaN is where there are none."""
    return np.where(np.isnan(values), np.inf, values)


def _rows_of(file: Path, table: Printed, problem: JudgedProblem) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
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


def _rows_at(file: Path, table: Printed, problem: JudgedProblem) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
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
    file: Path, table: Printed, problem: JudgedProblem, near: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """``_rows_at`` where several nodes are at one place: cells with the same middle are the same, with their points."""
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
