"""The shape of cells: their measure, and whether they are valid."""

from __future__ import annotations

import basix
import numpy as np
import numpy.typing as npt

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.cells import Cell
from signorini_fx.tuned import SAME_LENGTH, SAME_NUMBER

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
_Truths = npt.NDArray[np.bool_]

# Volumes of curved cells are integrated exactly.
_DEGREE = 5
# Number of cells that are processed at once.
_CHUNK = 20_000


def measures(points: Floats, nodes: Ints, cell: Cell) -> Floats:
    """Length, area or volume of each element, on its curved shape if it is one, shape (m,).

    Args:
        points: positions, shape (n, d).
        nodes: of each element in the order of its kind, shape (m, k).
        cell: the kind, of d dimensions or of one less.
    """
    return np.asarray(nodal_measures(points, nodes, cell).sum(axis=1))


def nodal_measures(points: Floats, nodes: Ints, cell: Cell) -> Floats:
    """The integral of each shape function over each element, which is the share of its node, shape (m, k)."""
    x, weights = basix.make_quadrature(cell.basix_type, _DEGREE)
    shares = [np.empty((0, len(cell.nodes)))]
    for start in range(0, len(nodes), _CHUNK):
        jacobian = _jacobian(points, nodes[start : start + _CHUNK], cell, x)
        if cell.dim == points.shape[1]:
            size = np.abs(np.linalg.det(jacobian))
        else:
            gram = np.einsum("mqdi,mqdj->mqij", jacobian, jacobian)
            size = np.sqrt(np.maximum(np.linalg.det(gram), 0.0))
        shares.append(size @ (weights[:, None] * cell.shape(x)))
    return np.concatenate(shares)


def _jacobian(points: Floats, nodes: Ints, cell: Cell, x: Floats) -> Floats:
    """Derivatives of the position at places of the reference cell, shape (m, places, d, dim)."""
    return np.asarray(np.einsum("jqk,mkd->mqdj", cell.gradient(x), points[nodes], optimize=True))


def _determinants(matrices: Floats) -> Floats:
    """Of many matrices; NumPy takes ten times as long for small ones."""
    if matrices.shape[-1] != 2:
        return np.asarray(np.linalg.det(matrices))
    return np.asarray(matrices[..., 0, 0] * matrices[..., 1, 1] - matrices[..., 0, 1] * matrices[..., 1, 0])


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
    parts = [_spoilt(points, cells[k : k + _CHUNK], cell) for k in range(0, len(cells), _CHUNK)]
    flat, folded = (np.concatenate(flags) for flags in zip(*parts, strict=True))
    for bad, defect in (
        (flat, "have a corner without an angle (nodes that coincide or are in line)"),
        (folded, "are folded"),
    ):
        if bad.any():
            middle = points[cells[int(np.argmax(bad)), : len(cell.corners)]].mean(axis=0)
            point = ", ".join(f"{value:g}" for value in middle)
            raise MeshError(f"{name}: {np.count_nonzero(bad)} cells {defect}, the first at ({point})")


def _spoilt(points: Floats, cells: Ints, cell: Cell) -> tuple[_Truths, _Truths]:
    """Which cells are flat at a corner, and which are inverted between two of their nodes."""
    x = np.array([np.mean([cell.corners[c] for c in corners], axis=0) for corners in cell.nodes])
    jacobian = _jacobian(points, cells, cell, x)
    size = _determinants(jacobian)
    spanned = np.sqrt(np.einsum("mqdj,mqdj->mqj", jacobian, jacobian).prod(axis=2))
    flat = np.any((np.abs(size) <= SAME_NUMBER * spanned)[:, : len(cell.corners)], axis=1)
    return flat, np.logical_and(size.min(axis=1) < 0, size.max(axis=1) > 0)
