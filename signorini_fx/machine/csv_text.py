"""CSV files."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.machine.terminal import printable

# The columns of a table by name, arrays of one entry per row.
Table = Mapping[str, Any]


def write_csv(path: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Rows with a header; see ``write_columns``."""
    rows = list(rows)
    names = dict.fromkeys(chain.from_iterable(rows))
    write_columns(path, {name: [row.get(name, "") for row in rows] for name in names})


def write_columns(path: Path, columns: Table) -> None:
    """Columns of equal length; numbers with all digits, names without control characters.

    A table without rows becomes an empty file.
    """
    with path.open("w", newline="", encoding="utf-8", errors="backslashreplace") as file:
        if any(len(column) for column in columns.values()):
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*map(_cells, columns.values()), strict=True))


def _cells(column: Sequence[Any]) -> list[Any]:
    """The values of a column as they are written in a CSV file."""
    values = column.tolist() if isinstance(column, np.ndarray) else column
    values = [value.item() if isinstance(value, np.generic) else value for value in values]
    # A zero is added: no minus zero.
    return [printable(v) if isinstance(v, str) else v + 0.0 if isinstance(v, float) else v for v in values]
