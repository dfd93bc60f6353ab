"""Nodes and faces to which a keyword of an input file gives the same, and bodies, which share no node."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from signorini_fx.addons.decks.text import ROTATIONS, DeckBlock, components, number_of, real
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.cells import Ints, dimension

Words = tuple[str, ...]


@dataclass(frozen=True)
class Group:
    """Nodes or faces to which a keyword gives the same, one by one.

    Attributes:
        name: of the set that they make.
        words: what is given, as in a row for a set.
        nodes: their numbers in the file; of faces none.
        values: of each node or face what is given there.
    """

    name: str
    words: Words
    nodes: tuple[int, ...]
    values: tuple[float, ...]


def given_alike(
    block: DeckBlock, nodes_of: Callable[[str], Ints], elements_of: Callable[[str], Ints]
) -> list[tuple[Words, dict[Any, float]]]:
    """The single nodes of *BOUNDARY, all nodes of *CLOAD and the faces of *DLOAD, by what they are given.

    Args:
        block: the keyword.
        nodes_of: the nodes of a set, or the one with a number.
        elements_of: likewise the elements.
    """
    groups: dict[Words, dict[Any, float]] = {}
    pressures: dict[Any, float] = {}  # of a face that is given several, their sum
    for target, *words in block.rows:
        match block.keyword:
            case "BOUNDARY" if (number := number_of(target)) is not None and "FIXED" not in block.parameters:
                for component, value in components(words).items():
                    if component not in ROTATIONS:
                        groups.setdefault((str(component), "", repr(value)), {})[number] = value
            case "CLOAD":
                value = real((*words, "0")[1])
                forces = groups.setdefault((words[0], ""), {})
                for node in plain(nodes_of(target)):
                    forces[node] = forces.get(node, 0.0) + value
            case "DLOAD" if words and re.fullmatch(r"P\d", words[0].upper()):
                value = real((*words, "0")[1])
                for element in plain(elements_of(target)):
                    face = element, int(words[0][1:])
                    pressures[face] = pressures.get(face, 0.0) + value
    for face, value in pressures.items():
        groups.setdefault(("P", repr(value)), {})[face] = value
    return list(groups.items())


def bodies(
    blocks: Sequence[tuple[str, Ints]], sets: dict[str, list[Ints]], free: Iterator[str]
) -> dict[str, list[Ints]]:
    """The bodies of a file, which share no node; nothing, if there is only one.

    Args:
        blocks: (kind, nodes of each element), as in ``RawMesh``.
        sets: of the file, for each block the rows of its elements.
        free: names that the file does not have.

    Returns:
        Name -> for each block the rows of its elements: that of a set of the file with these elements, or else one of
        the free names.
    """
    dim = max((dimension(kind) for kind, _ in blocks), default=0)
    solid = [number for number, (kind, _) in enumerate(blocks) if dimension(kind) == dim]
    starts = np.cumsum([0, *(len(blocks[number][1]) for number in solid)])
    nodes = [blocks[number][1] for number in solid]
    rows = np.concatenate(
        [np.repeat(start + np.arange(len(table)), table.shape[1]) for start, table in zip(starts, nodes, strict=False)]
    )
    columns = starts[-1] + np.concatenate([table.ravel() for table in nodes])
    labels = _components(rows, columns, int(columns.max()) + 1)[: starts[-1]]
    _, first = np.unique(labels, return_index=True)
    if len(first) < 2:
        return {}
    alike = {_key(listed): name for name, listed in reversed(sets.items())}
    groups_found: dict[str, list[Ints]] = {}
    for label in labels[np.sort(first)]:
        listed: list[Ints] = [np.empty(0, dtype=np.int64)] * len(blocks)
        for number, start, table in zip(solid, starts, nodes, strict=False):
            listed[number] = np.flatnonzero(labels[start : start + len(table)] == label).astype(np.int64)
        groups_found[alike.get(_key(listed)) or next(free)] = listed
    return groups_found


def _components(rows: Ints, columns: Ints, count: int) -> Ints:
    """The number of the connected part of each vertex of a graph with these edges."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _key(rows: Sequence[Ints]) -> tuple[bytes, ...]:
    """The same for the same rows, in any order."""
    return tuple(np.sort(part).tobytes() for part in rows)
