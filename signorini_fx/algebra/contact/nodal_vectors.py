"""Tangential vectors at contact points: one entry per point of this rank, shape (n, d - 1)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Nodal = npt.NDArray[np.float64]


def length(vectors: Nodal) -> Nodal:
    """Euclidean length of each row, shape (n,); exact for rows of one component."""
    return np.asarray(np.hypot.reduce(vectors, axis=1, initial=0.0))


def inner(a: Nodal, b: Nodal) -> Nodal:
    """Scalar product of each pair of rows, shape (n,)."""
    return np.einsum("ij,ij->i", a, b)


def unit(vectors: Nodal) -> Nodal:
    """Each row over its length; the first axis where a row is zero.  In R^1: the sign, +1 for
    zero.
    """
    size = length(vectors)
    units = np.zeros_like(vectors)
    units[:, :1] = 1.0
    np.divide(vectors, size[:, None], out=units, where=(size > 0)[:, None])
    return units
