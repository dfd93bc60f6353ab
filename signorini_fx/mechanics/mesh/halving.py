"""Operations on a mesh in plain arrays: straighten its sides, or halve the sides of all cells; names are kept.

A triangle or quadrilateral is divided into four, a tetrahedron or hexahedron into eight.  Cells with curved sides are
divided on their own geometry: their children lie on the same curves.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, row_keys, rows_of, sides_of
from signorini_fx.mechanics.mesh.files.cells import CELLS, Cell, Floats, Ints, straight

# Places on the reference cell in units of a quarter of a side, so that nodes between children's corners are whole
# numbers too.
_VertexKey = tuple[int, ...]
_SIDE = 4


def straightened(mesh: MeshArrays) -> MeshArrays:
    """The mesh without the nodes between its corners."""
    if mesh.degree == 1:
        return mesh
    used, corners = np.unique(mesh.corners, return_inverse=True)
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(used.size)
    return replace(
        mesh,
        points=mesh.points[used],
        kind=straight(mesh.cell).kind,
        cells=corners.reshape(mesh.corners.shape),
        facets=number[mesh.facet_corners],
    )


def quadratic(mesh: MeshArrays) -> MeshArrays:
    """A mesh of straight cells with nodes in the middle of their edges and faces, of the same shape."""
    cell = next(kind for kind in CELLS.values() if kind.corners == mesh.cell.corners and kind.degree == 2)
    nodes = _nodes([tuple(_SIDE * value for value in corner) for corner in cell.corners], cell)
    lattice, number, points = _on_lattice(mesh, [nodes])
    cells = number[:, _places([nodes], lattice)[0]]
    rows = rows_of(mesh.facet_corners, sides_of(mesh.cells, mesh.cell)[:, : len(mesh.facet.corners)])
    return replace(mesh, points=points, kind=cell.kind, cells=cells, facets=sides_of(cells, cell)[rows])


def halved(mesh: MeshArrays) -> MeshArrays:
    """The mesh with every side of every cell halved."""
    cell = mesh.cell
    children = [_nodes(child, cell) for child in _children(cell)]
    lattice, number, points = _on_lattice(mesh, children)
    places = _places(children, lattice)
    sides = _facets_of(children, places, cell)
    at = rows_of(mesh.facet_corners, sides_of(mesh.cells, cell)[:, : len(mesh.facet.corners)])
    owner, side = np.divmod(at, len(cell.facets))
    halves = number[owner[:, None, None], np.array(sides)[side]]
    return MeshArrays(
        points=points,
        kind=mesh.kind,
        cells=number[:, places].reshape(-1, len(cell.nodes)),
        facets=halves.reshape(-1, halves.shape[2]),
        boundaries={name: _repeated(rows, halves.shape[1]) for name, rows in mesh.boundaries.items()},
        regions={name: _repeated(rows, len(children)) for name, rows in mesh.regions.items()},
    )


def _facets_of(children: list[list[_VertexKey]], places: Ints, cell: Cell) -> list[Ints]:
    """For each facet of a cell the nodes of its children's facets on it, as places of the lattice, shape (parts, l)."""
    return [
        np.array(
            [
                places[child, list(nodes)]
                for child, members in enumerate(children)
                for nodes, corners in zip(cell.facet_nodes, cell.facets, strict=True)
                if all(_on(cell, facet, members[c]) for c in corners)
            ],
            dtype=np.int64,
        )
        for facet in cell.facets
    ]


def _nodes(corners: list[_VertexKey], kind: Cell) -> list[_VertexKey]:
    """The places of the nodes of a cell, or a facet, of a kind between its corners."""
    return [_middle([corners[c] for c in members]) for members in kind.nodes]


