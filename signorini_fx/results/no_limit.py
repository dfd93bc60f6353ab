"""Places where the stress has no limit as the mesh is refined, known from the shape of the body and its conditions.

Where two facets of the boundary meet at an angle, or their conditions change, the stress of linear elasticity grows
like a negative power of the distance if the angle within the body is large enough (Williams, J. Appl. Mech. 19 (1952)
526-528; Grisvard, Elliptic Problems in Nonsmooth Domains, 1985).  On an edge in space it does so across the edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from signorini_fx import compat
from signorini_fx.body.assembly import facet_entities
from signorini_fx.body.discretisation import Body
from signorini_fx.scene.model import friction_acts
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
# A place so many facets away from a vertex is beside it.
_BESIDE = 1.01


@dataclass(frozen=True)
class _Facet:
    """An exterior facet: its vertices, its outward normal, what is prescribed there and by which boundaries."""

    vertices: Array
    normal: Array
    kind: str
    names: tuple[str, ...]

    @property
    def size(self) -> float:
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))


def why_no_limit(body: Body, place: tuple[float, ...]) -> str | None:
    """Why the stress at a place, or within one facet from it, has no limit; None if nothing is known; collective.

    Contact boundaries count as pressed, with friction as held.  Jumps of loads and materials are not looked at.

    Args:
        body: the body.
        place: a point, length, shape (d,).
    """
    every = [facet for own in body.comm.allgather(_facets_near(body, np.array(place))) for facet in own]
    found = []
    for one, other in combinations(every, 2):
        distance = np.linalg.norm(one.vertices[:, None] - other.vertices[None], axis=2)
        shared = one.vertices[(distance <= 1e-8 * body.tagged.size).any(axis=1)]
        size = min(one.size, other.size)
        near = np.linalg.norm(shared - place, axis=1) <= _BESIDE * size
        if len(shared) == body.tagged.dimension - 1 and near.any():
            found.append(_reason(one, other))
    return min((reason for reason in found if reason is not None), default=None)


def _reason(one: _Facet, other: _Facet) -> str | None:
    """Why the stress has no limit where two facets meet."""
    turn = float(np.degrees(np.arccos(np.clip(one.normal @ other.normal, -1.0, 1.0))))
    reentrant = (other.vertices.mean(axis=0) - one.vertices.mean(axis=0)) @ one.normal > 0
    angle = 180 + turn if reentrant else 180 - turn
    kinds = tuple(sorted({one.kind, other.kind}))
    alike = len(kinds) == 1
    if (alike and turn <= _CURVED) or angle <= _BOUNDED[kinds] + (_CURVED if alike else _ROUND_OFF):
        return None
    if alike and one.kind != "guided":
        return "it is at a reentrant corner of the body"
    names = sorted({*one.names, *other.names} - ({*one.names} & {*other.names} if not alike else set()))
    return f"it is at the end of the boundar{'ies' if len(names) > 1 else 'y'} {' and '.join(names)}"


def _facets_near(body: Body, place: Array) -> list[_Facet]:
    """Exterior facets of this rank with a vertex within their size from a place."""
    mesh, dim = body.tagged.mesh, body.tagged.dimension
    mesh.topology.create_connectivity(dim - 1, dim)
    numbers = dmesh.exterior_facet_indices(mesh.topology)
    entities = facet_entities(mesh, numbers)
    corners = np.array(basix.topology(getattr(basix.CellType, mesh.topology.cell_name()))[dim - 1])
    nodes = compat.geometry_cells(mesh)[entities[:, 0]]
    x = np.asarray(mesh.geometry.x[..., :dim], dtype=np.float64)
    vertices = x[np.take_along_axis(nodes, corners[entities[:, 1]], axis=1)]
    size = np.linalg.norm(np.ptp(vertices, axis=1), axis=1)
    close = np.linalg.norm(vertices - place, axis=2).min(axis=1, initial=np.inf) <= _BESIDE * size
    found = []
    for k in np.flatnonzero(close):
        middle = x[nodes[k][: len(basix.geometry(getattr(basix.CellType, mesh.topology.cell_name())))]].mean(axis=0)
        normal = _normal(vertices[k], middle)
        found.append(_Facet(vertices[k], normal, *_condition(body, int(numbers[k]), normal)))
    return found


def _normal(vertices: Array, inside: Array) -> Array:
    """The unit normal of a facet that points away from a point inside."""
    normal = np.linalg.svd(vertices - vertices.mean(axis=0))[2][-1]
    return np.asarray(normal * np.sign(normal @ (vertices.mean(axis=0) - inside)))


def _condition(body: Body, facet: int, normal: Array) -> tuple[str, tuple[str, ...]]:
    """What is prescribed on a facet, and by which boundaries."""
    scene, tagged, dim = body.scene, body.tagged, body.tagged.dimension
    supports = [effect for effect in scene.displacement if facet in tagged.facets(effect.boundary)]
    contacts = [effect for effect in scene.contact if facet in tagged.facets(effect.boundary)]
    rows: list[Array] = [normal for effect in (*supports, *contacts) if getattr(effect, "normal", 0.0) is not None]
    for effect in supports:
        rows += [np.eye(dim)[k] for k, value in enumerate(effect.components) if value is not None]
    names = tuple(effect.boundary for effect in (*supports, *contacts))
    if not rows:
        return "free", ()
    whole = np.linalg.matrix_rank(np.array(rows), tol=1e-6) == dim
    return "held" if whole or any(friction_acts(effect.friction) for effect in contacts) else "guided", names
