"""Surfaces of nodes of an Abaqus input file that fill no whole faces, as the faces around them that look at the other
side of their contact.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock
from signorini_fx.mechanics.mesh.files.cells import Corners
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import FACING

Face = tuple[int, int]


@dataclass(frozen=True)
class ElementFaces:
    """The faces of the elements of a file.

    Attributes:
        points: of the nodes, by their rows, shape (n, 2) or (n, 3).
        elements: number -> nodes by their rows, corners first.
        faces: number -> corners of its faces S1, S2 and so on.
    """

    points: Floats
    elements: Mapping[int, Ints]
    faces: Mapping[int, Sequence[Corners]]

    def corners(self, face: Face) -> Ints:
        """Nodes at the corners of a face, by their rows."""
        element, number = face
        return self.elements[element][list(self.faces[element][number - 1])]

    def outward(self, face: Face) -> Floats:
        """Its outward unit normal, shape (3,)."""
        x = np.zeros((len(corners := self.corners(face)), 3))
        x[:, : self.points.shape[1]] = self.points[corners]
        inside = np.zeros(3)
        inside[: self.points.shape[1]] = self.points[self.elements[face[0]]].mean(axis=0)
        along = x[1:3] - x[0]
        normal = np.array([along[0, 1], -along[0, 0], 0.0]) if len(x) == 2 else np.cross(along[0], along[1])
        normal *= np.sign(normal @ (x.mean(axis=0) - inside))
        return np.asarray(normal / np.linalg.norm(normal))

    def around(self, nodes: Ints) -> list[Face]:
        """The faces at the boundary of the body that have some of these nodes at a corner."""
        count: dict[frozenset[int], int] = {}
        faces: dict[frozenset[int], Face] = {}
        among = {*map(int, nodes)}
        for element, listed in self.elements.items():
            if among.isdisjoint(map(int, listed)):
                continue
            for number in range(1, len(self.faces[element]) + 1):
                corners = frozenset(map(int, self.corners((element, number))))
                if not corners.isdisjoint(among):
                    count[corners] = count.get(corners, 0) + 1
                    faces[corners] = element, number
        return [face for corners, face in faces.items() if count[corners] == 1]


def faces_of_nodes(
    blocks: Sequence[DeckBlock],
    faces: ElementFaces,
    nodes_of: Mapping[str, Ints],
    surfaces: Mapping[str, Sequence[Face]],
) -> Iterator[tuple[str, list[Face]]]:
    """Surfaces of nodes in contact whose nodes are all corners of no face, and the faces that are taken for them.

    Args:
        blocks: all keywords.
        faces: of the elements of the body.
        nodes_of: surface of nodes, by its name in capitals -> its nodes, by their rows.
        surfaces: surface of faces, by its name in capitals -> its faces.
    """
    for block in blocks:
        if block.keyword != "CONTACTPAIR":
            continue
        for row in block.rows:
            slave, master = (name.upper() for name in (*row, "", "")[:2])
            if slave not in nodes_of or slave in surfaces or not surfaces.get(master):
                continue
            nodes = nodes_of[slave]
            around = faces.around(nodes)
            if any(np.isin(faces.corners(face), nodes).all() for face in around):
                continue
            others = [face for face in surfaces[master] if face[0] in faces.elements]
            middles = np.array([faces.points[faces.corners(face)].mean(axis=0) for face in others])
            facing = []
            for face in around if len(others) else ():
                middle = faces.points[faces.corners(face)].mean(axis=0)
                nearest = others[int(np.argmin(np.linalg.norm(middles - middle, axis=1)))]
                if faces.outward(face) @ faces.outward(nearest) < -FACING:
                    facing.append(face)
            if facing:
                yield slave, facing