def _on_lattice(mesh: MeshArrays, children: list[list[_VertexKey]]) -> tuple[list[_VertexKey], Ints, Floats]:
    """The places of the nodes of children; the number of each in each cell, the same in all cells that share it, shape
    (m, places); and the positions of these numbers, shape (n, d).
    """
    cell = mesh.cell
    lattice = sorted({point for child in children for point in child})
    x = np.array(lattice) / _SIDE
    number, first = _numbered(mesh.corners, np.rint(cell.weights(x) * _SIDE**cell.dim).astype(np.int64))
    points = np.einsum("ln,cnd->cld", cell.shape(x), mesh.points[mesh.cells])
    return lattice, number, points.reshape(-1, mesh.dim)[first]


def _places(entities: list[list[_VertexKey]], lattice: list[_VertexKey]) -> Ints:
    """Where the nodes of each entity are in the lattice."""
    return np.array([[lattice.index(point) for point in nodes] for nodes in entities], dtype=np.int64)


def _numbered(corners: Ints, weights: Ints) -> tuple[Ints, Ints]:
    """A number for each place of the lattice in each cell, the same in all cells that share it, shape (m, places), and
    for each number the first place in the flattened table.  Corners and their weights say where a place is.
    """
    count, weight_bound = int(corners.max()) + 1, int(weights.max()) + 1
    number = np.empty((len(corners), len(weights)), dtype=np.int64)
    first: list[Ints] = []
    total = 0
    on = (weights > 0).sum(axis=1)
    for width in np.unique(on):  # places at corners, on sides, on faces, inside
        columns = np.flatnonzero(on == width)
        corner_numbers = np.array([np.flatnonzero(weights[column]) for column in columns])
        keys = corners[:, corner_numbers] * weight_bound + weights[columns[:, None], corner_numbers]
        if width == weights.shape[1]:
            keys = np.arange(len(corners) * len(columns)).reshape(len(corners), len(columns), 1) + count * weight_bound
        _, index, inverse = np.unique(row_keys(keys.reshape(-1, keys.shape[2])), return_index=True, return_inverse=True)
        number[:, columns] = total + inverse.reshape(len(corners), len(columns))
        cell, column = np.divmod(index, len(columns))
        first.append(cell * len(weights) + columns[column])
        total += len(index)
    return number, np.concatenate(first)


def _repeated(rows: Ints, times: int) -> Ints:
    """Rows of the children."""
    return (times * rows[:, None] + np.arange(times)).ravel()


def _middle(places: list[_VertexKey]) -> _VertexKey:
    return tuple(sum(values) // len(places) for values in zip(*places, strict=True))


def _on(cell: Cell, facet: tuple[int, ...], point: _VertexKey) -> bool:
    """Whether a place is on a facet: no other corner has a weight there."""
    weights = cell.weights(np.array([point]) / _SIDE)[0]
    return float(weights[list(facet)].sum()) > 1 - 1e-9


def _children(cell: Cell) -> list[list[_VertexKey]]:
    """The corners of each child, in the order of a cell of the kind."""
    ends = [tuple(_SIDE * value for value in corner) for corner in cell.corners]
    if not cell.simplex:
        half = _SIDE // 2
        lows = product((0, half), repeat=cell.dim)
        return [
            [tuple(a + half * e for a, e in zip(low, corner, strict=True)) for corner in cell.corners] for low in lows
        ]
    mid = {(a, b): _middle([ends[a], ends[b]]) for b in range(len(ends)) for a in range(b)}
    if cell.dim == 2:
        return [
            [ends[0], mid[0, 1], mid[0, 2]],
            [mid[0, 1], ends[1], mid[1, 2]],
            [mid[0, 2], mid[1, 2], ends[2]],
            [mid[1, 2], mid[0, 2], mid[0, 1]],
        ]
    # The order of Bey (Computing 55, 1995): however often they are divided, tetrahedra have three shapes at most.
    x0, x1, x2, x3 = ends
    x01, x02, x03, x12, x13, x23 = (mid[pair] for pair in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)))
    return [
        [x0, x01, x02, x03],
        [x01, x1, x12, x13],
        [x02, x12, x2, x23],
        [x03, x13, x23, x3],
        [x01, x02, x03, x13],
        [x01, x02, x12, x13],
        [x02, x03, x13, x23],
        [x02, x12, x13, x23],
    ]
