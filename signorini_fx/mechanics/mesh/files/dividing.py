"""Quadrilaterals beside triangles, and hexahedra beside wedges and tetrahedra, divided into smaller ones.

A mesh here has one kind of cell.  Where most cells are straight quadrilaterals or hexahedra, all become such: bodies of
these alone keep their cells; in others each cell becomes one for each of its corners, by the middles of its edges, its
faces and itself: a quadrilateral four, a triangle three, a hexahedron eight, a wedge six, a tetrahedron four.
Simplices of degree 1 in their place would make bodies too stiff, and their stress at a corner is off by several
percent.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.mesh.files.cells import Corners
from signorini_fx.mechanics.mesh.files.cutting import BETWEEN, CORNERS, FACES, WORDS
from signorini_fx.mechanics.mesh.files.raw import RawMesh, row_keys, rows_of
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import DIVIDED_AT_MOST

_IN_PLANE = ("triangle", "quad")
# What all cells become -> those that may be beside them, but not more.  At each corner of each of them two edges meet
# in the plane, and three in space.
_BESIDE = {"quad": {"triangle"}, "hexahedron": {"tetra", "wedge"}}
# The kind of what a cell, a side of it or an edge becomes, by its number of nodes.
_PARTS = {2: "line", 4: "quad", 8: "hexahedron"}
_NUMBERS = {3: "three", 4: "four", 6: "six", 8: "eight"}


def divided(raw: RawMesh) -> tuple[RawMesh, Ints, str]:
    """A mesh of quadrilaterals in place of one in the plane that has triangles, too, but not more, or of hexahedra in
    place of one that has wedges or tetrahedra; any other as it is, and in space one whose cells do not meet face to
    face, or that would have too many nodes.

    Returns:
        The mesh, whose new points come last; the nodes between which each of these is, shape (k, 4), in space (k, 8),
        -1: none; and in words what was divided.
    """
    unchanged = raw, np.empty((0, 4), dtype=np.int64), ""
    if not (body := _mixed(raw)):
        return unchanged
    mixed = _bodies_with(raw, body, body - _BESIDE.keys())
    taken = [mixed[nodes[:, 0]] if kind in body and nodes.size else None for kind, nodes in raw.blocks]
    cells = [(kind, nodes[rows]) for (kind, nodes), rows in zip(raw.blocks, taken, strict=True) if rows is not None]
    middles = _Dividing.of(cells, len(raw.points))
    centre = middles.first + len(middles.edges) + len(middles.faces)
    in_space = bool(len(middles.faces))
    if in_space and (not middles.meet() or centre + sum(len(nodes) for _, nodes in cells) > DIVIDED_AT_MOST):
        return unchanged
    blocks: list[tuple[str, Ints]] = []
    origins: list[Ints] = []  # of each block the row of the file that each row is a part of
    left_out = 0
    for (kind, nodes), rows in zip(raw.blocks, taken, strict=True):
        if rows is not None:
            centres = np.where(rows, centre + np.cumsum(rows) - 1, -1)
            centre += np.count_nonzero(rows)
        else:
            centres = middles.of_sides(kind, nodes)
        split = np.flatnonzero(centres >= 0)
        if not split.size:
            blocks.append((kind, nodes))
            origins.append(np.arange(len(nodes)))
            continue
        parts = middles.parts(kind, nodes[split], centres[split])
        width = parts.shape[2]
        # Of another kind than its parts, what is not divided is no cell and no side of one.
        undivided = np.flatnonzero(centres < 0)
        if _PARTS[width] != kind:
            left_out += undivided.size
            undivided = split[:0]
        blocks.append((_PARTS[width], np.concatenate((nodes[undivided].reshape(-1, width), parts.reshape(-1, width)))))
        origins.append(np.concatenate((undivided, split.repeat(parts.shape[1]))))
    ends = middles.ends([nodes for _, nodes in cells])
    mesh = replace(
        raw,
        points=np.concatenate((raw.points, _means(raw.points, ends))),
        blocks=blocks,
        sets={name: _rows(members, origins) for name, members in raw.sets.items()},
        node_sets={name: middles.added_to(nodes) for name, nodes in raw.node_sets.items()},
        data={name: [v[k] for v, k in zip(values, origins, strict=True)] for name, values in raw.data.items()},
    )
    shells = f"; {left_out} triangles that are no side of a cell are left out" if left_out else ""
    return mesh, ends, _words(cells) + shells


def _mixed(raw: RawMesh) -> set[str]:
    """The kinds of the cells of a mesh that is to be divided; none: it is not."""
    counts: dict[str, int] = {}
    for kind, nodes in raw.blocks:
        if len(nodes) and not kind.startswith(("line", "vertex", "polygon")):
            counts[kind] = counts.get(kind, 0) + len(nodes)
    body = counts.keys() - set(_IN_PLANE) or set(counts)
    valid = all(0 <= nodes.min() <= nodes.max() < len(raw.points) for _, nodes in raw.blocks if nodes.size)
    for kind, beside in _BESIDE.items():
        among = body & beside
        if body == {kind} | among and among and sum(counts[fewer] for fewer in among) <= counts[kind]:
            in_space = kind == "hexahedron"
            return set(body) if valid and (not in_space or raw.points.shape[1] == 3) else set()
    return set()


@dataclass(frozen=True)
class _Dividing:
    """The points that divide cells: in the middle of their edges, then in space of their faces, then of the cells.

    Attributes:
        first: the number of the first one.
        edges: the nodes of each edge, shape (e, 2).
        faces: those of each face, along its perimeter, shape (f, 4), the last -1 of a triangle; none in the plane.
    """

    first: int
    edges: Ints
    faces: Ints

    @classmethod
    def of(cls, cells: Sequence[tuple[str, Ints]], first: int) -> _Dividing:
        """Those of cells by their kinds."""
        edges = np.concatenate([nodes[:, _edges(kind)].reshape(-1, 2) for kind, nodes in cells])
        faces = np.concatenate(
            [np.empty((0, 4), dtype=np.int64)]
            + [_padded(nodes[:, face], 4) for kind, nodes in cells for face in FACES.get(kind, ())]
        )
        return cls(first, *(table[np.unique(row_keys(table), return_index=True)[1]] for table in (edges, faces)))

    def meet(self) -> bool:
        """Whether no triangle is a part of a quadrilateral of another cell."""
        of_four = self.faces[self.faces[:, 3] >= 0]
        halves = of_four[:, [[0, 1, 2], [1, 2, 3], [2, 3, 0], [3, 0, 1]]].reshape(-1, 3)
        return not (rows_of(self.faces[self.faces[:, 3] < 0, :3], halves) >= 0).any()

    def of_sides(self, kind: str, nodes: Ints) -> Ints:
        """The points in the middle of lines in the plane, or faces in space; -1: it is of no divided cell."""
        in_space = bool(len(self.faces))
        if not nodes.size or kind not in (_IN_PLANE if in_space else ("line",)):
            return np.full(len(nodes), -1)
        table, first = (self.faces, self.first + len(self.edges)) if in_space else (self.edges, self.first)
        at = rows_of(_padded(nodes, table.shape[1]), table)
        return np.where(at >= 0, first + at, -1)

    def parts(self, kind: str, nodes: Ints, centres: Ints) -> Ints:
        """The parts of cells, or sides, one for each corner, shape (m, corners, nodes of each)."""
        edges = self.first + rows_of(nodes[:, _edges(kind)].reshape(-1, 2), self.edges).reshape(len(nodes), -1)
        sides = [
            self.first + len(self.edges) + rows_of(_padded(nodes[:, face], 4), self.faces)[:, None]
            for face in FACES.get(kind, ())
        ]
        points = np.concatenate((nodes, edges, *sides, centres[:, None]), axis=1)
        return points[:, _parts(kind)]

    def ends(self, cells: Sequence[Ints]) -> Ints:
        """The nodes between which each point is, of cells by their blocks, too; see ``divided``."""
        width = 8 if len(self.faces) else 4
        return np.concatenate([_padded(nodes, width) for nodes in (self.edges, self.faces, *cells)])

    def added_to(self, nodes: Ints) -> Ints:
        """A set of nodes with the middles of the edges and faces all of whose corners it has."""
        within = [np.isin(self.edges, nodes).all(axis=1), (np.isin(self.faces, nodes) | (self.faces < 0)).all(axis=1)]
        return np.concatenate((nodes, self.first + np.flatnonzero(np.concatenate(within))))


def _edges(kind: str) -> Ints:
    """Corners of each edge of a kind of cell, shape (k, 2)."""
    return np.array(_pairs(kind), dtype=np.int64).reshape(-1, 2)


def _pairs(kind: str) -> list[Corners]:
    """The edges of a kind of cell; a line has none."""
    return [pair for pair in BETWEEN.get(kind, ()) if len(pair) == 2]


def _parts(kind: str) -> Ints:
    """Of each part of a kind of cell its nodes, by their numbers among the corners, edges, faces and the middle."""
    if kind == "line":
        return np.array([(0, 2), (2, 1)])
    pairs, faces, count = _pairs(kind), FACES.get(kind, ()), CORNERS[kind]
    centre = count + len(pairs) + len(faces)

    def edge(*ends: int) -> int:
        return count + next(k for k, pair in enumerate(pairs) if set(pair) == set(ends))

    def face(*corners: int) -> int:
        return count + len(pairs) + next(k for k, face in enumerate(faces) if set(corners) <= set(face))

    parts: list[Corners] = []
    for corner in range(count):
        around = next((face for face in faces if corner in face), tuple(range(count)))
        at = around.index(corner)
        back, forth = around[at - 1], around[(at + 1) % len(around)]
        if not faces:
            parts.append((corner, edge(corner, forth), centre, edge(back, corner)))
            continue
        ends = {end for pair in pairs if corner in pair for end in pair}
        (up,) = ends - {corner, back, forth}
        below = corner, edge(corner, back), face(corner, back, forth), edge(corner, forth)
        parts.append((*below, edge(corner, up), face(corner, back, up), centre, face(corner, forth, up)))
    return np.array(parts)


def _padded(nodes: Ints, width: int) -> Ints:
    """Rows of nodes with -1 for those that they lack."""
    return np.pad(nodes, ((0, 0), (0, width - nodes.shape[1])), constant_values=-1)


def _words(cells: Sequence[tuple[str, Ints]]) -> str:
    """What was divided."""
    counts: dict[str, int] = {}
    for kind, nodes in cells:
        counts[kind] = counts.get(kind, 0) + len(nodes)
    target = "quad" if counts.keys() <= set(_IN_PLANE) else "hexahedron"
    parts = [
        f"{counts[kind]} {WORDS[kind]} into {_NUMBERS[CORNERS[kind]]} each"
        for kind in (target, *sorted(_BESIDE[target]))
        if counts.get(kind)
    ]
    divided_cells = " and ".join(parts)
    return f"{divided_cells} are divided, as a mesh has one kind of cell: all are {WORDS[target]}"


def _bodies_with(raw: RawMesh, body: Collection[str], kinds: Collection[str]) -> npt.NDArray[np.bool_]:
    """Which points are of a body, cells that share nodes, that has a cell of some kinds."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(raw.points)
    pairs = [
        np.column_stack((np.repeat(nodes[:, 0], nodes.shape[1] - 1), nodes[:, 1:].ravel()))
        for kind, nodes in raw.blocks
        if kind in body and nodes.size
    ]
    i, j = np.concatenate(pairs).T
    number = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(count, count)), directed=False)[1]
    corners = [nodes[:, 0] for kind, nodes in raw.blocks if kind in kinds and nodes.size]
    return np.isin(number, np.unique(number[np.concatenate(corners)]))


def _means(points: Floats, ends: Ints) -> Floats:
    """The places midway between some of the points, shape (k, d or 3); ``ends``: see ``divided``."""
    x = np.where((ends >= 0)[:, :, None], np.asarray(points, dtype=np.float64)[ends], 0.0)
    return np.asarray(x.sum(axis=1) / (ends >= 0).sum(axis=1)[:, None])


def _rows(members: list[Ints], origins: list[Ints]) -> list[Ints]:
    """The rows of each block that are parts of some rows of it before."""
    return [np.flatnonzero(np.isin(rows, chosen)) for rows, chosen in zip(origins, members, strict=True)]
