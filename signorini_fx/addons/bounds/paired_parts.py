"""The parts of the contact of two bodies in the plane: pieces of one facet of either side that lie over each other.

Their ends are nodes of one side and the places on the other one that these are projected to.  On each part the other
side is reached by an affine map, so that a displacement has a jump of degree 2 there, and a traction that is linear on
one side is linear on the other one.  The cells at the contact are divided at the ends, see ``split_triangles``: after
that the facets of both sides match one to one.

An end too near a node would leave a sliver, whose stresses are lost in round-off.  Where the boundary is straight at
that node, the node is moved there: the body is the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_scene import NEARLY_MET, REFUSES_OF_PAIRS
from signorini_fx.addons.bounds.simplices import Simplices
from signorini_fx.mechanics.pairs.mortar_coupling import Coupling
from signorini_fx.mechanics.pairs.overlap_plane import ends_in_plane
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import NEAR_NODE, NO_PART, THINNEST_PART

# Sides of a pair: that with the contact points, and the other one.
SLAVE, MASTER = 0, 1


@dataclass(frozen=True)
class PairedParts:
    """The parts of one pair, m of them, between n ends.

    Attributes:
        x: of the ends on the slave and on the master, length, shape (n, 2, 2).
        vertex: of the triangles at them, shape (n, 2); -1: they are inside a facet.
        facet: one that they are on, shape (n, 2).
        ends: of each part, shape (m, 2).
        facets: that it is on, shape (m, 2).
    """

    x: Array
    vertex: Ints
    facet: Ints
    ends: Ints
    facets: Ints

    @classmethod
    def of(cls, t: Simplices, x: Array, facets: Ints) -> PairedParts:
        """Of pieces of the overlap.

        Args:
            t: the triangles.
            x: both ends of each piece on both sides, length, shape (p, 2, 2, 2).
            facets: of both sides, shape (p, 2).
        """
        x, facets = _between_vertices(t, x, facets)
        tiny = NO_PART * float(t.area[facets].min())
        flat, rows = x.reshape(-1, 4), np.repeat(facets, 2, axis=0)
        near = cKDTree(flat).query_pairs(tiny, output_type="ndarray")
        graph = sp.csr_matrix((np.ones(len(near)), tuple(near.T)), shape=(len(flat), len(flat)))
        number = np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
        first = np.unique(number, return_index=True)[1]
        at, vertex = flat[first].reshape(-1, 2, 2), np.full((len(first), 2), -1)
        for side in (SLAVE, MASTER):
            corners = t.facets[rows[:, side]]
            away = np.linalg.norm(t.x[corners] - flat.reshape(-1, 2, 2)[:, None, side], axis=2)
            for k in (0, 1):
                meets = away[:, k] <= tiny
                vertex[number[meets], side] = corners[meets, k]
            on_vertex = vertex[:, side] >= 0
            at[on_vertex, side] = t.x[vertex[on_vertex, side]]
        ends = number.reshape(-1, 2)
        parts = ends[:, 0] != ends[:, 1]
        return cls(at, vertex, rows[first], ends[parts], facets[parts])

    def moved(self, t: Simplices, movable: npt.NDArray[np.bool_]) -> tuple[PairedParts, Array]:
        """With nodes that ends are near to moved to these, the ends of the other side first; and all nodes.

        Args:
            t: the triangles.
            movable: nodes that may move along their boundary, shape (v,).

        Raises:
            Refused: an end that is left would make a sliver.
        """
        x, movable, parts = t.x.copy(), movable.copy(), self
        for side in (MASTER, SLAVE):
            for end, node in parts.ends_near(t, side, NEAR_NODE):
                if movable[node] and (merged := parts.merged(end, node, side)) is not None and _bears(t, x, merged):
                    parts, x[node], movable[node] = merged[0], merged[1], False
        for side in (MASTER, SLAVE):
            for end, _ in parts.ends_near(replace(t, x=x), side, THINNEST_PART):
                at = ", ".join(f"{value:.6g}" for value in parts.x[end, side])
                raise Refused(f"{REFUSES_OF_PAIRS[NEARLY_MET]}, as near ({at}): let them meet, or move one of them")
        return parts, x

    def ends_near(self, t: Simplices, side: int, share: float) -> list[tuple[int, int]]:
        """Ends inside facets, and the nodes of these that they are nearer to than a share of the height of the triangle
        there, one for each end, the nearest first.
        """
        inside = np.flatnonzero((self.vertex[:, side] < 0) & np.isin(np.arange(len(self.x)), self.ends))
        facet = self.facet[inside, side]
        height = 2 * t.volume[t.sides[facet, 0]] / t.area[facet]
        away = np.linalg.norm(t.x[t.facets[facet]] - self.x[inside, None, side], axis=2)
        rows, columns = np.nonzero(away < share * height[:, None])
        order = np.argsort(away[rows, columns], kind="stable")
        return [(int(inside[k]), int(t.facets[facet[k], c])) for k, c in zip(rows[order], columns[order], strict=True)]

    def merged(self, end: int, node: int, side: int) -> tuple[PairedParts, Array, int] | None:
        """With an end at a node that is moved to it; None: this is an end of its own, or the end has one already."""
        if self.vertex[end, side] >= 0:
            return None
        rivals = np.flatnonzero(self.vertex[:, side] == node)
        if (self.vertex[rivals, 1 - side] >= 0).any():
            return None
        vertex, ends = self.vertex.copy(), self.ends.copy()
        vertex[end, side] = node
        vertex[rivals] = -1
        ends[np.isin(ends, rivals)] = end
        parts = ends[:, 0] != ends[:, 1]
        merged = replace(self, vertex=vertex, ends=ends[parts], facets=self.facets[parts])
        return merged, self.x[end, side], node


def _bears(t: Simplices, x: Array, merged: tuple[PairedParts, Array, int]) -> bool:
    """Whether the triangles around a node keep half of their areas, and no facet gets shorter by a half."""
    _, target, node = merged
    around = (t.corners == node).any(axis=1)
    changed = x.copy()
    changed[node] = target
    thinner = replace(t, x=changed, corners=t.corners[around])
    cells = replace(t, x=x, corners=t.corners[around])
    return bool((thinner.volume > cells.volume / 2).all())


def _between_vertices(t: Simplices, x: Array, facets: Ints) -> tuple[Array, Ints]:
    """Pieces cut at vertices of the triangles that are inside them, as triangles are divided where the displacement is
    of degree 2.  See ``PairedParts.of``; here the facets are several for each piece, shape (p, 2, k).
    """
    if facets.shape[2] == 1:
        return x, facets[:, :, 0]
    pieces, numbers = [], []
    for number in range(len(x)):
        ends, halves = np.asarray(x[number]), np.asarray(facets[number])
        cuts = [0.0, 1.0]
        for side in (SLAVE, MASTER):
            middle = np.intersect1d(t.facets[halves[side, 0]], t.facets[halves[side, 1]])[0]
            along = ends[1, side] - ends[0, side]
            parameter = float((t.x[middle] - ends[0, side]) @ along / (along @ along))
            cuts += [parameter] if NO_PART < parameter < 1 - NO_PART else []
        cuts.sort()
        for a, b in pairwise(cuts):
            if b - a <= NO_PART:
                continue
            piece = np.stack([(1 - s) * ends[0] + s * ends[1] for s in (a, b)])
            chosen = []
            for side in (SLAVE, MASTER):
                centres = t.x[t.facets[halves[side]]].mean(axis=1)
                chosen.append(halves[side, np.linalg.norm(centres - piece[:, side].mean(axis=0), axis=1).argmin()])
            pieces.append(piece)
            numbers.append(chosen)
    return np.array(pieces), np.array(numbers, dtype=np.int64)


def pieces_of(coupling: Coupling, slave: PairSurface, master: PairSurface) -> tuple[Array, Ints]:
    """Both ends of each piece of the overlap on both sides, length, shape (p, 2, 2, 2), and the numbers of its facets
    on the surfaces, shape (p, 2).
    """
    at, over = ends_in_plane(coupling.overlap, slave, master, coupling.directions)
    numbers = coupling.overlap.slave, coupling.overlap.master
    x = np.stack((slave.positions(numbers[0], at), master.positions(numbers[1], over)), axis=2)
    return x, np.stack(numbers, axis=1)
