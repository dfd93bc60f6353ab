"""Meshes in Abaqus input files (.inp): nodes, elements, and the sets and surfaces that name parts of them.

meshio knows neither the plane elements CPE3, CPE4, CPS4R ... nor surfaces on the faces of elements, so this is a reader
of our own.  Keywords that say nothing of the mesh are passed over.  Supports, forces and pressures that are given for
single nodes and faces name the boundary on which they act, so that a scene can refer to it.
"""

from __future__ import annotations

import gc
import itertools
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.abaqus_assembly import assembled
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, DeckError, check_rows, real
from signorini_fx.mechanics.mesh.files.abaqus_groups import Group, Groups, agreeing, bodies, single
from signorini_fx.mechanics.mesh.files.abaqus_include import Source
from signorini_fx.mechanics.mesh.files.abaqus_node_surfaces import ElementFaces, faces_of_nodes
from signorini_fx.mechanics.mesh.files.abaqus_sectors import NextSector, ReadMesh, asks_for_contact, with_next_sectors
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, plain
from signorini_fx.mechanics.mesh.files.cells import Corners, completed, straight
from signorini_fx.mechanics.mesh.files.raw import RawMesh, rows_of
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
        self.points: dict[int, list[float]] = {}
        self.blocks: dict[str, list[list[int]]] = {}  # one of each kind, as there may be thousands of keywords
        self.elements: dict[int, tuple[str, int]] = {}  # number -> (kind, row)
        self.tied = False
        self.passed_over: set[int] = set()  # elements that are nothing of the body
        self._steps = 0
        self.emptied: set[str] = set()  # surfaces of removed elements alone, in capitals
        self._removed: list[DeckBlock] = []  # what takes elements away before anything acts
        self.element_sets: dict[str, list[int]] = {}
        self.node_sets: dict[str, list[int]] = {}
        self.surfaces: dict[str, list[tuple[int, int]]] = {}  # name -> (element, face from 1 on)
        self._element_blocks: list[tuple[str, int, DeckBlock]] = []  # kind, its elements so far, keyword
        self._sections: list[DeckBlock] = []
        self._pairs: list[DeckBlock] = []
        self._node_surfaces: set[str] = set()
        self.bare: tuple[int, DeckBlock] | None = None
        self.sections: dict[int, str | None] = {}
        self.groups: dict[int, list[Group]] = {}
        self.undefined: dict[str, int] = {}
        self.places: dict[int, int] = {}
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
                for name, *x in rows:
                    if int(name) in self.points:
                        raise ValueError(f"node {name} is defined twice")
                    self.points[int(name)] = [real(value) for value in x[:3]]
                if "NSET" in parameters:
                    name = self._name(parameters["NSET"])
                    self.node_sets.setdefault(name, []).extend(int(row[0]) for row in rows)
            case "ELEMENT":
                self._read_elements(block)
            case "NSET":
                self._read_set(self.node_sets, self._name(parameters["NSET"]), parameters, rows)
            case "ELSET":
                self._read_set(self.element_sets, self._name(parameters["ELSET"]), parameters, rows)
            case "SURFACE":
                self._read_surface(parameters, rows)
            case "CONTACTPAIR":
                self._pairs.append(block)
            case "BOUNDARY" | "CLOAD" | "DLOAD":
                apart = not any(map(completed, self.blocks))
                sets = (partial(self._member, of) for of in (self.node_sets, self.element_sets))
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

    def _resolve_sections(self) -> None:
        """Of an element in several sections the last one holds: what is left of the others is a set of its own."""
        owner: dict[int, int] = {}
        members = {}
        for block in self._sections:
            if "ELSET" not in block.parameters:
                raise DeckError(block, "ELSET is missing")
            members[block.number] = self.element_sets.get(self._name(block.parameters["ELSET"]), [])
            owner.update(dict.fromkeys(members[block.number], block.number))
        bare = (element for element in self.elements if element not in owner and self._is_body(element))
        if (element := next(bare, None)) is not None:
            self.bare = element, self._defining(element)
        for block in self._sections:
            elements = members[block.number]
            owned = [element for element in elements if owner[element] == block.number]
            if len(owned) == len(elements):
                continue
            self.sections[block.number] = None
            if owned:
                name = self._unused(f"{block.parameters['ELSET']}_rest")
                self.sections[block.number] = name
                self.element_sets[name] = owned

    def _read_elements(self, block: DeckBlock) -> None:
        parameters, rows = block.parameters, block.rows
        if NO_BODY.match(parameters["TYPE"].upper()):
            self.tied |= not POINTS.match(parameters["TYPE"].upper())
            self.passed_over.update(int(row[0]) for row in rows)
            if "ELSET" in parameters:
                self.element_sets.setdefault(self._name(parameters["ELSET"]), [])
            return
        kind, count = _kind(parameters["TYPE"].upper())
        words = [int(word) for row in rows for word in row]
        if len(words) % (count + 1):
            raise ValueError(f"*ELEMENT, TYPE={parameters['TYPE']}: {count} nodes per element are expected")
        table = [words[n : n + count + 1] for n in range(0, len(words), count + 1)]
        same_kind = self.blocks.setdefault(kind, []) if table else []
        for element, *nodes in table:
            if element in self.elements:
                raise ValueError(f"element {element} is defined twice")
            self.elements[element] = kind, len(same_kind)
            same_kind.append(nodes)
        self._element_blocks.append((kind, len(same_kind), block))
        if "ELSET" in parameters:
            self.element_sets.setdefault(self._name(parameters["ELSET"]), []).extend(row[0] for row in table)

    def _read_set(
        self, sets: dict[str, list[int]], name: str, parameters: dict[str, str], rows: list[list[str]]
    ) -> None:
        members: dict[int, None] = dict.fromkeys(sets.get(name, ()))
        taken: set[str] = set()
        for row in rows:
            if "GENERATE" in parameters:
                first, last, step = (*map(int, row), 1)[:3]
                if step < 1 or (last - first) // step > self._room:
                    raise ValueError(f"set {name!r}: {first} to {last} by {step} is not a possible range")
                members.update(dict.fromkeys(range(first, last + 1, step)))
                continue
            for word in filter(None, row):
                if word.isdigit():
                    members[int(word)] = None
                elif self._name(word) == name:
                    raise ValueError(f"set {name!r} contains itself")
                elif word not in taken:
                    taken.add(word)
                    members.update(dict.fromkeys(self._member(sets, word)))
        self._members += len(members) - len(sets.get(name, ()))
        if self._members > _MOST_MEMBERS:
            raise ValueError(f"the sets up to {name!r} have more than {_MOST_MEMBERS:,} members together")
        sets[name] = list(members)

    def _member(self, sets: dict[str, list[int]], word: str) -> list[int]:
        """A set within a set, perhaps with the name of its instance before it."""
        for name in (word, word.rpartition(".")[2]):
            if (members := sets.get(self._name(name))) is not None:
                return members
        if (number := single(word)) is not None:
            return [number]
        raise ValueError(f"set {word!r} does not exist")

    def _read_surface(self, parameters: dict[str, str], rows: list[list[str]]) -> None:
        name, kind = self._name(parameters["NAME"]), parameters.get("TYPE", "ELEMENT").upper()
        for row in rows:
            if kind == "NODE":
                self._node_surfaces.add(name)
                self.node_sets.setdefault(name, []).extend(
                    [int(row[0])] if row[0].isdigit() else self._member(self.node_sets, row[0])
                )
            elif kind == "ELEMENT" and len(row) > 1 and re.fullmatch(r"[SE]\d+", row[1].upper()):
                members = [int(row[0])] if row[0].isdigit() else self._member(self.element_sets, row[0])
                faces = self.surfaces.setdefault(name, [])
                faces.extend((element, int(row[1][1:])) for element in members)
                self._members += len(members)
                if self._members > _MOST_MEMBERS:
                    raise ValueError(f"the surfaces up to {name!r} have more than {_MOST_MEMBERS:,} faces together")
            elif kind == "ELEMENT" and len(row) > 1 and row[1] and not _OTHER_FACE.fullmatch(row[1].upper()):
                raise ValueError(f"surface {name!r}: a face S1, S2 ... is expected, not {row[1]!r}")

    def result(self) -> RawMesh:
        """Everything with the numbering of arrays; members of sets that are nothing of the body are passed over."""
        self._remove_elements()
        self._resolve_sections()
        self.groups = self._groups.named(list(self.blocks.values()), self.node_sets, self.surfaces, self._free)
        node_rows = self.places = {node: index for index, node in enumerate(self.points)}
        points = np.array(list(self._padded().values()), dtype=np.float64)
        points = points if len(points) else np.empty((0, 2))
        tables = {kind: self._table(kind, nodes, node_rows) for kind, nodes in self.blocks.items()}
        sets = {name: self._rows(name, members) for name, members in self.element_sets.items()}
        self._add_faces_of_nodes(points, tables)
        facets: dict[int, list[list[int]]] = {2: [], 3: [], 4: []}  # by the number of their corners
        ranges: dict[str, dict[int, range]] = {}
        for name, faces in self.surfaces.items():
            solid = self._defined(name, [face for face in faces if self._is_body(face[0])], len(faces))
            first = {corners: len(sides) for corners, sides in facets.items()}
            for element, face in solid:
                side = self._side(tables, name, element, face)
                facets[len(side)].append(side)
            ranges[name] = {corners: range(first[corners], len(sides)) for corners, sides in facets.items()}
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
            *((kinds[corners], np.array(facets[corners], dtype=np.int64)) for corners in present),
        ]
        if self._nodal:
            named = bodies(blocks, sets, self._free)
            self.bodies = tuple(named)
            sets |= named
        node_sets = {
            name: np.array(
                self._defined(name, [node_rows[n] for n in nodes if n in node_rows], len(nodes)), dtype=np.int64
            )
            for name, nodes in self.node_sets.items()
        }
        return RawMesh(points, blocks, sets, node_sets)

    def _padded(self) -> dict[int, list[float]]:
        """The coordinates of each node, as many of all; those that a line lacks are zero."""
        widths = {*map(len, self.points.values())}
        width = max(widths, default=0)
        if width > 1 and len(widths) == 1:
            return self.points
        return {node: x + [0.0] * (max(width, 2) - len(x)) for node, x in self.points.items()}

    def _remove_elements(self) -> None:
        """Take away the elements that the first step removes: they never carry anything."""
        names = [word for block in self._removed for row in block.rows for word in row if word]
        removed = {element for name in names for element in self._member(self.element_sets, name)}
        if not removed & self.elements.keys():
            return
        self.passed_over |= removed & self.elements.keys()
        rows = {kind: [number for number in numbers if number not in removed] for kind, numbers in self._by_kind()}
        before = {kind: np.cumsum([number not in removed for number in numbers]) for kind, numbers in self._by_kind()}
        self._element_blocks = [
            (kind, int(before[kind][count - 1]) if count else 0, block) for kind, count, block in self._element_blocks
        ]
        self.blocks = {
            kind: [self.blocks[kind][self.elements[number][1]] for number in numbers] for kind, numbers in rows.items()
        }
        self.elements = {number: (kind, row) for kind, numbers in rows.items() for row, number in enumerate(numbers)}
        for name, faces in self.surfaces.items():
            rest = [face for face in faces if face[0] not in removed]
            if faces and not rest:
                self.emptied.add(name.upper())
            self.surfaces[name] = rest

    def with_next_sectors(self, blocks: list[DeckBlock]) -> tuple[list[DeckBlock], dict[int, NextSector]]:
        """The keywords that have been read, and what sectors touch; see ``abaqus_sectors.with_next_sectors``."""
        self._remove_elements()
        solid = [number for number in self.elements if self._is_body(number)]
        kinds = {number: self.elements[number] for number in solid}
        mesh = ReadMesh(
            self._padded(),
            {number: self.blocks[kind][row] for number, (kind, row) in kinds.items()},
            {number: self._defining(number).parameters["TYPE"] for number in solid},
            self.surfaces,
            self.node_sets,
            self.element_sets,
            lambda number, face: dict(enumerate(faces_of(self.elements[number][0]), 1)).get(face, ()),
        )
        return with_next_sectors(blocks, mesh, self._unused)

    def _by_kind(self) -> list[tuple[str, list[int]]]:
        """The numbers of the elements of each kind, in their order."""
        numbers: dict[str, list[int]] = {kind: [] for kind in self.blocks}
        for number, (kind, _) in self.elements.items():
            numbers[kind].append(number)
        return list(numbers.items())

    def _add_faces_of_nodes(self, points: Floats, tables: dict[str, Ints]) -> None:
        """Surfaces of single nodes in contact become those of the faces around them."""
        pairs = [block for block in self._pairs if block.rows]
        named = {self._name(name) for block in pairs for row in block.rows for name in row[:1]} & self._node_surfaces
        if not named:
            return
        solid = [element for element in self.elements if self._is_body(element)]
        kinds = {element: self.elements[element] for element in solid}
        faces = ElementFaces(
            points,
            {element: tables[kind][row] for element, (kind, row) in kinds.items()},
            {element: _FACES.get(kind.rstrip("0123456789"), ()) for element, (kind, _) in kinds.items()},
        )
        nodes_of = {
            name.upper(): np.array([self.places[node] for node in self.node_sets[name] if node in self.places])
            for name in named
        }
        surfaces = {name.upper(): listed for name, listed in self.surfaces.items()}
        for name, facing in faces_of_nodes(pairs, faces, nodes_of, surfaces):
            self.surfaces[self._name(name)] = facing

    def _is_body(self, element: int) -> bool:
        """Whether an element is defined and no line."""
        return element in self.elements and not self.elements[element][0].startswith("line")

    def _defining(self, element: int) -> DeckBlock:
        """The keyword that defines an element."""
        kind, row = self.elements[element]
        return next(block for defined, count, block in self._element_blocks if defined == kind and row < count)

    def _defined(self, name: str, members: list[Any], count: int) -> list[Any]:
        """The members of a set that the file defines; how many it does not is kept."""
        if len(members) < count:
            self.undefined[name] = count - len(members)
        return members

    def _table(self, kind: str, nodes: list[list[int]], node_rows: dict[int, int]) -> Ints:
        try:
            return np.array([[node_rows[n] for n in row] for row in nodes], dtype=np.int64)
        except KeyError:
            row = next(k for k, row in enumerate(nodes) if not node_rows.keys() >= set(row))
            element = next(number for number, where in self.elements.items() if where == (kind, row))
            node = next(n for n in nodes[row] if n not in node_rows)
            why = f"element {element} has the node {node}, which the file does not define"
            raise DeckError(self._defining(element), why) from None

    def _rows(self, name: str, members: list[int]) -> list[Ints]:
        by_kind: dict[str, list[int]] = {kind: [] for kind in self.blocks}
        known_members = [member for member in members if member in self.elements or member in self.passed_over]
        for member in self._defined(name, known_members, len(members)):
            if member not in self.passed_over:
                kind, row = self.elements[member]
                by_kind[kind].append(row)
        return [np.array(rows, dtype=np.int64) for rows in by_kind.values()]

    def _side(self, tables: dict[str, Ints], name: str, element: int, face: int) -> list[int]:
        kind, row = self.elements[element]
        faces = _FACES.get(kind.rstrip("0123456789"), ())
        if not 1 <= face <= len(faces):
            raise ValueError(f"surface {name!r}: element {element} is a {kind} and has no face S{face}")
        return [int(tables[kind][row, corner]) for corner in faces[face - 1]]


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
    places: dict[int, int]
    surfaces: dict[str, list[tuple[int, int]]]
    bare: tuple[int, DeckBlock] | None
    bodies: tuple[str, ...]
    tied: bool
    emptied: frozenset[str]
    sectors: dict[int, NextSector]


def read_keywords(file: Path) -> list[DeckBlock]:
    """All keywords of an Abaqus input file, whatever its elements are.

    Raises:
        MeshError: it is not such a file, or one that it includes cannot be read.
    """
    return _keywords(file)[0]


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
        return [replace(block, number=number) for number, block in enumerate(assembled(source.blocks()))], source.size
    except DeckError as error:
        raise MeshError(f"{file}: {error.text}") from None


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
        if reader.passed_over | reader.elements.keys() and all(kind.startswith("line") for kind, _ in mesh.blocks):
            raise ValueError("there is no body of solid or plane elements, but beams, springs or the like")
        if not reader.elements and not reader.passed_over:
            last = blocks[-1] if blocks else DeckBlock("", {}, 1, name="NODE")
            raise DeckError(last, "up to here, the last keyword, there is no element")
    return DeckModel(
        mesh,
        blocks,
        reader.groups,
        reader.sections,
        reader.undefined,
        reader.places,
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
    except (ValueError, IndexError, TypeError, OverflowError) as error:
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
