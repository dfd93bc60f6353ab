"""Type aliases of numpy arrays and of values; lengths and products of rows, and sides of
polygons.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import ufl.core.expr

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int32]  # local numbers of nodes, cells and facets in dolfinx
Ints = npt.NDArray[np.int64]
Integers = npt.NDArray[np.signedinteger]  # local or global numbers
Column = npt.NDArray[Any]  # a column of a table, numbers or text
Columns = Mapping[str, Column]  # columns by name
# A field in UFL, such as a Function or a Constant; and a field in UFL or as values at points.
Expr: TypeAlias = "ufl.core.expr.Expr"
FieldValue: TypeAlias = "Expr | Array"
# A number, a function of points of shape (3, n), such as an ``Expression``, or UFL.
Value: TypeAlias = "float | Callable[[Array], npt.ArrayLike] | Expr"
# What JSON and TOML hold.
Plain: TypeAlias = "float | str | Sequence[Plain] | Mapping[str, Plain] | None"


def length(vectors: Array) -> Array:
    """Return the Euclidean length of each row, shape (n,); exact for rows of one component."""
    return np.hypot.reduce(vectors, axis=1, initial=0.0)


def inner(a: Array, b: Array) -> Array:
    """Return the scalar product of each pair of rows, shape (n,)."""
    return np.einsum("ij,ij->i", a, b)


def matvec(matrices: npt.NDArray[np.floating], vectors: Array) -> Array:
    """Return each of n matrices of shape (n, i, j) times its vector of shape (n, j)."""
    return np.einsum("nij,nj->ni", matrices, vectors)


def rmatvec(matrices: npt.NDArray[np.floating], vectors: Array) -> Array:
    """Return the transpose of each of n matrices of shape (n, i, j) times its vector of shape (n,
    i).
    """
    return np.einsum("nij,ni->nj", matrices, vectors)


def diagonal(points: Array) -> float:
    """Return the length of the diagonal of the box around points of shape (n, d)."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def extents(corners: Array) -> Array:
    """Return the diagonal of the bounding box of each of m sets of corners, shape (m, k, d), as
    shape (m,).
    """
    sizes = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
    return sizes


def unit(vectors: Array) -> Array:
    """Return each row divided by its length; rows of zeros become the first unit vector.

    In R^1 it is the sign, +1 for zero.
    """
    size = length(vectors)
    units = np.zeros_like(vectors)
    units[:, :1] = 1.0
    return quotient(vectors, size[:, None], otherwise=units)


def quotient(
    dividend: npt.ArrayLike,
    divisor: npt.ArrayLike,
    where: Flags | None = None,
    *,
    otherwise: npt.ArrayLike = 0.0,
) -> Array:
    """Return dividend / divisor where the divisor is positive, or at the entries ``where``, and the
    value ``otherwise`` at all others.
    """
    below = np.asarray(divisor)
    found = np.full(np.broadcast_shapes(np.shape(dividend), below.shape), otherwise, np.float64)
    np.divide(dividend, below, out=found, where=below > 0 if where is None else where)
    return found


def sides_of(polygons: Ints) -> Ints:
    """Return the two ends of each side of polygons, shape (m, k, 2), from their corners in order,
    shape (m, k).
    """
    return np.stack((polygons, np.roll(polygons, -1, axis=1)), axis=2)
