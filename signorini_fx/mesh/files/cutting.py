"""Wedges and pyramids, and hexahedra beside them, cut into tetrahedra that meet face to face.

Every cell is cut by the rays from the corner that the file numbers lowest, and so is every quadrilateral: two cells cut
the face between them alike, without new points (Dompierre, Labbe, Vallet and Camarero, "How to subdivide pyramids,
prisms and hexahedra into tetrahedra", 1999).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from signorini_fx.errors import MeshError
from signorini_fx.mesh.files.raw import RawMesh
from signorini_fx.mesh.files.shape import Floats, Ints

# Corners along each face, in the order of VTK.
_FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
}
_FLAT = 1e-12  # of the volume of a cell: round-off
_WORDS = {"tetra": "tetrahedra", "pyramid": "pyramids", "wedge": "wedges", "hexahedron": "hexahedra"}


def cut(raw: RawMesh, name: str) -> tuple[RawMesh, str]:
    """A mesh of tetrahedra in place of one with wedges or pyramids, and what was cut; any other mesh as it is.

    Cells with nodes between their corners are not cut.

    Raises:
        MeshError: a cell is folded.
    """
    kinds = {kind for kind, nodes in raw.blocks if len(nodes)}
    whole = all(0 <= nodes.min() <= nodes.max() < len(raw.points) for _, nodes in raw.blocks if nodes.size)
    if not kinds & {"pyramid", "wedge"} or not whole or raw.points.shape[1] < 3:
        return raw, ""
    counts = dict.fromkeys(_WORDS, 0)
    blocks: list[tuple[str, Ints]] = []
    pieces: list[int] = []
    for kind, nodes in raw.blocks:
        if kind in _FACES and kind != "tetra":
            counts[kind] += len(nodes)
            found, folded = _cells(raw.points, nodes, kind)
            if folded.any():
                count = f"{np.count_nonzero(folded)} {_WORDS[kind]}"
                place = ", ".join(f"{x:g}" for x in raw.points[nodes[np.argmax(folded)]].mean(axis=0))
                raise MeshError(f"{name}: {count} are folded, the first at ({place})")
            blocks.append(("tetra", found.reshape(-1, 4)))
            pieces.append(found.shape[1])
        elif kind == "quad":
            blocks.append(("triangle", _halves(nodes).reshape(-1, 3)))
            pieces.append(2)
        else:
            blocks.append((kind, nodes))
            pieces.append(1)
    sets: dict[str, list[Ints]] = {
        name: [np.asarray(rows[:, None] * k + np.arange(k)).ravel() for rows, k in zip(members, pieces, strict=True)]
        for name, members in raw.sets.items()
    }
    data = {
        name: [values.repeat(k, axis=0) for values, k in zip(numbers, pieces, strict=True)]
        for name, numbers in raw.data.items()
    }
    told = " and ".join(f"{count} {_WORDS[kind]}" for kind, count in counts.items() if count)
    return replace(raw, blocks=blocks, sets=sets, data=data), f"{told} are cut into tetrahedra"


def _halves(quads: Ints) -> Ints:
    """Two triangles of each quadrilateral, at the diagonal through its lowest number, shape (m, 2, 3)."""
    turned = np.take_along_axis(quads, (np.argmin(quads, axis=1)[:, None] + np.arange(4)) % 4, axis=1)
    return np.asarray(turned[:, [[0, 1, 2], [0, 2, 3]]])


def _cells(points: Floats, cells: Ints, kind: str) -> tuple[Ints, npt.NDArray[np.bool_]]:
    """The tetrahedra of each cell, shape (m, k, 4), and whether some of them are inside out, shape (m,)."""
    faces = _FACES[kind]
    lowest = np.argmin(cells, axis=1)
    found: Ints | None = None
    for corner in range(cells.shape[1]):
        here = lowest == corner
        opposite = [
            _halves(cells[here][:, face]) if len(face) == 4 else cells[here][:, None, face]
            for face in faces
            if corner not in face
        ]
        sides = np.concatenate(opposite, axis=1)
        own = np.concatenate(
            (sides, np.broadcast_to(cells[here, corner][:, None, None], (*sides.shape[:2], 1))), axis=2
        )
        # From the apex of a pyramid there are two, and from another corner as well.
        found = np.empty((len(cells), own.shape[1], 4), dtype=np.int64) if found is None else found
        found[here] = own
    assert found is not None
    x = np.asarray(points, dtype=np.float64)[found]
    volume = np.linalg.det(x[:, :, 1:] - x[:, :, :1])
    # Programs number wedges either way round.
    volume *= np.sign(volume.sum(axis=1, keepdims=True))
    return found, (volume < -_FLAT * volume.sum(axis=1, keepdims=True)).any(axis=1)
