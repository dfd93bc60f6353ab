"""What cells miss of equilibrium by round-off, carried from cell to cell to the supports."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order

from signorini_fx.accuracy.triangles import Array, Ints


def carried(centre: Array, sides: Ints, held: Ints, missed: Array) -> tuple[Array, Array]:
    """Bounds of the force that each cell passes on, and of its couple about the centre of the cell, shapes (n,).

    Args:
        centre: of the cells, length, shape (n, d).
        sides: the cells at both sides of each facet, -1 for none, shape (f, 2).
        held: cells with a facet that is held; none: the last cell of the body takes the rest.
        missed: bounds of the force that each cell misses, shape (n,).
    """
    count, start = len(centre), held if held.size else np.array([0])
    inner = np.flatnonzero((sides >= 0).all(axis=1))
    graph = sp.csr_matrix((np.ones(inner.size), tuple(sides[inner].T)), shape=(count, count))
    # One more node joins all cells that are held.
    root = sp.csr_matrix((np.ones(start.size), (np.full(start.size, 0), start)), shape=(1, count))
    whole = sp.bmat([[graph, None], [root, sp.csr_matrix((1, 1))]], format="csr")
    order, before = breadth_first_order(whole, count, directed=False)
    total, couple = np.append(missed, 0.0), np.zeros(count + 1)
    arm = np.append(np.linalg.norm(centre - centre[before[:count].clip(0, count - 1)], axis=1), 0.0)
    for one in order[:0:-1]:
        total[before[one]] += total[one]
        couple[before[one]] += couple[one] + total[one] * arm[one]
    todo = np.ones(count, dtype=bool)
    todo[order[order < count]] = False
    if todo.any():  # several pieces: each is summed up as if it were a path
        total[:count][todo] = missed[todo].sum()
        couple[:count][todo] = missed[todo].sum() * count * float(np.linalg.norm(np.ptp(centre, axis=0)))
    return total[:count], couple[:count]
