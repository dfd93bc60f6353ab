"""Which facets of a side share nodes, and so turn each other's normals at these, and which nodes are on one facet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class FacetNeighbours:
    """The nodes of each facet and of those that share nodes with it, f facets with k nodes.

    Attributes:
        around: these nodes, those of the facet among them, filled up by its first one, shape (f, w).
        own_places: where the nodes of the facet are among them, shape (f, k).
        turned: nodes of facets, numbered facet by facet, once for each facet that has the node, shape (p,).
        turning: the same node in that facet, numbered likewise, shape (p,).
        places: where the nodes of that facet are in ``around`` of the first one, shape (p, k).
    """

    around: Indices
    own_places: Indices
    turned: Indices
    turning: Indices
    places: Indices

    @classmethod
    def of(cls, nodes: Indices) -> FacetNeighbours:
        """Of facets with these nodes, shape (f, k)."""
        facets, count = nodes.shape
        flat = nodes.ravel()
        order = np.argsort(flat, kind="stable")
        begins, sizes = np.searchsorted(flat[order], flat), np.bincount(flat)[flat]
        turned = np.repeat(np.arange(flat.size), sizes)
        turning = order[begins[turned] + np.arange(turned.size) - np.repeat(np.cumsum(sizes) - sizes, sizes)]
        total = int(flat.max(initial=0)) + 1
        keys = (turned // count)[:, None] * total + nodes[turning // count]
        distinct, at = np.unique(keys, return_inverse=True)
        facet = distinct // total
        slot = np.arange(distinct.size) - np.searchsorted(facet, np.arange(facets))[facet]
        around = np.repeat(nodes[:, :1], int(slot.max(initial=0)) + 1, axis=1)
        around[facet, slot] = distinct % total
        own_places = slot[np.searchsorted(distinct, np.arange(facets)[:, None] * total + nodes)]
        return cls(around, own_places, turned, turning, slot[at.reshape(keys.shape)])


def nodes_beside(facets: Indices, count: int) -> tuple[Indices, npt.NDArray[np.bool_]]:
    """The nodes that are on a facet with each node, itself included, ascending, and which of these entries are any,
    shape (N, m).

    Args:
        facets: nodes of each, shape (f, k).
        count: of all nodes, N.
    """
    keys = np.unique((facets[:, :, None] * count + facets[:, None]).ravel())
    row = keys // count
    slot = np.arange(row.size) - np.searchsorted(row, np.arange(count))[row]
    beside = np.zeros((count, int(slot.max(initial=-1)) + 1), dtype=np.int64)
    listed = np.zeros(beside.shape, dtype=bool)
    beside[row, slot], listed[row, slot] = keys % count, True
    return beside, listed
