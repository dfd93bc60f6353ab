"""Meshes in Abaqus input files (.inp): nodes, elements, and the sets and surfaces that name parts of them.

meshio knows neither the plane elements CPE3, CPE4, CPS4R ... nor surfaces on the faces of elements, so this is a reader
of our own.  Keywords that say nothing of the mesh are passed over.  Supports, forces and pressures that are given for
single nodes and faces name the boundary on which they act, so that a scene can refer to it.
"""

from __future__ import annotations

import gc
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.abaqus_assembly import assembled
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, DeckError, check_rows, real
from signorini_fx.mechanics.mesh.files.abaqus_groups import Group, Groups, agreeing, bodies, single
from signorini_fx.mechanics.mesh.files.abaqus_include import Source
from signorini_fx.mechanics.mesh.files.abaqus_node_surfaces import ElementFaces, faces_of_nodes
from signorini_fx.mechanics.mesh.files.abaqus_numbers import NumberedElements, NumberedNodes, Numbering, distinct
from signorini_fx.mechanics.mesh.files.abaqus_sectors import NextSector, ReadMesh, asks_for_contact, with_next_sectors
from signorini_fx.mechanics.mesh.files.abaqus_tables import NumberTable
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, plain
from signorini_fx.mechanics.mesh.files.cells import Corners, completed, straight
from signorini_fx.mechanics.mesh.files.raw import RawMesh, increases, rows_of
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

_SOLID_IN_PLANE = re.compile(r"(?:CPEG|CPE|CPS|CAX|DC2D|STRI|M3D|SFM3D|R3D|DS|S)([34689])")
_LINE = re.compile(r"(?:T2D|T3D|R2D|B2|B3|DC1D)([123])")
_KIND = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
# Sides of shells and beams, which a body does not have.
_OTHER_FACE = re.compile(r"SPOS|SNEG|EDGE\d*|END\d")
_SOLID = re.compile(r"(?:C3D|DC3D|AC3D)(\d+)")
# Points, springs, dampers, couplings and networks of fluid: nothing of the body.
POINTS = re.compile("MASS|ROTARYI|HEATCAP")  # these have no stiffness
NO_BODY = re.compile(r"MASS|ROTARYI|HEATCAP|DASHPOT|SPRING|GAP|DCOUP|CONN|D$")
_KIND_IN_SPACE = {
    4: "tetra",
    5: "pyramid",
    6: "wedge",
    8: "hexahedron",
    10: "tetra10",
    15: "wedge15",
    20: "hexahedron20",
}
# Corners of the faces S1, S2 ... of an element with so many corners; of a plane one its sides.
_FACES: dict[str, tuple[Corners, ...]] = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}


def _kind(element: str) -> tuple[str, int]:
    """The shape of an element type and its number of nodes.

    Raises:
        ValueError: it is not one of a plane or solid body.
    """
    if match := _SOLID.match(element):
        if (count := int(match[1])) not in _KIND_IN_SPACE:
            raise ValueError(f"element type {element}: known are C3D4, C3D5, C3D6, C3D8, C3D10, C3D15, C3D20")
        return _KIND_IN_SPACE[count], count
    if match := _SOLID_IN_PLANE.match(element):
        return _KIND[int(match[1])], int(match[1])
    if match := _LINE.match(element):
        # B21 has two nodes, T2D2 too.
        count = int(match[1]) + (element[0] == "B")
        return ("line" if count == 2 else "line3"), count
    raise ValueError(
        f"element type {element} is neither a plane one nor a solid; known are CPE3, CPE4, CPE6, CPS3, CPS4, CPS6, S3, "
        "S4 ..., and in space C3D4, C3D8, C3D10, C3D20 ..."
    )


def faces_of(kind: str) -> tuple[Corners, ...]:
    """Corners of the faces S1, S2 ... of a kind of cell; of a plane one its sides."""
    return _FACES[kind.rstrip("0123456789")]


def removes_elements(block: DeckBlock) -> bool:
    """Whether a *MODEL CHANGE takes elements away."""
    return block.parameters.get("TYPE", "ELEMENT").upper() == "ELEMENT" and "REMOVE" in block.parameters


# Sets of sets may name the same elements repeatedly: more members than this in all sets are an error.
_MOST_MEMBERS = 20_000_000


