"""The hybrid system of a body in space, solved by conjugate gradients, and tractions that balance what they leave.

The preconditioner has the blocks of the faces, and the displacements that are linear on the body.  What it leaves out
of equilibrium is carried away by tractions, so that no digit rests on its convergence.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order

from signorini_fx.addons.bounds.arrays import Array
from signorini_fx.addons.bounds.cell_pieces import free_motions
from signorini_fx.addons.bounds.definite_factor import Factor
from signorini_fx.addons.bounds.johnson_mercier import LocalStress
from signorini_fx.addons.bounds.linear_displacement import assembled, free_basis
from signorini_fx.addons.bounds.simplices import FACETS, Simplices, moments_of
from signorini_fx.addons.bounds.spring_facets import SpringFacets
from signorini_fx.tuned import BALANCING_PRODUCTS, BALANCING_RESIDUAL, SINGULAR


class IteratedSystem:
    """The system of the displacements on the faces of a body that is held in given directions."""

    def __init__(self, t: Simplices, local: LocalStress, held: Array, springs: SpringFacets | None = None) -> None:
        count = len(t.facets)
        self._springs = springs
        self._free, self._compliance = np.eye(3) - held, local.compliance
        self._places = (3 * local.places[..., None] + np.arange(3)).reshape(-1, 36)
        blocks = np.zeros((count, 3, 3, 3, 3))
        compliance = local.compliance.reshape(-1, 4, 3, 3, 4, 3, 3)
        corner = local.places - 3 * t.facets_of[:, :, None]
        for i in range(4):
            for a in range(3):
                for b in range(3):
                    # A face has at most two tetrahedra: each of them adds to it once.
                    for first in (True, False):
                        k = np.flatnonzero((t.sign[:, i] > 0) == first)
                        blocks[t.facets_of[k, i], corner[k, i, a], :, corner[k, i, b]] += compliance[k, i, a, :, i, b]
        blocks = np.einsum("fij,fajbk,fkl->faibl", self._free, blocks, self._free)
        if springs is not None:
            blocks[springs.facets] += springs.matrices.reshape(-1, 3, 3, 3, 3)
        unit = np.einsum("faiai->f", blocks) / 9 + np.einsum("faiai->", blocks) / (9e6 * count)
        blocks += np.einsum("f,ab,fij->faibj", unit, np.eye(3), held)
        self._blocks = np.linalg.inv(blocks.reshape(count, 9, 9))
        self._linear(t, held)

    def _linear(self, t: Simplices, held: Array) -> None:
        """The matrix for displacements that are linear on the body."""
        gather = np.zeros((36, 12))
        for row, corner in enumerate(FACETS[3].ravel()):
            gather[3 * row : 3 * row + 3, 3 * corner : 3 * corner + 3] = np.eye(3)
        matrix = assembled(gather.T @ self._compliance @ gather, t.corners, len(t.x))
        if self._springs is not None:
            matrix += assembled(self._springs.matrices, t.facets[self._springs.facets], len(t.x))
        weight = np.zeros((len(t.x), 3, 3))
        for k in range(3):
            np.add.at(weight, t.facets[:, k], held)
        sizes, vectors = np.linalg.eigh(weight)
        basis = free_basis(vectors, sizes > SINGULAR)
        # As many tied unknowns as there are free motions: loads in balance cause no force there.
        remaining_modes = basis.T @ free_motions(t, held if self._springs is None else self._springs.stopped(held))
        pins, diagonal = np.zeros(basis.shape[1]), (basis.T @ matrix @ basis).diagonal()
        for _ in range(remaining_modes.shape[1]):
            pin = int(np.argmax(np.linalg.norm(remaining_modes, axis=1)))
            along = remaining_modes[pin] / np.linalg.norm(remaining_modes[pin])
            remaining_modes -= np.outer(remaining_modes @ along, along)
            pins[pin] = float(diagonal[pin])
        upper = sp.triu(basis.T @ matrix @ basis + sp.diags_array(pins), format="csr")
        upper.sort_indices()
        self._factor = Factor(upper) if basis.shape[1] else None
        rows = (3 * np.arange(t.facets.size)[:, None] + np.arange(3)).ravel()
        columns = (3 * t.facets.reshape(-1, 1) + np.arange(3)).ravel()
        onto = sp.csr_matrix((np.ones(rows.size), (rows, columns)), shape=(rows.size, t.x.size))
        self._onto = sp.csr_matrix(onto @ basis)

    def moments(self, alone: Array, loads: Array, start: Array) -> Array:
        """Moments of each tetrahedron, out of it, which are nearly equal and opposite but for loads, (n, 4, 3, 3).

        Args:
            alone: see ``LocalStress.alone``.
            loads: moments of the tractions on each face, force, shape (f, 3, 3).
            start: displacements at the vertices of faces, with those prescribed in held directions, shape (f, 3, 3).
        """
        u = self._solve(start, self._summed(alone) - loads @ self._free)
        return (self._forces(u) + alone).reshape(-1, 4, 3, 3)

    def _forces(self, u: Array) -> Array:
        """Moments of each tetrahedron out of it from displacements (f, 3, 3), shape (n, 36)."""
        return np.asarray((self._compliance @ u.ravel()[self._places][:, :, None])[:, :, 0])

    def _resisted(self, u: Array) -> Array:
        """Moments in free directions that displacements (f, 3, 3) need, springs included, shape (f, 3, 3)."""
        moments = self._summed(self._forces(u))
        if self._springs is not None:
            facets = self._springs.facets
            moments[facets] += (self._springs.matrices @ u[facets].reshape(-1, 9, 1)).reshape(-1, 3, 3)
        return moments

    def _summed(self, moments: Array) -> Array:
        """Those of both sides of the faces in free directions, shape (f, 3, 3)."""
        sums = np.bincount(self._places.ravel(), moments.ravel(), 9 * len(self._free)).reshape(-1, 3, 3)
        return np.asarray(sums @ self._free)

    def _preconditioned(self, r: Array) -> Array:
        correction = (self._blocks @ r.reshape(-1, 9, 1)).reshape(r.shape) @ self._free
        if self._factor is not None:
            correction += (self._onto @ self._factor.solve(self._onto.T @ r.ravel())).reshape(r.shape)
        return correction

    def _solve(self, u: Array, alone: Array) -> Array:
        """Displacements with which moments are equal and opposite but for loads, from a start, shape (f, 3, 3).

        Args:
            u: start with prescribed components.
            alone: moments without displacements less those of the loads, summed up, shape (f, 3, 3).
        """
        r = -alone - self._resisted(u)
        z = p = self._preconditioned(r)
        first = current = float((r * z).sum())
        largest = max(first, float((alone * self._preconditioned(alone)).sum()))
        for _ in range(BALANCING_PRODUCTS):
            if not current > BALANCING_RESIDUAL**2 * largest:
                break
            q = self._resisted(p)
            step = current / float((p * q).sum())
            u, r = u + step * p, r - step * q
            z = self._preconditioned(r)
            previous, current = current, float((r * z).sum())
            p = z + current / previous * p
        return u


def balanced(t: Simplices, body: Array, held: Array, tractions: Array) -> Array:
    """Tractions near given ones with which each tetrahedron is in equilibrium, (f, 3, 3).

    A rigid motion of each piece, as a traction on its held faces, balances the piece; then forces and couples are
    carried from one tetrahedron to the next, to the last one of the piece, where nothing is left.

    Args:
        t: the tetrahedra.
        body: see ``Loads``.
        held: projector onto the directions in which each face is held, shape (f, 3, 3).
        tractions: at the vertices of each face out of its first tetrahedron, stress, shape (f, 3, 3).
    """
    count, centre = len(t.corners), t.x.mean(axis=0)
    length = float(np.ptp(t.x, axis=0).max())
    arm = (t.x - centre)[t.facets] / length

    def resultants(traction: Array) -> Array:
        """Force, and couple over a length, of linear tractions (f, 3, 3), shape (f, 6)."""
        moments = moments_of(t, traction)
        return np.concatenate((moments.sum(axis=1), np.cross(arm, moments).sum(axis=1)), axis=1)

    def left(faces: Array) -> Array:
        """What tetrahedra have of resultants on faces and of loads, shape (n, 6)."""
        return np.asarray((t.sign[:, :, None] * faces[t.facets_of]).sum(axis=1) + inside)

    couples = np.cross((t.x[t.corners] - centre) / length, body).sum(axis=1)
    inside = np.concatenate((body.sum(axis=1), couples), axis=1)
    between = np.flatnonzero(t.sides[:, 1] >= 0)
    graph = sp.csr_matrix((np.ones(between.size), tuple(t.sides[between].T)), shape=(count, count))
    piece, pieces = t.piece, int(t.piece.max(initial=-1)) + 1
    residuals = left(resultants(tractions))
    units = np.concatenate((np.broadcast_to(np.eye(3), (*arm.shape[:2], 3, 3)), -_cross_matrix(arm)), axis=3)
    reactions = np.einsum("fij,fajk->faik", held, units)  # of a displacement and a rotation over the length
    works = np.stack([resultants(reactions[..., k]) for k in range(6)], axis=2)
    motion = np.zeros((pieces, 6))
    for k in range(pieces):
        outer_faces = t.outer[piece[t.sides[t.outer, 0]] == k]
        motion[k] = np.linalg.lstsq(works[outer_faces].sum(axis=0), -residuals[piece == k].sum(axis=0), rcond=1e-12)[0]
    tractions = tractions.copy()
    tractions[t.outer] += np.einsum("faik,fk->fai", reactions[t.outer], motion[piece[t.sides[t.outer, 0]]])
    total = left(resultants(tractions))
    keys = t.sides[between] @ [count, 1]
    order = np.argsort(keys)
    through, cells = [], []
    for k in range(pieces):
        path, parent = breadth_first_order(graph, int(np.flatnonzero(piece == k)[0]), directed=False)
        for tetrahedron in path[:0:-1]:
            total[parent[tetrahedron]] += total[tetrahedron]
        low, high = np.sort(np.column_stack((path[1:], parent[path[1:]])), axis=1).T
        through.append(between[order][np.searchsorted(keys[order], low * count + high)])
        cells.append(path[1:])
    face, cell = np.concatenate(through), np.concatenate(cells)
    # Moments with these resultants about the centre of the face, the smallest ones.
    middle, size = arm[face].mean(axis=1), np.sqrt(t.area[face]) / length
    local_arm = (arm[face] - middle[:, None]) / size[:, None, None]
    map_ = np.concatenate((np.broadcast_to(np.eye(3), (*local_arm.shape[:2], 3, 3)), _cross_matrix(local_arm)), axis=2)
    couple = (total[cell, 3:] - np.cross(middle, total[cell, :3])) / size[:, None]
    wanted = np.concatenate((total[cell, :3], couple), axis=1)[:, :, None]
    moments = np.linalg.pinv(map_.transpose(0, 2, 1, 3).reshape(-1, 6, 9)) @ -wanted
    moments = moments.reshape(-1, 3, 3) * np.where(t.sides[face, 0] == cell, 1.0, -1.0)[:, None, None]
    tractions[face] += (12 * moments - 3 * moments.sum(axis=1, keepdims=True)) / t.area[face, None, None]
    return tractions


def _cross_matrix(a: Array) -> Array:
    """The matrices of b -> a x b, shape (..., 3, 3)."""
    return np.stack([np.cross(a, np.eye(3)[k]) for k in range(3)], axis=-1)
