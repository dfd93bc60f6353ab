"""Sparse maps of vectors at the nodes of both sides: scaled, of components, beside each other; the mean rotation of
nodes times distances, and the rotation of normals.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.tuned import SAME_NUMBER, ZERO_COMPONENT

Array = npt.NDArray[np.float64]


def scaled_rows(factors: Array, matrix: Any) -> sp.csr_array:
    """Rows of a matrix times factors, shape (n,); what a factor of zero leaves is no entry."""
    scaled = sp.csr_array(sp.diags_array(factors) @ matrix)
    scaled.eliminate_zeros()
    return scaled


def scaled_columns(matrix: Any, factors: Array) -> sp.csr_array:
    """Columns of a matrix times factors, likewise."""
    scaled = sp.csr_array(matrix @ sp.diags_array(factors))
    scaled.eliminate_zeros()
    return scaled


def placed_rows(matrix: sp.csr_array, rows: npt.NDArray[np.int64], count: int) -> sp.csr_array:
    """Rows of a matrix as some, ascending, of so many, of which the others are empty."""
    sizes = np.zeros(count + 1, dtype=matrix.indptr.dtype)
    sizes[rows + 1] = np.diff(matrix.indptr)
    return sp.csr_array((matrix.data, matrix.indices, np.cumsum(sizes)), shape=(count, matrix.shape[1]))


def of_components(matrix: Any, count: int) -> sp.csr_array:
    """A matrix of nodes as one of vectors at them, which does the same to each of so many components."""
    return sp.csr_array(sp.kron(matrix, sp.eye_array(count), format="csr"))


def beside(left: Any, right: Any) -> sp.csr_array:
    """Two matrices with as many rows beside each other."""
    return sp.csr_array(sp.hstack((left, right), format="csr"))


def without_round_off(matrix: sp.csr_array) -> sp.csr_array:
    """Without the round-off of what is zero; entries have no unit."""
    matrix.data[np.abs(matrix.data) < ZERO_COMPONENT] = 0.0
    matrix.eliminate_zeros()
    return matrix


def turning_of(arms: sp.csr_array, x: Array, distance: Array) -> sp.csr_array:
    """Omega_i(u) x d_i as a matrix, see ``Coupling``; ``arms``: a_il, shape (n, nodes), ``distance``: d_i."""
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
        blocks = np.stack((-d[:, 1], d[:, 0]), axis=1)[:, :, None] * omega[:, None, :]
    else:
        inertia: Array = np.zeros((count, 3, 3))
        squares = np.einsum("ld,ld->l", r, r)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :]
        np.add.at(inertia, row, a[:, None, None] * squares)
        inverse = np.asarray(np.linalg.pinv(inertia, rcond=SAME_NUMBER, hermitian=True), dtype=np.float64)
        blocks = -_crossing(d) @ inverse[row] @ (a[:, None, None] * _crossing(r))
    matrix = sp.bsr_array((blocks, arms.indices, arms.indptr), shape=(count * dim, len(x) * dim))
    return without_round_off(sp.csr_array(matrix))


def turned_normals(side: PairSurface) -> sp.csr_array:
    """How displacements of the nodes of a side turn its normals at the nodes, sparse, shape (d N, d N).

    The normal of a node is along the integral of that of the facets times its function, without what it has across
    planes of symmetry.
    """
    functions, (count, dim) = side.functions, side.x.shape
    at, weights = functions.rule(2 * functions.degree + 2)
    values, slopes = functions.values(at) * weights[:, None], functions.slopes(at)
    along = np.einsum("aqk,fkd->afqd", slopes, side.corners)
    if dim == 2:
        normal = np.stack((along[0, ..., 1], -along[0, ..., 0]), axis=-1)
        turning = np.multiply.outer(values.T @ slopes[0], [[0.0, 1.0], [-1.0, 0.0]])
        turning = side.sign[:, None, None, None, None] * turning
    else:
        normal = np.cross(along[0], along[1])
        arms = slopes[1][None, :, :, None] * along[0][:, :, None] - slopes[0][None, :, :, None] * along[1][:, :, None]
        vectors = np.einsum("qk,fqld->fkld", values, arms, optimize=True) * side.sign[:, None, None, None]
        turning = _crossing(vectors.reshape(-1, 3)).reshape(*vectors.shape, 3)
    rows = dim * side.nodes[:, :, None, None, None] + np.arange(dim)[:, None]
    columns = dim * side.nodes[:, None, :, None, None] + np.arange(dim)
    places = tuple(np.broadcast_to(numbers, turning.shape).ravel() for numbers in (rows, columns))
    moments = sp.csr_array((turning.ravel(), places), shape=(dim * count, dim * count))
    sums = np.zeros((count, dim))
    np.add.at(sums, side.nodes, np.einsum("qk,fqd->fkd", values, normal * side.sign[:, None, None]))
    within = np.eye(dim) - side.across
    size = np.linalg.norm(np.einsum("nij,nj->ni", within, sums), axis=1)
    inverse = np.divide(1.0, size, out=np.zeros(count), where=size > 0)
    normals = side.nodal_normals
    across = inverse[:, None, None] * (within - np.einsum("ni,nj->nij", normals, normals))
    return sp.csr_array(of_blocks(across) @ moments)


def of_blocks(blocks: Array) -> sp.csr_array:
    """The matrix with blocks of shape (n, i, j) on its diagonal, sparse, shape (n i, n j)."""
    numbers = np.arange(len(blocks) + 1)
    shape = (len(blocks) * blocks.shape[1], len(blocks) * blocks.shape[2])
    return sp.csr_array(sp.bsr_array((blocks, numbers[:-1], numbers), shape=shape))


def _crossing(vectors: Array) -> Array:
    """The matrices of v x ., shape (n, 3, 3)."""
    matrices = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    matrices[:, 0, 1], matrices[:, 0, 2], matrices[:, 1, 2] = -z, y, -x
    return matrices - matrices.transpose(0, 2, 1)
