"""The pieces of a body of triangles or tetrahedra, and the rigid motions that supports leave to each of them.

Cells pass forces to each other through the edges or faces that they share, so that each piece is a body of its own:
it has its own free motions, its own balance of forces and its own bound.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.simplices import Simplices
from signorini_fx.tuned import NOTHING_LEFT


def rigid_motions(x: Array) -> Array:
    """Translations and rotations about the centre, of size one, shape (v, d, 3 or 6).

    Args:
        x: positions, length, shape (v, d).
    """
    d, arm = x.shape[1], x - x.mean(axis=0)
    arm = arm / np.abs(arm).max()
    axes = list(combinations(range(d), 2))
    modes = np.zeros((len(x), d, d + len(axes)))
    modes[:, :, :d] = np.eye(d)
    for turn, (i, j) in enumerate(axes, start=d):
        modes[:, i, turn], modes[:, j, turn] = -arm[:, j], arm[:, i]
    return modes


def free_motions(t: Simplices, held: Array) -> Array:
    """An orthonormal basis of the rigid motions that held facets leave free, each of one piece, shape (d v, k).

    Args:
        t: the cells.
        held: projector onto the directions in which each facet is held, shape (f, d, d).
    """
    d, held_facets = t.x.shape[1], np.flatnonzero(held.any(axis=(1, 2)))
    of_facet, bases = t.piece_of_vertex[t.facets[held_facets, 0]], []
    for piece in range(int(t.piece.max(initial=-1)) + 1):
        inside = t.piece_of_vertex == piece
        modes = np.zeros((len(t.x), d, d * (d + 1) // 2))
        modes[inside] = rigid_motions(t.x[inside])
        facets = held_facets[of_facet == piece]
        rows = np.einsum("fij,fajk->faik", held[facets], modes[t.facets[facets]]).reshape(-1, modes.shape[2])
        values, vectors = np.linalg.eigh(rows.T @ rows / max(len(rows), 1))
        free = vectors[:, values <= NOTHING_LEFT * max(values[-1], 1.0)]
        bases.append(np.linalg.qr(modes.reshape(-1, modes.shape[2]) @ free)[0])
    return np.concatenate(bases, axis=1)


def of_each_piece(t: Simplices, motions: Array) -> list[tuple[int, Ints]]:
    """The pieces that have free motions, each with the columns of these.

    Args:
        t: the cells.
        motions: of ``free_motions``, shape (d v, k).
    """
    if not motions.shape[1]:
        return []
    piece = t.piece_of_vertex[np.abs(motions).argmax(axis=0) // t.x.shape[1]]
    return [(int(number), np.flatnonzero(piece == number)) for number in np.unique(piece)]