class _Reader:
    """The content that has been read so far.

    Args:
        room: more nodes or elements than this cannot be in the file.
    """

    def __init__(self, room: int) -> None:
        self._room = room
        self._members = 0
        self._spelt: dict[str, str] = {}  # names in capitals, which the programs do not distinguish -> as they are here
        self._groups = Groups([])
        self._node_parts: list[tuple[DeckBlock, Ints, Floats]] = []
        self._element_parts: list[tuple[DeckBlock, str, Ints]] = []
        self._without: Ints | None = None  # elements that the first step removes
        self.tied = False
        self.passed_over: set[int] = set()  # elements that are nothing of the body
        self._steps = 0
        self.emptied: set[str] = set()  # surfaces of removed elements alone, in capitals
        self._removed: list[DeckBlock] = []  # what takes elements away before anything acts
        self.element_sets: dict[str, Ints] = {}
        self.node_sets: dict[str, Ints] = {}
        self.surfaces: dict[str, list[tuple[int, int]]] = {}  # name -> (element, face from 1 on)
        self._sections: list[DeckBlock] = []
        self._pairs: list[DeckBlock] = []
        self._node_surfaces: set[str] = set()
        self.bare: tuple[int, DeckBlock] | None = None
        self.sections: dict[int, str | None] = {}
        self.groups: dict[int, list[Group]] = {}
        self.undefined: dict[str, int] = {}
        self._nodal = False  # whether nodes are given values, which belong to their bodies
        self.bodies: tuple[str, ...] = ()

    def read(self, block: DeckBlock) -> None:
        check_rows(block)
        parameters, rows = block.parameters, block.rows
        self._nodal |= block.keyword in (
            "BOUNDARY",
            "CLOAD",
            "TEMPERATURE",
            "INITIALCONDITIONS",
            "EQUATION",
            "MPC",
            "TIE",
        )
        match block.keyword:
            case "NODE":
                if parameters.get("SYSTEM", "R").upper() not in ("R", "RECTANGULAR"):
                    raise ValueError("coordinates are expected along x, y and z")
                numbers, x = _coordinates(rows)
                self._node_parts.append((block, numbers, x))
                if "NSET" in parameters:
                    self._extend(self.node_sets, self._name(parameters["NSET"]), numbers)
            case "ELEMENT":
                self._read_elements(block)
            case "NSET":
                name = self._name(parameters["NSET"])
                self._read_set(self.node_sets, name, parameters, rows)
                if "ELSET" in parameters:
                    self._extend(self.node_sets, name, self._nodes_of(parameters["ELSET"]))
            case "ELSET":
                self._read_set(self.element_sets, self._name(parameters["ELSET"]), parameters, rows)
            case "SURFACE":
                self._read_surface(parameters, rows)
            case "CONTACTPAIR":
                self._pairs.append(block)
            case "BOUNDARY" | "CLOAD" | "DLOAD":
                apart = not any(completed(kind) for _, kind, _ in self._element_parts)
                sets = (partial(self._listed, of) for of in (self.node_sets, self.element_sets))
                self._groups.said += [(block, *group) for group in agreeing(block, *sets, apart=apart)]
            case "STEP":
                self._steps += 1
            case "MODELCHANGE" if self._steps == 1 and removes_elements(block):
                self._removed.append(block)
            case "SYSTEM" if rows:
                raise ValueError("coordinates are expected along x, y and z")
            case "NGEN" | "NFILL" | "NCOPY" | "NMAP" | "ELGEN" | "ELCOPY":
                raise ValueError("nodes and elements are not generated here: write them all into the file")
            case "SOLIDSECTION" | "SHELLSECTION" | "MEMBRANESECTION":
                self._sections.append(block)

    def _name(self, name: str) -> str:
        """A name as it was written first."""
        return self._spelt.setdefault(name.upper(), name)

    def _free(self, name: str) -> str | None:
        """A name that the file does not have."""
        return None if name.upper() in self._spelt else self._name(name)

    def _unused(self, word: str) -> str:
        """A name that the file does not have, a word and perhaps a number."""
        return next(filter(None, (self._free(f"{word}{n or ''}") for n in itertools.count())))

    @cached_property
    def nodes(self) -> NumberedNodes:
        """All nodes, when everything has been read.

        Raises:
            DeckError: a number is defined twice.
        """
        return NumberedNodes.of(self._node_parts)

    @cached_property
    def _defined_elements(self) -> NumberedElements:
        """All elements of the body and lines.

        Raises:
            DeckError: a number is defined twice.
        """
        return NumberedElements.of(self._element_parts)

    @property
    def elements(self) -> NumberedElements:
        """The same without those that the first step removes."""
        return self._remaining_elements if self._without is not None else self._defined_elements

    @cached_property
    def _remaining_elements(self) -> NumberedElements:
        return self._defined_elements.without(np.asarray(self._without))

    def _resolve_sections(self) -> None:
        """Of an element in several sections the last one holds: what is left of the others is a set of its own."""
        no_numbers = np.empty(0, dtype=np.int64)
        members: list[Ints] = []
        for block in self._sections:
            if "ELSET" not in block.parameters:
                raise DeckError(block, "ELSET is missing")
            members.append(self.element_sets.get(self._name(block.parameters["ELSET"]), no_numbers))
        listed = np.concatenate([no_numbers, *members])
        numbering = Numbering(listed if increases(listed) else np.unique(listed))
        owner = np.full(len(numbering), -1)
        for position, elements in enumerate(members):
            owner[numbering.rows(elements)] = position
        numbers = self.elements.rows.numbers[self.elements.solid]
        bare = numbers[numbering.rows(numbers) < 0]
        if bare.size:
            self.bare = int(bare[0]), self.elements.defining(int(bare[0]))
        for position, (block, elements) in enumerate(zip(self._sections, members, strict=True)):
            owned = elements[owner[numbering.rows(elements)] == position]
            if len(owned) == len(elements):
                continue
            self.sections[block.number] = None
            if len(owned):
                name = self._unused(f"{block.parameters['ELSET']}_rest")
                self.sections[block.number] = name
                self.element_sets[name] = owned

    def _read_elements(self, block: DeckBlock) -> None:
        parameters, rows = block.parameters, block.rows
        if NO_BODY.match(parameters["TYPE"].upper()):
            self.tied |= not POINTS.match(parameters["TYPE"].upper())
            self.passed_over.update(int(row[0]) for row in rows)
            if "ELSET" in parameters:
                self.element_sets.setdefault(self._name(parameters["ELSET"]), np.empty(0, dtype=np.int64))
            return
        kind, count = _kind(parameters["TYPE"].upper())
        words: Ints = (
            np.asarray(rows.values, dtype=np.int64)
            if isinstance(rows, NumberTable)
            else np.array([int(word) for row in rows for word in row], dtype=np.int64)
        )
        if len(words) % (count + 1):
            raise ValueError(f"*ELEMENT, TYPE={parameters['TYPE']}: {count} nodes per element are expected")
        table = words.reshape(-1, count + 1)
        self._element_parts.append((block, kind, table))
        if "ELSET" in parameters:
            self._extend(self.element_sets, self._name(parameters["ELSET"]), table[:, 0])

    def _nodes_of(self, name: str) -> Ints:
        """The numbers of the nodes of a set of elements.

        Raises:
            ValueError: there is no such set.
        """
        elements = self._member(self.element_sets, name)
        nodes = [table[np.isin(table[:, 0], elements), 1:].ravel() for _, _, table in self._element_parts]
        return distinct(np.concatenate([np.empty(0, dtype=np.int64), *nodes]))

    def _extend(self, sets: dict[str, Ints], name: str, members: Ints) -> None:
        """Add members to a set."""
        sets[name] = np.concatenate((sets[name], members)) if name in sets else members

    def _read_set(
        self, sets: dict[str, Ints], name: str, parameters: dict[str, str], rows: Sequence[list[str]]
    ) -> None:
        before = sets.get(name, np.empty(0, dtype=np.int64))
        parts, taken = [before], set[str]()
        singles: list[int] = []  # since the last part
        for row in rows:
            if "GENERATE" in parameters:
                first, last, step = (*map(int, row), 1)[:3]
                if step < 1 or (last - first) // step > self._room:
                    raise ValueError(f"set {name!r}: {first} to {last} by {step} is not a possible range")
                parts.append(np.arange(first, last + 1, step, dtype=np.int64))
                if sum(map(len, parts)) > _MOST_MEMBERS:
                    parts = [distinct(np.concatenate(parts))]
                continue
            for word in filter(None, row):
                if word.isdigit():
                    singles.append(int(word))
                elif self._name(word) == name:
                    raise ValueError(f"set {name!r} contains itself")
                elif word not in taken:
                    taken.add(word)
                    parts += [np.array(singles, dtype=np.int64), self._member(sets, word)]
                    singles = []
        parts.append(np.array(singles, dtype=np.int64))
        members = distinct(np.concatenate(parts))
        self._members += len(members) - len(before)
        if self._members > _MOST_MEMBERS:
            raise ValueError(f"the sets up to {name!r} have more than {_MOST_MEMBERS:,} members together")
        sets[name] = members

    def _listed(self, sets: dict[str, Ints], word: str) -> list[int]:
        """The same as ``_member``, as a list."""
        members: list[int] = plain(self._member(sets, word))
        return members

    def _member(self, sets: dict[str, Ints], word: str) -> Ints:
        """A set within a set, perhaps with the name of its instance before it."""
        for name in (word, word.rpartition(".")[2]):
            if (members := sets.get(self._name(name))) is not None:
                return members
        if (number := single(word)) is not None:
            return np.array([number], dtype=np.int64)
        raise ValueError(f"set {word!r} does not exist")

    def _read_surface(self, parameters: dict[str, str], rows: Sequence[list[str]]) -> None:
        name, kind = self._name(parameters["NAME"]), parameters.get("TYPE", "ELEMENT").upper()
        for row in rows:
            if kind == "NODE":
                self._node_surfaces.add(name)
                members = np.array([int(row[0])]) if row[0].isdigit() else self._member(self.node_sets, row[0])
                self._extend(self.node_sets, name, members)
            elif kind == "ELEMENT" and len(row) > 1 and re.fullmatch(r"[SE]\d+", row[1].upper()):
                elements = [int(row[0])] if row[0].isdigit() else self._listed(self.element_sets, row[0])
                faces = self.surfaces.setdefault(name, [])
                faces.extend((element, int(row[1][1:])) for element in elements)
                self._members += len(elements)
                if self._members > _MOST_MEMBERS:
                    raise ValueError(f"the surfaces up to {name!r} have more than {_MOST_MEMBERS:,} faces together")
            elif kind == "ELEMENT" and len(row) > 1 and row[1] and not _OTHER_FACE.fullmatch(row[1].upper()):
                raise ValueError(f"surface {name!r}: a face S1, S2 ... is expected, not {row[1]!r}")

    def result(self) -> RawMesh:
        """Everything with the numbering of arrays; members of sets that are nothing of the body are passed over."""
        self._remove_elements()
        self._resolve_sections()
        elements, points = self.elements, self.nodes.points
        self.groups = self._groups.named(list(elements.nodes.values()), self.node_sets, self.surfaces, self._free)
        tables = {kind: self._table(kind, nodes) for kind, nodes in elements.nodes.items()}
        sets = {name: self._rows(name, members) for name, members in self.element_sets.items()}
        self._add_faces_of_nodes(points, tables)
        facets: dict[int, list[Ints]] = {2: [], 3: [], 4: []}  # by the number of their corners
        ranges: dict[str, dict[int, range]] = {}
        for name, faces in self.surfaces.items():
            first = {corners: sum(map(len, sides)) for corners, sides in facets.items()}
            for side in self._sides(tables, name, faces):
                facets[side.shape[1]].append(side)
            ranges[name] = {corners: range(first[corners], sum(map(len, sides))) for corners, sides in facets.items()}
        present = [corners for corners, sides in facets.items() if sides]
        no_rows = np.empty(0, dtype=np.int64)
        for name, rows in ranges.items():
            if any(rows.values()):
                earlier = sets.get(name, [no_rows] * len(tables))
                sets[name] = [*earlier, *(np.array(rows[corners], dtype=np.int64) for corners in present)]
        count = len(tables) + len(present)
        sets = {name: [*members, *([no_rows] * (count - len(members)))] for name, members in sets.items()}
        kinds = {2: "line", 3: "triangle", 4: "quad"}
        blocks = [
            *tables.items(),
            *((kinds[corners], np.concatenate(facets[corners])) for corners in present),
        ]
        if self._nodal:
            named = bodies(blocks, sets, self._free)
            self.bodies = tuple(named)
            sets |= named
        node_sets = {}
        for name, nodes in self.node_sets.items():
            node_rows = self.nodes.rows.rows(nodes)
            node_sets[name] = self._defined(name, node_rows[node_rows >= 0], len(nodes))
        return RawMesh(points, blocks, sets, node_sets)

    def _remove_elements(self) -> None:
        """Take away the elements that the first step removes: they never carry anything."""
        names = [word for block in self._removed for row in block.rows for word in row if word]
        removed = {element for name in names for element in self._listed(self.element_sets, name)}
        numbers = np.array(sorted(removed), dtype=np.int64)
        present = numbers[self.elements.rows.rows(numbers) >= 0]
        if not present.size:
            return
        self.passed_over.update(plain(present))
        self._without = numbers
        for name, faces in self.surfaces.items():
            rest = [face for face in faces if face[0] not in removed]
            if faces and not rest:
                self.emptied.add(name.upper())
            self.surfaces[name] = rest

    def with_next_sectors(self, blocks: list[DeckBlock]) -> tuple[list[DeckBlock], dict[int, NextSector]]:
        """The keywords that have been read, and what sectors touch; see ``abaqus_sectors.with_next_sectors``."""
        self._remove_elements()
        elements = self.elements
        solid = np.flatnonzero(elements.solid)
        kinds = dict(zip(plain(elements.rows.numbers[solid]), plain(elements.kind[solid]), strict=True))
        mesh = ReadMesh(
            dict(zip(self.nodes.rows, plain(self.nodes.points), strict=True)),
            elements.nodes_of(solid),
            {number: elements.defining(number).parameters["TYPE"] for number in kinds},
            self.surfaces,
            _as_lists(self.node_sets),
            _as_lists(self.element_sets),
            lambda number, face: dict(enumerate(faces_of(elements.kinds[kinds[number]]), 1)).get(face, ()),
        )
        return with_next_sectors(blocks, mesh, self._unused)

    def _add_faces_of_nodes(self, points: Floats, tables: dict[str, Ints]) -> None:
        """Surfaces of single nodes in contact become those of the faces around them."""
        pairs = [block for block in self._pairs if block.rows]
        named = {self._name(name) for block in pairs for row in block.rows for name in row[:1]} & self._node_surfaces
        if not named:
            return
        elements = self.elements
        solid = np.flatnonzero(elements.solid)
        kinds = [elements.kinds[k] for k in plain(elements.kind[solid])]
        numbers, rows = plain(elements.rows.numbers[solid]), plain(elements.row[solid])
        faces = ElementFaces(
            points,
            {number: tables[kind][row] for number, kind, row in zip(numbers, kinds, rows, strict=True)},
            {number: _FACES.get(kind.rstrip("0123456789"), ()) for number, kind in zip(numbers, kinds, strict=True)},
        )
        nodes_of = {}
        for name in named:
            node_rows = self.nodes.rows.rows(self.node_sets[name])
            nodes_of[name.upper()] = node_rows[node_rows >= 0]
        surfaces = {name.upper(): listed for name, listed in self.surfaces.items()}
        for name, facing in faces_of_nodes(pairs, faces, nodes_of, surfaces):
            self.surfaces[self._name(name)] = facing

    def _defined(self, name: str, members: Ints, count: int) -> Ints:
        """The members of a set that the file defines; how many it does not is kept."""
        if len(members) < count:
            self.undefined[name] = count - len(members)
        return members

    def _table(self, kind: str, nodes: Ints) -> Ints:
        """The rows of the nodes of each element of a kind.

        Raises:
            DeckError: the file does not define one of them.
        """
        table = self.nodes.rows.rows(nodes)
        missing = np.argwhere(table < 0)
        if missing.size:
            row, corner = missing[0]
            element = self.elements.of_kind(kind, int(row))
            why = f"element {element} has the node {nodes[row, corner]}, which the file does not define"
            raise DeckError(self.elements.defining(element), why)
        return table

    def _rows(self, name: str, members: Ints) -> list[Ints]:
        """The rows of the elements of a set among those of each kind."""
        elements = self.elements
        rows = elements.rows.rows(members)
        passed = np.isin(members, list(self.passed_over)) if self.passed_over else np.zeros(len(members), dtype=bool)
        self._defined(name, members[(rows >= 0) | passed], len(members))
        rows = rows[(rows >= 0) & ~passed]
        return [elements.row[rows[elements.kind[rows] == k]] for k in range(len(elements.kinds))]

    def _sides(self, tables: dict[str, Ints], name: str, faces: Sequence[tuple[int, int]]) -> Iterator[Ints]:
        """The corners of the faces of a surface that are sides of the body, by their number, shape (n, corners).

        Raises:
            ValueError: an element has no such face.
        """
        elements = self.elements
        listed: Ints = np.array(faces, dtype=np.int64).reshape(-1, 2)
        rows = elements.rows.rows(listed[:, 0])
        on_body = rows >= 0
        on_body[on_body] = elements.solid[rows[on_body]]
        self._defined(name, listed[on_body], len(listed))
        rows, listed = rows[on_body], listed[on_body]
        corners: Ints = np.full((len(rows), 4), -1)
        for k, face in plain(np.unique(np.column_stack((elements.kind[rows], listed[:, 1])), axis=0)):
            chosen = (elements.kind[rows] == k) & (listed[:, 1] == face)
            kind = elements.kinds[k]
            of_kind = _FACES.get(kind.rstrip("0123456789"), ())
            if not 1 <= face <= len(of_kind):
                element = listed[int(np.argmax(chosen)), 0]
                raise ValueError(f"surface {name!r}: element {element} is a {kind} and has no face S{face}")
            side = list(of_kind[face - 1])
            corners[chosen, : len(side)] = tables[kind][elements.row[rows[chosen]]][:, side]
        counts = (corners >= 0).sum(axis=1)
        for count in plain(np.unique(counts)):
            yield corners[counts == count, :count]


