"""Displacements of degree 2 on parallelograms, which have nine nodes, beside others of degree 2 on eight triangles.

The other one, u_h', has the values at the vertices and the middles of the edges of the triangles, into which both
diagonal halves of a cell are divided.  On sides of cells it is the same; inside these are products s^2 t, s t^2 and
s^2 t^2, which it is not.  With its strain and what is beyond it, eps(u_h) = eps(u_h') + e, for any stress tau and
displacement v on the triangles

    |C eps(u_h) - tau|^2 = |C eps(u_h') - tau|^2 + 2 int (C eps(u_h') - tau) : e + |e|^2,
    |u_h - v|^2 = |u_h' - v|^2 + 2 int C eps(u_h' - v) : e + |e|^2,

in which stresses are linear on the thirds of a triangle: the moments of e with the linear functions there are enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.facets import POINTS, WEIGHTS
from signorini_fx.addons.bounds.simplices import COLUMNS, CORNERS_OF_PARTS, ROWS, TWICE, Simplices

# Places along both axes of the nodes, in halves of the sides: vertices, middles of sides, and the centre.
_NODES: Ints = np.array([[0, 0], [2, 0], [0, 2], [2, 2], [1, 0], [0, 1], [2, 1], [1, 2], [1, 1]])


@dataclass(frozen=True)
class StrainBeyond:
    """What the strain of u_h is beyond that of u_h'.

    Attributes:
        moments: integrals of e times the barycentric coordinates of each third, area, shape (n, 3, 3, 3).
        squares: of the energy norm, energies per thickness, shape (n,).
    """

    moments: Array
    squares: Array

    def added(self, stress: Array) -> Array:
        """What e adds to the square of the norm of a linear stress, energies per thickness, shape (n,).

        Args:
            stress: on the thirds at their corners, see ``LocalStress.stress``.
        """
        return np.asarray(2 * (stress * self.moments * TWICE[2]).sum(axis=(1, 2, 3)) + self.squares)


def on_triangles(t: Simplices, owner: Ints, x: Array, values: Array) -> tuple[Array, Array, StrainBeyond]:
    """The displacement u_h' at vertices and middles of edges, length, shapes (v, 2) and (e, 2), and what it misses.

    Args:
        t: the triangles, whose vertices are the nodes.
        owner: the cell that each is in, shape (n,).
        x: vertices of the cells, length, shape (m, 4, 2).
        values: u_h at the nodes of the cells, length, shape (m, 9, 2).
    """
    inverse = np.linalg.inv(np.stack((x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=2))[owner]

    def at(local: Array) -> Array:
        """Values and slopes of the nine polynomials at barycentric points of the triangles, shape (n, q, 9, 3)."""
        points = np.einsum("qc,ncd->nqd", local, t.x[t.corners]) - x[owner, :1]
        return _polynomials(np.einsum("nij,nqj->nqi", inverse, points))

    y, middle = np.zeros_like(t.x), np.zeros((len(t.edges), 2))
    y[t.corners] = np.einsum("nqk,nkd->nqd", at(np.eye(3))[..., 0], values[owner])
    middle[t.facets_of] = np.einsum("nqk,nkd->nqd", at((1 - np.eye(3)) / 2)[..., 0], values[owner])
    strain = t.strain_at_corners(y, middle)
    moments, squares = np.zeros((len(owner), 3, 3, 3)), np.zeros(len(owner))
    for third, corners in enumerate(CORNERS_OF_PARTS[2]):
        points = POINTS[3] @ corners
        gradient = np.einsum("nqkj,nkd,nji->nqdi", at(points)[..., 1:], values[owner], inverse)
        beyond = (gradient[..., ROWS[2], COLUMNS[2]] + gradient[..., COLUMNS[2], ROWS[2]]) / 2 - points @ strain
        share = t.volume / 3
        moments[:, third] = np.einsum("n,q,qc,nqk->nck", share, WEIGHTS[3], POINTS[3], beyond)
        squares += share * ((t.stress(beyond) * beyond * TWICE[2]).sum(axis=2) @ WEIGHTS[3])
    return y, middle, StrainBeyond(moments, squares)


def _polynomials(places: Array) -> Array:
    """The nine polynomials, and their slopes along both axes, shape (n, q, 9, 3).

    Args:
        places: coordinates from 0 to 1 along both sides of the cells, shape (n, q, 2).
    """
    s = places[..., None]
    value = np.concatenate(((1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)), axis=3)
    slope = np.concatenate((4 * s - 3, 4 - 8 * s, 4 * s - 1), axis=3)
    (first, second), (along, across) = (
        (part[:, :, 0, _NODES[:, 0]], part[:, :, 1, _NODES[:, 1]]) for part in (value, slope)
    )
    return np.stack((first * second, along * second, first * across), axis=3)
