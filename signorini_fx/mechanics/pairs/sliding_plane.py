"""Where points of sides in 2D that slide see each other, and the vertices of the master: see ``sliding_pieces``."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.mechanics.pairs.kinks import Kinks, Projection
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
    return Projection(ways / length, _turned_with_normals(slave, directions), nodes, shape / length)


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


def turned_normals_in_plane(side: PairSurface) -> sp.csr_array:
    """How displacements of the nodes of a side turn its normals at the nodes, sparse, shape (2 N, 2 N)."""
    return _turned_with_normals(side, side.nodal_normals)


def _turned_with_normals(side: PairSurface, vectors: Array) -> sp.csr_array:
    """How displacements turn vectors at the nodes, shape (N, 2), that turn as the normals do, likewise."""
    across = _turned(vectors)[side.nodes]
    turned = across[..., None] * _turned_by_facets(side).reshape(*side.nodes.shape, 1, -1)
    places = (2 * side.nodes[..., None] + np.arange(2)).reshape(len(side.nodes), -1)
    at = places[:, :, None], places[:, None]
    rows, columns = (np.broadcast_to(numbers, (*places.shape, places.shape[1])).ravel() for numbers in at)
    return sp.csr_array((turned.ravel(), (rows, columns)), shape=(2 * len(side.x), 2 * len(side.x)))


def _turned_by_facets(side: PairSurface) -> Array:
    """What each facet turns of the normals at its nodes, as these are displaced, angles, shape (f, k, k, 2).

    The normal of a node is along the integral of that of its facets times its function.  Those in planes of symmetry do
    not turn.
    """
    normals = side.nodal_normals
    at, weights = side.functions.rule(2 * side.functions.degree)
    functions = side.functions.values(at) * weights[:, None]
    products = functions.T @ side.functions.slopes(at)[0]
    facets, moments = np.arange(len(side.nodes)), np.zeros_like(normals)
    facing = side.normals(facets, np.broadcast_to(at, (len(facets), *at.shape)))
    np.add.at(moments, side.nodes, np.einsum("qk,fqd->fkd", functions, facing))
    size = np.linalg.norm(moments, axis=1)
    turns = (size > 0) & ~side.across.any(axis=(1, 2))
    factor = np.divide(-1.0, size, out=np.zeros_like(size), where=turns)[side.nodes] * side.sign[:, None]
    return np.asarray((factor[:, :, None] * products)[..., None] * normals[side.nodes][:, :, None])


def _turned(vectors: Array) -> Array:
    """Vectors, shape (..., 2), turned by 90 degrees."""
    return np.stack((-vectors[..., 1], vectors[..., 0]), axis=-1)
