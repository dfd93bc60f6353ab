"""CSV files, and names in them: a spreadsheet would compute what begins like a formula, wherever a name comes from."""

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
# What begins a formula in Excel, LibreOffice or Google Sheets; the apostrophe is their sign for text.
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")
_TEXT = "'"


def as_text(name: str) -> str:
    """A name without control characters, with an apostrophe where it would be a formula, or seems to have got one."""
    name = printable(name)
    return f"{_TEXT}{name}" if name.lstrip(_TEXT).startswith(_FORMULA) else name


def as_name(text: str) -> str:
    """The name that ``as_text`` was given."""
    return text[len(_TEXT) :] if text.startswith(_TEXT) and text.lstrip(_TEXT).startswith(_FORMULA) else text


def write_csv(path: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Rows with a header; see ``write_columns``."""
    rows = list(rows)
    names = dict.fromkeys(chain.from_iterable(rows))
    write_columns(path, {name: [row.get(name, "") for row in rows] for name in names})


def write_columns(path: Path, columns: Table) -> None:
    """Columns of equal length; numbers with all digits, and names as text that no spreadsheet takes for a formula.

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
    texts = {name: as_text(name) for name in {value for value in values if isinstance(value, str)}}
    # A zero is added: no minus zero.
    return [texts[v] if isinstance(v, str) else v + 0.0 if isinstance(v, float) else v for v in values]
