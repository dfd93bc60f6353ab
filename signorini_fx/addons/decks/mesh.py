"""The mesh of an Abaqus input file: nodes, elements, and the sets and surfaces with names.

The single nodes and faces of supports, forces and pressures become named boundaries, so that a
scene can refer to them.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.addons.decks.assembly import assembled
from signorini_fx.addons.decks.text import (
    ROTATIONS,
    DeckBlock,
    DeckError,
    check_rows,
    components,
    coordinates,
    mesh_errors,
    number_of,
    read_keywords,
    real,
)
from signorini_fx.arrays import Array, Ints
from signorini_fx.mechanics.mesh.files.arrays import Numbering, RawMesh, plain
from signorini_fx.mechanics.mesh.files.cells import dimension

_SOLID = re.compile(r"(?:C3D|DC3D|AC3D)(\d+)")
_PLANE = re.compile(r"(?:CPEG|CPE|CPS|CAX|DC2D|STRI|M3D|SFM3D|R3D|DS|S)([34689])")
_LINE = re.compile(r"(?:T2D|T3D|R2D|B2|B3|DC1D)([123])")
_SOLID_KINDS = dict(
    zip(
        (4, 5, 6, 8, 10, 15, 20),
        ["tetra", "pyramid", "wedge", "hexahedron", "tetra10", "wedge15", "hexahedron20"],
        strict=True,
    )
)
_PLANE_KINDS = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
# Sides of shells and beams, which a body does not have.
_OTHER_FACE = re.compile(r"SPOS|SNEG|EDGE\d*|END\d")
# Points, springs, dampers, couplings and networks of fluid are no part of the body; points have no
# stiffness.
POINTS = re.compile("MASS|ROTARYI|HEATCAP")
NO_BODY = re.compile(r"MASS|ROTARYI|HEATCAP|DASHPOT|SPRING|GAP|DCOUP|CONN|D$")
# Corners of the faces S1, S2 ... of each kind of element; in 2D those of its sides.
_FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": (
        (0, 1, 2, 3),
        (4, 7, 6, 5),
        (0, 4, 5, 1),
        (1, 5, 6, 2),
        (2, 6, 7, 3),
        (3, 7, 4, 0),
    ),
}
_FACET_KINDS = {2: "line", 3: "triangle", 4: "quad"}
# Keywords that give values to nodes, which belong to their bodies.
_AT_NODES = {"BOUNDARY", "CLOAD", "TEMPERATURE", "INITIALCONDITIONS", "EQUATION", "MPC", "TIE"}
_LABELS = {"BOUNDARY": "support", "CLOAD": "force", "DLOAD": "pressure"}
# A range with more numbers than this is a mistake.
_MOST_MEMBERS = 20_000_000
_NO_NUMBERS = np.empty(0, dtype=np.int64)
Words = tuple[str, ...]


def _kind(element: str) -> tuple[str, int]:
    """Return the shape of an element type and its number of nodes."""
    if match := _SOLID.match(element):
        if (count := int(match[1])) not in _SOLID_KINDS:
            raise ValueError(
                f"element type {element}: supported are C3D4, C3D6, C3D8, C3D10, C3D15, C3D20"
            )
        return _SOLID_KINDS[count], count
    if match := _PLANE.match(element):
        return _PLANE_KINDS[int(match[1])], int(match[1])
    if match := _LINE.match(element):
        count = int(match[1]) + (element[0] == "B")  # B21 has two nodes, as T2D2
        return ("line" if count == 2 else "line3"), count
    raise ValueError(
        f"element type {element} is neither a plane one nor a solid; supported are CPE3, CPE4, "
        "CPE6, CPS3, CPS4, CPS6, S3, S4 ..., and in 3D C3D4, C3D8, C3D10, C3D20 ..."
    )


def _faces_of(kind: str) -> tuple[tuple[int, ...], ...]:
    """Return the corners of the faces S1, S2 ... of a kind of cell, in 2D those of its sides; a
    line has none.
    """
    return _FACES.get(kind.rstrip("0123456789"), ())


@dataclass(frozen=True)
class Group:
    """Nodes or faces to which a keyword gives values of the same kind, one by one."""

    name: str  # of the set that they make
    words: Words  # the data, as in a row for a set
    nodes: tuple[int, ...]  # their numbers in the file; of faces none
    values: tuple[float, ...]  # the value at each node or face


@dataclass(frozen=True)
class DeckModel:
    """The mesh and the keywords of an Abaqus input file."""

    raw: RawMesh  # its mesh
    blocks: list[DeckBlock]  # its keywords
    # number of a keyword -> the sets of single nodes and faces to which it gives something
    groups: dict[int, list[Group]]
    undefined: dict[
        str, int
    ]  # name of a surface -> how many of its faces are those of no element of the body
    places: Numbering  # number of a node -> its row in the mesh
    surfaces: dict[
        str, list[tuple[int, int]]
    ]  # name of a surface -> its elements, each with a face from 1 on
    elements: dict[str, Ints]  # name of a set of elements -> their numbers, of points too
    spelt: dict[str, str]  # name in capitals -> its first spelling
    # names of the parts that share no node, if there are several and the file gives nodes values
    bodies: tuple[str, ...]


@dataclass
class _Reader:
    """The content of the mesh during reading."""

    node_parts: list[tuple[DeckBlock, Ints, Array]] = field(default_factory=list)
    element_parts: list[tuple[DeckBlock, str, Ints]] = field(default_factory=list)
    node_sets: dict[str, Ints] = field(default_factory=dict)
    element_sets: dict[str, Ints] = field(default_factory=dict)
    surfaces: dict[str, list[tuple[int, int]]] = field(default_factory=dict)
    nodal_values: list[tuple[DeckBlock, tuple[str, ...], dict[Any, float]]] = field(
        default_factory=list
    )
    passed_over: bool = False  # whether there are elements that are no part of the body
    undefined: dict[str, int] = field(default_factory=dict)
    spelt: dict[str, str] = field(default_factory=dict)  # name in capitals -> its first spelling

    def read(self, block: DeckBlock) -> None:
        """Read the nodes, elements, sets and single values of a keyword."""
        parameters = block.parameters
        if block.keyword != "NODE":
            check_rows(block)
        match block.keyword:
            case "NODE":
                if parameters.get("SYSTEM", "R").upper() not in ("R", "RECTANGULAR"):
                    raise ValueError("coordinates are expected along x, y and z")
                numbers, x = coordinates(block)
                self.node_parts.append((block, numbers, x))
                if "NSET" in parameters:
                    self._extend(self.node_sets, parameters["NSET"], numbers)
            case "ELEMENT":
                self._read_elements(block)
            case "NSET":
                self._read_set(self.node_sets, parameters["NSET"], block)
                if "ELSET" in parameters:
                    elements = self._member(self.element_sets, parameters["ELSET"])
                    nodes = [
                        table[np.isin(table[:, 0], elements), 1:].ravel()
                        for _, _, table in self.element_parts
                    ]
                    self._extend(
                        self.node_sets, parameters["NSET"], _distinct([_NO_NUMBERS, *nodes])
                    )
            case "ELSET":
                self._read_set(self.element_sets, parameters["ELSET"], block)
            case "SURFACE":
                self._read_surface(block)
            case "BOUNDARY" | "CLOAD" | "DLOAD":
                self.nodal_values += [(block, *group) for group in self._given_alike(block)]
            case "SYSTEM" if block.rows:
                raise ValueError("coordinates are expected along x, y and z")
            case "NGEN" | "NFILL" | "NCOPY" | "NMAP" | "ELGEN" | "ELCOPY":
                raise ValueError(
                    "nodes and elements are not generated here: write them all into the file"
                )

    def _name(self, name: str) -> str:
        return self.spelt.setdefault(name.upper(), name)

    def _free(self, word: str) -> Iterator[str]:
        """Yield names that are not in the file, made of a word and a number."""
        for n in itertools.count(1):
            if (name := word.format(n)).upper() not in self.spelt:
                yield self._name(name)

    def _extend(self, sets: dict[str, Ints], name: str, members: Ints) -> None:
        name = self._name(name)
        sets[name] = np.concatenate((sets[name], members)) if name in sets else members

    def _read_elements(self, block: DeckBlock) -> None:
        kind_name = block.parameters["TYPE"].upper()
        if NO_BODY.match(kind_name):
            self.passed_over |= bool(block.rows)
            if "ELSET" in block.parameters:
                rows = block.rows if POINTS.match(kind_name) else []
                numbers = np.array([int(row[0]) for row in rows], dtype=np.int64)
                self._extend(self.element_sets, block.parameters["ELSET"], numbers)
            return
        kind, count = _kind(kind_name)
        at_once = block.numbers(np.int64)
        single_words = [int(word) for row in block.rows for word in row] if at_once is None else []
        words = np.array(single_words, dtype=np.int64) if at_once is None else at_once[0]
        if len(words) % (count + 1):
            raise ValueError(
                f"*ELEMENT, TYPE={block.parameters['TYPE']}: {count} nodes per element are expected"
            )
        table = words.reshape(-1, count + 1)
        self.element_parts.append((block, kind, table))
        if "ELSET" in block.parameters:
            self._extend(self.element_sets, block.parameters["ELSET"], table[:, 0])

    def _read_set(self, sets: dict[str, Ints], name: str, block: DeckBlock) -> None:
        name = self._name(name)
        parts = [sets.pop(name, _NO_NUMBERS)]
        taken = set[str]()
        for row in block.rows:
            if "GENERATE" in block.parameters:
                first, last, step = (*map(int, row), 1)[:3]
                if step < 1 or (last - first) // step > _MOST_MEMBERS:
                    raise ValueError(
                        f"set {name!r}: {first} to {last} by {step} is not a possible range"
                    )
                parts.append(np.arange(first, last + 1, step, dtype=np.int64))
                continue
            for word in filter(None, row):
                if self._name(word) == name:
                    raise ValueError(f"set {name!r} contains itself")
                if word not in taken:
                    taken.add(word)
                    parts.append(self._member(sets, word))
        self._extend(sets, name, _distinct(parts))

    def _member(self, sets: dict[str, Ints], word: str) -> Ints:
        """Return the numbers of the members of a set, or a single number as an array, shape
        (n,).
        """
        if (number := number_of(word)) is not None:
            return np.array([number], dtype=np.int64)
        if (members := sets.get(self._name(word))) is None:
            raise ValueError(f"set {word!r} does not exist")
        return members

    def _given_alike(self, block: DeckBlock) -> list[tuple[Words, dict[Any, float]]]:
        """Return the single nodes of *BOUNDARY, all nodes of *CLOAD and the faces of *DLOAD,
        grouped by equal data.
        """
        groups: dict[Words, dict[Any, float]] = {}
        pressures: dict[Any, float] = {}  # of a face that is given several, their sum
        for target, *words in block.rows:
            match block.keyword:
                case "BOUNDARY" if (
                    number := number_of(target)
                ) is not None and "FIXED" not in block.parameters:
                    for component, value in components(words).items():
                        if component not in ROTATIONS:
                            groups.setdefault((str(component), "", repr(value)), {})[number] = value
                case "CLOAD":
                    value = real((*words, "0")[1])
                    forces = groups.setdefault((words[0], ""), {})
                    for node in plain(self._member(self.node_sets, target)):
                        forces[node] = forces.get(node, 0.0) + value
                case "DLOAD" if words and re.fullmatch(r"P\d", words[0].upper()):
                    value = real((*words, "0")[1])
                    for element in plain(self._member(self.element_sets, target)):
                        face = element, int(words[0][1:])
                        pressures[face] = pressures.get(face, 0.0) + value
        for face, value in pressures.items():
            groups.setdefault(("P", repr(value)), {})[face] = value
        return list(groups.items())

    def _read_surface(self, block: DeckBlock) -> None:
        name = self._name(block.parameters["NAME"])
        kind = block.word("TYPE", "ELEMENT")
        for row in block.rows:
            if kind == "NODE":
                self._extend(self.node_sets, name, self._member(self.node_sets, row[0]))
            elif kind == "ELEMENT" and len(row) > 1 and re.fullmatch(r"[SE]\d+", row[1].upper()):
                elements = plain(self._member(self.element_sets, row[0]))
                self.surfaces.setdefault(name, []).extend(
                    (element, int(row[1][1:])) for element in elements
                )
            elif (
                kind == "ELEMENT"
                and len(row) > 1
                and row[1]
                and not _OTHER_FACE.fullmatch(row[1].upper())
            ):
                raise ValueError(f"surface {name!r}: a face S1, S2 ... is expected, not {row[1]!r}")

    # --- when all keywords have been read ---------------------------------------------------------

    @cached_property
    def nodes(self) -> tuple[Numbering, Array]:
        """All nodes and their positions, length, shape (n, 2) or (n, 3)."""
        rows = _numbering("node", [(block, numbers) for block, numbers, _ in self.node_parts])
        dim = max((2, *(x.shape[1] for _, _, x in self.node_parts)))
        points = [np.pad(x, ((0, 0), (0, dim - x.shape[1]))) for _, _, x in self.node_parts]
        return rows, np.concatenate([np.empty((0, dim)), *points])

    @cached_property
    def elements(self) -> _Elements:
        """All elements of the body, lines included."""
        return _Elements([part for part in self.element_parts if len(part[2])])

    def result(self, blocks: list[DeckBlock]) -> DeckModel:
        """Return the mesh, with rows of arrays in place of numbers of the file."""
        elements = self.elements
        node_rows, points = self.nodes
        tables = [(kind, self._table(number)) for number, (kind, _) in enumerate(elements.parts)]
        of_node = _body_of_nodes(tables, len(points))
        groups = self._named_groups(of_node)
        sets = {
            name: elements.by_part(elements.rows.rows(listed))
            for name, listed in self.element_sets.items()
        }
        facets: dict[int, list[Ints]] = {corners: [] for corners in _FACET_KINDS}
        ranges: dict[str, dict[int, Ints]] = {}
        for name, faces in self.surfaces.items():
            for sides in self._sides(tables, name, faces):
                corners = sides.shape[1]
                first = sum(map(len, facets[corners]))
                ranges.setdefault(name, {})[corners] = np.arange(first, first + len(sides))
                facets[corners].append(sides)
        present = [corners for corners, sides in facets.items() if sides]
        for name, rows in ranges.items():
            sets[name] = [
                *sets.get(name, [_NO_NUMBERS] * len(tables)),
                *(rows.get(corners, _NO_NUMBERS) for corners in present),
            ]
        count = len(tables) + len(present)
        sets = {
            name: [*members, *([_NO_NUMBERS] * (count - len(members)))]
            for name, members in sets.items()
        }
        all_blocks = [*tables, *((_FACET_KINDS[c], np.concatenate(facets[c])) for c in present)]
        named = (
            _bodies(all_blocks, of_node, sets, self._free("body_{}"))
            if any(b.keyword in _AT_NODES for b in blocks)
            else {}
        )
        node_sets = {}
        for name, nodes in self.node_sets.items():
            members = node_rows.rows(nodes)
            node_sets[name] = members[members >= 0]
        raw = RawMesh(points, all_blocks, sets | named, node_sets)
        return DeckModel(
            raw,
            blocks,
            groups,
            self.undefined,
            node_rows,
            self.surfaces,
            self.element_sets,
            self.spelt,
            tuple(named),
        )

    def _named_groups(self, of_node: Ints) -> dict[int, list[Group]]:
        """Return the groups by the number of their keyword.

        Each group is a set that the file names, or a set that is added here.  Forces on several
        bodies are several groups.
        """
        names = {label: self._free(f"{label}_{{}}") for label in _LABELS.values()}
        set_names = {
            **{
                frozenset(plain(nodes)): name
                for name, nodes in self.node_sets.items()
                if self.nodal_values
            },
            **{
                frozenset(faces): name for name, faces in self.surfaces.items() if self.nodal_values
            },
        }
        groups: dict[int, list[Group]] = {}
        for block, words, nodal_values in self._by_body(of_node):
            key = frozenset(nodal_values)
            if (name := set_names.get(key)) is None:
                name = set_names[key] = next(names[_LABELS[block.keyword]])
                if block.keyword == "DLOAD":
                    self.surfaces[name] = list(nodal_values)
                elif len(key) > 1:  # one node is no boundary
                    self.node_sets[name] = np.array(list(nodal_values), dtype=np.int64)
            nodes = () if block.keyword == "DLOAD" else tuple(nodal_values)
            groups.setdefault(block.number, []).append(
                Group(name, words, nodes, tuple(nodal_values.values()))
            )
        return groups

    def _by_body(self, of_node: Ints) -> Iterator[tuple[DeckBlock, Words, dict[Any, float]]]:
        """Yield the values that keywords give to nodes and faces; the forces of *CLOAD are split by
        body.
        """
        for block, words, nodal_values in self.nodal_values:
            if block.keyword != "CLOAD":
                yield block, words, nodal_values
                continue
            rows = self.nodes[0].rows(np.array(list(nodal_values), dtype=np.int64))
            labels = np.where(rows < 0, -1, of_node[rows])
            for label in plain(_distinct([labels])):
                chosen = zip(nodal_values.items(), plain(labels == label), strict=True)
                yield block, words, dict(item for item, inside in chosen if inside)

    def _table(self, number: int) -> Ints:
        """Return the rows of the nodes of the elements of one part, shape (m, k)."""
        elements = self.elements
        nodes = self.elements.parts[number][1]
        table = self.nodes[0].rows(nodes.ravel()).reshape(nodes.shape)
        missing = np.argwhere(table < 0)
        if missing.size:
            row, corner = missing[0]
            element = elements.rows.numbers[elements.first[number] + row]
            why = (
                f"element {element} has the node {nodes[row, corner]}, which the file does not "
                "define"
            )
            raise DeckError(elements.blocks[number], why)
        return table

    def _sides(
        self, tables: list[tuple[str, Ints]], name: str, faces: Sequence[tuple[int, int]]
    ) -> Iterator[Ints]:
        """Yield the corners of those faces of a surface that are sides of the body, grouped by
        number of corners, shape (n, corners).
        """
        elements = self.elements
        listed = np.array(faces, dtype=np.int64).reshape(-1, 2)
        rows = elements.rows.rows(listed[:, 0])
        on_body = (rows >= 0) & elements.solid[rows]
        self.undefined[name] = int(np.count_nonzero(~on_body))
        rows = rows[on_body]
        listed = listed[on_body]
        corners = np.full((len(rows), 4), -1)
        for k, face in plain(
            np.unique(np.column_stack((elements.part[rows], listed[:, 1])), axis=0)
        ):
            chosen = (elements.part[rows] == k) & (listed[:, 1] == face)
            kind, table = tables[k]
            if not 1 <= face <= len(_faces_of(kind)):
                element = listed[int(np.argmax(chosen)), 0]
                raise ValueError(
                    f"surface {name!r}: element {element} is a {kind} and has no face S{face}"
                )
            side = list(_faces_of(kind)[face - 1])
            corners[chosen, : len(side)] = table[rows[chosen] - elements.first[k]][:, side]
        counts = (corners >= 0).sum(axis=1)
        for count in plain(np.unique(counts)):
            yield corners[counts == count, :count]


class _Elements:
    """The elements of a file, by keyword."""

    def __init__(self, parts: Sequence[tuple[DeckBlock, str, Ints]]) -> None:
        self.blocks = [block for block, _, _ in parts]  # the keywords that define some
        # of each its kind in meshio's words, and the numbers of the nodes of its elements, shape
        # (m, k)
        self.parts = [(kind, table[:, 1:]) for _, kind, table in parts]
        sizes = [len(table) for _, _, table in parts]
        self.first = np.cumsum([0, *sizes])  # element of each keyword, in the order of the file
        # of each element the number of its keyword among ``blocks``, shape (n,)
        self.part = np.repeat(np.arange(len(parts)), sizes)
        self.rows = _numbering("element", [(block, table[:, 0]) for block, _, table in parts])
        self.solid = np.array([not kind.startswith("line") for kind, _ in self.parts], dtype=bool)[
            self.part
        ]

    def by_part(self, rows: Ints) -> list[Ints]:
        """Return numbers of elements as rows of each keyword; negative numbers are left out."""
        rows = rows[rows >= 0]
        return [rows[self.part[rows] == k] - self.first[k] for k in range(len(self.parts))]


def _numbering(name: str, parts: Sequence[tuple[DeckBlock, Ints]]) -> Numbering:
    """Return the numbering of nodes or elements; it is an error if one is defined twice."""
    rows = Numbering(np.concatenate([_NO_NUMBERS, *(numbers for _, numbers in parts)]))
    if rows.again.size:
        row = int(rows.again.min())
        part = int(
            np.searchsorted(np.cumsum([len(numbers) for _, numbers in parts]), row, side="right")
        )
        raise DeckError(parts[part][0], f"{name} {rows.numbers[row]} is defined twice")
    return rows


def _distinct(parts: Sequence[Ints]) -> Ints:
    """Return numbers without repetition, in order of first occurrence."""
    numbers = np.concatenate(parts)
    return numbers[np.sort(np.unique(numbers, return_index=True)[1])]


def read_model(file: Path) -> DeckModel:
    """Return the mesh of an Abaqus input file, and all of its keywords.

    Element sets name regions (and boundaries, if they hold lines, or in 3D shells and membranes),
    node sets and surfaces name boundaries.
    """
    with mesh_errors(file):
        blocks = assembled(read_keywords(file)[0])
    reader = _Reader()
    for number, block in enumerate(blocks):
        block.number = number
        with mesh_errors(file, block):
            reader.read(block)
    with mesh_errors(file):
        model = reader.result(blocks)
        if (reader.passed_over or reader.elements.parts) and not reader.elements.solid.any():
            raise ValueError(
                "there is no body of solid or plane elements, but beams, springs or the like"
            )
        if not reader.elements.parts:
            last = blocks[-1] if blocks else DeckBlock("", {}, 1, name="NODE")
            raise DeckError(last, "up to here, the last keyword, there is no element")
    return model


# --- bodies ---------------------------------------------------------------------------------------


def _solid(blocks: Sequence[tuple[str, Ints]]) -> dict[int, Ints]:
    """Return the blocks of the highest dimension, by their position."""
    dim = max((dimension(kind) for kind, _ in blocks), default=0)
    return {number: table for number, (kind, table) in enumerate(blocks) if dimension(kind) == dim}


def _body_of_nodes(blocks: Sequence[tuple[str, Ints]], count: int) -> Ints:
    """Return the number of the body of each node, shape (n,), and -1 for nodes of no cell; cells
    connect their nodes.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    tables = [*_solid(blocks).values()]
    first = np.concatenate(
        [_NO_NUMBERS, *(np.repeat(table[:, 0], table.shape[1]) for table in tables)]
    )
    nodes = np.concatenate([_NO_NUMBERS, *(table.ravel() for table in tables)])
    graph = coo_array((np.ones(len(nodes), dtype=bool), (first, nodes)), shape=(count, count))
    numbers = connected_components(graph, directed=False)[1]
    return np.where(np.isin(np.arange(count), nodes), numbers, -1).astype(np.int64)


def _bodies(
    blocks: Sequence[tuple[str, Ints]],
    of_node: Ints,
    sets: dict[str, list[Ints]],
    free: Iterator[str],
) -> dict[str, list[Ints]]:
    """Return the elements of each body, by name; empty if there is only one body.

    Bodies share no node.  The name is that of a set with the same elements, or a free one.

    Args:
        blocks: the cells, with their kind.
        of_node: number of the body of each node.
        sets: the named sets.
        free: yields free names.
    """
    solid = _solid(blocks)
    labels = plain(_distinct([of_node[table[:, 0]] for table in solid.values()]))
    if len(labels) < 2:
        return {}
    alike = {_key(listed): name for name, listed in reversed(sets.items())}
    bodies: dict[str, list[Ints]] = {}
    for label in labels:
        listed: list[Ints] = [_NO_NUMBERS] * len(blocks)
        for number, table in solid.items():
            listed[number] = np.flatnonzero(of_node[table[:, 0]] == label).astype(np.int64)
        bodies[alike.get(_key(listed)) or next(free)] = listed
    return bodies


def _key(rows: Sequence[Ints]) -> tuple[bytes, ...]:
    """Return a key that is equal for equal rows in any order."""
    return tuple(np.sort(part).tobytes() for part in rows)
