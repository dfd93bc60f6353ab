"""Operations on a mesh in plain arrays: straighten its sides, or halve the sides of all cells; names are kept.

A triangle or quadrilateral is divided into four, a tetrahedron or hexahedron into eight.  Where only some triangles
are, those beside them are divided so that the mesh stays conforming.  Cells with curved sides are divided on their own
geometry: their children lie on the same curves.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, sides_of
from signorini_fx.mechanics.mesh.files.cells import Cell, straight
from signorini_fx.mechanics.mesh.files.raw import row_keys, rows_of
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

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


def halved(mesh: MeshArrays) -> MeshArrays:
    """The mesh with every side of every cell halved; it remembers what was made of the cells of its file."""
    cell = mesh.cell
    children = [_nodes(child, cell) for child in _children(cell)]
    lattice, number, points = _on_lattice(mesh, children)
    places = _places(children, lattice)
    # The children of each facet, by the facets of children that are on it.
    sides = [
        [
            places[child, nodes]
            for child, members in enumerate(children)
            for nodes, corners in zip(cell.facet_nodes, cell.facets, strict=True)
            if all(_on(cell, facet, members[c]) for c in corners)
        ]
        for facet in cell.facets
    ]
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
        note=mesh.note,
        subdivided=mesh.subdivided,
    )


def halved_in_part(mesh: MeshArrays, chosen: npt.NDArray[np.bool_]) -> MeshArrays:
    """The triangles with the sides of some of them halved, and conforming.

    A triangle with one halved side is divided into two, and one with two halved sides into four: its third side is
    halved, too (Bank, Sherman and Weiser, Refinement algorithms and data structures for regular local mesh refinement,
    1983).

    Args:
        mesh: of triangles.
        chosen: whether all sides of each are halved, shape (m,).
    """
    cell = mesh.cell
    assert (cell.dim, len(cell.corners)) == (2, 3)
    keys = row_keys(sides_of(mesh.cells, cell)[:, :2])
    side = np.unique(keys, return_inverse=True)[1].reshape(-1, 3)
    halved_sides = np.zeros(int(side.max()) + 1, dtype=bool)
    halved_sides[side[chosen]] = True
    while (two := halved_sides[side].sum(axis=1) == 2).any():
        halved_sides[side[two]] = True
    split = halved_sides[side]
    ends = [tuple(_SIDE * value for value in corner) for corner in cell.corners]
    corners = [[ends[c] for c in facet] for facet in cell.facets]
    middles = [_middle(facet) for facet in corners]
    patterns = [(~split.any(axis=1), [ends]), (split.all(axis=1), _children(cell))]
    for number, (first, second) in enumerate(corners):
        opposite, middle = next(end for end in ends if end not in (first, second)), middles[number]
        alone = split[:, number] & (split.sum(axis=1) == 1)
        patterns.append((alone, [[first, middle, opposite], [middle, second, opposite]]))
    divided = [(holds, [_nodes(child, cell) for child in children]) for holds, children in patterns]
    lattice, number_of, points = _on_lattice(mesh, [child for _, children in divided for child in children])
    cells, parents = [], []
    for holds, children in divided:
        cells.append(number_of[holds][:, _places(children, lattice)].reshape(-1, len(cell.nodes)))
        parents.append(np.repeat(np.flatnonzero(holds), len(children)))
    owner, which = np.divmod(rows_of(mesh.facet_corners, sides_of(mesh.cells, cell)[:, :2]), 3)
    cut = split[owner, which]
    facets, facet_parents = [], []
    for holds, parts in (
        (~cut, corners),
        (cut, [[first, middle] for (first, _), middle in zip(corners, middles, strict=True)]),
        (cut, [[middle, second] for (_, second), middle in zip(corners, middles, strict=True)]),
    ):
        places = _places([_nodes(part, mesh.facet) for part in parts], lattice)
        facets.append(number_of[owner[holds][:, None], places[which[holds]]])
        facet_parents.append(np.flatnonzero(holds))
    used, numbers = np.unique(np.concatenate(cells), return_inverse=True)
    renumbered = np.full(len(points), -1)
    renumbered[used] = np.arange(used.size)
    parent, facet_parent = np.concatenate(parents), np.concatenate(facet_parents)
    return MeshArrays(
        points=points[used],
        kind=mesh.kind,
        cells=numbers.reshape(-1, len(cell.nodes)),
        facets=renumbered[np.concatenate(facets)],
        boundaries={name: np.flatnonzero(np.isin(facet_parent, rows)) for name, rows in mesh.boundaries.items()},
        regions={name: np.flatnonzero(np.isin(parent, rows)) for name, rows in mesh.regions.items()},
        note=mesh.note,
        subdivided=mesh.subdivided,
    )


def _nodes(corners: list[_VertexKey], kind: Cell) -> list[_VertexKey]:
    """The places of the nodes of a cell, or a facet, of a kind between its corners."""
    return [_middle([corners[c] for c in members]) for members in kind.nodes]


def _on_lattice(mesh: MeshArrays, children: list[list[_VertexKey]]) -> tuple[list[_VertexKey], Ints, Floats]:
    """The places of the nodes of children.

    Returns:
        The places, in order; the number of each in each cell, the same in all cells that share it, shape (m, places);
        and the positions of these numbers, shape (n, d).
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
    """A number for each place of the lattice in each cell, the same in all cells that share the place.

    Args:
        corners: of each cell, shape (m, c).
        weights: of the corners at each place, whole numbers: with the corners' numbers they say where a place is.

    Returns:
        The numbers, shape (m, places), and for each number the first place in the flattened table that has it.
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
    half = _SIDE // 2
    if not cell.simplex:
        at = product((0, half), repeat=cell.dim)
        return [[tuple(a + b // 2 for a, b in zip(low, end, strict=True)) for end in ends] for low in at]
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