def _coordinates(rows: Sequence[list[str]]) -> tuple[Ints, Floats]:
    """The numbers of nodes and their coordinates, those that a line lacks as zero.

    Raises:
        ValueError: a word is no number.
    """
    if isinstance(rows, NumberTable):
        return rows.values[:, 0].astype(np.int64), np.asarray(rows.values[:, 1:4], dtype=np.float64)
    width = max((len(row) for row in rows), default=1) - 1
    numbers, x = np.zeros(len(rows), dtype=np.int64), np.zeros((len(rows), min(width, 3)))
    for k, (number, *words) in enumerate(rows):
        numbers[k] = int(number)
        x[k, : len(words[:3])] = [real(word) for word in words[:3]]
    return numbers, x


def _as_lists(sets: Mapping[str, Ints]) -> dict[str, list[int]]:
    return {name: plain(members) for name, members in sets.items()}


@dataclass(frozen=True)
class DeckModel:
    """An Abaqus input file.

    Attributes:
        raw: its mesh.
        blocks: its keywords.
        groups: number of a keyword -> what it says of single nodes and faces.
        sections: number of the keyword of a section -> the set of its elements that no later section has; None: it has
            none.  Sections that keep all of their elements are not listed.
        undefined: name of a set -> how many of its members the file does not define.
        places: number of a node -> its row in the mesh.
        surfaces: name of a surface -> its elements, each with a face from 1 on.
        bare: an element of the body that is in no section, and the keyword that defines it; None: all are in one.
        emptied: names of surfaces, in capitals, all of whose elements the first step removes.
        sectors: number of a *CYCLIC SYMMETRY MODEL with contact -> the part of the next sector that has been added.
        tied: whether there are elements with stiffness that are nothing of the body, such as springs.
        bodies: names of the parts that share no node, if there are several and the file gives nodes values.
    """

    raw: RawMesh
    blocks: list[DeckBlock]
    groups: dict[int, list[Group]]
    sections: dict[int, str | None]
    undefined: dict[str, int]
    places: Numbering
    surfaces: dict[str, list[tuple[int, int]]]
    bare: tuple[int, DeckBlock] | None
    bodies: tuple[str, ...]
    tied: bool
    emptied: frozenset[str]
    sectors: dict[int, NextSector]


