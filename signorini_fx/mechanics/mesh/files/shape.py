"""The shape of cells: their measure, their quality, and whether they are valid."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.cells import Cell
from signorini_fx.tuned import SAME_LENGTH, SAME_NUMBER

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
_Truths = npt.NDArray[np.bool_]

# Gauss points on [0, 1], exact for degree 5: volumes of curved cells are integrated exactly.
_GAUSS = np.polynomial.legendre.leggauss(3)
# Number of cells that are processed at once.
_CHUNK = 20_000


def measures(points: Floats, nodes: Ints, cell: Cell) -> Floats:
    """Length, area or volume of each element, on its curved shape if it is one, shape (m,).

    Args:
        points: positions, shape (n, d).
        nodes: of each element in the order of its kind, shape (m, k).
        cell: the kind, of d dimensions or of one less.
    """
    sizes = [np.empty(0), *(size @ weights for size, weights, _ in _sizes(points, nodes, cell))]
    return np.concatenate(sizes)


def nodal_measures(points: Floats, nodes: Ints, cell: Cell) -> Floats:
    """The integral of each shape function over each element, which is the share of its node, shape (m, k)."""
    shares = [size @ (weights[:, None] * cell.shape(x)) for size, weights, x in _sizes(points, nodes, cell)]
    return np.concatenate([np.empty((0, len(cell.nodes))), *shares])


def _sizes(points: Floats, nodes: Ints, cell: Cell) -> Iterator[tuple[Floats, Floats, Floats]]:
    """Of some elements after others the measure at each place of a quadrature, with its weights and places."""
    x, weights = _quadrature(cell)
    for start in range(0, len(nodes), _CHUNK):
        jacobian = _jacobian(points, nodes[start : start + _CHUNK], cell, x)
        if cell.dim == points.shape[1]:
            size = np.abs(np.linalg.det(jacobian))
        else:
            gram = np.einsum("mqdi,mqdj->mqij", jacobian, jacobian)
            size = np.sqrt(np.maximum(np.linalg.det(gram), 0.0))
        yield size, weights, x


def _quadrature(cell: Cell) -> tuple[Floats, Floats]:
    """Points and weights on the reference cell; on a simplex those of the cube, collapsed."""
    at, weight = (_GAUSS[0] + 1) / 2, _GAUSS[1] / 2
    x = np.stack(np.meshgrid(*[at] * cell.dim, indexing="ij"), axis=-1).reshape(-1, cell.dim)
    weights = np.stack(np.meshgrid(*[weight] * cell.dim, indexing="ij"), axis=-1).reshape(-1, cell.dim).prod(axis=1)
    if cell.simplex:
        remaining = np.ones(len(x))
        for k in range(cell.dim):
            coordinate = x[:, k].copy()
            weights, x[:, k], remaining = weights * remaining, coordinate * remaining, remaining * (1 - coordinate)
    return x, weights


def _jacobian(points: Floats, nodes: Ints, cell: Cell, x: Floats) -> Floats:
    """Derivatives of the position at places of the reference cell, shape (m, places, d, dim)."""
    # Shape functions are quadratic along each axis at most: the central difference is the derivative.
    steps = np.eye(cell.dim) / 2
    gradient = np.stack([cell.shape(x + step) - cell.shape(x - step) for step in steps], axis=2)
    return np.einsum("qkj,mkd->mqdj", gradient, points[nodes])


def is_straight(points: Floats, cells: Ints, cell: Cell) -> bool:
    """Whether all nodes between corners are where those of straight cells would be."""
    limit = SAME_LENGTH * float(np.linalg.norm(np.ptp(points, axis=0)))
    return all(
        bool((np.abs(points[cells[:, k]] - points[cells[:, list(corners)]].mean(axis=1)) <= limit).all())
        for k, corners in enumerate(cell.nodes)
    )


def check_shape(points: Floats, cells: Ints, cell: Cell, name: str) -> None:
    """Refuse cells that are flat or folded.

    Raises:
        MeshError: with how many there are and where the first one is.
    """
    find = _spoilt_in_plane if cell.dim == 2 and cell.degree == 1 else _spoilt
    parts = [find(points, cells[k : k + _CHUNK], cell) for k in range(0, len(cells), _CHUNK)]
    flat, folded = (np.concatenate(flags) for flags in zip(*parts, strict=True))
    for bad, defect in (
        (flat, "have a corner without an angle (nodes that coincide or are in line)"),
        (folded, "are folded"),
    ):
        if bad.any():
            middle = points[cells[int(np.argmax(bad)), : len(cell.corners)]].mean(axis=0)
            point = ", ".join(f"{value:g}" for value in middle)
            raise MeshError(f"{name}: {np.count_nonzero(bad)} cells {defect}, the first at ({point})")


def _spoilt_in_plane(points: Floats, cells: Ints, cell: Cell) -> tuple[_Truths, _Truths]:
    """Which cells are flat at a corner, and which have corners of both orientations."""
    forth = _sides_of_corners(points, cells[:, : len(cell.corners)])
    cross = _cross_products(forth)
    # No side is longer than the sum of its components: where this limit, with room for round-off, is not reached, the
    # other one is not.
    doubtful = np.abs(cross) <= 2 * SAME_NUMBER * _products(np.abs(forth[0]) + np.abs(forth[1]))
    flat: _Truths = np.zeros(len(cells), dtype=bool)
    if doubtful.any():
        flat = np.asarray(np.any(np.abs(cross) <= SAME_NUMBER * _products(np.hypot(*forth)), axis=0), dtype=np.bool_)
    return flat, np.logical_and(cross.min(axis=0) < 0, cross.max(axis=0) > 0)


def _spoilt(points: Floats, cells: Ints, cell: Cell) -> tuple[_Truths, _Truths]:
    """Which curved or solid cells are flat at a corner, and which are inverted between two of their nodes."""
    x = np.array([np.mean([cell.corners[c] for c in corners], axis=0) for corners in cell.nodes])
    jacobian = _jacobian(points, cells, cell, x)
    size = np.linalg.det(jacobian)
    spanned = np.linalg.norm(jacobian, axis=2).prod(axis=2)
    flat = np.any((np.abs(size) <= SAME_NUMBER * spanned)[:, : len(cell.corners)], axis=1)
    return flat, np.logical_and(size.min(axis=1) < 0, size.max(axis=1) > 0)


def _sides_of_corners(points: Floats, corners: Ints) -> Floats:
    """From each corner of each cell to the next one, shape (2, 3 or 4, m): sums go along the cells."""
    x = np.stack([coordinate[corners.T] for coordinate in points.T])
    forth = np.empty_like(x)
    np.subtract(x[:, 1:], x[:, :-1], out=forth[:, :-1])
    np.subtract(x[:, 0], x[:, -1], out=forth[:, -1])
    return forth


def _cross_products(forth: Floats) -> Floats:
    """Of the sides that meet in each corner of each cell, positive where it is to the left of the way around."""
    return np.stack([forth[1, k] * forth[0, k - 1] - forth[0, k] * forth[1, k - 1] for k in range(forth.shape[1])])


def _products(lengths: Floats) -> Floats:
    """Of the lengths of the sides that meet in each corner of each cell, shape (3 or 4, m)."""
    return np.stack([lengths[k] * lengths[k - 1] for k in range(len(lengths))])


def quality(points: Floats, corners: Ints) -> Floats:
    """Shape of each cell: 1 for equilateral triangles and tetrahedra, squares and cubes, 0 for flat cells, shape (m,).

    It is the mean ratio: of triangles 4 sqrt(3) area / sum of squared sides, of tetrahedra 12 (3 volume)^(2/3) / that
    sum; of quadrilaterals the smallest over the corners of 2 |a x b| / (|a|^2 + |b|^2) for the sides a, b that meet
    there, of hexahedra 3 |det(a, b, c)|^(2/3) / (|a|^2 + |b|^2 + |c|^2).

    Args:
        points: positions, shape (n, d).
        corners: corners of each cell in the order of its kind, shape (m, 3 or 4) in 2D, (m, 4 or 8) in 3D.
    """
    x = points[corners]
    if points.shape[1] == 3:
        return _quality_in_space(x)
    cross = np.abs(_cross_products(_sides_of_corners(points, corners))).T
    squares = ((np.roll(x, -1, axis=1) - x) ** 2).sum(axis=-1)
    if corners.shape[1] == 3:
        return 2 * np.sqrt(3.0) * cross[:, 0] / squares.sum(axis=1)
    return (2 * cross / (squares + np.roll(squares, 1, axis=1))).min(axis=1)


# The corners at the other ends of the sides that meet in each corner.
_NEIGHBOURS = [(1, 3, 4), (2, 0, 5), (3, 1, 6), (0, 2, 7), (7, 5, 0), (4, 6, 1), (5, 7, 2), (6, 4, 3)]


def _quality_in_space(x: Floats) -> Floats:
    if x.shape[1] == 4:
        volume = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / 6
        squares = sum(((x[:, a] - x[:, b]) ** 2).sum(axis=1) for a in range(4) for b in range(a))
        return 12 * np.cbrt(3 * volume) ** 2 / squares
    sides = x[:, _NEIGHBOURS] - x[:, :, None]
    return (3 * np.cbrt(np.linalg.det(sides)) ** 2 / (sides**2).sum(axis=(2, 3))).min(axis=1)
