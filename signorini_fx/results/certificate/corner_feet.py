"""Contact points at corners of foundations, found anew for the certificate.

The foot of a corner is its nearest point of the boundary.  Here it is found by roots of polynomials
on all facets, without the search of the solver, as are the nodes that have no contact point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from numpy.polynomial import polynomial

from signorini_fx.arrays import Array, Flags, Ints, diagonal, inner
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.interfaces import PlacedShape
from signorini_fx.mechanics.obstacles.corner_points import BoundaryLine, CornerFeet
from signorini_fx.mechanics.statement.rigid_shape import Corners, corners_of
from signorini_fx.tuned import (
    ALONG_FACET,
    BEYOND_FACET,
    DIGITS_OF_FILES,
    PROLONGED_FACET,
    ROOT_OF_EPS,
    SAME_LENGTH,
)


def judged_corners(
    boundary: ContactBoundary,
    gap: Array,
    shapes: Sequence[PlacedShape],
    displacement: Array | None = None,
) -> tuple[ContactBoundary, Array]:
    """Return the contact points and their gaps, length, shape (n,), with the points at corners and
    the nodes without points found anew.  Without corners both are returned as they are.
    Collective.

    Args:
        boundary: the contact points of the solver.
        gap: their gaps, length, shape (n,).
        shapes: the foundations.
        displacement: displacement of the nodes of this rank at which corners meet the body, length,
            shape (nodes, d); None for none.
    """
    known = boundary.corners
    if known is None:
        return boundary, gap
    gap = gap.copy()
    alone = known.alone.copy()
    normal = boundary.normal.copy()
    shares = boundary.averages.shares.tolil(copy=True)
    nodes = boundary.averages.nodes
    moved = boundary.moved(displacement)
    added: list[tuple[int, int, float]] = []  # row, global node, share
    for foundation in shapes:
        part = boundary.part == foundation.contact
        rows = np.flatnonzero(part & ~boundary.at_nodes)
        counts = parallel.gather_rows(boundary.comm, np.array([[rows.size]]))
        if not counts.any():
            continue
        corners = corners_of(foundation.shape, 2)
        assert corners is not None
        if counts.sum() != 2 * len(corners.places):
            gap[part] = np.nan  # not all corners have contact points: no certificate holds
            continue
        surface = next(one for one in boundary.surface if one[2] == foundation.contact)
        line = BoundaryLine.of(surface[0], surface[1], displacement)
        feet = feet_of(line, corners)
        far = diagonal(line.x.reshape(-1, 2))
        at = np.flatnonzero(part & boundary.at_nodes)
        out = _left_out(line, feet, boundary.global_nodes[at], boundary.normal[at, :2])
        added_gap = foundation.added if isinstance(foundation.added, int | float) else 0.0
        distance = foundation.shape.distance(boundary.x[at] + moved[at])[0] + added_gap
        ahead = inner(normal[at], moved[at])
        gap[at] = np.where(out, far, np.where(alone[at], distance, gap[at] - ahead)) + ahead
        alone[at] = out
        if not rows.size:
            continue
        phi, names, along, opening, _ = feet.rows(line, corners)
        given = gap[rows] - known.opening[rows] - inner(normal[rows], moved[rows])
        given = np.where(known.alone[rows], 0.0, given)
        alone[rows] = feet.alone.ravel()
        ahead = np.einsum("nd,np,npd->n", along, phi, (line.x - line.initial)[feet.facet.ravel()])
        gap[rows] = np.where(alone[rows], far, opening + given) + ahead
        normal[rows, :2] = along
        for k, point in enumerate(map(int, rows)):
            shares[point] = 0.0
            added += [(point, int(n), float(f)) for n, f in zip(names[k], phi[k], strict=True)]
    row = np.array([entry[0] for entry in added], dtype=np.int64)
    values = np.array([entry[2] for entry in added])
    further, column = np.unique(
        np.array([entry[1] for entry in added], dtype=np.int64), return_inverse=True
    )
    own = sp.csr_array((values, (row, column)), shape=(boundary.size, further.size))
    averages = boundary.averages
    unknown = np.zeros((further.size, averages.x.shape[1]))
    places = dict(zip(map(int, nodes), averages.x, strict=True))
    for k, name in enumerate(map(int, further)):
        unknown[k] = places.get(name, unknown[k])
    between = None
    if averages.paired:  # there are pairs of bodies too
        dim = boundary.x.shape[1]
        kept = np.ones(boundary.size)
        kept[row] = 0.0
        others = sp.diags_array(np.repeat(kept, dim)) @ averages.between
        here = sp.kron(own, sp.eye_array(dim))
        between = sp.csr_array(sp.hstack([others, here], format="csr"))
    averages = replace(
        averages,
        between=between,
        shares=sp.hstack([sp.csr_array(shares), own], format="csr"),
        nodes=np.concatenate((nodes, further)),
        x=np.concatenate((averages.x, unknown)),
        fixed=np.concatenate((averages.fixed, unknown > np.inf)),
        lift=None,
    )
    free = (boundary.free | known.alone[:, None]) & ~alone[:, None]
    points = replace(known, alone=alone)
    return replace(boundary, normal=normal, free=free, averages=averages, corners=points), gap


def feet_of(line: BoundaryLine, corners: Corners) -> CornerFeet:
    """Return the feet of corners on a boundary line: all facets near the nearest node are tried."""
    found = []
    for c in corners.places:
        to_nodes = np.linalg.norm(line.x - c, axis=2).min(axis=1)
        near = np.flatnonzero(to_nodes <= to_nodes.min() + line.lengths.max())
        each = [_stationary(line, int(facet), c) for facet in near]
        ways = [
            _away(line, int(facet), c, np.clip(roots, 0.0, 1.0))
            for facet, roots in zip(near, each, strict=True)
        ]
        distances = np.array([way.min() for way in ways])
        k = int(np.flatnonzero(distances <= distances.min() + SAME_LENGTH * line.lengths[near])[0])
        at = float(np.clip(each[k][ways[k].argmin()], 0.0, 1.0))
        found.append(_points(line, c, int(near[k]), _on_tangent(line, int(near[k]), c, at)))
    facets, xis, alone, beside, on = zip(*found, strict=True)
    return CornerFeet(
        np.array(facets),
        np.array(xis),
        np.array(alone),
        np.unique(np.concatenate(beside)).astype(np.int64),
        np.unique(np.concatenate(on)).astype(np.int64),
        np.full(len(found), -1),
    )


def _points(
    line: BoundaryLine, c: Array, facet: int, xi: float
) -> tuple[list[int], list[float], list[bool], list[int], list[int]]:
    """Return the two points of a corner, and the nodes of the facet of its foot and those on the
    foot.

    The points are three lists of two: facets, places along them, and whether the point is unused.
    """
    end = round(np.clip(xi, 0.0, 1.0))
    vertex = line.nodes[facet, -end]
    others = np.flatnonzero(line.nodes[:, end - 1] == vertex)
    facets = [0, 0]
    xis = [0.5, 0.5]
    alone = [True, True]
    goes_on = concave = False
    if others.size:
        pair = (facet, int(others[0])) if end else (int(others[0]), facet)
        one, two = (line.normal(f, 1.0 - k) for k, f in enumerate(pair))
        sine = float(one[0] * two[1] - one[1] * two[0])
        goes_on = bool(one @ two >= BEYOND_FACET)
        concave = sine < -SAME_LENGTH
    if not (-SAME_LENGTH <= xi <= 1.0 + SAME_LENGTH or goes_on):
        return facets, xis, alone, [], []
    facets[facet % 2] = facet
    xis[facet % 2] = xi
    alone[facet % 2] = False
    at_nodes = np.linspace(0.0, 1.0, line.nodes.shape[1])
    on = line.nodes[facet][np.abs(xi - at_nodes) <= DIGITS_OF_FILES].tolist()
    if concave and int(others[0]) != facet:
        other = int(others[0])
        slot = 1 - facet % 2
        roots = np.clip(_stationary(line, other, c), 0.0, 1.0)
        nearest = float(roots[np.abs(roots - (1.0 - end)).argmin()])
        beyond = _on_tangent(line, other, c, nearest)
        facets[slot] = other
        xis[slot] = float(np.clip(beyond, *PROLONGED_FACET))
        alone[slot] = False
    return facets, xis, alone, line.nodes[facet].tolist(), on


def _stationary(line: BoundaryLine, facet: int, c: Array) -> Array:
    """Return the places along a facet, and beyond its ends, where the distance from c is
    stationary.
    """
    x = line.x[facet]
    basis = np.linalg.inv(np.vander(np.linspace(0.0, 1.0, len(x)), increasing=True))
    curve = (basis @ x).T
    curve[:, 0] -= c
    slope = polynomial.polyadd(
        *(polynomial.polymul(along, polynomial.polyder(along)) for along in curve)
    )
    size = np.abs(slope).max()
    roots = polynomial.polyroots(polynomial.polytrim(slope, ROOT_OF_EPS * size))
    return roots.real[np.abs(roots.imag) <= ROOT_OF_EPS]


def _on_tangent(line: BoundaryLine, facet: int, c: Array, at: float) -> float:
    """Return a place along a facet; at an end, the projection of c onto the tangent there."""
    if 0.0 < at < 1.0:
        return at
    _, x, along = line.place(facet, at)
    return at + float((c - x) @ along / (along @ along))


def _away(line: BoundaryLine, facet: int, c: Array, at: Array) -> Array:
    """Return the distances of c from some places along a facet, length, shape (n,)."""
    return np.array([np.linalg.norm(line.place(facet, float(xi))[1] - c) for xi in at])


def _left_out(line: BoundaryLine, feet: CornerFeet, nodes: Ints, direction: Array) -> Flags:
    """Return which nodes lose their contact points to corners, shape (nodes,).

    Args:
        line: the boundary line.
        feet: the feet of the corners on it.
        nodes: global numbers of the nodes.
        direction: their directions of contact, shape (nodes, 2).
    """
    cosine = np.full(len(nodes), -np.inf)
    for j in range(line.nodes.shape[1]):
        xi = j / (line.nodes.shape[1] - 1)
        for facet, name in enumerate(line.nodes[:, j]):
            here = nodes == name
            cosine[here] = np.maximum(cosine[here], direction[here] @ line.normal(facet, xi))
    return np.isin(nodes, feet.on) | (np.isin(nodes, feet.beside) & (cosine < ALONG_FACET))
