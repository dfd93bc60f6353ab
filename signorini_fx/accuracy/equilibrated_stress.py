"""A symmetric stress in equilibrium with given tractions, on triangles.

The stress is that of Johnson and Mercier, ``local_stress``; its tractions are those of least complementary energy.
Displacements on the edges, the multipliers of equal and opposite tractions, are the unknowns of one symmetric positive
definite system (hybridisation), of which ``divided_cells`` eliminates those inside cells.  So no constant of Korn's
inequality enters.  Plain arrays, one rank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from signorini_fx.accuracy.arrays import Array
from signorini_fx.accuracy.carried import carried
from signorini_fx.accuracy.cell_pieces import free_motions
from signorini_fx.accuracy.definite_factor import Factor
from signorini_fx.accuracy.divided_cells import DividedCells
from signorini_fx.accuracy.local_stress import LocalStress, reference
from signorini_fx.accuracy.triangles import Triangles

# Pivots of motions that are free, relative.
_FREE = 1e-10
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Loads:
    """What acts on the triangles.

    Attributes:
        body: integrals of the force per volume times the barycentric coordinates, force, shape (n, 3, 2).
        traction: linear tractions at both ends of each edge of the boundary, zero elsewhere, stress, shape (e, 2, 2).
        unknown: bound of the force on each triangle that quadrature does not know, shape (n,); 0: none.
    """

    body: Array
    traction: Array
    unknown: Array | float = 0.0


@dataclass(frozen=True)
class Equilibrated:
    """A stress in equilibrium.

    Attributes:
        stress: (xx, yy, xy) on each third of each triangle, opposite its corners, at the corners of the third: the two
            next ones of the triangle, and the centroid; shape (n, 3, 3, 3).
        tractions: at both ends of each edge out of its first triangle, stress, shape (e, 2, 2).
        squares: of bounds of the work of what is not in equilibrium by round-off, per unit of the energy norm, shape
            (n,).
    """

    stress: Array
    tractions: Array
    squares: Array

    @property
    def missing(self) -> float:
        """The bound for all triangles."""
        return float(np.sqrt(self.squares.sum()))


class Equilibration:
    """Stresses in equilibrium on a body that is held in given directions; the system is factorised once.

    From displacements at both ends of each edge each triangle has balanced tractions of its own; those of the solution
    are equal and opposite.  What the linear system misses of this is part of ``missing``: no digit rests on it.
    """

    def __init__(self, t: Triangles, held: Array) -> None:
        """Factorise.

        Args:
            t: the triangles.
            held: projector onto the directions in which each edge is held, shape (e, 2, 2).
        """
        self._t, self._held = t, held
        self._local = local = LocalStress(t)
        self._cells = cells = DividedCells(t, local)
        # Held directions as unknowns of their own.
        held = held[cells.nodes.ravel() // 2]
        self._turn, kept = np.tile(np.eye(2), (len(held), 1, 1)), np.zeros((len(held), 2), dtype=bool)
        some = np.flatnonzero(held.any(axis=(1, 2)))
        values, vectors = np.linalg.eigh(held[some])
        aligned = np.abs(held[some, 0, 1]) <= _FREE
        self._turn[some] = np.where(aligned[:, None, None], np.eye(2), vectors)
        kept[some] = np.where(aligned[:, None], np.einsum("nii->ni", held[some]), values) > 0.5
        self._kept = kept
        self._skew = np.zeros(len(held), dtype=bool)
        self._skew[some[~aligned]] = True
        modes = free_motions(t, self._held).reshape(len(t.x), 2, -1)[t.edges.ravel()[cells.nodes.ravel()]]
        modes = self._turn.transpose(0, 2, 1) @ modes * ~kept[:, :, None]
        self._factor = Factor(self._assembled(modes.reshape(2 * len(held), -1)))

    def _assembled(self, modes: Array) -> sp.csr_matrix:
        """The upper half of the matrix, with 1 for held unknowns and as many tied ones as there are free motions.

        Loads in balance cause no force where it is tied.
        """
        cells, free = self._cells, (~self._kept).ravel()
        matrix, places = cells.matrix, cells.places
        turned = np.flatnonzero(self._skew[places[:, ::2] // 2].any(axis=1))
        if turned.size:
            matrix, turn = matrix.copy(), np.zeros((turned.size, *matrix.shape[1:]))
            for k in range(0, places.shape[1], 2):
                turn[:, k : k + 2, k : k + 2] = self._turn[places[turned, k] // 2]
            matrix[turned] = turn.transpose(0, 2, 1) @ matrix[turned] @ turn
        lower, higher = np.triu_indices(places.shape[1])
        rows, columns = places[:, lower], places[:, higher]
        values = np.where(free[rows] & free[columns], matrix[:, lower, higher], 0.0).ravel()
        rows, columns = np.minimum(rows, columns).ravel(), np.maximum(rows, columns).ravel()
        diagonal, left = (~free).astype(np.float64), modes.copy()
        for _ in range(modes.shape[1]):
            pin = int(np.argmax(np.linalg.norm(left, axis=1)))
            unit = left[pin] / np.linalg.norm(left[pin])
            left -= np.outer(left @ unit, unit)
            diagonal[pin] += float(values[(rows == pin) & (columns == pin)].sum())
        upper = sp.coo_matrix((values, (rows, columns)), shape=(free.size, free.size)).tocsr()
        return sp.csr_matrix(upper + sp.diags_array(diagonal))

    def stress(self, loads: Loads, prescribed: Array) -> Equilibrated:
        """The stress of least complementary energy among those of this kind in equilibrium with loads.

        Args:
            loads: what acts on the triangles; its resultant on free motions must vanish.
            prescribed: the displacement at both ends of held edges, as a linear function, length, shape (e, 2, 2).
        """
        t, cells = self._t, self._cells
        nodes, places, turn = cells.nodes.ravel(), cells.places, self._turn
        alone = self._local.alone(loads.body)
        a, b = loads.traction[:, 0], loads.traction[:, 1]
        moments = np.stack((2 * a + b, a + 2 * b), axis=1) * t.length[:, None, None] / 6
        fixed = np.where(self._kept, (prescribed.reshape(-1, 1, 2)[nodes] @ turn)[:, 0], 0.0)
        start = (turn @ fixed[:, :, None]).ravel()
        forces = cells.condensed(alone) + (cells.matrix @ start[places][:, :, None])[:, :, 0]
        right = moments.reshape(-1, 2)[nodes] - np.bincount(places.ravel(), forces.ravel(), start.size).reshape(-1, 2)
        right = np.where(self._kept, 0.0, (right[:, None] @ turn)[:, 0])
        found = self._factor.solve(right.ravel()).reshape(-1, 2, 1)
        return self._mean(loads, cells.moments((start + (turn @ found).ravel())[places], alone))

    def _mean(self, loads: Loads, moments: Array) -> Equilibrated:
        """The stress of the means of the moments of both sides, where tractions are given of these.

        Args:
            loads: what acts.
            moments: of each triangle, out of it, force, shape (n, 3, 2, 2).
        """
        t, place = self._t, self._local.places
        sign = np.where(t.sides[t.of_triangle, 0] == np.arange(len(t.corners))[:, None], 1.0, -1.0)[:, :, None, None]
        signed = (sign * moments).reshape(-1, 2)
        summed = np.column_stack([np.bincount(place.ravel(), signed[:, k], 2 * len(t.edges)) for k in (0, 1)])
        total = summed.reshape(-1, 2, 2) / ((t.sides >= 0).sum(axis=1) * t.length)[:, None, None]
        tractions = np.stack((4 * total[:, 0] - 2 * total[:, 1], 4 * total[:, 1] - 2 * total[:, 0]), axis=1)
        out = np.where(t.sides[t.outer, :1, None] < 0, -1.0, 1.0)
        held = self._held[t.outer]
        given = loads.traction[t.outer] @ (np.eye(2) - held) + tractions[t.outer] * out @ held
        tractions[t.outer] = given * out
        stress, rest = self._local.stress(sign * tractions.reshape(-1, 2)[place], loads.body)
        return Equilibrated(stress, tractions, _round_off(t, loads, self._held, tractions, rest))


def _round_off(t: Triangles, loads: Loads, held: Array, tractions: Array, rest: Array) -> Array:
    """Squares of bounds of the work of what is not in equilibrium, per unit of the energy norm, shape (n,).

    The forces and couples that a triangle misses are carried from triangle to triangle to a held edge, or to a
    triangle of a piece without one, by linear tractions: those with a resultant R and a couple M about the middle of an
    edge of length l are at most R / l + 6 M / l^2.  The stress of each that balances these is bounded by the norm of
    the map from tractions to stresses.
    """
    force = np.abs(tractions).max(axis=(1, 2)) * t.length
    own = force[t.of_triangle].max(axis=1) + np.abs(loads.body).sum(axis=(1, 2))
    missed = own * (rest + 32 * _EPS) + loads.unknown
    start = t.outer[np.einsum("eii->e", held)[t.outer] > 0]
    total, couple = carried(t.x[t.corners].mean(axis=1), t.sides, t.sides[start].max(axis=1), missed)
    shape = np.linalg.norm(t.jacobian, axis=(1, 2)) ** 2 / (2 * t.area)
    size = float(np.linalg.norm(reference()[0], 2))
    sides = t.length[t.of_triangle]
    forces = total + 6 * (couple + total * sides.max(axis=1)) / sides.min(axis=1)
    return np.asarray((size * shape**2 * forces) ** 2 / t.softest)
