"""Groups of nodes, faces and elements of an Abaqus input file that get names: what single nodes and faces are given
alike, and the bodies that share no node.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from signorini_fx.mechanics.mesh.files.abaqus_blocks import ROTATIONS, DeckBlock, components, real
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.cells import dimension
from signorini_fx.mechanics.mesh.files.shape import Ints

Words = tuple[str, ...]
Members = dict[Any, float]


@dataclass(frozen=True)
class Group:
    """Nodes or faces, given one by one, for which a keyword says the same.

    Attributes:
        name: of the set that they make.
        words: what is said, as a row says it of a set by its name.
        nodes: their numbers in the file; of faces none.
        values: of each node or face what is given there.
    """

    name: str
    words: Words
    nodes: tuple[int, ...]
    values: tuple[float, ...]


def single(word: str) -> int | None:
    """The number of a node or element; None: it is none, as 1.2, or O.5 where no instance is called O."""
    return int(word) if word.isascii() and word.isdigit() else None


def agreeing(
    block: DeckBlock, nodes_of: Callable[[str], list[int]], elements_of: Callable[[str], list[int]], *, apart: bool
) -> list[tuple[Words, Members]]:
    """What a keyword says of nodes and faces, one by one.

    Args:
        block: *BOUNDARY, *CLOAD or *DLOAD.
        nodes_of: the nodes of a set.
        elements_of: the elements of a set.
        apart: whether forces that pull are told from those that push; not so where both belong to one face, because
            its elements have no nodes in the middle of faces.
    """
    groups: dict[Words, Members] = {}
    pressures: Members = {}  # of a face that is given several, their sum
    for target, *words in block.rows:
        number = single(target)
        match block.keyword:
            case "BOUNDARY" if number is not None:
                for component, value in components(words).items():
                    if component not in ROTATIONS:
                        groups.setdefault((str(component), "", repr(value)), {})[number] = value
            case "CLOAD":
                value = real((*words, "0")[1])
                forces = groups.setdefault((words[0], "-" if value < 0 and apart else ""), {})
                for node in nodes_of(target) if number is None else [number]:
                    forces[node] = forces.get(node, 0.0) + value
            case "DLOAD" if words and re.fullmatch(r"P\d", words[0].upper()):
                members = elements_of(target) if number is None else [number]
                value = real((*words, "0")[1])
                for element in members:
                    face = element, int(words[0][1:])
                    pressures[face] = pressures.get(face, 0.0) + value
    for face, value in pressures.items():
        groups.setdefault(("P", repr(value)), {})[face] = value
    return list(groups.items())


@dataclass(frozen=True)
class Neighbours:
    """Which elements some nodes have: those that share one are joined.

    Attributes:
        elements: node -> numbers of its elements.
    """

    elements: dict[int, list[int]]

    @classmethod
    def of(cls, nodes: Iterable[int], tables: Iterable[Sequence[Sequence[int]]]) -> Neighbours:
        """Those of some nodes in tables of the nodes of each element."""
        elements: dict[int, list[int]] = {node: [] for node in nodes}
        for number, element_nodes in enumerate(itertools.chain.from_iterable(tables)):
            for node in element_nodes:
                if node in elements:
                    elements[node].append(number)
        return cls(elements)

    def pieces(self, members: Members) -> list[Members]:
        """Nodes in groups that are not joined: forces on several bodies, or on several sides of one, are several."""
        around: dict[int, list[int]] = {}
        for node in members:
            for element in self.elements[node]:
                around.setdefault(element, []).append(node)
        piece: dict[int, int] = {}
        for start in members:
            if start in piece:
                continue
            waiting, number = [start], len(piece)
            while waiting:
                node = waiting.pop()
                if node in piece:
                    continue
                piece[node] = number
                for element in self.elements[node]:
                    waiting += around.pop(element, ())
        pieces: dict[int, Members] = {}
        for node, value in members.items():
            pieces.setdefault(piece[node], {})[node] = value
        return list(pieces.values())


@dataclass
class Groups:
    """All groups of a file, which get names when everything else has been read."""

    said: list[tuple[DeckBlock, Words, Members]]

    def named(
        self,
        elements: Sequence[Ints],
        node_sets: dict[str, Ints],
        surfaces: dict[str, list[tuple[int, int]]],
        free: Callable[[str], str | None],
    ) -> dict[int, list[Group]]:
        """The groups by the numbers of their keywords; each is a set that the file names, or one that is added.

        Args:
            elements: tables of nodes of each element.
            node_sets: of the file.
            surfaces: of the file, by their faces.
            free: takes a name and returns it, or None where the file has it.
        """
        if not self.said:
            return {}
        labels = {"BOUNDARY": "support", "CLOAD": "force", "DLOAD": "pressure"}
        names = {
            label: filter(None, map(free, map(f"{label}_{{}}".format, itertools.count(1)))) for label in labels.values()
        }
        set_names: dict[frozenset[Any], str] = {frozenset(plain(nodes)): name for name, nodes in node_sets.items()}
        set_names |= {frozenset(faces): name for name, faces in surfaces.items()}
        forces = [members for block, _, members in self.said if block.keyword == "CLOAD" and len(members) > 1]
        tables = [plain(nodes) for nodes in elements] if forces else []
        joined = Neighbours.of(itertools.chain.from_iterable(forces), tables)
        groups: dict[int, list[Group]] = {}
        for block, words, all_members in self.said:
            for members in (
                joined.pieces(all_members) if block.keyword == "CLOAD" and len(all_members) > 1 else [all_members]
            ):
                key = frozenset(members)
                if (name := set_names.get(key)) is None:
                    name = set_names[key] = next(names[labels[block.keyword]])
                    if block.keyword == "DLOAD":
                        surfaces[name] = list(members)
                    elif len(members) > 1:  # one node is no boundary
                        node_sets[name] = np.array(list(members), dtype=np.int64)
                nodes = () if block.keyword == "DLOAD" else tuple(members)
                groups.setdefault(block.number, []).append(Group(name, words, nodes, tuple(members.values())))
        return groups


def bodies(
    blocks: Sequence[tuple[str, Ints]], sets: dict[str, list[Ints]], free: Callable[[str], str | None]
) -> dict[str, list[Ints]]:
    """The bodies of a file, which share no node; nothing, if there is only one.

    Args:
        blocks: (kind, nodes of each element), as in ``RawMesh``.
        sets: of the file, for each block the rows of its elements.
        free: takes a name and returns it, or None where the file has it.

    Returns:
        Name -> for each block the rows of its elements: that of a set of the file with these elements, or else
        ``body_1`` and so on.
    """
    dim = max((dimension(kind) for kind, _ in blocks), default=0)
    solid = [number for number, (kind, _) in enumerate(blocks) if dimension(kind) == dim]
    joined = _joined([blocks[number][1] for number in solid])
    pieces = dict(zip(solid, joined, strict=True))
    of_elements = np.concatenate([np.empty(0, dtype=np.int64), *pieces.values()])
    first = np.full(int(of_elements.max(initial=-1)) + 1, of_elements.size)
    first[of_elements[::-1]] = np.arange(of_elements.size)[::-1]
    count = np.count_nonzero(first < of_elements.size)
    if count < 2:
        return {}
    place = np.argsort(np.argsort(first, kind="stable"))  # of a body in the order of their first elements
    names: Iterator[str] = filter(None, map(free, map("body_{}".format, itertools.count(1))))
    no_rows = np.empty(0, dtype=np.int64)
    # Of bodies by their places the rows in each block, which are sorted by body.
    sorted_rows = {k: np.argsort(place[piece], kind="stable") for k, piece in pieces.items()}
    parts = {
        k: np.split(rows, np.searchsorted(place[pieces[k]][rows], np.arange(1, count)))
        for k, rows in sorted_rows.items()
    }
    found = [[parts[k][body] if k in parts else no_rows for k in range(len(blocks))] for body in range(count)]
    sizes = {tuple(map(len, rows)) for rows in found}
    alike = {_key(listed): name for name, listed in reversed(sets.items()) if tuple(map(len, listed)) in sizes}
    return {alike.get(_key(rows)) or next(names): rows for rows in found}


def _joined(tables: Sequence[Ints]) -> list[Ints]:
    """The number of the body of each element, where bodies share no node.

    Args:
        tables: of the nodes of elements, those of one kind each, shape (m, k).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # Most elements have their first node from the one before them.  Runs of such elements are tied to one another by
    # the nodes that they share, and there are far fewer of them.
    columns = [np.ascontiguousarray(nodes.T) for nodes in tables]
    runs: list[Ints] = []
    count = 0
    for nodes in columns:
        begins = np.ones(nodes.shape[1], dtype=bool)
        for earlier in nodes:
            begins[1:] &= nodes[0, 1:] != earlier[:-1]
        runs.append(count + np.cumsum(begins) - 1)
        count += np.count_nonzero(begins)
    owner = np.zeros(max((int(nodes.max(initial=-1)) for nodes in columns), default=-1) + 1, dtype=np.int64)
    for nodes, run in zip(columns, runs, strict=True):
        owner[nodes] = run  # the last one of those that have the node
    ties = [np.empty(0, dtype=np.int64)]
    for nodes, run in zip(columns, runs, strict=True):
        for column in nodes:
            owners = owner[column]
            shared = np.flatnonzero(owners != run)
            ties.append(run[shared] * count + owners[shared])
    pairs = np.divmod(np.unique(np.concatenate(ties)), max(count, 1))
    graph = coo_array((np.ones(len(pairs[0]), dtype=bool), pairs), shape=(count, count))
    labels = connected_components(graph, directed=False)[1]
    return [labels[run] for run in runs]


def _key(rows: Sequence[Ints]) -> tuple[bytes, ...]:
    """The same for the same rows, in any order."""
    return tuple(np.sort(part).tobytes() for part in rows)
