"""Vectors at single nodes, which a table names by their places; a body where several have a node at one place."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from signorini_fx.errors import SceneError

Array = npt.NDArray[np.float64]
# A file of more rows is refused: its nodes are looked for one by one on every rank.
_MOST_ROWS = 2_000_000


@dataclass(frozen=True)
class NodalTable:
    """Vectors at nodes, n of them.

    Attributes:
        points: where the nodes are, length, shape (n, d).
        regions: the part of the body that each node belongs to; empty: any.
        vectors: at them, shape (n, d).
        groups: a number for each row, such as that of the link it belongs to, shape (n,); zeros where there is none.
    """

    points: Array
    regions: tuple[str, ...]
    vectors: Array
    groups: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.points)


def read_nodal_table(path: str, file: Path, prefix: str, group: str | None = None) -> NodalTable:
    """The table of a .csv with the columns x, y, in space z, those of a vector, and ``region``, which may be missing.

    Args:
        path: of the entry that has the file, for errors.
        file: the table.
        prefix: of the columns of the vector: ``f`` stands for fx, fy and, in space, fz.
        group: the column of whole numbers that say which rows belong together; None: there is none.

    Raises:
        SceneError: the file cannot be read, or is no such table.
    """
    try:
        changed = file.stat().st_mtime_ns
        return _table(file, prefix, group, changed)
    except OSError as error:
        raise SceneError([(path, f"{file}: cannot be read: {error.strerror}")]) from None
    except (ValueError, UnicodeDecodeError, csv.Error) as error:
        raise SceneError([(path, f"{file}: {error}")]) from None


@lru_cache(maxsize=8)
def _table(file: Path, prefix: str, group: str | None, _changed: int) -> NodalTable:
    with file.open(encoding="utf-8-sig", newline="") as stream:
        head, *rows = [row for row in csv.reader(stream) if row] or [[]]
    names = [name.strip() for name in head]
    axes = [axis for axis in "xyz" if axis in names]
    columns = [*axes, *(f"{prefix}{axis}" for axis in axes), *([group] if group else [])]
    if axes not in (["x", "y"], ["x", "y", "z"]) or not {*columns} <= {*names} or len({*names}) < len(names):
        needed = f"x, y, {prefix}x, {prefix}y, in space z and {prefix}z"
        raise ValueError(f"it has the columns {', '.join(names)}; it needs {needed}{f', and {group}' if group else ''}")
    if not rows or len(rows) > _MOST_ROWS:
        raise ValueError(f"it has {len(rows)} rows; from 1 to {_MOST_ROWS:,} are expected")
    for number, row in enumerate(rows, 2):
        if len(row) != len(names):
            raise ValueError(f"row {number} has {len(row)} entries for {len(names)} columns")
    by_name = dict(zip(names, zip(*rows, strict=True), strict=True))
    try:
        values = np.array([by_name[name] for name in columns], dtype=np.float64).T
    except ValueError:
        raise ValueError("it has an entry that is no number") from None
    if not np.isfinite(values).all():
        raise ValueError("it has numbers that are not finite")
    dim = len(axes)
    regions = tuple(word.strip() for word in by_name.get("region", ("",) * len(rows)))
    groups = values[:, -1] if group else np.zeros(len(rows))
    if (groups != np.round(groups)).any():
        raise ValueError(f"the column {group} has an entry that is no whole number")
    return NodalTable(values[:, :dim], regions, values[:, dim : 2 * dim], groups.astype(np.int64))
