"""The mean rotation of nodes from their displacements, times distances."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.tuned import NO_ARM, ZERO_COMPONENT

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


def without_round_off(matrix: sp.csr_array) -> sp.csr_array:
    """Without the round-off of what is zero; entries have no unit."""
    matrix.data[np.abs(matrix.data) < ZERO_COMPONENT] = 0.0
    matrix.eliminate_zeros()
    return matrix


def turning_of(arms: sp.csr_array, x: Array, distance: Array) -> sp.csr_array:
    """Omega_i(u) x d_i as a matrix, see ``Coupling``; ``arms``: a_il, shape (n, nodes), ``distance``: d_i."""
    row, blocks = turning_blocks(arms, x, distance)
    count, dim = distance.shape
    of_rows = row[:, None, None] * dim + np.arange(dim)[:, None]
    of_columns = arms.indices[:, None, None] * dim + np.arange(dim)
    at = tuple(np.broadcast_to(places, blocks.shape).ravel() for places in (of_rows, of_columns))
    return without_round_off(sp.csr_array((blocks.ravel(), at), shape=(count * dim, len(x) * dim)))


def turning_blocks(arms: sp.csr_array, x: Array, distance: Array) -> tuple[Indices, Array]:
    """The point of each entry of ``arms``, in whose order they are, and what a displacement of its node adds to
    omega_i(u) x d_i, shapes (e,) and (e, d, d); for the arguments see ``turning_of``.
    """
    arms.sort_indices()
    count, dim = distance.shape
    row = np.repeat(np.arange(count), np.diff(arms.indptr))
    a, seen = arms.data, x[arms.indices]
    total, r, d = np.bincount(row, a, minlength=count)[:, None], seen, distance[row]
    # The second time without the round-off of coordinates far from the origin, which is a motion of the middle.
    for _ in range(2):
        sums = np.stack([np.bincount(row, a * component, count) for component in r.T], axis=1)
        r = r - (sums / total)[row]
    if dim == 2:
        polar = np.bincount(row, a * np.einsum("ld,ld->l", r, r), minlength=count)[row]
        omega = (a / polar)[:, None] * np.stack((-r[:, 1], r[:, 0]), axis=1)
        return row, np.stack((-d[:, 1], d[:, 0]), axis=1)[:, :, None] * omega[:, None, :]
    inertia: Array = np.zeros((count, 3, 3))
    squares = np.einsum("ld,ld->l", r, r)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :]
    np.add.at(inertia, row, a[:, None, None] * squares)
    inverse = np.asarray(np.linalg.pinv(inertia, rcond=NO_ARM, hermitian=True), dtype=np.float64)
    return row, -_crossing(d) @ inverse[row] @ (a[:, None, None] * _crossing(r))


def _crossing(vectors: Array) -> Array:
    """The matrices of v x ., shape (n, 3, 3)."""
    matrices = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    matrices[:, 0, 1], matrices[:, 0, 2], matrices[:, 1, 2] = -z, y, -x
    return matrices - matrices.transpose(0, 2, 1)
