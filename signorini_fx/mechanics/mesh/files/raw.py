"""The content of a mesh file as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

_Ints = npt.NDArray[np.int64]


@dataclass
class RawMesh:
    """The content of a file in meshio's layout: blocks of elements of one kind, sets and data block by block.

    Attributes:
        points: positions, shape (n, 2) or (n, 3).
        blocks: (kind in meshio's words, nodes of shape (elements, nodes of each)).
        sets: name -> for each block the numbers of its elements that belong.
        node_sets: name -> numbers of points.
        data: name -> for each block the whole number of each element, shape (elements,), or where an element may have
            several its numbers, shape (elements, k); below 0 is none.
    """

    points: npt.NDArray[np.float64]
    blocks: list[tuple[str, _Ints]]
    sets: dict[str, list[_Ints]] = field(default_factory=dict)
    node_sets: dict[str, _Ints] = field(default_factory=dict)
    data: dict[str, list[_Ints]] = field(default_factory=dict)


class Numbering:
    """Numbers of nodes or elements, and the row of each.

    Attributes:
        numbers: in the order of the rows.
        again: the rows of numbers that an earlier row has.
    """

    def __init__(self, numbers: _Ints) -> None:
        self.numbers = numbers
        self._order = np.argsort(numbers, kind="stable")
        self._sorted = numbers[self._order]
        self.again = self._order[1:][self._sorted[1:] == self._sorted[:-1]]

    def rows(self, wanted: _Ints) -> _Ints:
        """The row of each number, -1: it is none of these."""
        if not self.numbers.size:
            return np.full(len(wanted), -1)
        places = np.minimum(np.searchsorted(self._sorted, wanted), len(self.numbers) - 1)
        return np.where(self._sorted[places] == wanted, self._order[places], -1)


def row_keys(rows: _Ints) -> _Ints:
    """One number for each row: two rows have the same if they hold the same numbers, -1 or more, in any order."""
    ordered = 1 + (
        np.column_stack((np.minimum(*rows.T), np.maximum(*rows.T))) if rows.shape[1] == 2 else np.sort(rows, axis=1)
    )
    largest = int(ordered.max(initial=0)) + 1
    keys: _Ints = ordered[:, 0]
    for column in ordered.T[1:]:  # renumbered each time, so that the product of two counts does not overflow
        keys = np.unique(keys * largest + column, return_inverse=True)[1].reshape(-1)
    return keys


def rows_of(wanted: _Ints, table: _Ints) -> _Ints:
    """Where each row of nodes is in a table of distinct rows, in any order of nodes; -1: nowhere."""
    keys = row_keys(np.concatenate((table, wanted)))
    row_numbers = np.full(int(keys.max(initial=0)) + 1, -1)
    row_numbers[keys[: len(table)]] = np.arange(len(table))
    return row_numbers[keys[len(table) :]]
