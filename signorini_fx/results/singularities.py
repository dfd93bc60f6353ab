"""Places where the stress has no limit as the mesh is refined, known from the shape of the body and its conditions.

Where two facets of the boundary meet at an angle, or their conditions change, the stress of linear elasticity grows
like a negative power of the distance if the angle within the body is large enough (Williams, J. Appl. Mech. 19 (1952)
526-528; Grisvard, Elliptic Problems in Nonsmooth Domains, 1985).  On an edge in 3D it does so across the edge.
Where a load along the boundary jumps it grows like a logarithm (Timoshenko and Goodier, Theory of Elasticity, section
38), and where materials meet at the boundary, or their interface has a corner, like a power again (Bogy, J. Appl. Mech.
38 (1971) 377-386): for most pairs of materials, a few are bounded and named all the same.

At a node that is held or loaded alone it grows like the inverse of the distance, in 3D of its square (the
solutions of Flamant and Boussinesq).

Bodies that touch are judged one by one.  Where the edge of one of them, of 90 degrees or more, presses on another one
the stress has no limit in both, though materials decide how fast it grows (Dundurs and Lee, J. Elasticity 2 (1972)
109-112); where they are bonded the corner of both together decides.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.results.near_singularity import BoundaryFacet, cells_near, facets_near, size_of_cells
from signorini_fx.tuned import BESIDE_VERTEX, CORNER_ANGLE, JUMP_OF_LOAD, SAME_ANGLE, SAME_PLACE_IN_CELL, SAME_POSITION

Array = npt.NDArray[np.float64]

# The largest angle within the body, degrees, up to which the stress is bounded where facets with these conditions meet:
# nothing prescribed, the normal component alone, or all of the displacement.
_BOUNDED = {
    ("free",): 180.0,
    ("held",): 180.0,
    ("guided",): 90.0,
    ("free", "guided"): 90.0,
    ("guided", "held"): 90.0,
    ("free", "held"): 60.0,
}
# Angles that meshes of curved boundaries have too, degrees.
_CURVED = np.degrees(CORNER_ANGLE)


def why_no_limit(body: Model, point: tuple[float, ...], step: float = 0.0) -> str | None:
    """Why the stress at a place, or within one facet from it, has no limit; None if nothing is known; collective.

    Contact boundaries count as pressed, with friction as held.

    Args:
        body: the body.
        point: a point, length, shape (d,).
        step: the load step that the loads are those of, its place in the lists of factors.
    """
    facets = [
        facet
        for local_facets in body.comm.allgather(facets_near(body, np.array(point), step))
        for facet in local_facets
    ]
    reasons = [_where_materials_meet(body, np.array(point), facets), _at_a_single_node(body, np.array(point), step)]
    for facet_a, facet_b in combinations(facets, 2):
        if facet_a.piece != facet_b.piece:
            continue
        distance = np.linalg.norm(facet_a.vertices[:, None] - facet_b.vertices[None], axis=2)
        first, second = np.nonzero(distance <= SAME_POSITION * body.tagged.size)
        size = min(facet_a.size, facet_b.size)
        near = np.linalg.norm(facet_a.vertices[first] - point, axis=1) <= BESIDE_VERTEX * size
        if len(first) == body.tagged.dimension - 1 and near.any():
            opposite_facets = [
                facet for facet in facets if facet.piece != facet_a.piece and facet.reaches(facet_a.vertices[first])
            ]
            reasons += [_reason(facet_a, facet_b, opposite_facets), _where_loads_jump(facet_a, facet_b, first, second)]
    return min((reason for reason in reasons if reason is not None), default=None)


def _reason(facet_a: BoundaryFacet, facet_b: BoundaryFacet, opposite_facets: list[BoundaryFacet]) -> str | None:
    """Why the stress has no limit where two facets of a body meet, and facets of others are."""
    turn, angle = _corner(facet_a.normal, facet_b.normal, facet_b.vertices.mean(axis=0) - facet_a.vertices.mean(axis=0))
    kinds = tuple(sorted({facet_a.kind, facet_b.kind}))
    alike = len(kinds) == 1
    if facet_a.paired or facet_b.paired:
        touched = any(facet.paired for facet in opposite_facets)
        if (facet_a.paired and facet_b.paired) or not touched:
            filled = touched and facet_a.paired == facet_b.paired == "bonded"
            return None if filled or angle <= 180 + _CURVED else "it is at a reentrant corner of the body"
        side = facet_a if facet_a.paired else facet_b
        beyond = [
            _corner(-side.normal, facet.normal, (facet.vertices - side.vertices[:1]).mean(axis=0))[1]
            for facet in opposite_facets
            if not facet.paired
        ]
        together = angle + min(beyond, default=180.0)
        if angle < 90 - SAME_ANGLE or together <= 180 + SAME_ANGLE:
            return None
    elif (alike and turn <= _CURVED) or angle <= _BOUNDED[kinds] + (_CURVED if alike else SAME_ANGLE):
        return None
    elif alike and facet_a.kind != "guided":
        return "it is at a reentrant corner of the body"
    names = {*facet_a.names, *facet_b.names} if alike else {*facet_a.names} ^ {*facet_b.names}
    return f"it is at the end of the {_boundaries(names)}"


def _corner(normal: Array, other_normal: Array, toward: Array) -> tuple[float, float]:
    """How far the normal turns from one facet to another one, and the angle within the body between them, degrees.

    Args:
        normal: of the one.
        other_normal: that of the other one.
        toward: from the one to the other.
    """
    turn = _turn(normal, other_normal)
    return turn, 180 + turn if toward @ normal > 0 else 180 - turn


def _turn(normal: Array, other_normal: Array) -> float:
    """The angle between two normals, degrees."""
    return float(np.degrees(np.arccos(np.clip(normal @ other_normal, -1.0, 1.0))))


def _boundaries(names: set[str]) -> str:
    """Boundaries by their names."""
    return f"boundar{'ies' if len(names) > 1 else 'y'} {' and '.join(sorted(names))}"


def _where_loads_jump(
    facet_a: BoundaryFacet, facet_b: BoundaryFacet, first: npt.NDArray[np.int64], second: npt.NDArray[np.int64]
) -> str | None:
    """Whether a load along the boundary jumps where two facets meet that share these vertices of theirs.

    A boundary that only guides is a mirror: a load that ends there at a right angle, or acts along it, is one that
    jumps.
    """
    turn = _turn(facet_a.normal, facet_b.normal)
    kinds = {facet_a.kind, facet_b.kind}
    loads = facet_a.traction[first], facet_b.traction[second]
    if kinds <= {"free", "guided"} and turn <= _CURVED:
        jump, normal = loads[0] - loads[1], facet_a.normal + facet_b.normal
    elif kinds == {"free", "guided"} and abs(turn - 90) <= SAME_ANGLE:
        free, guided = (0, 1) if facet_a.kind == "free" else (1, 0)
        normal, across = (facet_a, facet_b)[free].normal, (facet_a, facet_b)[guided].normal
        jump = (loads[free] @ across)[:, None] * across  # along the edge of a mirror nothing jumps
    else:
        return None
    along = jump - np.outer(jump @ normal, normal) / (normal @ normal)
    size = np.linalg.norm(np.concatenate((facet_a.traction, facet_b.traction)), axis=1).max()
    if not (np.linalg.norm(along, axis=1) > JUMP_OF_LOAD * size).all():
        return None
    return f"it is where the load along the {_boundaries({*facet_a.loaded, *facet_b.loaded})} jumps"


def _at_a_single_node(body: Model, point: Array, step: float) -> str | None:
    """Whether a node within a cell from a place is held or loaded alone; collective."""
    statement, dim = body.statement, body.tagged.dimension
    held = [np.array([support.at]) for support in statement.displacement if support.at is not None]
    loads: list[Any] = [effect for effect in statement.of(Force) if effect.nodal and effect.acts]
    acting = [load.table(dim) for factor, load in (statement.now(load, step) for load in loads) if factor]
    nodes = {
        "held alone": held,
        "loaded alone": [table.points[np.any(table.vectors, axis=1)] for table in acting],
    }
    if not any(nodes.values()):
        return None
    reach = BESIDE_VERTEX * size_of_cells(body, point)
    for how, places in nodes.items():
        if any((np.linalg.norm(at[:, :dim] - point, axis=1) <= reach).any() for at in places):
            return f"it is at a node that is {how}"
    return None


def _where_materials_meet(body: Model, point: Array, boundary: list[BoundaryFacet]) -> str | None:
    """Whether materials meet at the boundary, or their interface has a corner, within a facet of a place; collective.

    Those of bodies that touch do not, unless they are bonded.

    It shows in the angles, in 3D solid angles, that the cells of each material have at a vertex.
    """
    if len(body.statement.material) == 1:
        return None
    cells = cells_near(body, point)
    full_angle = 2 * np.pi if body.tagged.dimension == 2 else 4 * np.pi
    reasons: list[str] = []
    for vertex, joined in ((cell.vertex, cell.joined) for cell in cells):
        cells_at_vertex = [
            cell
            for cell in cells
            if cell.joined == joined and np.linalg.norm(cell.vertex - vertex) <= SAME_POSITION * body.tagged.size
        ]
        angles = {
            kind: sum(cell.angle for cell in cells_at_vertex if cell.kind == kind)
            for kind in (cell.kind for cell in cells_at_vertex)
        }
        reach = BESIDE_VERTEX * min(cell.length for cell in cells_at_vertex)
        if len(angles) == 1 or np.linalg.norm(vertex - point) > reach:
            continue
        total = sum(angles.values())
        facets = [
            facet
            for facet in boundary
            if facet.paired != "bonded"
            and (np.linalg.norm(facet.vertices - vertex, axis=1) <= SAME_POSITION * body.tagged.size).any()
        ]
        # A flat boundary that only guides is a mirror.
        mirror = (
            bool(facets)
            and all(facet.kind == "guided" for facet in facets)
            and abs(2 * total / full_angle - 1) < SAME_PLACE_IN_CELL
        )
        inside = mirror or abs(total / full_angle - 1) < SAME_PLACE_IN_CELL
        if inside and len(angles) == 2 and abs(2 * min(angles.values()) / total - 1) <= _CURVED / 180:
            continue
        reasons.append(
            "it is at a corner of the interface of materials"
            if inside
            else "it is where materials meet at the boundary"
        )
    return min(reasons, default=None)
