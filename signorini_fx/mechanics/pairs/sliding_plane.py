"""Where points of sides in 2D that slide see each other, and the vertices of the master: see ``sliding_pieces``."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.mechanics.pairs.kinks import Kinks, Projection
from signorini_fx.mechanics.pairs.mean_rotation import of_blocks, turned_normals
from signorini_fx.mechanics.pairs.mortar_coupling import Tested
from signorini_fx.mechanics.pairs.overlap_plane import PLACES_OF_RULE
from signorini_fx.mechanics.pairs.overlap_quadrature import Overlap
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.tuned import NO_PART

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


def ways_in_plane(slave: PairSurface, overlap: Overlap, directions: Array) -> Projection:
    """N between the directions at the nodes of a facet, of length one, shape (N, 2), which turn as its normals do."""
    nodes, shape = slave.nodes[overlap.slave], slave.functions.values(overlap.at)
    ways = shape @ directions[nodes]
    length = np.linalg.norm(ways, axis=2, keepdims=True)
    turns = of_blocks(np.einsum("ni,nj->nij", _turned(directions), _turned(slave.nodal_normals)))
    return Projection(ways / length, sp.csr_array(turns @ turned_normals(slave)), nodes, shape / length)


def seen_vertices(slave: PairSurface, master: PairSurface, tested: Tested, directions: Array) -> Kinks:
    """Those of an overlap; for the arguments see ``SlidingPieces.of``."""
    overlap = tested.overlap
    at, over = overlap.at[..., 0], overlap.over[..., 0]
    half = (at[:, -1] - at[:, 0]) / (2 * PLACES_OF_RULE[-1])
    middle = (at[:, 0] + at[:, -1]) / 2
    rises = over[:, -1] > over[:, 0]
    ends, places = np.concatenate((middle - half, middle + half)), master.functions.places[:, 0]
    first = np.concatenate((rises, ~rises))  # whether the vertex is at the beginning of the facet
    piece = np.tile(np.arange(len(at)), 2)
    vertex = master.nodes[overlap.master[piece], np.where(first, places.argmin(), places.argmax())]
    upper = np.repeat([False, True], len(at))
    inside = (ends > NO_PART) & (ends < 1.0 - NO_PART)
    facet = overlap.slave[piece]
    key = facet * len(master.x) + vertex
    below, above = (np.flatnonzero(inside & side) for side in (upper, ~upper))
    _, from_below, from_above = np.intersect1d(key[below], key[above], return_indices=True)
    below, above = below[from_below], above[from_above]
    facets, s = facet[below], ends[below]
    shape, slope = slave.functions.values(s[:, None]), slave.functions.slopes(s[:, None])[0]
    nodes, vertices = slave.nodes[facets], vertex[below]
    ways, turns = (np.einsum("vk,vkd->vd", values, directions[nodes]) for values in (shape, slope))
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    ways = ways / length
    across = _turned(ways)
    distance = np.einsum("vd,vd->v", master.x[vertices] - np.einsum("vk,vkd->vd", shape, slave.x[nodes]), ways)

    def inclination(rows: Indices) -> Array:
        """The normal of a facet at its vertex along N^ over that along N."""
        numbers, end = overlap.master[piece[rows]], np.where(first[rows], 0.0, 1.0)
        normal = master.normals(numbers, end[:, None, None])[:, 0]
        return np.asarray(np.einsum("vd,vd->v", normal, across) / np.einsum("vd,vd->v", normal, ways))

    kink = inclination(below) - inclination(above)
    stretch = np.einsum("vk,vkd->vd", slope, slave.x[nodes]) + distance[:, None] * turns / length
    rate = kink / np.einsum("vd,vd->v", stretch, across)
    functions = np.einsum("vij,vj->vi", tested.coefficients[facets], slave.tests.values(s[:, None]))
    at_vertices = s[:, None, None]
    functions *= rate[:, None] * slave.measured(facets, at_vertices, slave.sizes(facets, at_vertices))
    numbers = np.broadcast_to(np.arange(len(s))[:, None], functions.shape)
    entries = functions.ravel(), (slave.points[facets].ravel(), numbers.ravel())
    count = len(slave.x)
    blocks = np.column_stack((nodes, count + vertices, count + len(master.x) + nodes))
    share = np.column_stack((-shape, np.ones(len(s)), -distance[:, None] * shape / length))
    return Kinks(sp.csr_array(entries, shape=(count, len(s))), blocks, share, across)


def _turned(vectors: Array) -> Array:
    """Vectors, shape (..., 2), turned by 90 degrees."""
    return np.stack((-vectors[..., 1], vectors[..., 0]), axis=-1)
