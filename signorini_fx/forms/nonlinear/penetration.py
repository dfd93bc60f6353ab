"""Whether a rigid shape lies inside a nonlinear body, or has passed through it since the last solution, or two bodies
have done so with each other: which contact, how deep and where, in words; "": none.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.forms.nonlinear.linearised import MovingFoundations, State
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.obstacles.paired_points import SlidingSides
from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells, InsideBody
from signorini_fx.tuned import MOST_PLACES, SHAPE_INSIDE

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


def overlap(foundations: MovingFoundations, last: State) -> str:
    """Of shapes, since the ``last`` solution, or what there is before; collective.

    Before there is a solution a shape comes from where it is given, if it is outside of the body there.
    """
    cells, solved = foundations.cells, last.certificate is not None
    now, then = cells.placed(foundations.at.x.array), cells.placed(last.displacement)
    for number, moving in foundations.moving.items():
        added = parallel.largest(cells.space.mesh.comm, moving.added, -np.inf)
        if (deep := cells.inside(now, moving.shape, added)) is not None:
            return f"contact[{number}]: {deep}"
        before = last.shapes[number] if solved else foundations.settled[number]
        if not solved and cells.inside(then, before, added) is not None:
            continue
        if (deep := cells.passed((then, before), (now, moving.shape), added)) is not None:
            return f"contact[{number}]: on its way, {deep}"
    return ""


def overlap_of_bodies(foundations: MovingFoundations, last: State) -> str:
    """Of pairs, since the ``last`` solution, or what there is before; collective.

    The nodes of each side are looked for in the cells of other pieces of the mesh, at the end and on the straight way
    to it.  In contact they may be there by what the chords of both sides leave: up to ``SHAPE_INSIDE`` of a facet of
    the other side, and at the end no farther than the points of the pair look for partners.
    """
    if not foundations.sliding:
        return ""
    cells = foundations.cells
    comm, now, then = cells.space.mesh.comm, cells.placed(foundations.at.x.array), cells.placed(last.displacement)
    piece, every = find_pieces(cells.space.mesh).of_cell, cells.space.dofmap.list
    nodal = np.zeros((len(now), 1))
    nodal[every.ravel(), 0] = np.repeat(piece[: len(every)], every.shape[1])
    owned = cells.space.dofmap.index_map.size_local
    lengths = np.linalg.norm(np.ptp(now[cells.nodes], axis=1), axis=1)
    total, count = parallel.global_sum(comm, np.array([lengths.sum(), lengths.size]))
    way = parallel.largest(comm, np.linalg.norm(now - then, axis=1), 0.0) / (SHAPE_INSIDE * total / count)
    steps = math.ceil(min(max(float(way), 1.0), MOST_PLACES))
    for number, pair in foundations.sliding.items():
        of_node = pair.sides.gathered(nodal[:owned])[:, 0]
        for share in np.arange(1, steps + 1) / steps:
            # Contact at the end would not see what is deeper than its reach.
            seen = pair.sides.reach if share == 1.0 else math.inf
            places = (1.0 - share) * then + share * now
            at = pair.sides.gathered(np.ascontiguousarray(places[:owned]))
            found = _within(cells, places, piece[: len(cells.nodes)], at, of_node)
            within = parallel.global_sum(comm, found.astype(np.int64)) > 0
            if (deep := _deepest(pair.sides, at, within, seen)) is not None:
                return f"contact[{number}]: {deep}"
    return ""


def _within(cells: BodyCells, places: Array, piece: Indices, at: Array, of_node: Array) -> Flags:
    """Which points, of the pieces ``of_node``, are in a cell of this rank that belongs to another piece, shape (m,)."""
    within, corners = np.zeros(len(at), dtype=bool), cells.corners(places)
    meets = (corners.max(axis=1) >= at.min(axis=0)) & (corners.min(axis=1) <= at.max(axis=0))
    near = np.flatnonzero(meets.all(axis=1))
    if not near.size:
        return within
    corners = corners[near]
    middles = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    points = cKDTree(at).query_ball_point(middles, reach)
    cell, point = np.repeat(np.arange(near.size), list(map(len, points))), np.concatenate(points).astype(np.int64)
    others = piece[near][cell] != of_node[point]
    cell, point = cell[others], point[others]
    on_planes, outward = cells.planes(corners)
    beyond = np.einsum("kfd,kfd->kf", at[point, None] - on_planes[cell], outward[cell])
    within[point[(beyond <= 0.0).all(axis=1)]] = True
    return within


def _deepest(sides: SlidingSides, at: Array, within: Flags, at_most: float) -> InsideBody | None:
    """The deepest of the nodes of both sides that are in the other body, of those that are too deep: along the normal
    of the other side at its nearest node.
    """
    halves, deepest = np.split(np.arange(len(at)), [sides.slave.nodes.size]), None
    both = zip((sides.slave.surface, sides.master.surface), halves, strict=True)
    surfaces = [surface.displaced(at[half] - surface.x) for surface, half in both]
    for half, other in zip(halves, surfaces[::-1], strict=True):
        x = at[half][within[half]]
        size = np.full(len(other.x), np.inf)  # of the smallest facet around each node
        extent = np.linalg.norm(np.ptp(other.corners, axis=1), axis=1) / other.functions.degree
        np.minimum.at(size, other.nodes, extent[:, None])
        nearest = cKDTree(other.x).query(x)[1]
        depth = np.einsum("nd,nd->n", other.x[nearest] - x, other.directions[nearest])
        for k in np.flatnonzero(depth > np.minimum(SHAPE_INSIDE * size[nearest], at_most)):
            if deepest is None or depth[k] > deepest.depth:
                deepest = InsideBody(float(depth[k]), tuple(x[k].tolist()))
    return deepest
