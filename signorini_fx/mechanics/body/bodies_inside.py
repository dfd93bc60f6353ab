"""Whether two bodies of the plane lie inside each other, or have passed through each other: what contact at the points
of a pair cannot see.

The nodes of each side are looked for in the cells of other pieces of the mesh than their own.  In contact they may be
there by what the chords of both sides leave: up to ``SHAPE_INSIDE`` of the nearest facet of the other side.  Two bodies
have passed through each other if they lie inside each other on the straight way between two displacements.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.machine import parallel
from signorini_fx.mechanics.body.averages import from_owners
from signorini_fx.mechanics.body.pieces import find_pieces
from signorini_fx.mechanics.body.shapes_inside import BodyCells, InsideBody
from signorini_fx.mechanics.body.sliding_sides import SlidingSides
from signorini_fx.tuned import MOST_PLACES, SHAPE_INSIDE

Array = npt.NDArray[np.float64]

# The nodes of a cell along its outline, by how many it has.
_AROUND = {3: [0, 1, 2], 4: [0, 1, 3, 2], 6: [0, 5, 1, 3, 2, 4], 9: [0, 4, 1, 6, 3, 7, 2, 5]}


@dataclass(frozen=True)
class PairedBodies:
    """The two bodies of a pair.

    Attributes:
        cells: of this rank.
        sides: of the pair.
        piece: of each cell, shape (c,).
        of_node: piece of each node of both sides, those of the slave first, shape (m,).
    """

    cells: BodyCells
    sides: SlidingSides
    piece: npt.NDArray[np.int64]
    of_node: npt.NDArray[np.int64]

    @classmethod
    def of(cls, cells: BodyCells, sides: SlidingSides) -> PairedBodies:
        """Those of a pair; collective."""
        space, pieces = cells.space, find_pieces(cells.space.mesh)
        nodal = np.zeros(len(cells.x))
        every = space.dofmap.list
        nodal[every.ravel()] = np.repeat(pieces.of_cell[: len(every)], every.shape[1])
        owned = space.dofmap.index_map.size_local
        of_node = from_owners(nodal[:owned, None], sides.nodes, sides.comm)[:, 0].astype(np.int64)
        return cls(cells, sides, np.asarray(pieces.of_cell[: len(cells.nodes)]), of_node)

    def inside(self, begun: Array, ended: Array) -> InsideBody | None:
        """Where the bodies lie inside each other at the end, or on the straight way to it; None: nowhere; collective.

        Args:
            begun: places of the nodes of this rank, see ``BodyCells.placed``.
            ended: likewise.
        """
        comm = self.sides.comm
        lengths = np.linalg.norm(np.ptp(ended[self.cells.nodes], axis=1), axis=1)
        total, count = parallel.global_sum(comm, np.array([lengths.sum(), lengths.size]))
        way = parallel.largest(comm, np.linalg.norm(ended - begun, axis=1), 0.0) / (SHAPE_INSIDE * total / count)
        steps = math.ceil(min(max(float(way), 1.0), MOST_PLACES))
        for share in np.arange(1, steps + 1) / steps:
            if (deep := self._deepest((1.0 - share) * begun + share * ended)) is not None:
                return deep
        return None

    def _deepest(self, places: Array) -> InsideBody | None:
        """The node that is deepest in the other body, of those that are too deep; collective."""
        sides = self.sides
        owned, count = sides.space.dofmap.index_map.size_local, sides.slave.nodes.size
        at = sides.gathered(np.ascontiguousarray(places[:owned]))
        within = parallel.global_sum(sides.comm, self._within(places, at).astype(np.int64)) > 0
        deepest: InsideBody | None = None
        for nodes, first, surface in (
            (np.arange(count), count, sides.master.surface),
            (np.arange(count, len(at)), 0, sides.slave.surface),
        ):
            inner = nodes[within[nodes]]
            if not inner.size:
                continue
            nodes_along = surface.nodes[:, np.argsort(surface.functions.places[:, 0])]
            chords = np.stack((nodes_along[:, :-1], nodes_along[:, 1:]), axis=2).reshape(-1, 2)
            start, end = at[first + chords].transpose(1, 0, 2)
            along = end - start
            size = np.linalg.norm(along, axis=1)
            share = np.clip(np.einsum("nfk,fk->nf", at[inner, None] - start, along) / size**2, 0.0, 1.0)
            apart = np.linalg.norm(at[inner, None] - start - share[..., None] * along, axis=2)
            nearest = apart.argmin(axis=1)
            depth = apart[np.arange(inner.size), nearest]
            for k in np.flatnonzero(depth > SHAPE_INSIDE * size[nearest]):
                if deepest is None or depth[k] > deepest.depth:
                    deepest = InsideBody(float(depth[k]), tuple(at[inner[k]].tolist()))
        return deepest

    def _within(self, places: Array, at: Array) -> npt.NDArray[np.bool_]:
        """Which points, shape (m, 2), are in a cell of this rank of another piece than their own."""
        within = np.zeros(len(at), dtype=bool)
        nodes = self.cells.nodes
        if not len(nodes):
            return within
        corners = places[nodes[:, _AROUND[nodes.shape[1]]]]
        middles = corners.mean(axis=1)
        reach = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
        near = cKDTree(at).query_ball_point(middles, reach)
        cell = np.repeat(np.arange(len(nodes)), [len(points) for points in near])
        point = np.array([number for points in near for number in points], dtype=np.int64)
        others = self.piece[cell] != self.of_node[point]
        cell, point = cell[others], point[others]
        edges = np.roll(corners[cell], -1, axis=1) - corners[cell]
        away = at[point, None] - corners[cell]
        turns = edges[..., 0] * away[..., 1] - edges[..., 1] * away[..., 0]
        within[point[(turns >= 0).all(axis=1) | (turns <= 0).all(axis=1)]] = True
        return within
