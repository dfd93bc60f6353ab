"""Places where the stress has no limit as the mesh is refined, known from the shape of the body and its conditions.

Where two facets of the boundary meet at an angle, or their conditions change, the stress of linear elasticity grows
like a negative power of the distance if the angle within the body is large enough (Williams, J. Appl. Mech. 19 (1952)
526-528; Grisvard, Elliptic Problems in Nonsmooth Domains, 1985).  On an edge in space it does so across the edge.
Where a load along the boundary jumps it grows like a logarithm (Timoshenko and Goodier, Theory of Elasticity, section
38), and where materials meet at the boundary, or their interface has a corner, like a power again (Bogy, J. Appl. Mech.
38 (1971) 377-386): for most pairs of materials, a few are bounded and named all the same.

Bodies that touch are judged one by one.  Where the edge of one of them, of 90 degrees or more, presses on another one
the stress has no limit in both, though materials decide how fast it grows (Dundurs and Lee, J. Elasticity 2 (1972)
109-112); where they are bonded the corner of both together decides.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import numpy.typing as npt

from signorini_fx.body.discretisation import Discretisation
from signorini_fx.results.near_place import BESIDE, BoundaryFacet, cells_near, facets_near
from signorini_fx.tuned import CORNER_ANGLE

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
# Angles that meshes of curved boundaries have too, and round-off.
_CURVED, _ROUND_OFF = np.degrees(CORNER_ANGLE), 1.0
# Share of a load that is a jump.
_JUMP = 1e-3
# Vertices at a distance below this share of the size of the body are at one place.
_SAME = 1e-8
# Share of an angle around a vertex that is round-off.
_SAME_ANGLE = 1e-6


def why_no_limit(body: Discretisation, place: tuple[float, ...], step: float = 0.0) -> str | None:
    """Why the stress at a place, or within one facet from it, has no limit; None if nothing is known; collective.

    Contact boundaries count as pressed, with friction as held.

    Args:
        body: the body.
        place: a point, length, shape (d,).
        step: the load step that the loads are those of, its place in the lists of factors.
    """
    every = [facet for own in body.comm.allgather(facets_near(body, np.array(place), step)) for facet in own]
    found = [_where_materials_meet(body, np.array(place), every)]
    for one, other in combinations(every, 2):
        if one.piece != other.piece:
            continue
        distance = np.linalg.norm(one.vertices[:, None] - other.vertices[None], axis=2)
        first, second = np.nonzero(distance <= _SAME * body.tagged.size)
        size = min(one.size, other.size)
        near = np.linalg.norm(one.vertices[first] - place, axis=1) <= BESIDE * size
        if len(first) == body.tagged.dimension - 1 and near.any():
            others = [facet for facet in every if facet.piece != one.piece and facet.reaches(one.vertices[first])]
            found += [_reason(one, other, others), _where_loads_jump(one, other, first, second)]
    return min((reason for reason in found if reason is not None), default=None)


def _reason(one: BoundaryFacet, other: BoundaryFacet, others: list[BoundaryFacet]) -> str | None:
    """Why the stress has no limit where two facets of a body meet, and facets of others are."""
    turn, angle = _corner(one.normal, other.normal, other.vertices.mean(axis=0) - one.vertices.mean(axis=0))
    kinds = tuple(sorted({one.kind, other.kind}))
    alike = len(kinds) == 1
    if one.paired or other.paired:
        touched = any(facet.paired for facet in others)
        if (one.paired and other.paired) or not touched:
            filled = touched and one.paired == other.paired == "bonded"
            return None if filled or angle <= 180 + _CURVED else "it is at a reentrant corner of the body"
        side = one if one.paired else other
        beyond = [
            _corner(-side.normal, facet.normal, (facet.vertices - side.vertices[:1]).mean(axis=0))[1]
            for facet in others
            if not facet.paired
        ]
        together = angle + min(beyond, default=180.0)
        if angle < 90 - _ROUND_OFF or together <= 180 + _ROUND_OFF:
            return None
    elif (alike and turn <= _CURVED) or angle <= _BOUNDED[kinds] + (_CURVED if alike else _ROUND_OFF):
        return None
    elif alike and one.kind != "guided":
        return "it is at a reentrant corner of the body"
    names = {*one.names, *other.names} if alike else {*one.names} ^ {*other.names}
    return f"it is at the end of the {_boundaries(names)}"


def _corner(normal: Array, other: Array, toward: Array) -> tuple[float, float]:
    """How far the normal turns from one facet to another one, and the angle within the body between them, degrees.

    Args:
        normal: of the one.
        other: that of the other one.
        toward: from the one to the other.
    """
    turn = _turn(normal, other)
    return turn, 180 + turn if toward @ normal > 0 else 180 - turn


def _turn(normal: Array, other: Array) -> float:
    """The angle between two normals, degrees."""
    return float(np.degrees(np.arccos(np.clip(normal @ other, -1.0, 1.0))))


def _boundaries(names: set[str]) -> str:
    """Boundaries by their names."""
    return f"boundar{'ies' if len(names) > 1 else 'y'} {' and '.join(sorted(names))}"


def _where_loads_jump(
    one: BoundaryFacet, other: BoundaryFacet, first: npt.NDArray[np.int64], second: npt.NDArray[np.int64]
) -> str | None:
    """Whether a load along the boundary jumps where two facets meet that share these vertices of theirs.

    A boundary that only guides is a mirror: a load that ends there at a right angle, or acts along it, is one that
    jumps.
    """
    turn = _turn(one.normal, other.normal)
    kinds = {one.kind, other.kind}
    loads = one.traction[first], other.traction[second]
    if kinds <= {"free", "guided"} and turn <= _CURVED:
        jump, normal = loads[0] - loads[1], one.normal + other.normal
    elif kinds == {"free", "guided"} and abs(turn - 90) <= _ROUND_OFF:
        free, guided = (0, 1) if one.kind == "free" else (1, 0)
        normal, across = (one, other)[free].normal, (one, other)[guided].normal
        jump = (loads[free] @ across)[:, None] * across  # along the edge of a mirror nothing jumps
    else:
        return None
    along = jump - np.outer(jump @ normal, normal) / (normal @ normal)
    size = np.linalg.norm(np.concatenate((one.traction, other.traction)), axis=1).max()
    if not (np.linalg.norm(along, axis=1) > _JUMP * size).all():
        return None
    return f"it is where the load along the {_boundaries({*one.loaded, *other.loaded})} jumps"


def _where_materials_meet(body: Discretisation, place: Array, boundary: list[BoundaryFacet]) -> str | None:
    """Whether materials meet at the boundary, or their interface has a corner, within a facet of a place; collective.

    Those of bodies that touch do not, unless they are bonded.

    It shows in the angles, in space solid angles, that the cells of each material have at a vertex.
    """
    if len(body.scene.material) == 1:
        return None
    every = cells_near(body, place)
    whole = 2 * np.pi if body.tagged.dimension == 2 else 4 * np.pi
    found: list[str] = []
    for vertex, joined in ((one.vertex, one.joined) for one in every):
        here = [
            one
            for one in every
            if one.joined == joined and np.linalg.norm(one.vertex - vertex) <= _SAME * body.tagged.size
        ]
        angles = {kind: sum(one.angle for one in here if one.kind == kind) for kind in (one.kind for one in here)}
        if len(angles) == 1 or np.linalg.norm(vertex - place) > BESIDE * min(one.length for one in here):
            continue
        total = sum(angles.values())
        facets = [
            facet
            for facet in boundary
            if facet.paired != "bonded"
            and (np.linalg.norm(facet.vertices - vertex, axis=1) <= _SAME * body.tagged.size).any()
        ]
        # A flat boundary that only guides is a mirror.
        mirror = (
            bool(facets)
            and all(facet.kind == "guided" for facet in facets)
            and abs(2 * total / whole - 1) < _SAME_ANGLE
        )
        inside = mirror or abs(total / whole - 1) < _SAME_ANGLE
        if inside and len(angles) == 2 and abs(2 * min(angles.values()) / total - 1) <= _CURVED / 180:
            continue
        found.append(
            "it is at a corner of the interface of materials"
            if inside
            else "it is where materials meet at the boundary"
        )
    return min(found, default=None)
