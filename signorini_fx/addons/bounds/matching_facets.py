"""Facets of two bodies in space that lie over each other one to one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.simplices import Simplices
from signorini_fx.tuned import SAME_DIRECTION


@dataclass(frozen=True)
class MatchingFacets:
    """Those of one contact, m of them.

    Attributes:
        slave: of the side with the contact points, shape (m,).
        master: the one over each, shape (m,).
        order: of the vertices of the latter those over each of the former, shape (m, 3).
    """

    slave: Ints
    master: Ints
    order: Ints

    @classmethod
    def of(cls, t: Simplices, slave: Ints, master: Ints, tiny: float) -> MatchingFacets:
        """Pair facets whose vertices are at the same places, of flat parallel sides along their normal.

        Args:
            t: the cells.
            slave: facets of one side.
            master: of the other one.
            tiny: by how much places may differ, length.
        """
        along = t.normal[slave[0]]
        parallel = max(np.abs(t.normal[slave] - along).max(), np.abs(t.normal[master] + along).max()) <= SAME_DIRECTION
        places: Array = t.x - np.outer(t.x @ along, along) if parallel else t.x
        vertices = np.unique(t.facets[master])
        away, nearest = cKDTree(places[vertices]).query(places)
        over = np.where(away <= tiny, vertices[nearest], -1)[t.facets[slave]]
        keys = t.keys(t.facets[master])
        by_key = np.argsort(keys)
        candidate = by_key[np.searchsorted(keys, t.keys(np.sort(over, axis=1)), sorter=by_key).clip(max=len(keys) - 1)]
        met = (t.facets[master[candidate]] == np.sort(over, axis=1)).all(axis=1)
        order = np.argsort(np.argsort(over[met], axis=1), axis=1)
        return cls(slave[met], master[candidate[met]], order)
