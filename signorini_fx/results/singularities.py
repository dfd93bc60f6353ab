"""Places where the stress has no limit as the mesh is refined, known from the shape of the body and
its conditions.

Where two facets of the boundary meet at an angle, or their conditions change, the stress of linear
elasticity grows like a negative power of the distance if the angle within the body is large enough
(Williams, J. Appl. Mech. 19 (1952) 526-528; Grisvard, Elliptic Problems in Nonsmooth Domains,
1985).  On an edge in 3D it does so across the edge. Where materials meet at the boundary it grows
like a power again (Bogy, J. Appl. Mech. 38 (1971) 377-386): for most pairs of materials, a few are
bounded and named all the same.

Bodies that touch are judged one by one: at their contact boundaries only reentrant corners are
named.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, diagonal, extents
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import (
    facet_entities,
    facet_vertices,
)
from signorini_fx.mechanics.loads.supports import on_axis
from signorini_fx.mechanics.mesh.tagged import outer_facets
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import ForceDensity, InitialStrain
from signorini_fx.tuned import CORNER_ANGLE, DIGITS_OF_FILES, ROOT_OF_EPS, SAME_ANGLE


@dataclass(frozen=True)
class BoundaryFacet:
    """An exterior facet."""

    vertices: Array
    normal: Array
    kind: str  # what is prescribed there
    names: tuple[str, ...]  # by which boundaries
    paired: str  # how it may touch another body, "contact", "bonded" or ""
    piece: int
    material: tuple[Any, ...]  # what counts of it

    @property
    def size(self) -> float:
        """The diagonal of the box around it, length."""
        return diagonal(self.vertices)


# The largest angle within the body, degrees, up to which the stress is bounded where facets with
# these conditions meet: nothing prescribed, the normal component alone, or all of the displacement.
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


# How many facets away from a reentrant corner the largest stress may be on a coarse mesh.
_FACETS_BESIDE = 3


def why_no_limit(body: Model, point: tuple[float, ...]) -> str | None:
    """Why the stress at a place, or within one facet from it, of a reentrant corner within three,
    has no limit; None if nothing is known; collective.

    Contact boundaries count as pressed, with friction as held.
    """
    if _beside_a_node_that_is_loaded(body, point):
        return "where a single node is loaded or held"
    facets = [
        facet
        for local_facets in body.comm.allgather(facets_near(body, np.array(point)))
        for facet in local_facets
    ]
    reasons: list[str | None] = []
    if body.boundary is not None and (corners := body.boundary.corners) is not None:
        away = np.linalg.norm(corners.place[:, : len(point)] - point, axis=1)
        close = ~corners.alone & (away <= (1 + DIGITS_OF_FILES) * corners.facet)
        if parallel.any_rank(body.comm, close):
            reasons.append("it is at a corner of the foundation")
    for facet_a, facet_b in _meeting(facets, ROOT_OF_EPS * body.tagged.size):
        if facet_a.piece != facet_b.piece:
            continue
        distance = np.linalg.norm(facet_a.vertices[:, None] - facet_b.vertices[None], axis=2)
        first, _ = np.nonzero(distance <= ROOT_OF_EPS * body.tagged.size)
        size = min(facet_a.size, facet_b.size)
        if len(first) != body.tagged.dimension - 1:
            continue
        away = np.linalg.norm(facet_a.vertices[first] - point, axis=1).min() / size
        reason = _reason(facet_a, facet_b)
        if away <= 1 + DIGITS_OF_FILES or (reason == _REENTRANT and away <= _FACETS_BESIDE):
            reasons.append(reason)
    return min((reason for reason in reasons if reason is not None), default=None)


def _meeting(
    facets: list[BoundaryFacet], same: float
) -> Iterator[tuple[BoundaryFacet, BoundaryFacet]]:
    """The pairs of facets that have a vertex in common, within this distance."""
    vertices = np.concatenate([facet.vertices for facet in facets] or [np.zeros((0, 1))])
    owners = np.repeat(np.arange(len(facets)), [len(facet.vertices) for facet in facets])
    for a, b in sorted(
        {(*sorted(owners[[*pair]]),) for pair in cKDTree(vertices).query_pairs(same)}
    ):
        yield facets[a], facets[b]


_REENTRANT = "at a reentrant corner of the body"


def _beside_a_node_that_is_loaded(body: Model, point: tuple[float, ...]) -> bool:
    """Whether a force or a support acts at one node, within a cell from a place; collective."""
    mesh = body.tagged.mesh
    dim = body.tagged.dimension
    statement = body.statement
    forces: Iterable[Any] = statement.of(ForceDensity)
    loaded = [load.at for load in forces if load.nodal and load.acts]
    loaded += [support.at for support in statement.displacement if support.at is not None]
    x = mesh.geometry.x[compat.geometry_cells(mesh)][:, :, :dim]
    found = False
    for at in loaded:
        around = np.linalg.norm(x - np.array(at), axis=2).min(axis=1, initial=np.inf)
        cells = x[around <= ROOT_OF_EPS * body.tagged.size]
        size = extents(cells).max(initial=0.0)
        away = np.linalg.norm(np.array(at) - point)
        found = found or bool(away <= (1 + DIGITS_OF_FILES) * size)
    return parallel.any_rank(body.comm, found)


def _reason(facet_a: BoundaryFacet, facet_b: BoundaryFacet) -> str | None:
    """Why the stress has no limit where two facets of a body meet."""
    if (
        facet_a.material != facet_b.material and not facet_a.kind == facet_b.kind == "guided"
    ):  # that is a mirror
        return "where materials meet at the boundary"
    turn = float(np.degrees(np.arccos(np.clip(facet_a.normal @ facet_b.normal, -1.0, 1.0))))
    reentrant = (facet_b.vertices.mean(axis=0) - facet_a.vertices.mean(axis=0)) @ facet_a.normal > 0
    angle = 180 + turn if reentrant else 180 - turn
    kinds = tuple(sorted({facet_a.kind, facet_b.kind}))
    alike = len(kinds) == 1
    if facet_a.paired or facet_b.paired:
        filled = facet_a.paired == facet_b.paired == "bonded"
        return None if filled or angle <= 180 + _CURVED else _REENTRANT
    if (alike and turn <= _CURVED) or angle <= _BOUNDED[kinds] + (_CURVED if alike else SAME_ANGLE):
        return None
    if alike and facet_a.kind != "guided":
        return _REENTRANT
    names = {*facet_a.names, *facet_b.names} if alike else {*facet_a.names} ^ {*facet_b.names}
    return (
        f"at the end of the boundar{'ies' if len(names) > 1 else 'y'} {' and '.join(sorted(names))}"
    )


def facets_near(body: Model, point: Array) -> list[BoundaryFacet]:
    """Exterior facets of this rank with a corner within three of their sizes from a place."""
    mesh = body.tagged.mesh
    dim = body.tagged.dimension
    numbers = outer_facets(mesh)
    entities = facet_entities(mesh, numbers)
    cell = getattr(basix.CellType, mesh.topology.cell_name())
    corners = len(basix.geometry(cell))
    # Curved ones have nodes on their sides and within, too.
    of_facet = len(basix.topology(cell)[dim - 1][0])
    vertices = facet_vertices(mesh, numbers)[:, :of_facet, :dim]
    size = extents(vertices)
    close = (
        np.linalg.norm(vertices - point, axis=2).min(axis=1, initial=np.inf)
        <= _FACETS_BESIDE * size
    )
    facets = []
    for k in np.flatnonzero(close):
        nodes = compat.geometry_cells(mesh)[entities[k, 0], :corners]
        middle = mesh.geometry.x[nodes, :dim].mean(axis=0)
        normal = _normal(vertices[k], middle)
        condition = _condition(body, int(numbers[k]), normal, vertices[k])
        piece = int(body.pieces.of_cell[entities[k, 0]])
        facets.append(
            BoundaryFacet(
                vertices[k], normal, *condition, piece, _material(body, int(entities[k, 0]))
            )
        )
    return facets


def _material(body: Model, cell: int) -> tuple[Any, ...]:
    """What counts of the material of a cell: its kind, and its expansion where something
    expands.
    """
    strained = bool(body.statement.of(InitialStrain))
    materials = body.materials
    inside = (
        one
        for one in reversed(materials)
        if one.region is None or cell in body.tagged.cells(one.region)
    )
    material = next(inside, materials[0])
    return *material.kind, strained and material.expansion


def _normal(vertices: Array, inside: Array) -> Array:
    """The unit normal of a facet that points away from a point inside."""
    normal = np.linalg.svd(vertices - vertices.mean(axis=0))[2][-1]
    return normal * np.sign(normal @ (vertices.mean(axis=0) - inside))


def _condition(
    body: Model, facet: int, normal: Array, corners: Array
) -> tuple[str, tuple[str, ...], str]:
    """What is prescribed on a facet, by which boundaries, and how it may touch another body."""
    tagged = body.tagged
    dim = body.tagged.dimension
    supports = [one for one in body.held if one.where and facet in tagged.facets(one.where)]
    contacts = [
        (effect, name)
        for effect in body.contacts
        for name in (effect.boundary, effect.against)
        if name is not None and facet in tagged.facets(name)
    ]
    paired = ["bonded" if effect.bonded else "contact" for effect, _ in contacts if effect.against]
    touching = [effect for effect, _ in contacts]
    rows = [
        normal for effect in (*supports, *touching) if getattr(effect, "normal", 0.0) is not None
    ]
    for effect in supports:
        rows += [
            np.eye(dim)[k] for k, value in enumerate(effect.components[:dim]) if value is not None
        ]
    names = (*(effect.boundary for effect in supports), *(name for _, name in contacts))
    if (zero := body.kinematics.zero_on_axis) and on_axis(corners, body.tagged).all():
        rows.append(np.eye(dim)[zero[0]])
    still = body.kinematics.out_of_section > 0 and any(
        effect.components[2] is not None for effect in supports
    )  # around the axis
    if not rows and not still:
        return "free", (), ""
    clamped = still or np.linalg.matrix_rank(np.array(rows), tol=1e-6) == dim
    held = clamped or any(effect.friction.acts for effect in touching)
    return "held" if held else "guided", names, min(paired, default="")
