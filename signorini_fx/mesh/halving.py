"""A mesh in plain arrays, with its sides straightened or all its cells divided into four; names are kept.

Cells with curved sides are divided on their own geometry: their children lie on the same parabolas.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from signorini_fx.mesh.files.arrays import CORNERS, Floats, Ints, MeshArrays, plain

# Lattice of the nodes of four children on the reference cell, in quarters (curved) or halves (straight) of a side.
_Place = tuple[int, int]


def straightened(mesh: MeshArrays) -> MeshArrays:
    """The mesh without the nodes between its corners."""
    if mesh.degree == 1:
        return mesh
    used, corners = np.unique(mesh.corners, return_inverse=True)
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(used.size)
    kind = "triangle" if CORNERS[mesh.kind] == 3 else "quad"
    return replace(
        mesh,
        points=mesh.points[used],
        kind=kind,
        cells=corners.reshape(mesh.corners.shape),
        facets=number[mesh.facets[:, :2]],
    )


def halved(mesh: MeshArrays) -> MeshArrays:
    """The mesh with every cell divided into four, every facet into two."""
    corners, unit = CORNERS[mesh.kind], 2 * mesh.degree
    old = _places(corners, mesh.degree, unit)
    children = _children(corners, mesh.degree, unit)
    lattice = sorted({place for child in children for place in child})
    weights = _shape(corners, mesh.degree, np.array(lattice) / unit)
    points = np.einsum("ln,cnd->cld", weights, mesh.points[mesh.cells])
    # A node is known by the old nodes that it lies between: on a side two cells have it.
    count = len(mesh.points)
    keys = np.empty((len(mesh.cells), len(lattice), 2), dtype=np.int64)
    for column, place in enumerate(lattice):
        if place in old:
            keys[:, column] = mesh.cells[:, [old.index(place)]]
            continue
        ends = _side_of(place, old, corners, mesh.degree)
        if ends is None:  # inside the cell
            keys[:, column, 0] = count + column
            keys[:, column, 1] = np.arange(len(mesh.cells))
        else:
            keys[:, column] = np.sort(mesh.cells[:, list(ends)], axis=1)
    _, first, number = np.unique(keys.reshape(-1, 2), axis=0, return_index=True, return_inverse=True)
    number = number.reshape(len(mesh.cells), len(lattice))
    cells = np.concatenate([number[:, [lattice.index(place) for place in child]] for child in children], axis=1)
    cells = cells.reshape(-1, len(children[0]))
    points = points.reshape(-1, 2)[first]
    found: list[list[int]] = plain(keys.reshape(-1, 2)[first])
    find = {(a, b): k for k, (a, b) in enumerate(found)}
    halves = []
    facets: list[list[int]] = plain(mesh.facets)
    for facet in facets:
        corners_of, middle = facet[:2], facet[2] if mesh.degree == 2 else None
        centre = find[(min(corners_of), max(corners_of)) if middle is None else (middle, middle)]
        for end in corners_of:
            between = [] if middle is None else [find[(min(end, middle), max(end, middle))]]
            halves.append([find[(end, end)], centre, *between])
    return MeshArrays(
        points=points,
        kind=mesh.kind,
        cells=cells,
        facets=np.array(halves, dtype=np.int64),
        boundaries={name: _repeated(rows, 2) for name, rows in mesh.boundaries.items()},
        regions={name: _repeated(rows, 4) for name, rows in mesh.regions.items()},
    )


def _repeated(rows: Ints, times: int) -> Ints:
    """Rows of the children."""
    return (times * rows[:, None] + np.arange(times)).ravel()


def _places(corners: int, degree: int, unit: int) -> list[_Place]:
    """Where the nodes of a cell are on the lattice, in the order of ``MeshArrays.cells``."""
    ends = [(0, 0), (unit, 0), (0, unit)] if corners == 3 else [(0, 0), (unit, 0), (unit, unit), (0, unit)]
    if degree == 1:
        return ends
    sides = [_middle(ends[k], ends[(k + 1) % corners]) for k in range(corners)]
    return [*ends, *sides, *([(unit // 2, unit // 2)] if corners == 4 else [])]


def _middle(a: _Place, b: _Place) -> _Place:
    return (a[0] + b[0]) // 2, (a[1] + b[1]) // 2


def _children(corners: int, degree: int, unit: int) -> list[list[_Place]]:
    """The nodes of each child, in the order of ``MeshArrays.cells``."""
    half, own = unit // 2, _places(corners, degree, unit // 2)
    if corners == 4:
        return [[(x + a, y + b) for x, y in own] for a, b in product((0, half), repeat=2)]
    moved = [[(x + a, y + b) for x, y in own] for a, b in ((0, 0), (half, 0), (0, half))]
    return [*moved, [(half - x, half - y) for x, y in own]]


def _side_of(place: _Place, old: list[_Place], corners: int, degree: int) -> tuple[int, int] | None:
    """The two old nodes of a side that the place is in the middle of; None inside the cell."""
    for k in range(corners):
        a, b = k, (k + 1) % corners
        pairs = [(a, b)] if degree == 1 else [(a, corners + k), (corners + k, b)]
        for pair in pairs:
            if tuple(np.add(old[pair[0]], old[pair[1]])) == (2 * place[0], 2 * place[1]):
                return pair
    return None


def _shape(corners: int, degree: int, x: Floats) -> Floats:
    """Shape functions of a cell at reference points, shape (points, nodes)."""
    s, t = x.T
    if corners == 3:
        a, b, c = 1 - s - t, s, t
        if degree == 1:
            return np.stack((a, b, c), axis=1)
        ends, sides = (a, b, c), ((a, b), (b, c), (c, a))
        return np.stack([*(v * (2 * v - 1) for v in ends), *(4 * v * w for v, w in sides)], axis=1)
    if degree == 1:
        return np.stack(((1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t), axis=1)
    along = [[(2 * v - 1) * (v - 1), 4 * v * (1 - v), v * (2 * v - 1)] for v in (s, t)]
    order = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]
    return np.stack([along[0][i] * along[1][j] for i, j in order], axis=1)
