"""What cells miss of equilibrium by round-off, carried from cell to cell to the supports."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.simplices import pieces_of_cells


def carried(centre: Array, sides: Ints, held: Ints, missed: Array) -> tuple[Array, Array]:
    """Bounds of the force that each cell passes on, and of its couple about the centre of the cell, shapes (n,).

    Args:
        centre: of the cells, length, shape (n, d).
        sides: the cells at both sides of each facet, -1 for none, shape (f, 2).
        held: cells with a facet that is held; in a piece without one a cell of it takes the rest.
        missed: bounds of the force that each cell misses, shape (n,).
    """
    count, piece = len(centre), pieces_of_cells(sides, len(centre))
    loose = np.setdiff1d(np.arange(piece.max(initial=-1) + 1), piece[held])
    start = np.concatenate((held, np.unique(piece, return_index=True)[1][loose]))
    inner = np.flatnonzero((sides >= 0).all(axis=1))
    graph = sp.csr_matrix((np.ones(inner.size), tuple(sides[inner].T)), shape=(count, count))
    # One more node joins all cells that take what the others pass on.
    root = sp.csr_matrix((np.ones(start.size), (np.full(start.size, 0), start)), shape=(1, count))
    rooted_graph = sp.bmat([[graph, None], [root, sp.csr_matrix((1, 1))]], format="csr")
    order, parent = breadth_first_order(rooted_graph, count, directed=False)
    total, couple = np.append(missed, 0.0), np.zeros(count + 1)
    arm = np.append(np.linalg.norm(centre - centre[parent[:count].clip(0, count - 1)], axis=1), 0.0)
    for cell in order[:0:-1]:
        total[parent[cell]] += total[cell]
        couple[parent[cell]] += couple[cell] + total[cell] * arm[cell]
    return total[:count], couple[:count]
