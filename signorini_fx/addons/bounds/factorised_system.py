"""The hybrid system of a plane body, factorised once; those unknowns that are inside divided cells are eliminated."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.cell_pieces import free_motions
from signorini_fx.addons.bounds.definite_factor import Factor
from signorini_fx.addons.bounds.divided_cells import DividedCells
from signorini_fx.addons.bounds.johnson_mercier import LocalStress
from signorini_fx.addons.bounds.simplices import Simplices
from signorini_fx.addons.bounds.spring_facets import SpringFacets
from signorini_fx.tuned import SINGULAR


class FactorisedSystem:
    """The system of displacements at both ends of each edge; what it misses by round-off nobody removes."""

    def __init__(self, t: Simplices, local: LocalStress, held: Array, springs: SpringFacets | None = None) -> None:
        """Factorise.

        Args:
            t: the triangles.
            local: their matrices.
            held: projector onto the directions in which each edge is held, shape (e, 2, 2).
            springs: on edges; None: there are none.
        """
        self._cells = cells = DividedCells(t, local)
        parts = [(cells.matrix, cells.places)]
        if springs is not None:
            number = np.zeros(2 * len(t.facets), dtype=np.int64)
            number[cells.nodes.ravel()] = np.arange(cells.nodes.size)
            ends = number[2 * springs.facets[:, None] + [0, 1]]
            parts.append((springs.matrices, (2 * ends[:, :, None] + [0, 1]).reshape(-1, 4)))
        stopped = held if springs is None else springs.stopped(held)
        modes: Array = free_motions(t, stopped).reshape(len(t.x), 2, -1)
        modes = modes[t.facets.ravel()[cells.nodes.ravel()]]
        # Held directions as unknowns of their own.
        held = held[cells.nodes.ravel() // 2]
        self._turn, is_held = np.tile(np.eye(2), (len(held), 1, 1)), np.zeros((len(held), 2), dtype=bool)
        held_nodes = np.flatnonzero(held.any(axis=(1, 2)))
        values, vectors = np.linalg.eigh(held[held_nodes])
        aligned = np.abs(held[held_nodes, 0, 1]) <= SINGULAR
        self._turn[held_nodes] = np.where(aligned[:, None, None], np.eye(2), vectors)
        is_held[held_nodes] = np.where(aligned[:, None], np.einsum("nii->ni", held[held_nodes]), values) > 0.5
        self._held_components = is_held
        self._skew = np.zeros(len(held), dtype=bool)
        self._skew[held_nodes[~aligned]] = True
        modes = self._turn.transpose(0, 2, 1) @ modes * ~is_held[:, :, None]
        self._factor = Factor(self._assembled(modes.reshape(2 * len(held), -1), parts))

    def _assembled(self, modes: Array, parts: list[tuple[Array, Ints]]) -> sp.csr_matrix:
        """The upper half of the matrix, with 1 for held unknowns and as many tied ones as there are free motions.

        Loads in balance cause no force where it is tied.

        Args:
            modes: free motions, shape (unknowns, k).
            parts: matrices of cells, and of edges, with the places of their unknowns.
        """
        free = (~self._held_components).ravel()
        of_parts = [self._entries(matrix, places, free) for matrix, places in parts]
        rows, columns, values = (np.concatenate(entries) for entries in zip(*of_parts, strict=True))
        diagonal, remaining_modes = (~free).astype(np.float64), modes.copy()
        for _ in range(modes.shape[1]):
            pin = int(np.argmax(np.linalg.norm(remaining_modes, axis=1)))
            unit = remaining_modes[pin] / np.linalg.norm(remaining_modes[pin])
            remaining_modes -= np.outer(remaining_modes @ unit, unit)
            diagonal[pin] += float(values[(rows == pin) & (columns == pin)].sum())
        upper = sp.coo_matrix((values, (rows, columns)), shape=(free.size, free.size)).tocsr()
        return sp.csr_matrix(upper + sp.diags_array(diagonal))

    def _entries(self, matrix: Array, places: Ints, free: npt.NDArray[np.bool_]) -> tuple[Ints, Ints, Array]:
        """Rows, columns and values of the upper half of the sum of matrices, between unknowns that are free."""
        turned = np.flatnonzero(self._skew[places[:, ::2] // 2].any(axis=1))
        if turned.size:
            matrix, turn = matrix.copy(), np.zeros((turned.size, *matrix.shape[1:]))
            for k in range(0, places.shape[1], 2):
                turn[:, k : k + 2, k : k + 2] = self._turn[places[turned, k] // 2]
            matrix[turned] = turn.transpose(0, 2, 1) @ matrix[turned] @ turn
        lower, higher = np.triu_indices(places.shape[1])
        rows, columns = places[:, lower], places[:, higher]
        values = np.where(free[rows] & free[columns], matrix[:, lower, higher], 0.0).ravel()
        return np.minimum(rows, columns).ravel(), np.maximum(rows, columns).ravel(), values

    def moments(self, alone: Array, loads: Array, start: Array) -> Array:
        """Moments of each triangle, out of it, which are equal and opposite but for loads, force, shape (n, 3, 2, 2).

        Args:
            alone: see ``LocalStress.alone``.
            loads: moments of the tractions on each edge, force, shape (e, 2, 2).
            start: displacements at both ends of the edges, of which held directions are looked at, shape (e, 2, 2).
        """
        cells = self._cells
        nodes, places, turn = cells.nodes.ravel(), cells.places, self._turn
        fixed = np.where(self._held_components, (start.reshape(-1, 1, 2)[nodes] @ turn)[:, 0], 0.0)
        known = (turn @ fixed[:, :, None]).ravel()
        forces = cells.condensed(alone) + (cells.matrix @ known[places][:, :, None])[:, :, 0]
        right = loads.reshape(-1, 2)[nodes] - np.bincount(places.ravel(), forces.ravel(), known.size).reshape(-1, 2)
        right = np.where(self._held_components, 0.0, (right[:, None] @ turn)[:, 0])
        solution = self._factor.solve(right.ravel()).reshape(-1, 2, 1)
        return cells.moments((known + (turn @ solution).ravel())[places], alone)
