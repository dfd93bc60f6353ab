"""A displacement without penetration, from a computed one that penetrates foundations or other
bodies.

Vertices are moved along the normals by hat functions, on both sides by shares with the least energy
of springs in series; where the parts of a contact are whole facets the middles of edges follow by
parabolas.  On other parts each vertex moves by the largest excess around it, so that the change is
as large everywhere on these.  Where contact is closed, both sides may also be moved together: the
remaining gap between nodes times the pressure is of the order of the error, while a change of the
displacement adds only its square.
"""

from __future__ import annotations

import numpy as np

from signorini_fx.addons.bounds.plain_problem import FacetsInContact, PlainProblem
from signorini_fx.addons.bounds.simplices import EDGES_OF_FACET
from signorini_fx.arrays import Array, Ints, inner, matvec, quotient
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import SAME_LENGTH

# Times that bodies are moved out of foundations and each other.
_ATTEMPTS = 5
# A direction along which supports leave a vertex so much of a way along its normals is one in which
# it may move.
_MOVABLE = 0.25


def admissible(problem: PlainProblem, tiny: float, *, closed: bool) -> Array:
    """Return the displacement without penetration at nodes, length, shape (v + e, d).

    Args:
        problem: the problem with the computed displacement.
        tiny: penetration that is allowed as round-off, length.
        closed: whether both sides are moved together where there is pressure.

    Raises:
        Refused: supports prevent the motion.
    """
    t = problem.t
    y = problem.y.copy()
    # Projectors onto the directions in which supports let nodes move.
    held = np.zeros((*y.shape, t.dimension))
    for column in t.nodes_of_facets[t.outer].T:
        np.add.at(held, column, problem.held[t.outer])
    sizes, vectors = np.linalg.eigh(held)
    free = np.einsum("vik,vk,vjk->vij", vectors, np.where(sizes > SAME_LENGTH, 0.0, 1.0), vectors)
    for attempt in range(_ATTEMPTS):
        for surface in problem.contacts:
            _separate(problem, surface, y, free, tiny, closed=closed and not attempt)
        deepest = [
            surface.excess(problem.relative(surface, y)).max(initial=0.0)
            for surface in problem.contacts
        ]
        if max(deepest, default=0.0) <= 2 * tiny:
            return y
    raise Refused(
        "no displacement near the computed one keeps to supports, foundations and other bodies"
    )


def _separate(
    problem: PlainProblem,
    surface: FacetsInContact,
    y: Array,
    free: Array,
    tiny: float,
    *,
    closed: bool,
) -> None:
    """Remove the penetration of one contact from a displacement, in place."""
    t = problem.t
    parts = surface.parts
    d = problem.t.dimension
    nodes = [parts.nodes(t, side) for side in parts.sides]
    at_vertices = closed & (parts.on_parts(surface.pressure) > 0)
    at_edges = at_vertices[:, EDGES_OF_FACET[d]].all(axis=2)
    # What supports keep of a share the other side does.
    for share in (surface.share, 0.0, 1.0) if surface.paired else (1.0,):
        excess = surface.excess(problem.relative(surface, y))
        depth = (
            excess[:, :d]
            if parts.by_facets
            else excess.max(axis=1, keepdims=True).repeat(d, axis=1)
        )
        depth = np.where(at_vertices, depth, depth.clip(min=-tiny)) + tiny
        shares = [*zip(nodes, (share, share - 1.0), strict=False)]
        for (vertices, _), moved in shares:
            y -= moved * t.with_middles(_moved(vertices, depth, parts.normal, free)[: len(t.x)])
        if parts.by_facets:
            depth = surface.excess(problem.relative(surface, y))[:, d:]
            depth = np.where(at_edges, depth, depth.clip(min=-tiny)) + tiny
            for (_, edges), moved in shares:
                # The Bernstein coefficient of an edge changes by twice as much as its middle.
                y -= moved * _moved(edges, depth / 2, parts.normal, free)


def _moved(places: Ints, depth: Array, normal: Array, free: Array) -> Array:
    """Return displacements of nodes along the normals of the parts around them, by at least the
    depths of these parts.

    Args:
        places: nodes of each part, shape (m, k).
        depth: depths at these nodes, length, shape (m, k).
        normal: normals of the parts, shape (m, d).
        free: projectors onto the directions that supports leave free, shape (nodes, d, d).
    """
    sums = np.zeros(free.shape[:2])
    deepest = np.full(len(free), -np.inf)
    for column, depths in zip(places.T, depth.T, strict=True):
        np.add.at(sums, column, normal)
        np.maximum.at(deepest, column, depths)
    sizes = np.linalg.norm(sums, axis=1, keepdims=True)
    mean = quotient(sums, sizes)
    ways = matvec(free, mean)
    least = np.full(len(free), np.inf)
    for column in places.T:
        np.minimum.at(least, column, inner(ways[column], normal))
    movable = (least > _MOVABLE) & np.isfinite(least)
    scale = quotient(deepest, least, movable)
    return scale[:, None] * ways
