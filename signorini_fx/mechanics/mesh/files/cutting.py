"""Wedges and pyramids, and hexahedra beside them, cut into tetrahedra; quadrilaterals beside triangles into triangles.

Every cell is cut by the rays from the corner that the file numbers lowest, and so is every quadrilateral: two cells cut
the face between them alike (Dompierre, Labbe, Vallet and Camarero, "How to subdivide pyramids, prisms and hexahedra
into tetrahedra", 1999).  Cells with nodes on their edges become tetrahedra with ten nodes: those of the file, and one
in the middle of each diagonal of a face or cell.  Where the cell has none there, it is where the shape functions of the
serendipity element put it, so that two cells have the same one on the face between them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.cells import CELLS, Corners, completed
from signorini_fx.mechanics.mesh.files.raw import RawMesh, row_keys, rows_of
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import PARALLEL

# Corners along each face, in the order of VTK.
FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
}
# The corners that each node between corners is in the middle of; an element may lack the last ones.
BETWEEN: dict[str, tuple[Corners, ...]] = {
    "triangle": CELLS["triangle6"].nodes[3:],
    "quad": CELLS["quad9"].nodes[4:],
    "tetra": CELLS["tetra10"].nodes[4:],
    "pyramid": ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4), (0, 1, 2, 3)),
    "wedge": (
        *((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
        *((0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    ),
    "hexahedron": CELLS["hexahedron27"].nodes[8:],
}
CORNERS = {"triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
WORDS = {
    **{"pyramid": "pyramids", "wedge": "wedges", "hexahedron": "hexahedra", "quad": "quadrilaterals"},
    **{"tetra": "tetrahedra", "triangle": "triangles"},
}


def shape_of(kind: str) -> str:
    """The kind without its number of nodes."""
    return kind.rstrip("0123456789")


def cut(raw: RawMesh, name: str) -> tuple[RawMesh, str]:
    """A mesh of simplices in place of one with wedges, pyramids or several shapes in the plane; any other as it is.

    Returns:
        The mesh, and in words what was cut.

    Raises:
        MeshError: a cell is folded.
    """
    kinds = {kind for kind, nodes in raw.blocks if len(nodes)}
    solid = {kind for kind in kinds if shape_of(kind) in FACES}
    body = solid or {kind for kind in kinds if shape_of(kind) in ("triangle", "quad")}
    shapes = {shape_of(kind) for kind in body}
    curved = {kind != shape_of(kind) for kind in body}
    valid = all(0 <= nodes.min() <= nodes.max() < len(raw.points) for _, nodes in raw.blocks if nodes.size)
    if not valid or len(curved) > 1 or "triangle7" in body:
        return raw, ""
    wanted = len(shapes) == 2
    if solid:
        apart = len(shapes) > 1 and _apart(raw, body)
        wanted = (bool(shapes & {"pyramid", "wedge"}) or apart) and raw.points.shape[1] == 3
    if not wanted:
        return raw, ""
    simplex = "tetra" if solid else "triangle"
    middles = _Middles(raw, body) if True in curved else None
    counts = dict.fromkeys(WORDS, 0)
    blocks: list[tuple[str, Ints]] = []
    pieces: list[int] = []
    for kind, nodes in raw.blocks:
        shape = shape_of(kind)
        simplices = nodes[:, None]
        if len(nodes) and kind in body and shape != simplex:
            counts[shape] += len(nodes)
            simplices = _cells(raw.points, nodes[:, : CORNERS[shape]], shape, name) if solid else _halves(nodes[:, :4])
            kind, simplices = (simplex, simplices) if middles is None else middles.given(simplex, simplices)
        elif shape == "quad":
            kind, simplices = "triangle", _halves(nodes[:, :4])
        blocks.append((kind, simplices.reshape(-1, simplices.shape[2])))
        pieces.append(simplices.shape[1])
    sets: dict[str, list[Ints]] = {
        name: [np.asarray(rows[:, None] * k + np.arange(k)).ravel() for rows, k in zip(members, pieces, strict=True)]
        for name, members in raw.sets.items()
    }
    data = {
        name: [values.repeat(k, axis=0) for values, k in zip(numbers, pieces, strict=True)]
        for name, numbers in raw.data.items()
    }
    description = " and ".join(f"{count} {WORDS[kind]}" for kind, count in counts.items() if count)
    points = raw.points if middles is None else middles.points
    word = "tetrahedra" if solid else "triangles"
    return replace(raw, points=points, blocks=blocks, sets=sets, data=data), f"{description} are cut into {word}"


def _apart(raw: RawMesh, body: set[str]) -> bool:
    """Whether cells of different shapes have no common node: they are different bodies."""
    present: dict[str, npt.NDArray[np.bool_]] = {}
    for kind, nodes in raw.blocks:
        if kind in body:
            present.setdefault(shape_of(kind), np.zeros(len(raw.points), dtype=bool))[nodes] = True
    return bool((np.sum([*present.values()], axis=0) <= 1).all())


class _Middles:
    """The nodes in the middle of edges and diagonals.

    Attributes:
        points: those of the file, and those that its elements lack.
    """

    def __init__(self, raw: RawMesh, body: set[str]) -> None:
        self.points = np.asarray(raw.points, dtype=np.float64)
        made: list[tuple[Ints, Ints]] = []
        existing: list[tuple[Ints, Ints]] = []
        for kind, nodes in raw.blocks:
            if kind in body and len(nodes):
                shape = shape_of(kind)
                for k, corners in enumerate(BETWEEN[shape][: nodes.shape[1] - CORNERS[shape]]):
                    existing += [(nodes[:, pair], nodes[:, CORNERS[shape] + k]) for pair in _pairs(corners)]
                made += self._lacking(shape, nodes)
        # What the file has comes last, and is taken.
        self._pairs = np.concatenate([pairs for pairs, _ in made + existing])
        self._nodes = np.concatenate([node for _, node in made + existing])

    def _lacking(self, shape: str, nodes: Ints) -> list[tuple[Ints, Ints]]:
        """Diagonals of faces and cells without a node in the middle, and the new nodes there."""
        node_of = {frozenset(corners): CORNERS[shape] + k for k, corners in enumerate(BETWEEN[shape])}
        node_count = nodes.shape[1]
        added: list[tuple[Ints, Ints]] = []
        faces = [face for face in FACES.get(shape, (tuple(range(CORNERS[shape])),)) if len(face) == 4]
        lacking = [corners for corners in faces if node_of[frozenset(corners)] >= node_count]
        for corners in [*lacking, tuple(range(8))] if node_count == 20 else lacking:
            element = completed("quad8" if len(corners) == 4 else "hexahedron20")
            assert element is not None
            cell, weights = element
            ends = [[corners[c] for c in pair] for pair in cell.nodes if len(pair) <= 2]
            locals_ = [pair[0] if len(pair) == 1 else node_of[frozenset(pair)] for pair in ends]
            _, first, number = np.unique(row_keys(nodes[:, corners]), return_index=True, return_inverse=True)
            x = np.einsum("n,cnd->cd", weights[-1], self.points[nodes[first][:, locals_]])
            added += [(nodes[:, pair], len(self.points) + number.reshape(-1)) for pair in _pairs(corners)]
            self.points = np.concatenate((self.points, x))
        return added

    def given(self, simplex: str, corners: Ints) -> tuple[str, Ints]:
        """The kind of simplices with nodes on their edges, and their nodes, shape (m, k, nodes of each)."""
        between = np.array(BETWEEN[simplex])
        wanted = corners[:, :, between].reshape(-1, 2)
        rows = rows_of(wanted, self._pairs)
        assert rows.min(initial=0) >= 0
        nodes = self._nodes[rows].reshape(*corners.shape[:2], len(between))
        return f"{simplex}{corners.shape[2] + len(between)}", np.concatenate((corners, nodes), axis=2)


def _pairs(corners: Corners) -> list[list[int]]:
    """The pairs of corners whose middle is that of an edge, a face or a hexahedron."""
    opposite = {2: ((0, 1),), 4: ((0, 2), (1, 3)), 8: ((0, 6), (1, 7), (2, 4), (3, 5))}[len(corners)]
    return [[corners[a], corners[b]] for a, b in opposite]


def _halves(quads: Ints) -> Ints:
    """Two triangles of each quadrilateral, at the diagonal through its lowest number, shape (m, 2, 3)."""
    turned = np.take_along_axis(quads, (np.argmin(quads, axis=1)[:, None] + np.arange(4)) % 4, axis=1)
    return np.asarray(turned[:, [[0, 1, 2], [0, 2, 3]]])


def _cells(points: Floats, cells: Ints, kind: str, name: str) -> Ints:
    """The tetrahedra of each cell, shape (m, k, 4).

    Raises:
        MeshError: some of them are inside out.
    """
    faces = FACES[kind]
    lowest = np.argmin(cells, axis=1)
    tetrahedra: Ints | None = None
    for corner in range(cells.shape[1]):
        chosen = lowest == corner
        opposite = [
            _halves(cells[chosen][:, face]) if len(face) == 4 else cells[chosen][:, None, face]
            for face in faces
            if corner not in face
        ]
        sides = np.concatenate(opposite, axis=1)
        fan = np.concatenate(
            (sides, np.broadcast_to(cells[chosen, corner][:, None, None], (*sides.shape[:2], 1))), axis=2
        )
        # From the apex of a pyramid there are two, and from another corner as well.
        tetrahedra = np.empty((len(cells), fan.shape[1], 4), dtype=np.int64) if tetrahedra is None else tetrahedra
        tetrahedra[chosen] = fan
    assert tetrahedra is not None
    x = np.asarray(points, dtype=np.float64)[tetrahedra]
    volume = np.linalg.det(x[:, :, 1:] - x[:, :, :1])
    # Programs number wedges either way round.
    volume *= np.sign(volume.sum(axis=1, keepdims=True))
    folded: npt.NDArray[np.bool_] = (volume < -PARALLEL * volume.sum(axis=1, keepdims=True)).any(axis=1)
    if folded.any():
        point = ", ".join(f"{x:g}" for x in np.asarray(points)[cells[np.argmax(folded)]].mean(axis=0))
        raise MeshError(f"{name}: {np.count_nonzero(folded)} {WORDS[kind]} are folded, the first at ({point})")
    return tetrahedra
