"""Results of other programs, assigned to the nodes of a problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.addons.decks.results import READERS, ForeignResult
from signorini_fx.addons.judging.judged_problem import JudgedProblem
from signorini_fx.arrays import Array, Ints
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.arrays import Numbering, plain
from signorini_fx.tuned import DIGITS_OF_FILES, JUDGED_SAME_PLACE


def read_result(result: object, problem: JudgedProblem) -> ForeignResult:
    """Return a result, in any form that ``judge`` takes, at the nodes of a problem."""
    if isinstance(result, str | Path):
        return _read(Path(result), problem)
    nodes, dim = problem.points.shape
    values = np.asarray(result)
    if values.dtype.kind not in "iuf" or values.shape not in ((nodes, dim), (nodes, 3)):
        raise MeshError(
            f"the result: real numbers of shape {(nodes, dim)} are expected, not of {values.shape}"
        )
    return ForeignResult(_finite(values[:, :dim].astype(np.float64)))


def _read(file: Path, problem: JudgedProblem) -> ForeignResult:
    """Return the result of a file; nodes are matched by their numbers, or without numbers by their
    positions.
    """
    kind = file.suffix.lower()
    if kind not in READERS:
        raise MeshError(f"{file}: results are read from {', '.join(READERS)}")
    printed = READERS[kind](file)
    dim = problem.arrays.dim
    positions = printed.points if printed.numbers is None else None
    if any(
        table is not None and table.shape[1] < dim for table in (printed.displacement, positions)
    ):
        raise MeshError(
            f"{file}: displacements and positions with {dim} components are expected, as of the "
            "problem"
        )
    rows = (
        _rows_at(file, printed, problem)
        if printed.numbers is None
        else _rows_of(file, printed, problem)
    )
    displacement = _finite(printed.displacement[rows, :dim])
    displacement[rows < 0] = np.nan
    return replace(
        printed, displacement=displacement, numbers=None, points=None, cells=(), name=file.name
    )


def _finite(values: Array) -> Array:
    """Return values with infinity in place of nan, because nan stands for missing values."""
    return np.where(np.isnan(values), np.inf, values)


def _rows_of(file: Path, table: ForeignResult, problem: JudgedProblem) -> Ints:
    """Return the row of the table for the number of each node, shape (n,), and -1 where it has
    none.
    """
    assert table.numbers is not None
    numbering = Numbering(table.numbers)
    again = numbering.again
    if (
        table.displacement[again] != table.displacement[numbering.rows(table.numbers[again])]
    ).any():
        raise MeshError(f"{file}: a node is there several times, with different displacements")
    rows = numbering.rows(problem.names)
    if table.points is not None:
        dim = min(problem.arrays.dim, table.points.shape[1])
        away = np.linalg.norm(table.points[rows, :dim] - problem.points[:, :dim], axis=1)
        if (wrong := (rows >= 0) & (away > JUDGED_SAME_PLACE * problem.arrays.diagonal)).any():
            node = problem.names[np.argmax(wrong)]
            raise MeshError(
                f"{file}: node {node} is at another place in the problem: it is the result of "
                "another mesh"
            )
    return rows


def _rows_at(file: Path, table: ForeignResult, problem: JudgedProblem) -> Ints:
    """Return the row of the table at the position of each node, shape (n,), and -1 where it has
    none.

    Nodes at one position are distinguished by the middles of their cells.
    """
    near = JUDGED_SAME_PLACE * problem.arrays.diagonal
    if table.points is None:
        raise MeshError(
            f"{file}: has neither numbers nor positions of nodes: give columns node, or x and y"
        )
    x = np.pad(problem.points, ((0, 0), (0, table.points.shape[1] - problem.arrays.dim)))
    nodes: Ints = np.arange(len(x))
    rows: Ints = np.arange(len(table.points))
    points = table.points
    if table.cells and all(cKDTree(places).query_pairs(near) for places in (points, x)):
        nodes, x = _in_cells(x, (problem.cells,))
        rows, points = _in_cells(points, table.cells)
    tree = cKDTree(points)
    away, nearest = tree.query(x)
    alike = DIGITS_OF_FILES * float(np.abs(table.displacement).max())
    for place, at_place in zip(plain(x), tree.query_ball_point(x, near), strict=True):
        if (
            len(at_place) > 1
            and not np.ptp(table.displacement[rows[at_place]], axis=0).max() <= alike
        ):
            cure = "give a table with a column node, the numbers of the problem"
            raise MeshError(
                f"{file}: several points are at {tuple(place[:3])}, with different displacements: "
                f"{cure}"
            )
    row_of_node = np.full(len(problem.points), -1)
    row_of_node[nodes[away <= near]] = rows[nearest[away <= near]]
    return row_of_node


def _in_cells(x: Array, tables: Sequence[Ints]) -> tuple[Ints, Array]:
    """Return the node of each corner of each cell, shape (k,), and its position followed by the
    middle of its cell, length, shape (k, 2 d).
    """
    middles = [np.broadcast_to(x[cells].mean(axis=1)[:, None], x[cells].shape) for cells in tables]
    numbers = np.concatenate([cells.ravel() for cells in tables])
    return numbers, np.hstack(
        (x[numbers], np.concatenate([middle.reshape(-1, x.shape[1]) for middle in middles]))
    )
