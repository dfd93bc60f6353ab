"""Nodes and elements of an Abaqus input file, which have any numbers, and their rows in arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, DeckError
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.raw import increases
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

Truths = npt.NDArray[np.bool_]
# A table of all numbers that are possible is made if it has at most so many entries for each that there is.
_SPARSEST = 16


@dataclass(frozen=True, eq=False)
class Numbering(Mapping[int, int]):
    """Distinct numbers and the row of each.

    Attributes:
        numbers: in the order of the rows.
    """

    numbers: Ints

    @cached_property
    def _table(self) -> tuple[int, Ints] | None:
        """The smallest number, and the row of each one from there on, -1: it is none; None: there would be too many."""
        if not self.numbers.size:
            return 0, np.full(1, -1)
        least, largest = int(self.numbers.min()), int(self.numbers.max())
        if largest - least > _SPARSEST * self.numbers.size:
            return None
        table = np.full(largest - least + 1, -1)
        table[self.numbers - least] = np.arange(self.numbers.size)
        return least, table

    @cached_property
    def _sorted(self) -> tuple[Ints, Ints]:
        order = np.argsort(self.numbers, kind="stable")
        return order, self.numbers[order]

    def rows(self, wanted: Ints) -> Ints:
        """The row of each number, -1: it is none of these."""
        if self._table is not None:
            least, table = self._table
            if wanted.size and least <= wanted.min() and wanted.max() < least + len(table):
                return table[wanted - least]
            inside = (wanted >= least) & (wanted < least + len(table))
            return np.where(inside, table[np.where(inside, wanted - least, 0)], -1)
        order, numbers = self._sorted
        places = np.minimum(np.searchsorted(numbers, wanted), len(numbers) - 1)
        return np.where(numbers[places] == wanted, order[places], -1)

    def __getitem__(self, number: int) -> int:
        row = int(self.rows(np.array([number]))[0])
        if row < 0:
            raise KeyError(number)
        return row

    def __iter__(self) -> Iterator[int]:
        return iter(plain(self.numbers))

    def __len__(self) -> int:
        return len(self.numbers)


def _check_once(numbers: Ints, of: Callable[[int], DeckBlock], word: str) -> None:
    """Refuse a number that is defined twice.

    Args:
        numbers: in the order of the file.
        of: the keyword that defines the one of a row.
        word: what has the number.

    Raises:
        DeckError: with the keyword that defines it again.
    """
    if increases(numbers) or np.unique(numbers).size == numbers.size:
        return
    first = np.zeros(numbers.size, dtype=bool)
    first[np.unique(numbers, return_index=True)[1]] = True
    row = int(np.argmin(first))
    raise DeckError(of(row), f"{word} {numbers[row]} is defined twice")


@dataclass(frozen=True, eq=False)
class NumberedNodes:
    """The nodes of a file.

    Attributes:
        rows: of each number.
        points: positions, shape (n, 2) or (n, 3).
    """

    rows: Numbering
    points: Floats

    @classmethod
    def of(cls, parts: Sequence[tuple[DeckBlock, Ints, Floats]]) -> NumberedNodes:
        """Those of some keywords, each with its numbers and coordinates; of those that a line lacks zero is taken.

        Raises:
            DeckError: a number is defined twice.
        """
        numbers = np.concatenate([np.empty(0, dtype=np.int64), *(listed for _, listed, _ in parts)])
        ends = np.cumsum([len(listed) for _, listed, _ in parts])
        _check_once(numbers, lambda row: parts[int(np.searchsorted(ends, row, side="right"))][0], "node")
        points = np.zeros((len(numbers), max(2, *(x.shape[1] for _, _, x in parts)) if parts else 2))
        for end, (_, _, x) in zip(ends, parts, strict=True):
            points[end - len(x) : end, : x.shape[1]] = x
        return cls(Numbering(numbers), points)


@dataclass(frozen=True, eq=False)
class NumberedElements:
    """The elements of a file.

    Attributes:
        rows: of each number among all elements, in the order of the file.
        kinds: in meshio's words, in the order in which they occur.
        kind: of each element its place in ``kinds``, shape (n,).
        row: its row among the elements of its kind, shape (n,).
        nodes: kind -> numbers of the nodes of each element, shape (m, k).
        defined: of each element the place of its keyword in ``blocks``, shape (n,).
        blocks: keywords.
    """

    rows: Numbering
    kinds: list[str]
    kind: Ints
    row: Ints
    nodes: dict[str, Ints]
    defined: Ints
    blocks: list[DeckBlock] = field(default_factory=list)

    @classmethod
    def of(cls, parts: Sequence[tuple[DeckBlock, str, Ints]]) -> NumberedElements:
        """Those of some keywords, each with their kind and a table of the number of each element and of its nodes.

        Raises:
            DeckError: a number is defined twice.
        """
        parts = [part for part in parts if len(part[2])]
        kinds = list(dict.fromkeys(kind for _, kind, _ in parts))
        sizes = [len(table) for _, _, table in parts]
        blocks = [block for block, _, _ in parts]
        no_numbers = np.empty(0, dtype=np.int64)
        numbers = np.concatenate([no_numbers, *(table[:, 0] for _, _, table in parts)])
        kind = np.repeat(np.array([kinds.index(kind) for _, kind, _ in parts], dtype=np.int64), sizes)
        defined = np.repeat(np.arange(len(parts)), sizes)
        _check_once(numbers, lambda row: blocks[int(defined[row])], "element")
        nodes = {name: np.concatenate([table[:, 1:] for _, other, table in parts if other == name]) for name in kinds}
        return cls(Numbering(numbers), kinds, kind, _counted(kind, len(kinds)), nodes, defined, blocks)

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def solid(self) -> Truths:
        """Which ones are no lines, shape (n,)."""
        return np.array([not kind.startswith("line") for kind in self.kinds], dtype=bool)[self.kind]

    def without(self, removed: Ints) -> NumberedElements:
        """The others."""
        remaining = ~np.isin(self.rows.numbers, removed)
        nodes = {name: listed[remaining[self.kind == k]] for k, (name, listed) in enumerate(self.nodes.items())}
        kind = self.kind[remaining]
        return replace(
            self,
            rows=Numbering(self.rows.numbers[remaining]),
            kind=kind,
            row=_counted(kind, len(self.kinds)),
            nodes=nodes,
            defined=self.defined[remaining],
        )

    def defining(self, number: int) -> DeckBlock:
        """The keyword that defines one."""
        return self.blocks[int(self.defined[self.rows[number]])]

    def of_kind(self, name: str, row: int) -> int:
        """The number of one by its row among those of its kind."""
        return int(self.rows.numbers[self.kind == self.kinds.index(name)][row])

    def nodes_of(self, rows: Ints) -> dict[int, list[int]]:
        """The numbers of some, by their rows, and of their nodes."""
        return {int(self.rows.numbers[k]): plain(self.nodes[self.kinds[int(self.kind[k])]][self.row[k]]) for k in rows}


def _counted(kind: Ints, count: int) -> Ints:
    """How many of the same kind are before each."""
    row = np.empty(len(kind), dtype=np.int64)
    for k in range(count):
        of_kind = kind == k
        row[of_kind] = np.arange(np.count_nonzero(of_kind))
    return row


def distinct(numbers: Ints) -> Ints:
    """Numbers without those that occur before."""
    return numbers if increases(numbers) else numbers[np.sort(np.unique(numbers, return_index=True)[1])]
