"""Whether a rigid shape lies inside a nonlinear body, or has passed through it since the last solution, or two bodies
have done so with each other, in words.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx.forms.nonlinear.linearised import State
from signorini_fx.forms.nonlinear.moving_shapes import MovingShape
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.obstacles.paired_points import MovingPair, SlidingSides
from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells, InsideBody
from signorini_fx.tuned import MOST_PLACES, SHAPE_INSIDE

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


def overlap(
    u: fem.Function, cells: BodyCells, shapes: Mapping[int, MovingShape], settled: Mapping[int, Any], last: State
) -> str:
    """Which shape, how deep and where; empty: none; collective.

    Before there is a solution a shape comes from where it is given, if it is outside of the body there.

    Args:
        u: the displacement of now.
        cells: of the body.
        shapes: by the numbers of their foundations.
        settled: where they were at the end of the last step.
        last: the last solution, or what there is before.
    """
    comm, now, then = cells.space.mesh.comm, cells.placed(u.x.array), cells.placed(last.displacement)
    solved = last.certificate is not None
    for number, moving in shapes.items():
        added = parallel.largest(comm, moving.added, -np.inf)
        deep = cells.inside(now, moving.shape, added)
        if deep is not None:
            return f"contact[{number}]: {deep}"
        before = last.shapes[number] if solved else settled[number]
        if not solved and cells.inside(then, before, added) is not None:
            continue
        deep = cells.passed((then, before), (now, moving.shape), added)
        if deep is not None:
            return f"contact[{number}]: on its way, {deep}"
    return ""


def overlap_of_bodies(u: fem.Function, cells: BodyCells, pairs: Mapping[int, MovingPair], last: State) -> str:
    """Which pair, how deep and where; empty: none; collective.  For the arguments see ``overlap``.

    The nodes of each side are looked for in the cells of other pieces of the mesh, at the end and on the straight way
    to it.  In contact they may be there by what the chords of both sides leave: up to ``SHAPE_INSIDE`` of a facet of
    the other side, and at the end no farther than the points of the pair look for partners.
    """
    if not pairs:
        return ""
    comm, now, then = cells.space.mesh.comm, cells.placed(u.x.array), cells.placed(last.displacement)
    piece = find_pieces(cells.space.mesh).of_cell
    every = cells.space.dofmap.list
    nodal = np.zeros((len(now), 1))
    nodal[every.ravel(), 0] = np.repeat(piece[: len(every)], every.shape[1])
    owned = cells.space.dofmap.index_map.size_local
    lengths = np.linalg.norm(np.ptp(now[cells.nodes], axis=1), axis=1)
    total, count = parallel.global_sum(comm, np.array([lengths.sum(), lengths.size]))
    way = parallel.largest(comm, np.linalg.norm(now - then, axis=1), 0.0) / (SHAPE_INSIDE * total / count)
    steps = math.ceil(min(max(float(way), 1.0), MOST_PLACES))
    for number, pair in pairs.items():
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
    corners, piece = corners[near], piece[near]
    middles = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    points = cKDTree(at).query_ball_point(middles, reach)
    cell = np.repeat(np.arange(near.size), [len(numbers) for numbers in points])
    point = np.array([number for numbers in points for number in numbers], dtype=np.int64)
    others = piece[cell] != of_node[point]
    cell, point = cell[others], point[others]
    on_planes, outward = cells.planes(corners)
    beyond = np.einsum("kfd,kfd->kf", at[point, None] - on_planes[cell], outward[cell])
    within[point[(beyond <= 0.0).all(axis=1)]] = True
    return within


def _deepest(sides: SlidingSides, at: Array, within: Flags, at_most: float) -> InsideBody | None:
    """The deepest of the nodes of both sides that are in the other body, of those that are too deep: along the normal
    of the other side at its nearest node.
    """
    count, deepest = sides.slave.nodes.size, None
    surfaces = [
        side.surface.displaced(x - side.surface.x)
        for side, x in ((sides.slave, at[:count]), (sides.master, at[count:]))
    ]
    for surface, other, first in ((surfaces[0], surfaces[1], 0), (surfaces[1], surfaces[0], count)):
        x = surface.x[within[first : first + len(surface.x)]]
        if not len(x):
            continue
        size = np.full(len(other.x), np.inf)  # of the smallest facet around each node
        extent = np.linalg.norm(np.ptp(other.corners, axis=1), axis=1) / other.functions.degree
        np.minimum.at(size, other.nodes, extent[:, None])
        nearest = cKDTree(other.x).query(x)[1]
        depth = np.einsum("nd,nd->n", other.x[nearest] - x, other.directions[nearest])
        for k in np.flatnonzero(depth > np.minimum(SHAPE_INSIDE * size[nearest], at_most)):
            if deepest is None or depth[k] > deepest.depth:
                deepest = InsideBody(float(depth[k]), tuple(x[k].tolist()))
    return deepest
