"""Nodes that *CONTACT PAIR, ADJUST moves onto the other surface before the first step.

Programs project nodes of the slave surface along the normal of the facet that they are opposite to; of degree 2 it is
the straight pieces between its nodes.  The mesh that is solved is that with these nodes.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.text import real_or_none
from signorini_fx.addons.judging.problem_data import JudgedMesh
from signorini_fx.addons.judging.projection import outward_signs
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import ADJUSTED_BESIDE, ADJUSTED_BESIDE_OF_DISTANCE, ADJUSTED_SAME, ADJUSTED_TRIED

# The straight pieces of each kind of facet, whose corners come first.
_PIECES = {
    "line": ((0, 1),),
    "line3": ((0, 2), (2, 1)),
    "triangle": ((0, 1, 2),),
    "quad": ((0, 1, 3), (1, 2, 3)),
    "triangle6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad8": ((0, 4, 7), (4, 1, 5), (6, 5, 2), (7, 6, 3), (7, 4, 6), (4, 5, 6)),
}


def adjusted_points(deck: Deck, mesh: JudgedMesh) -> tuple[Floats, list[str]]:
    """The nodes of an input file where its contact pairs put them, length, shape (n, d), and what is not clear of that.

    Args:
        deck: what was read.
        mesh: the nodes and cells of the file.
    """
    points, unclear = mesh.points.copy(), []
    for pair in deck.pairs:
        adjustment, slave, master = pair.adjust, deck.boundary(pair.slave), deck.boundary(pair.master)
        if adjustment is None or slave is None or master is None:
            continue
        nodes = np.unique(mesh.boundaries[slave])
        limit = real_or_none(adjustment)
        if limit is None and mesh.dim == 2:
            unclear.append(f"ADJUST={adjustment}: of plane elements CalculiX moves no nodes of a set, others do")
            continue
        if limit is None:
            limit = np.inf
            nodes = nodes[np.isin(deck.numbers[nodes], deck.nodes(adjustment))]
        distance, normal = _above(mesh, points, mesh.boundaries[master], nodes)
        near = distance <= limit
        equal = np.isfinite(distance) & (np.abs(distance - limit) <= ADJUSTED_SAME * mesh.size)
        if equal.any():
            name = mesh.names[nodes[np.argmax(equal)]]
            unclear.append(f"ADJUST={adjustment}: node {name} is at this very distance: say a little more or less")
        points[nodes[near]] -= distance[near, None] * normal[near]
    return points, unclear


def _above(mesh: JudgedMesh, points: Floats, facets: Ints, nodes: Ints) -> tuple[Floats, Floats]:
    """How far nodes are above pieces of facets, and the outward normal there; infinite: above none.

    Args:
        mesh: the mesh.
        points: where its nodes are now, length, shape (n, d).
        facets: nodes, shape (f, l).
        nodes: shape (p,).
    """
    dim = mesh.dim
    pieces = np.array(_PIECES[mesh.facet.kind])
    corners = points[facets[:, pieces]].reshape(-1, dim, dim)
    edges = corners[:, 1:] - corners[:, :1]
    plain = np.column_stack((edges[:, 0, 1], -edges[:, 0, 0])) if dim == 2 else np.cross(edges[:, 0], edges[:, 1])
    size = np.linalg.norm(plain, axis=1)
    normals = plain / size[:, None] * np.repeat(outward_signs(mesh, facets), len(pieces))[:, None]
    # The height of each corner above the opposite side, by which shares of corners become lengths.
    heights = np.repeat(size[:, None], dim, axis=1)
    if dim == 3:
        opposite_sides = np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)
        heights /= np.linalg.norm(opposite_sides, axis=2)
    x = points[nodes]
    count = min(ADJUSTED_TRIED, len(corners))
    _, near = cKDTree(corners.mean(axis=1)).query(x, k=count)
    near = near.reshape(len(x), count)
    from_first = x[:, None] - corners[near, 0]
    distance = np.einsum("pkd,pkd->pk", from_first, normals[near])
    in_plane = from_first - distance[..., None] * normals[near]
    gram = np.einsum("tid,tjd->tij", edges, edges)
    along = np.einsum("pkid,pkd->pki", edges[near], in_plane)
    shares = np.linalg.solve(gram[near], along[..., None])[..., 0]
    shares = np.concatenate((1 - shares.sum(axis=2, keepdims=True), shares), axis=2)
    beside = (-shares * heights[near]).max(axis=2)
    allowed = ADJUSTED_BESIDE * mesh.size + ADJUSTED_BESIDE_OF_DISTANCE * np.abs(distance)
    chosen = np.argmin(np.where(beside <= allowed, np.abs(distance), np.inf), axis=1)
    rows = np.arange(len(x))
    opposite = (beside <= allowed)[rows, chosen]
    return np.where(opposite, distance[rows, chosen], np.inf), normals[near[rows, chosen]]
