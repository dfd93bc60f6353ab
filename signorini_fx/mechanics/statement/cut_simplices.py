"""Segments, triangles and tetrahedra cut where the values of a scene may jump or have a kink."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.statement.expressions import Expression, in_space
from signorini_fx.tuned import SAME_LENGTH

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

# Halvings that find where an edge is cut, and cuts of one simplex by one function.
_HALVINGS, _MOST_CUTS = 48, 12


def cut(x: Array, values: Iterable[Any]) -> tuple[Ints, Array]:
    """The parts of simplices in which expressions have no jump and no kink.

    Where a comparison is affine in the position the parts are exact; else an edge is cut once where both its ends
    differ.  What is no expression is not known between points, and is cut nowhere.

    Args:
        x: corners, length, shape (n, k, d).
        values: of the scene.

    Returns:
        The simplex that each part is in, shape (m,), and its corners as barycentric coordinates of that simplex, shape
        (m, k, k).
    """
    count, size = x.shape[:2]
    owner: Ints = np.arange(count)
    parts: Array = np.tile(np.eye(size), (count, 1, 1))
    for value in values:
        if not isinstance(value, Expression):
            continue
        for number in range(value.switch_count):

            def sign(owner: Ints, places: Array, value: Expression = value, number: int = number) -> Array:
                """The function that changes its sign, at barycentric places (m, q, k), shape (m, q)."""
                at = np.einsum("mqk,mkd->mqd", places, x[owner])
                return value.switch(number, in_space(at.reshape(-1, x.shape[2]))).reshape(at.shape[:2])

            owner, parts = _cut(owner, parts, sign)
    return owner, parts


def _cut(owner: Ints, parts: Array, sign: Callable[[Ints, Array], Array]) -> tuple[Ints, Array]:
    """Simplices divided until none has corners on both sides of where one function is zero."""
    for _ in range(_MOST_CUTS):
        value = np.nan_to_num(sign(owner, parts))
        # A corner where a cut has been made is on neither side.
        at = np.where(np.abs(value) <= SAME_LENGTH * np.abs(value).max(axis=1, keepdims=True), 0.0, np.sign(value))
        first, second = np.full(len(owner), -1), np.full(len(owner), -1)
        share: Array = np.zeros(len(owner))
        for a, b in combinations(range(parts.shape[1]), 2):
            rows = np.flatnonzero((first < 0) & (at[:, a] * at[:, b] < 0))
            root = _root(owner[rows], parts[rows, a], parts[rows, b], at[rows, a], sign)
            inside = (root > SAME_LENGTH) & (root < 1 - SAME_LENGTH)
            rows, root = rows[inside], root[inside]
            first[rows], second[rows], share[rows] = a, b, root
        rows = np.flatnonzero(first >= 0)
        if not rows.size:
            return owner, parts
        middle = parts[rows, first[rows]] * (1 - share[rows, None]) + parts[rows, second[rows]] * share[rows, None]
        second_parts = parts[rows].copy()
        parts = parts.copy()
        second_parts[np.arange(len(rows)), first[rows]] = middle
        parts[rows, second[rows]] = middle
        owner, parts = np.concatenate((owner, owner[rows])), np.concatenate((parts, second_parts))
    return owner, parts


def _root(owner: Ints, a: Array, b: Array, at_a: Array, sign: Callable[[Ints, Array], Array]) -> Array:
    """Where between a and b a function changes its sign, as a share of the way, shape (m,)."""
    low: Array = np.zeros(len(owner))
    high: Array = np.ones(len(owner))
    for _ in range(_HALVINGS if len(owner) else 0):
        middle = (low + high) / 2
        values = sign(owner, (a + middle[:, None] * (b - a))[:, None])[:, 0]
        same_sign = np.sign(values) == at_a
        low, high = np.where(same_sign, middle, low), np.where(same_sign, high, middle)
    return (low + high) / 2
