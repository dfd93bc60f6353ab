"""A result folder in Python, without FEniCSx: the summary as a pydantic model, and the tables."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from signorini_fx.errors import ResultError
from signorini_fx.machine.result_files import read_csv, read_summary
from signorini_fx.quantities.summary import Summary


@dataclass(frozen=True)
class Results:
    """What ``solve`` has written.

    Attributes:
        path: of the folder.
        summary: summary.json: each key is an attribute, rows of lists too; None: there is no such key.  Quantities that
            are not installed are there as they are in the file.
    """

    path: Path
    summary: Summary

    @property
    def tables(self) -> tuple[str, ...]:
        """The names of the tables, such as ``contact``."""
        return tuple(sorted(file.stem for file in self.path.glob("*.csv")))

    def table(self, name: str) -> dict[str, Any]:
        """The columns of a table as arrays.

        Raises:
            ResultError: there is no such table, or it cannot be read.
        """
        if name not in self.tables:
            raise ResultError(f"{self.path}: has no table {name!r}; there are: {', '.join(self.tables)}")
        try:
            return read_csv(self.path / f"{name}.csv")
        except (OSError, ValueError) as error:
            raise ResultError(f"{self.path}: {name}.csv cannot be read: {error}") from None


def read_results(folder: str | os.PathLike[str]) -> Results:
    """Read a result folder.

    Raises:
        ResultError: it is none, or its summary is not as ``solve`` writes it.
    """
    path = Path(folder)
    summary = read_summary(path)
    try:
        return Results(path, Summary.model_validate(summary))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise ResultError(
            f"{path}: summary.json is not what solve writes: {key}: {first['msg']}: solve again"
        ) from None
