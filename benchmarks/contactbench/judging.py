"""Judges results of any program: a CSV with the columns quantity and value."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from .problem import Problem, Quantity

COLUMNS = ("quantity", "value")


class ResultError(ValueError):
    """A file of results that cannot be read: file, line, and what to do."""


class Result(NamedTuple):
    """One row of a file: the name of a quantity, and its value in the units of the problem."""

    quantity: str
    value: float


@dataclass(frozen=True)
class Verdict:
    """What a reference says of a value.

    Attributes:
        result: the row.
        quantity: with its reference.
        error: distance from the reference over the scale; zero within an interval or between two
        values.
        meets: whether the error is at most the tolerance.
        text: one sentence.
    """

    result: Result
    quantity: Quantity
    error: float
    meets: bool
    text: str


def read_results(path: Path, problem: Problem) -> list[Result]:
    """The rows of a file.

    Raises:
        ResultError: it cannot be read, has no quantity of the problem, or a row is wrong.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ResultError(f"{path}: cannot be read as text: {error}") from None
    rows = csv.reader(text.splitlines(), skipinitialspace=True)
    try:
        return _rows(path.name, rows, problem)
    except csv.Error as error:
        raise ResultError(f"{path.name}, line {rows.line_num}: {error}") from None


def _rows(name: str, rows: csv._reader, problem: Problem) -> list[Result]:  # type: ignore[name-defined]
    head = [cell.strip().lower() for cell in next(rows, [])]
    if any(head.count(column) != 1 for column in COLUMNS):
        raise ResultError(
            f"{name}, line 1: the columns must be {','.join(COLUMNS)}, not "
            f"{','.join(head) or 'nothing'}"
        )
    known, found = {quantity.name for quantity in problem.quantities}, list[Result]()
    for row in rows:
        where = f"{name}, line {rows.line_num}"
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(head):
            raise ResultError(f"{where}: {len(row)} cells instead of {len(head)}")
        quantity, value = (row[head.index(column)].strip() for column in COLUMNS)
        if quantity not in known:
            names = ", ".join(sorted(known))
            raise ResultError(
                f"{where}: {problem.name} has no quantity {quantity!r}: it has {names}"
            )
        try:
            number = float(value)
        except ValueError:
            raise ResultError(f"{where}: value {value!r} is not a number") from None
        if not math.isfinite(number):
            raise ResultError(f"{where}: value {value!r} is not finite")
        found.append(Result(quantity, number))
    if not found:
        raise ResultError(f"{name}: there is no row with a value")
    return found


def distance(quantity: Quantity, value: float) -> float:
    """How far a value is from the reference, over the scale of the quantity."""
    numbers = quantity.numbers
    if quantity.kind in ("interval", "values"):
        return max(min(numbers) - value, value - max(numbers), 0.0) / quantity.scale
    return abs(value - numbers[0]) / quantity.scale


def judge(problem: Problem, results: list[Result]) -> list[Verdict]:
    """A verdict for each row."""
    found = []
    for result in results:
        quantity = problem.quantity(result.quantity)
        error = distance(quantity, result.value)
        meets = error <= quantity.tolerance
        found.append(
            Verdict(result, quantity, error, meets, _text(quantity, result.value, error, meets))
        )
    return found


def _text(quantity: Quantity, value: float, error: float, meets: bool) -> str:
    numbers = ", ".join(f"{number:.7g}" for number in quantity.numbers)
    reference = {
        "exact": f"the exact value {numbers}",
        "interval": f"the certified interval [{numbers}]",
        "values": f"two independent values, {numbers}",
    }[quantity.kind]
    place = f"{100 * error:.3g} % from" if error or quantity.kind == "exact" else "within"
    limit = f"{100 * quantity.tolerance:.3g} %"
    return f"{value:.7g} is {place} {reference}: {'meets' if meets else 'MISSES'} {limit}"


def without_value(problem: Problem, results: list[Result]) -> list[str]:
    """Quantities of the problem that no row has."""
    there = {result.quantity for result in results}
    return [quantity.name for quantity in problem.quantities if quantity.name not in there]
