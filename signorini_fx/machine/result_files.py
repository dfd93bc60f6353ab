"""The files of a result folder: its summary, and its tables column by column."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from signorini_fx.errors import ResultError
from signorini_fx.machine.manifest import PART
from signorini_fx.machine.terminal import printable

if TYPE_CHECKING:
    from signorini_fx.arrays import Column, Plain

    pass

# Columns of our files that are text even if every entry looks like a number: a boundary may be
# called "1".
_TEXT_COLUMNS = frozenset({"against", "boundary", "friction", "name", "state", "status"})
# The columns of a table by name, arrays of one entry per row.
Cell = bool | int | float | str | None
Table = Mapping[str, npt.NDArray[np.generic] | Sequence[Cell]]


def folder_path(folder: object) -> Path:
    """Return the path of a result folder.

    Raises:
        TypeError: ``folder`` is not a path.
    """
    if isinstance(folder, str | os.PathLike):
        return Path(folder)
    raise TypeError(f"the path of a folder is expected, not {type(folder).__name__}")


def write_csv(path: Path, rows: Iterable[Mapping[str, Cell]]) -> None:
    """Write rows with a header as CSV; see ``write_columns``."""
    rows = list(rows)
    names = dict.fromkeys(chain.from_iterable(rows))
    write_columns(path, {name: [row.get(name, "") for row in rows] for name in names})


def write_columns(path: Path, columns: Table) -> None:
    """Write columns of equal length as CSV, numbers with all digits, text without control
    characters.

    A table without rows becomes an empty file.
    """
    with path.open("w", newline="", encoding="utf-8", errors="backslashreplace") as file:
        if any(len(column) for column in columns.values()):
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*map(_cells, columns.values()), strict=True))


def _cells(column: npt.NDArray[np.generic] | Sequence[Cell]) -> list[Plain]:
    """Return the values of a column as they are written in a CSV file."""
    values = column.tolist() if isinstance(column, np.ndarray) else column
    values = [value.item() if isinstance(value, np.generic) else value for value in values]
    # A zero is added: no minus zero.
    return [
        printable(v) if isinstance(v, str) else v + 0.0 if isinstance(v, float) else v
        for v in values
    ]


def read_csv(path: str | Path) -> dict[str, Column]:
    """Return the columns of a CSV file by their names.

    A column is of floats where every entry is a number (an empty one is nan), otherwise of strings.

    Raises:
        ValueError: a row has more or fewer entries than the header, or it is not a CSV file.
    """
    with Path(path).open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        rows = []
        try:
            names = reader.fieldnames or ()
            for row in reader:
                if None in row or None in row.values():
                    raise csv.Error("a row has more or fewer entries than there are names")
                rows.append(row)
        except csv.Error as error:
            raise ValueError(f"{path}, line {reader.line_num}: {error}") from None
    return {name: _column(name, [row[name] for row in rows]) for name in names}


def _column(name: str, entries: list[str]) -> Column:
    if name not in _TEXT_COLUMNS:
        try:
            return np.array(
                [float(entry) if entry.strip() else math.nan for entry in entries], dtype=np.float64
            )
        except ValueError:
            pass
    return np.array(entries, dtype=np.str_)


def read_summary(folder: Path) -> dict[str, Any]:
    """Return summary.json of a result folder.

    Raises:
        ResultError: the file does not exist, is not a summary, or is incomplete.
    """
    file = folder / "summary.json"
    if not os.path.isdir(folder):  # a name may be of any length
        reason = "is a file" if os.path.exists(folder) else "is not there"
        raise ResultError(
            f"{folder}: {reason}: give the folder that signorini-fx solve wrote, such as "
            "results/NAME"
        )
    if not file.is_file():
        begun = any((folder / name).exists() for name in (PART, "history.csv", "contact.csv"))
        reason = "is half written, it has no summary.json yet: let solve finish, or solve again"
        raise ResultError(
            f"{folder}: {reason if begun else 'is no result folder, it has no summary.json'}"
        )
    try:
        summary = json.loads(file.read_text(encoding="utf-8"))
    except RecursionError:
        raise ResultError(f"{file}: cannot be read: nested too deeply: solve again") from None
    except (OSError, ValueError) as error:
        raise ResultError(f"{file}: cannot be read: {error}: solve again") from None
    if not isinstance(summary, dict) or not {
        "status",
        "certificate",
        "scene",
        "linear_solves",
    } <= set(summary):
        raise ResultError(
            f"{file}: signorini-fx solve has not written it: give a folder that it wrote"
        )
    return {
        key: value if key == "scene" else _numbers(value, key) for key, value in summary.items()
    }


# Figures that are null only after a failed solve; null elsewhere means that there is no such
# figure.
_ALWAYS_NUMBERS = ("certificate", "moment")


def _numbers(value: Any, key: str) -> Any:
    """Return a value with nan for what a failed solve could not compute: null in a list, or under
    the keys ``_ALWAYS_NUMBERS``.
    """
    if isinstance(value, dict):
        return {
            name: _numbers(item, key if key in _ALWAYS_NUMBERS else name)
            for name, item in value.items()
        }
    if isinstance(value, list):
        return [math.nan if item is None else _numbers(item, key) for item in value]
    return math.nan if value is None and key in _ALWAYS_NUMBERS else value