@contextmanager
def _all_is_kept() -> Iterator[None]:
    """Without collecting garbage: a list for each line, of which none is garbage, would be looked through again and
    again, which takes as long as the reading itself.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


@_all_is_kept()
def _keywords(file: Path) -> tuple[list[DeckBlock], int]:
    """The keywords of a file, and how many nodes or elements it has at most."""
    source = Source(file)
    try:
        blocks = assembled(source.blocks())
    except DeckError as error:
        raise MeshError(f"{file}: {error.text}") from None
    for number, block in enumerate(blocks):
        block.number = number
    return blocks, source.size


def _read_blocks(file: Path, blocks: list[DeckBlock], size: int) -> _Reader:
    """What the keywords of a file say of its mesh.

    Raises:
        MeshError: a keyword is wrong.
    """
    reader = _Reader(size)
    for block in blocks:
        with _named(file, f"{block.place}, *{block.name}"):
            reader.read(block)
    return reader


@_all_is_kept()
def read_model(file: Path) -> DeckModel:
    """The mesh of an Abaqus input file, and all of its keywords.

    Raises:
        MeshError: it is not such a file, or one that it includes cannot be read; elements that are neither plane nor
            solid.
    """
    blocks, size = _keywords(file)
    reader = _read_blocks(file, blocks, size)
    sectors: dict[int, NextSector] = {}
    if any(map(asks_for_contact, blocks)):
        with _named(file, "sets and elements"):
            blocks, sectors = reader.with_next_sectors(blocks)
        reader = _read_blocks(file, blocks, size)
    with _named(file, "sets and elements"):
        mesh = reader.result()
        if (reader.passed_over or len(reader.elements)) and all(kind.startswith("line") for kind, _ in mesh.blocks):
            raise ValueError("there is no body of solid or plane elements, but beams, springs or the like")
        if not len(reader.elements) and not reader.passed_over:
            last = blocks[-1] if blocks else DeckBlock("", {}, 1, name="NODE")
            raise DeckError(last, "up to here, the last keyword, there is no element")
    return DeckModel(
        mesh,
        blocks,
        reader.groups,
        reader.sections,
        reader.undefined,
        reader.nodes.rows,
        reader.surfaces,
        reader.bare,
        reader.bodies,
        reader.tied,
        frozenset(reader.emptied),
        sectors,
    )


def read(file: Path) -> RawMesh:
    """The mesh of an Abaqus input file.

    Element sets name regions (and boundaries, if they hold lines, or in space shells and membranes), node sets and
    surfaces name boundaries.

    Raises:
        MeshError: see ``read_model``.
    """
    return read_model(file).raw


@contextmanager
def _named(file: Path, location: str) -> Iterator[None]:
    """Add the place in the file to an error."""
    try:
        yield
    except DeckError as error:
        raise MeshError(f"{file}: {error.text}") from None
    except KeyError as error:
        raise MeshError(f"{file}: {location}: {error} is missing") from None
    except OverflowError:
        raise MeshError(f"{file}: {location}: a number is too large") from None
    except (ValueError, IndexError, TypeError) as error:
        raise MeshError(f"{file}: {location}: {error}") from None


def write(mesh: MeshArrays, file: Path) -> None:
    """Write solid or plane strain elements, regions as element sets, boundaries as node sets and as surfaces.

    Raises:
        MeshError: quadrilaterals with nine nodes or hexahedra with 27, which Abaqus does not have.
    """
    if mesh.kind == "quad9":
        raise MeshError(f"{file}: Abaqus has no plane quadrilateral with nine nodes")
    if mesh.kind == "hexahedron27":
        raise MeshError(f"{file}: Abaqus has no plain hexahedron with 27 nodes: use .vtu or .msh")
    lines = ["*HEADING", "*NODE"]
    lines += [f"{n}, {', '.join(map(repr, x))}" for n, x in enumerate(plain(mesh.points), start=1)]
    lines.append(f"*ELEMENT, TYPE={'CPE' if mesh.dim == 2 else 'C3D'}{mesh.cells.shape[1]}")
    lines += [f"{n}, {', '.join(map(str, row))}" for n, row in enumerate(plain(mesh.cells + 1), start=1)]
    for name, cells in mesh.regions.items():
        lines += [f"*ELSET, ELSET={_quoted(name)}", *_wrapped(cells + 1)]
    faces = _FACES[straight(mesh.cell).kind]
    sides = mesh.cells[:, np.array(faces)].reshape(-1, len(faces[0]))
    where = rows_of(mesh.facet_corners, sides)
    for name, rows in mesh.boundaries.items():
        lines += [f"*NSET, NSET={_quoted(name)}", *_wrapped(np.unique(mesh.facets[rows]) + 1)]
        cell_faces = [divmod(side, len(faces)) for side in plain(where[rows])]
        lines += [
            f"*SURFACE, TYPE=ELEMENT, NAME={_quoted(name)}",
            *(f"{cell + 1}, S{face + 1}" for cell, face in cell_faces),
        ]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"\w[\w-]*", name) else f'"{name}"'


def _wrapped(numbers: Ints) -> list[str]:
    """Sixteen per line, the most that Abaqus accepts."""
    return [", ".join(map(str, numbers[n : n + 16])) for n in range(0, len(numbers), 16)]
