"""The content of a mesh file as plain arrays, and how it gets from one process to another."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import IO, Any

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
        corners: of a CAD drawing: surface -> its vertices, by which names of the file can be assigned.
    """

    points: npt.NDArray[np.float64]
    blocks: list[tuple[str, _Ints]]
    sets: dict[str, list[_Ints]] = field(default_factory=dict)
    node_sets: dict[str, _Ints] = field(default_factory=dict)
    data: dict[str, list[_Ints]] = field(default_factory=dict)
    corners: dict[int, list[list[float]]] = field(default_factory=dict)

    def save(self, stream: IO[bytes]) -> None:
        """Write everything; ``load`` reads it again."""
        arrays: dict[str, npt.NDArray[Any]] = {"points": self.points}

        def stored(values: npt.NDArray[Any]) -> str:
            key = f"array_{len(arrays)}"
            arrays[key] = values
            return key

        header = {
            "blocks": [(kind, stored(nodes)) for kind, nodes in self.blocks],
            "sets": {name: [stored(rows) for rows in tables] for name, tables in self.sets.items()},
            "node_sets": {name: stored(nodes) for name, nodes in self.node_sets.items()},
            "data": {name: [stored(values) for values in tables] for name, tables in self.data.items()},
            "corners": self.corners,
        }
        everything: dict[str, Any] = {"header": json.dumps(header), **arrays}
        np.savez(stream, **everything)

    @classmethod
    def load(cls, stream: IO[bytes]) -> RawMesh:
        """What ``save`` has written."""
        with np.load(stream, allow_pickle=False) as arrays:
            header = json.loads(str(arrays["header"]))
            return cls(
                arrays["points"],
                [(kind, arrays[key]) for kind, key in header["blocks"]],
                {name: [arrays[key] for key in keys] for name, keys in header["sets"].items()},
                {name: arrays[key] for name, key in header["node_sets"].items()},
                {name: [arrays[key] for key in keys] for name, keys in header["data"].items()},
                {int(tag): places for tag, places in header["corners"].items()},
            )


def increases(numbers: _Ints) -> bool:
    """Whether each number is larger than the one before it, so that none occurs twice and they are sorted."""
    return bool((numbers[1:] > numbers[:-1]).all())


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
