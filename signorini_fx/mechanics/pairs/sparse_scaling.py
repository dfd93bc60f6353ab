"""Sparse matrices times diagonal ones, for each component of vectors, and beside each other: by their entries, in a
fraction of the time of what scipy has for any matrices.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

Array = npt.NDArray[np.float64]


def scaled_rows(factors: Array, matrix: Any) -> sp.csr_array:
    """Rows of a matrix times factors, shape (n,); what a factor of zero leaves is no entry."""
    rows = _by_rows(matrix)
    return _scaled(rows, np.repeat(factors, np.diff(rows.indptr)))


def scaled_columns(matrix: Any, factors: Array) -> sp.csr_array:
    """Columns of a matrix times factors, likewise."""
    rows = _by_rows(matrix)
    return _scaled(rows, factors[rows.indices])


def placed_rows(matrix: sp.csr_array, rows: npt.NDArray[np.int64], count: int) -> sp.csr_array:
    """Rows of a matrix as some, ascending, of so many, of which the others are empty."""
    sizes = np.zeros(count + 1, dtype=matrix.indptr.dtype)
    sizes[rows + 1] = np.diff(matrix.indptr)
    return sp.csr_array((matrix.data, matrix.indices, np.cumsum(sizes)), shape=(count, matrix.shape[1]))


def of_components(matrix: Any, count: int) -> sp.csr_array:
    """A matrix of nodes as one of vectors at them, which does the same to each of so many components."""
    rows = _by_rows(matrix)
    sizes = np.diff(rows.indptr)
    begins, places = np.repeat(rows.indptr[:-1], count), np.repeat(sizes, count)
    ends = np.concatenate(([0], np.cumsum(places))).astype(rows.indptr.dtype)
    entries = np.arange(ends[-1]) - np.repeat(ends[:-1] - begins, places)
    component = np.repeat(np.tile(np.arange(count, dtype=rows.indices.dtype), sizes.size), places)
    columns = count * rows.indices[entries] + component
    return sp.csr_array((rows.data[entries], columns, ends), shape=(count * sizes.size, count * rows.shape[1]))


def of_vectors(components: list[sp.csr_array]) -> sp.csr_array:
    """The matrix of vectors from those of each of their d components, shape (n, m): shape (n d, m)."""
    rows = np.arange(len(components) * components[0].shape[0]).reshape(len(components), -1)
    return sp.csr_array(sp.csr_array(sp.vstack(components))[rows.T.ravel()])


def beside(left: Any, right: Any) -> sp.csr_array:
    """Two matrices with as many rows beside each other."""
    first, second = _by_rows(left), _by_rows(right)
    sizes = np.diff(first.indptr), np.diff(second.indptr)
    ends = first.indptr + second.indptr
    to = [
        np.arange(part.nnz) + np.repeat(ends[:-1] + before - part.indptr[:-1], size)
        for part, before, size in ((first, 0, sizes[0]), (second, sizes[0], sizes[1]))
    ]
    data, columns = np.empty(ends[-1]), np.empty(ends[-1], dtype=first.indices.dtype)
    data[to[0]], data[to[1]] = first.data, second.data
    columns[to[0]], columns[to[1]] = first.indices, first.shape[1] + second.indices
    return sp.csr_array((data, columns, ends), shape=(first.shape[0], first.shape[1] + second.shape[1]))


def _by_rows(matrix: Any) -> sp.csr_array:
    """A matrix as one of rows: the same if it is one."""
    return matrix if isinstance(matrix, sp.csr_array) else sp.csr_array(matrix)


def _scaled(rows: sp.csr_array, factors: Array) -> sp.csr_array:
    """The entries of a matrix, in their order, times factors."""
    if factors.all():
        return sp.csr_array((rows.data * factors, rows.indices, rows.indptr), shape=rows.shape)
    kept_entries = factors != 0.0
    ends = np.concatenate(([0], np.cumsum(kept_entries)))[rows.indptr].astype(rows.indptr.dtype)
    return sp.csr_array(
        (rows.data[kept_entries] * factors[kept_entries], rows.indices[kept_entries], ends), shape=rows.shape
    )
