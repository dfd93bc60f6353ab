"""Bounds of the round-off of sums and strains, by the sizes of what is summed up.

A sum of n products of floating-point numbers is known, in whatever order it is made, up to gamma_n = n u / (1 - n u) of
the sum of their sizes (N. J. Higham, Accuracy and Stability of Numerical Algorithms, SIAM 2002, (3.5) and (4.4)).  A
strain is such a sum in each cell, with gradients that are known up to the condition of the cell.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.bounds.arrays import Array
from signorini_fx.addons.bounds.bounded_error import ROUND_OFF
from signorini_fx.addons.bounds.simplices import ROWS, Simplices

_UNIT = float(np.finfo(float).eps) / 2
# Operations on each number before it is summed up, at most.
_BEFORE = 64


def of_sum(count: int) -> float:
    """Round-off of a sum of so many numbers over the sum of their sizes."""
    steps = (count + _BEFORE) * _UNIT
    return steps / (1 - steps)


def stiffest(t: Simplices) -> Array:
    """More than the largest stress : strain over strain : strain, stress, shape (n,)."""
    count = len(ROWS[t.dimension])
    return np.asarray(np.trace(t.stress(np.tile(np.eye(count), (len(t.corners), 1, 1))), axis1=1, axis2=2))


def of_strains(t: Simplices, y: Array, middle: Array) -> Array:
    """Squares of bounds of the energy norm of the round-off of ``Simplices.strain_at_corners``, by cell, shape (n,).

    Args:
        t: the cells.
        y: the displacement at vertices, length, shape (v, d).
        middle: at the middles of edges, length, shape (e, d).
    """
    d, first = t.dimension, y[t.corners[:, 0]][:, None]
    size = np.linalg.norm(y[t.corners] - first, axis=2).max(axis=1)
    size = np.maximum(size, np.linalg.norm(middle[t.edges_of] - first, axis=2).max(axis=1))
    slopes = np.linalg.norm(t.gradients, axis=2).sum(axis=1)
    condition = np.linalg.norm(t.jacobian, axis=(1, 2)) * np.linalg.norm(t.gradients[:, 1:], axis=(1, 2))
    # Of each of the d^2 components; products with both corners of an edge are up to eight times as large.
    component = ROUND_OFF * (1 + condition) * (1 + 8 * d) * slopes * size
    return np.asarray(t.volume * stiffest(t) * (d * component) ** 2)


def of_boundary_values(t: Simplices, constrained: npt.NDArray[np.int64], missed: float) -> float:
    """Bound of the energy norm of displacements that are at most ``missed`` at some vertices and zero at the others.

    Args:
        t: the cells.
        constrained: the vertices.
        missed: length.
    """
    inside = np.zeros(len(t.x), dtype=bool)
    inside[constrained] = True
    slopes = (np.linalg.norm(t.gradients, axis=2) * inside[t.corners]).sum(axis=1)
    return missed * float(np.sqrt(t.volume @ (stiffest(t) * slopes**2)))
