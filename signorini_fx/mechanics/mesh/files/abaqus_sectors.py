"""Contact between sectors of a cyclic body in Abaqus input files: what the sector touches is part of the next one.

A sector touches the next one, which moves as it does, turned about the axis.  The elements at the side that is touched
are added to the file once more, turned by the angle of a sector.  They are nearly without stiffness, and their nodes
are to be linked to those of which they are the images, so that they hand contact forces on to the sector itself.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, DeckError, parameter, real, real_or_none
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import WEAK_IMAGE, WEIGHTLESS_IMAGE

T = TypeVar("T")
_NAME = "next_sector"  # of what is added


@dataclass(frozen=True)
class Sectors:
    """What a *CYCLIC SYMMETRY MODEL says.

    Attributes:
        slave: the name of one side of the sector.
        master: that of the other side.
        count: how many sectors make the whole body.
        first: a point of the axis, shape (3,).
        axis: a unit vector, shape (3,).
    """

    slave: str
    master: str
    count: int
    first: Floats
    axis: Floats

    def turn(self, moving: Floats, fixed: Floats) -> Floats:
        """The matrix of the rotation by one sector that takes points of one side closer to those of the other one.

        Args:
            moving: of one side, shape (n, 3).
            fixed: of the other one, shape (m, 3).
        """
        from scipy.spatial import cKDTree

        tree = cKDTree(fixed)
        turns = [rotation(self.axis, sign * 2 * np.pi / self.count) for sign in (1.0, -1.0)]
        return min(turns, key=lambda turn: float(np.median(tree.query(self.turned(moving, turn))[0])))

    def turned(self, points: Floats, turn: Floats) -> Floats:
        """Points that a rotation about the axis has moved, shape (n, 3)."""
        return np.asarray((points - self.first) @ turn.T + self.first)


@dataclass(frozen=True)
class NextSector:
    """The part of the next sector that a sector touches.

    Attributes:
        sides: the names of both sides of the sector, slave and master, in capitals.
        region: the name of the elements of the image.
        surface: that of the image of the master.
        images: number of each node of the image -> that of its node of the sector.
        turn: the displacement of the image from that of the node, shape (3, 3).
    """

    sides: tuple[str, str]
    region: str
    surface: str
    images: Mapping[int, int]
    turn: Floats

    def facing(self, pair: tuple[str, str, str]) -> tuple[str, str, str]:
        """A contact pair between both sides of the sector as one with the next sector; others stay as they are."""
        if {name.upper() for name in pair[:2]} != {*self.sides}:
            return pair
        slave, master = (self.surface if name.upper() == self.sides[1] else name for name in pair[:2])
        return slave, master, pair[2]


def rotation(axis: Floats, angle: float) -> Floats:
    """The matrix of a rotation about a unit vector."""
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def sectors_of(block: DeckBlock, blocks: Iterable[DeckBlock]) -> Sectors:
    """What a *CYCLIC SYMMETRY MODEL says.

    Args:
        block: the keyword.
        blocks: all keywords of the file.

    Raises:
        DeckError: the number of sectors, the axis or the name of the tie is wrong.
    """
    name = block.parameters.get("TIE", "").upper()
    ties = [
        tie
        for tie in blocks
        if tie.keyword == "TIE" and "CYCLICSYMMETRY" in tie.parameters
        if not name or tie.parameters.get("NAME", "").upper() == name
    ]
    if len(ties) != 1 or not ties[0].rows or len(ties[0].rows[0]) < 2:
        raise DeckError(block, f"{f'TIE={name}' if name else 'its tie'} is no single *TIE, CYCLIC SYMMETRY of the file")
    if "N" not in block.parameters:
        raise DeckError(block, "'N' is missing")
    try:
        count, words = parameter(block, "N"), [real(word) for row in block.rows[:1] for word in row[:6]]
    except ValueError as error:
        raise DeckError(block, str(error)) from None
    if count < 2 or count != round(count) or len(words) != 6 or words[:3] == words[3:]:
        raise DeckError(block, "N, a whole number from 2 on, and two points of the axis are expected")
    first, second = np.array(words[:3]), np.array(words[3:])
    slave, master = ties[0].rows[0][:2]
    return Sectors(slave, master, int(count), first, (second - first) / np.linalg.norm(second - first))


@dataclass(frozen=True)
class ReadMesh:
    """What has been read of the mesh of a file.

    Attributes:
        points: the coordinates of each node by its number.
        nodes: the numbers of the nodes of each element by its number.
        types: the type of each element as the file has it, by its number.
        surfaces: the faces of each surface, each an element and a number from 1 on.
        node_sets: the numbers of the members of each set of nodes.
        element_sets: those of each set of elements.
        corners: of a face of an element, those among its nodes.
    """

    points: Mapping[int, Sequence[float]]
    nodes: Mapping[int, Sequence[int]]
    types: Mapping[int, str]
    surfaces: Mapping[str, Sequence[tuple[int, int]]]
    node_sets: Mapping[str, Sequence[int]]
    element_sets: Mapping[str, Sequence[int]]
    corners: Callable[[int, int], Sequence[int]]

    def side(self, name: str) -> list[int]:
        """The nodes of a surface of faces or of nodes, whatever its case; none: there is no such surface."""
        faces = _named(self.surfaces, name)
        solid = [(element, face) for element, face in faces if element in self.nodes]
        at_faces = [self.nodes[element][k] for element, face in solid for k in self.corners(element, face)]
        return list(dict.fromkeys([*at_faces, *_named(self.node_sets, name)]))


def asks_for_contact(block: DeckBlock) -> bool:
    """Whether a keyword says that a sector touches the next one."""
    return block.keyword == "CYCLICSYMMETRYMODEL" and "CONTACT" in block.parameters


def with_next_sectors(
    blocks: Sequence[DeckBlock], mesh: ReadMesh, unused: Callable[[str], str]
) -> tuple[list[DeckBlock], dict[int, NextSector]]:
    """The keywords of a file with what its sectors touch, before its first step.

    Args:
        blocks: the keywords.
        mesh: what they say of nodes and elements.
        unused: gives a name that the file does not have and that begins with a word.

    Returns:
        The keywords, and what has been added, by the number of its *CYCLIC SYMMETRY MODEL.  Where sides are not there,
        the one that is touched has no faces, or no *CONTACT PAIR names both, nothing is.

    Raises:
        DeckError: a *CYCLIC SYMMETRY MODEL is wrong.
    """
    added: list[DeckBlock] = []
    made: dict[int, NextSector] = {}
    numbers = itertools.chain(mesh.points, mesh.nodes, *mesh.node_sets.values(), *mesh.element_sets.values())
    following = 1 + max(numbers, default=0)
    pairs = [
        {word.upper() for word in row[:2]} for block in blocks if block.keyword == "CONTACTPAIR" for row in block.rows
    ]
    for block in filter(asks_for_contact, blocks):
        sectors = sectors_of(block, blocks)
        faces = [face for face in _named(mesh.surfaces, sectors.master) if face[0] in mesh.nodes]
        slave, master = (
            [node for node in mesh.side(name) if len(mesh.points.get(node, ())) == 3]
            for name in (sectors.slave, sectors.master)
        )
        if not slave or not master or not faces or {sectors.slave.upper(), sectors.master.upper()} not in pairs:
            continue
        at = [np.array([mesh.points[node] for node in side]) for side in (slave, master)]
        turn = sectors.turn(at[1], at[0])
        elements = list(dict.fromkeys(element for element, _ in faces))
        nodes = list(dict.fromkeys(node for element in elements for node in mesh.nodes[element]))
        if not mesh.points.keys() >= {*nodes}:
            continue  # an error, which is told where the elements are put together
        image = dict(zip(nodes, range(following, following + len(nodes)), strict=True))
        image_of = dict(zip(elements, range(following, following + len(elements)), strict=True))
        following += len(nodes) + len(elements)
        names = [unused(word) for word in (_NAME, f"{sectors.master}_{_NAME}")]
        new = _keywords(blocks, mesh, faces, (image, image_of), names)
        places = sectors.turned(np.array([mesh.points[node] for node in nodes]), turn)
        rows = [[str(image[node]), *map(repr, place)] for node, place in zip(nodes, plain(places), strict=True)]
        new.insert(0, DeckBlock("NODE", {}, 0, rows))
        added += [replace(entry, line=block.line, file=block.file, name=block.name) for entry in new]
        sides = sectors.slave.upper(), sectors.master.upper()
        made[block.number] = NextSector(sides, names[0], names[1], {image[node]: node for node in nodes}, turn)
    first = next((n for n, block in enumerate(blocks) if block.keyword == "STEP"), len(blocks))
    numbered = [replace(entry, number=len(blocks) + n) for n, entry in enumerate(added)]
    return [*blocks[:first], *numbered, *blocks[first:]], made


def _keywords(
    blocks: Sequence[DeckBlock],
    mesh: ReadMesh,
    faces: Sequence[tuple[int, int]],
    images: tuple[Mapping[int, int], Mapping[int, int]],
    names: Sequence[str],
) -> list[DeckBlock]:
    """The elements of an image, their material and the side that is touched; what is said of all elements is said of
    them, too.

    Args:
        blocks: of the file.
        mesh: what they say.
        faces: of the side that is touched.
        images: the number of the image of each node, and of each element.
        names: of the set of the elements, and of the side.
    """
    image, image_of = images
    new = []
    for kind in dict.fromkeys(mesh.types[element] for element in image_of):
        rows = [
            [str(copy), *(str(image[node]) for node in mesh.nodes[element])]
            for element, copy in image_of.items()
            if mesh.types[element] == kind
        ]
        new.append(DeckBlock("ELEMENT", {"TYPE": kind, "ELSET": names[0]}, 0, rows))
    everything = [name for name, members in mesh.element_sets.items() if {*members} >= mesh.nodes.keys()]
    new += [DeckBlock("ELSET", {"ELSET": name}, 0, [[names[0]]]) for name in everything]
    new.append(DeckBlock("SURFACE", {"NAME": names[1]}, 0, [[str(image_of[e]), f"S{face}"] for e, face in faces]))
    new += [
        DeckBlock("MATERIAL", {"NAME": names[0]}, 0),
        DeckBlock("ELASTIC", {}, 0, [[repr(WEAK_IMAGE * _least(blocks, "ELASTIC")), "0."]]),
    ]
    if density := _least(blocks, "DENSITY"):
        new.append(DeckBlock("DENSITY", {}, 0, [[repr(WEIGHTLESS_IMAGE * density)]]))
    if any(block.keyword == "EXPANSION" for block in blocks):
        new.append(DeckBlock("EXPANSION", {}, 0, [["0."]]))
    return [*new, DeckBlock("SOLIDSECTION", {"ELSET": names[0], "MATERIAL": names[0]}, 0)]


def _least(blocks: Sequence[DeckBlock], keyword: str) -> float:
    """The smallest positive first number of a keyword that the file has several times; zero: it has none."""
    rows = [block.rows[0] for block in blocks if block.keyword == keyword and block.rows]
    numbers = [real_or_none(row[0]) for row in rows if row]
    return min((number for number in numbers if number is not None and number > 0), default=0.0)


def _named(among: Mapping[str, Sequence[T]], name: str) -> Sequence[T]:
    """The members of what has a name, whatever its case."""
    return next((members for label, members in among.items() if label.upper() == name.upper()), ())
