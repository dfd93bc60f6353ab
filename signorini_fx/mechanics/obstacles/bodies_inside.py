"""Whether two bodies lie inside each other, or have passed through each other: what contact at the points of a pair
cannot see.

The nodes of each side are looked for in the cells of other pieces of the mesh than their own.  In contact they may be
there by what the chords of both sides leave: up to ``SHAPE_INSIDE`` of the nearest facet of the other side, and at the
end of a step no farther than the points of the pair look for partners.  Facets are divided into chords, in 3D into
triangles.  Two bodies have passed through each other if they lie inside each other on the straight way between two
displacements.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells, InsideBody
from signorini_fx.mechanics.obstacles.sliding_sides import SlidingSides
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.tuned import MOST_PLACES, SHAPE_INSIDE

Array = npt.NDArray[np.float64]

# Parts of a facet in 3D by how many nodes it has.
_TRIANGLES = {3: [[0, 1, 2]], 4: [[0, 1, 2], [1, 3, 2]]}


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
        first, last = begun[self.cells.nodes], ended[self.cells.nodes]
        lengths = np.linalg.norm(np.ptp(last, axis=1), axis=1)
        total, count = parallel.global_sum(comm, np.array([lengths.sum(), lengths.size]))
        way = parallel.largest(comm, np.linalg.norm(ended - begun, axis=1), 0.0) / (SHAPE_INSIDE * total / count)
        steps = math.ceil(min(max(float(way), 1.0), MOST_PLACES))
        low = np.minimum(first.min(axis=1), last.min(axis=1))
        high = np.maximum(first.max(axis=1), last.max(axis=1))
        nodes = np.stack([self._at_nodes_of_sides(places) for places in (begun, ended)])
        near = np.zeros(len(self.piece), dtype=bool)  # cells whose boxes on the way meet that of all points of others
        for piece in np.unique(self.piece):
            points = nodes[:, self.of_node != piece].reshape(-1, nodes.shape[2])
            if len(points):
                meets = (high >= points.min(axis=0)) & (low <= points.max(axis=0))
                near |= (self.piece == piece) & meets.all(axis=1)
        for share in np.arange(1, steps + 1) / steps:
            # Contact at the end would not see what is deeper than its reach.
            seen = self.sides.reach if share == 1.0 else math.inf
            places = (1.0 - share) * begun + share * ended
            if (deep := self._deepest(places, np.flatnonzero(near), seen)) is not None:
                return deep
        return None

    def _at_nodes_of_sides(self, places: Array) -> Array:
        """Places of the nodes of this rank at the nodes of both sides, shape (m, d); collective."""
        owned = self.sides.space.dofmap.index_map.size_local
        return self.sides.gathered(np.ascontiguousarray(places[:owned]))

    def _deepest(self, places: Array, cells: npt.NDArray[np.int64], at_most: float) -> InsideBody | None:
        """The node that is deepest in the other body, of those that are too deep; collective."""
        sides = self.sides
        at, count = self._at_nodes_of_sides(places), sides.slave.nodes.size
        within = parallel.global_sum(sides.comm, self._within(places, at, cells).astype(np.int64)) > 0
        deepest: InsideBody | None = None
        for nodes, first, surface in (
            (np.arange(count), count, sides.master.surface),
            (np.arange(count, len(at)), 0, sides.slave.surface),
        ):
            inner = nodes[within[nodes]]
            if not inner.size:
                continue
            apart, size = _from_parts(surface, at[first:], at[inner])
            nearest = apart.argmin(axis=1)
            depth = apart[np.arange(inner.size), nearest]
            for k in np.flatnonzero(depth > np.minimum(SHAPE_INSIDE * size[nearest], at_most)):
                if deepest is None or depth[k] > deepest.depth:
                    deepest = InsideBody(float(depth[k]), tuple(at[inner[k]].tolist()))
        return deepest

    def _within(self, places: Array, at: Array, cells: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
        """Which points, shape (m, d), are in a cell of another piece than their own, of some of this rank."""
        within = np.zeros(len(at), dtype=bool)
        if not len(cells):
            return within
        corners, piece = self.cells.corners(places)[cells], self.piece[cells]
        middles = corners.mean(axis=1)
        reach = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
        near = cKDTree(at).query_ball_point(middles, reach)
        cell = np.repeat(np.arange(len(corners)), [len(points) for points in near])
        point = np.array([number for points in near for number in points], dtype=np.int64)
        others = piece[cell] != self.of_node[point]
        cell, point = cell[others], point[others]
        on_planes, outward = self.cells.planes(corners)
        beyond = np.einsum("kfd,kfd->kf", at[point, None] - on_planes[cell], outward[cell])
        within[point[(beyond <= 0.0).all(axis=1)]] = True
        return within


def _from_parts(surface: PairSurface, places: Array, x: Array) -> tuple[Array, Array]:
    """Distances of points, shape (n, d), from the chords of a side, in 3D from its triangles, shape (n, f), and their
    sizes, shape (f,); ``places``: of its nodes.
    """
    if surface.dimension == 2:
        nodes_along = surface.nodes[:, np.argsort(surface.functions.places[:, 0])]
        start, end = places[np.stack((nodes_along[:, :-1], nodes_along[:, 1:]), axis=2).reshape(-1, 2)].swapaxes(0, 1)
        return _from_lines(start, end, x), np.linalg.norm(end - start, axis=1)
    corners = places[surface.nodes[:, np.array(_TRIANGLES[surface.nodes.shape[1]])].reshape(-1, 3)]
    edges = zip(*np.swapaxes((corners, np.roll(corners, -1, axis=1)), 1, 2), strict=True)
    apart = np.min([_from_lines(start, end, x) for start, end in edges], axis=0)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    square = np.sum(normal**2, axis=1)
    away = x[:, None] - corners[:, 0]
    shares = np.stack(
        (
            np.sum(np.cross(away, second) * normal, axis=2) / square,
            np.sum(np.cross(first, away) * normal, axis=2) / square,
        )
    )
    over = (shares >= 0).all(axis=0) & (shares.sum(axis=0) <= 1)
    height = np.abs(np.einsum("nfk,fk->nf", away, normal)) / np.sqrt(square)
    return np.where(over, height, apart), square**0.25


def _from_lines(start: Array, end: Array, x: Array) -> Array:
    """Distances of points, shape (n, d), from lines between two ends, shape (f, d) each: shape (n, f)."""
    along = end - start
    share = np.clip(np.einsum("nfk,fk->nf", x[:, None] - start, along) / np.sum(along**2, axis=1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(x[:, None] - start - share[..., None] * along, axis=2))
