"""Sparse matrices times diagonal ones, for each component of vectors, and beside each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

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
