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

from signorini_fx.bounds.arrays import Array
from signorini_fx.bounds.carried import carried
from signorini_fx.bounds.cell_pieces import free_motions
from signorini_fx.bounds.definite_factor import Factor
from signorini_fx.bounds.divided_cells import DividedCells
from signorini_fx.bounds.local_stress import LocalStress, reference
from signorini_fx.bounds.triangles import Triangles

# Pivots of motions that are free, relative.
_FREE = 1e-10
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class PlaneLoads:
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
class PlaneEquilibratedStress:
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
        self._turn, is_held = np.tile(np.eye(2), (len(held), 1, 1)), np.zeros((len(held), 2), dtype=bool)
        held_nodes = np.flatnonzero(held.any(axis=(1, 2)))
        values, vectors = np.linalg.eigh(held[held_nodes])
        aligned = np.abs(held[held_nodes, 0, 1]) <= _FREE
        self._turn[held_nodes] = np.where(aligned[:, None, None], np.eye(2), vectors)
        is_held[held_nodes] = np.where(aligned[:, None], np.einsum("nii->ni", held[held_nodes]), values) > 0.5
        self._held_components = is_held
        self._skew = np.zeros(len(held), dtype=bool)
        self._skew[held_nodes[~aligned]] = True
        modes = free_motions(t, self._held).reshape(len(t.x), 2, -1)[t.edges.ravel()[cells.nodes.ravel()]]
        modes = self._turn.transpose(0, 2, 1) @ modes * ~is_held[:, :, None]
        self._factor = Factor(self._assembled(modes.reshape(2 * len(held), -1)))

    def _assembled(self, modes: Array) -> sp.csr_matrix:
        """The upper half of the matrix, with 1 for held unknowns and as many tied ones as there are free motions.

        Loads in balance cause no force where it is tied.
        """
        cells, free = self._cells, (~self._held_components).ravel()
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
        diagonal, remaining_modes = (~free).astype(np.float64), modes.copy()
        for _ in range(modes.shape[1]):
            pin = int(np.argmax(np.linalg.norm(remaining_modes, axis=1)))
            unit = remaining_modes[pin] / np.linalg.norm(remaining_modes[pin])
            remaining_modes -= np.outer(remaining_modes @ unit, unit)
            diagonal[pin] += float(values[(rows == pin) & (columns == pin)].sum())
        upper = sp.coo_matrix((values, (rows, columns)), shape=(free.size, free.size)).tocsr()
        return sp.csr_matrix(upper + sp.diags_array(diagonal))

    def stress(self, loads: PlaneLoads, prescribed: Array) -> PlaneEquilibratedStress:
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
        fixed = np.where(self._held_components, (prescribed.reshape(-1, 1, 2)[nodes] @ turn)[:, 0], 0.0)
        start = (turn @ fixed[:, :, None]).ravel()
        forces = cells.condensed(alone) + (cells.matrix @ start[places][:, :, None])[:, :, 0]
        right = moments.reshape(-1, 2)[nodes] - np.bincount(places.ravel(), forces.ravel(), start.size).reshape(-1, 2)
        right = np.where(self._held_components, 0.0, (right[:, None] @ turn)[:, 0])
        solution = self._factor.solve(right.ravel()).reshape(-1, 2, 1)
        return self._mean(loads, cells.moments((start + (turn @ solution).ravel())[places], alone))

    def _mean(self, loads: PlaneLoads, moments: Array) -> PlaneEquilibratedStress:
        """The stress of the means of the moments of both sides, where tractions are given of these.

        Args:
            loads: what acts.
            moments: of each triangle, out of it, force, shape (n, 3, 2, 2).
        """
        t, places = self._t, self._local.places
        sign = np.where(t.sides[t.of_triangle, 0] == np.arange(len(t.corners))[:, None], 1.0, -1.0)[:, :, None, None]
        signed = (sign * moments).reshape(-1, 2)
        summed = np.column_stack([np.bincount(places.ravel(), signed[:, k], 2 * len(t.edges)) for k in (0, 1)])
        total = summed.reshape(-1, 2, 2) / ((t.sides >= 0).sum(axis=1) * t.length)[:, None, None]
        tractions = np.stack((4 * total[:, 0] - 2 * total[:, 1], 4 * total[:, 1] - 2 * total[:, 0]), axis=1)
        out = np.where(t.sides[t.outer, :1, None] < 0, -1.0, 1.0)
        held = self._held[t.outer]
        outer_tractions = loads.traction[t.outer] @ (np.eye(2) - held) + tractions[t.outer] * out @ held
        tractions[t.outer] = outer_tractions * out
        stress, missed_share = self._local.stress(sign * tractions.reshape(-1, 2)[places], loads.body)
        return PlaneEquilibratedStress(stress, tractions, _round_off(t, loads, self._held, tractions, missed_share))


def _round_off(t: Triangles, loads: PlaneLoads, held: Array, tractions: Array, missed_share: Array) -> Array:
    """Squares of bounds of the work of what is not in equilibrium, per unit of the energy norm, shape (n,).

    The forces and couples that a triangle misses are carried from triangle to triangle to a held edge, or to a
    triangle of a piece without one, by linear tractions: those with a resultant R and a couple M about the middle of an
    edge of length l are at most R / l + 6 M / l^2.  The stress of each that balances these is bounded by the norm of
    the map from tractions to stresses.
    """
    force = np.abs(tractions).max(axis=(1, 2)) * t.length
    force_sizes = force[t.of_triangle].max(axis=1) + np.abs(loads.body).sum(axis=(1, 2))
    missed = force_sizes * (missed_share + 32 * _EPS) + loads.unknown
    start = t.outer[np.einsum("eii->e", held)[t.outer] > 0]
    total, couple = carried(t.x[t.corners].mean(axis=1), t.sides, t.sides[start].max(axis=1), missed)
    shape = np.linalg.norm(t.jacobian, axis=(1, 2)) ** 2 / (2 * t.area)
    size = float(np.linalg.norm(reference()[0], 2))
    sides = t.length[t.of_triangle]
    forces = total + 6 * (couple + total * sides.max(axis=1)) / sides.min(axis=1)
    return np.asarray((size * shape**2 * forces) ** 2 / t.softest)
