"""Places where the stress is unbounded as the mesh is refined, known from the shape of the body and
its boundary conditions.

Where two facets of the boundary meet at an angle, or their conditions change, the stress of linear
elasticity grows like a negative power of the distance if the angle within the body is large enough
(Williams, J. Appl. Mech. 19 (1952) 526-528; Grisvard, Elliptic Problems in Nonsmooth Domains,
1985).  On an edge in 3D it does so across the edge. Where materials meet at the boundary it grows
like a power again (Bogy, J. Appl. Mech. 38 (1971) 377-386): for most pairs of materials; the few
pairs with a bounded stress are named all the same.

Bodies that touch are judged one by one: at their contact boundaries only reentrant corners are
named.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import basix
import numpy as np
from dolfinx import mesh as dmesh
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Indices, diagonal, extents
from signorini_fx.machine import compat, parallel
from signorini_fx.machine.display import point_in_words
from signorini_fx.mechanics.assembly.mesh_entities import (
    facet_entities,
    facet_vertices,
)
from signorini_fx.mechanics.contact_points.contact_table import ContactTable, is_closed
from signorini_fx.mechanics.loads.supports import on_axis
from signorini_fx.mechanics.mesh.tagged import outer_facets
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import ForceDensity, InitialStrain
from signorini_fx.results.accuracy.contact_surface import places
from signorini_fx.results.accuracy.pressure_error import growing_rows
from signorini_fx.tuned import CORNER_ANGLE, DIGITS_OF_FILES, NOTABLE, ROOT_OF_EPS, SAME_ANGLE


@dataclass(frozen=True)
class BoundaryFacet:
    """An exterior facet with its boundary conditions and its material."""

    vertices: Array
    normal: Array
    kind: str  # free, guided (some components prescribed) or held
    names: tuple[str, ...]  # of the boundaries with this condition
    paired: str  # contact with another body: "contact", "bonded" or ""
    piece: int
    material: tuple[Hashable, ...]  # equal for equal materials, see ``_materials``

    @property
    def size(self) -> float:
        """The diagonal of its bounding box, length."""
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


@dataclass(frozen=True)
class OuterFacets:
    """The exterior facets of a mesh on this rank.

    Attributes:
        numbers: local numbers.
        cells: the cell of each.
        vertices: positions of their corners, shape (facets, corners, dim).
        inside: the middle of the corners of each cell, shape (facets, dim).
        described: those whose conditions were asked for, by their row.
    """

    numbers: Indices
    cells: Indices
    vertices: Array
    inside: Array
    described: dict[int, BoundaryFacet] = field(default_factory=dict)

    @classmethod
    def of(cls, mesh: dmesh.Mesh) -> OuterFacets:
        """Return those of a mesh.  Collective."""
        dim = mesh.topology.dim
        numbers = outer_facets(mesh)
        cells = facet_entities(mesh, numbers)[:, 0]
        cell = getattr(basix.CellType, mesh.topology.cell_name())
        corners = len(basix.geometry(cell))
        # Curved facets have nodes on their sides and inside, too.
        of_facet = len(basix.topology(cell)[dim - 1][0])
        vertices = facet_vertices(mesh, numbers)[:, :of_facet, :dim]
        inside = mesh.geometry.x[compat.geometry_cells(mesh)[cells, :corners], :dim].mean(axis=1)
        return cls(numbers, cells, vertices, inside)


def why_no_limit(
    body: Model, point: tuple[float, ...], outer: OuterFacets | None = None
) -> str | None:
    """Return why the stress at a place has no limit as the mesh is refined, or None if nothing is
    known.  Collective.

    Singular corners within one facet of the place count, reentrant ones within three facets.
    Contact boundaries count as pressed, with friction as held.  ``outer`` are the exterior facets
    of the body if these are known.
    """
    if _beside_a_node_that_is_loaded(body, point):
        return "where a single node is loaded or held"
    reasons: list[str | None] = []
    if body.boundary is not None and (corners := body.boundary.corners) is not None:
        away = np.linalg.norm(corners.place[:, : len(point)] - point, axis=1)
        close = ~corners.alone & (away <= (1 + DIGITS_OF_FILES) * corners.facet)
        if parallel.any_rank(body.comm, close):
            reasons.append("it is at a corner of the foundation")
    for corner, size, reason in _corners(body, np.array(point), outer):
        away = np.linalg.norm(corner - point, axis=1).min() / size
        if away <= 1 + DIGITS_OF_FILES or (reason == _REENTRANT and away <= _FACETS_BESIDE):
            reasons.append(reason)
    return min((reason for reason in reasons if reason is not None), default=None)


def singular_corners(body: Model, outer: OuterFacets | None = None) -> list[tuple[Array, str]]:
    """Return the corners of a body where its stress has no limit, each with the reason.
    Collective.

    Only angles count that are singular even if the facets approximate a curve.  In 3D a corner is
    one end of each facet side along a singular edge.  ``outer`` is as for ``why_no_limit``.
    """
    return [(corner[0], reason) for corner, _, reason in _corners(body, None, outer)]


def _corners(
    body: Model, point: Array | None, outer: OuterFacets | None
) -> Iterator[tuple[Array, float, str]]:
    """Yield where facets meet so that the stress has no limit: their common vertices, the size of
    the smaller facet, and the reason.  Collective.

    Args:
        body: the body.
        point: only facets near this place count; None for all.
        outer: the exterior facets, if they are known.
    """
    local = facets_near(body, point, outer or OuterFacets.of(body.tagged.mesh))
    every = body.comm.allgather(local) if body.comm.size > 1 else [local]
    facets = [facet for of_rank in every for facet in of_rank]
    same = ROOT_OF_EPS * body.tagged.size
    for facet_a, facet_b, turn, reentrant in _meeting(facets, same):
        slack = _CURVED if point is None else SAME_ANGLE
        if (reason := _reason(facet_a, facet_b, turn, reentrant, slack)) is None:
            continue
        distance = np.linalg.norm(facet_a.vertices[:, None] - facet_b.vertices[None], axis=2)
        first, _ = np.nonzero(distance <= same)
        if len(first) == body.tagged.dimension - 1:
            yield facet_a.vertices[first], min(facet_a.size, facet_b.size), reason


def _meeting(
    facets: list[BoundaryFacet], same: float
) -> Iterator[tuple[BoundaryFacet, BoundaryFacet, float, bool]]:
    """Yield the pairs of facets of one piece that have a vertex in common, up to the distance
    ``same``, and differ in direction, condition or material.

    Each comes with the angle between the normals, degrees, and whether the body is reentrant there.
    """
    if not facets:
        return
    vertices = np.array([facet.vertices for facet in facets])
    normals = np.array([facet.normal for facet in facets])
    numbers = dict[Hashable, int]()
    kinds = [(facet.piece, facet.kind, facet.material) for facet in facets]
    kind = np.array([numbers.setdefault(one, len(numbers)) for one in kinds])
    owners = np.repeat(np.arange(len(facets)), vertices.shape[1])
    touching = cKDTree(np.concatenate(vertices)).query_pairs(same, output_type="ndarray")
    ends = np.sort(owners[touching], axis=1) @ (len(facets), 1)
    a, b = np.divmod(np.unique(ends), len(facets))
    cosines = np.clip(np.einsum("pi,pi->p", normals[a], normals[b]), -1.0, 1.0)
    middles = vertices.mean(axis=1)
    reentrant = np.einsum("pi,pi->p", middles[b] - middles[a], normals[a]) > 0
    for k in np.flatnonzero((cosines < np.cos(CORNER_ANGLE)) | (kind[a] != kind[b])):
        pair = facets[a[k]], facets[b[k]]
        if pair[0].piece == pair[1].piece:
            yield *pair, math.degrees(math.acos(cosines[k])), bool(reentrant[k])


_REENTRANT = "at a reentrant corner of the body"


def _beside_a_node_that_is_loaded(body: Model, point: tuple[float, ...]) -> bool:
    """Return whether a force or a support acts at a single node within one cell of a place.
    Collective.
    """
    mesh = body.tagged.mesh
    dim = body.tagged.dimension
    statement = body.statement
    forces: Iterable[Any] = statement.of(ForceDensity)
    loaded = [load.at for load in forces if load.nodal and load.acts]
    loaded += [support.at for support in statement.displacement if support.at is not None]
    if not loaded:
        return False
    x = mesh.geometry.x[compat.geometry_cells(mesh)][:, :, :dim]
    found = False
    for at in loaded:
        around = np.linalg.norm(x - np.array(at), axis=2).min(axis=1, initial=np.inf)
        cells = x[around <= ROOT_OF_EPS * body.tagged.size]
        size = extents(cells).max(initial=0.0)
        away = np.linalg.norm(np.array(at) - point)
        found = found or bool(away <= (1 + DIGITS_OF_FILES) * size)
    return parallel.any_rank(body.comm, found)


def _reason(
    facet_a: BoundaryFacet, facet_b: BoundaryFacet, turn: float, reentrant: bool, slack: float
) -> str | None:
    """Return why the stress has no limit where two facets of a body meet, or None.

    Args:
        facet_a: one facet.
        facet_b: the other one.
        turn: the angle between their normals, degrees.
        reentrant: whether the angle within the body exceeds 180 degrees.
        slack: by how much, in degrees, the angle may exceed the largest bounded one where
            conditions change.
    """
    if (
        facet_a.material != facet_b.material and not facet_a.kind == facet_b.kind == "guided"
    ):  # on a plane of symmetry
        return "where materials meet at the boundary"
    angle = 180 + turn if reentrant else 180 - turn
    kinds = tuple(sorted({facet_a.kind, facet_b.kind}))
    alike = len(kinds) == 1
    if facet_a.paired or facet_b.paired:
        filled = facet_a.paired == facet_b.paired == "bonded"
        return None if filled or angle <= 180 + _CURVED else _REENTRANT
    if (alike and turn <= _CURVED) or angle <= _BOUNDED[kinds] + (_CURVED if alike else slack):
        return None
    if alike and facet_a.kind != "guided":
        return _REENTRANT
    names = {*facet_a.names, *facet_b.names} if alike else {*facet_a.names} ^ {*facet_b.names}
    return (
        f"at the end of the boundar{'ies' if len(names) > 1 else 'y'} {' and '.join(sorted(names))}"
    )


def facets_near(body: Model, point: Array | None, outer: OuterFacets) -> list[BoundaryFacet]:
    """Return the exterior facets of this rank with a corner within three of their sizes from a
    place; None for all.
    """
    vertices = outer.vertices
    away = 0 * vertices[:, :, 0] if point is None else np.linalg.norm(vertices - point, axis=2)
    close = away.min(axis=1, initial=np.inf) <= _FACETS_BESIDE * extents(vertices)
    chosen = [*map(int, np.flatnonzero(close))]
    if new := [row for row in chosen if row not in outer.described]:
        around = vertices[new]
        middles = around.mean(axis=1)
        normals = np.linalg.svd(around - middles[:, None])[2][:, -1]
        outwards = np.einsum("fi,fi->f", normals, middles - outer.inside[new])
        normals *= np.sign(outwards)[:, None]
        condition_of = _conditions(body)
        material_of = _materials(body)
        for k, row in enumerate(new):
            cell = int(outer.cells[row])
            outer.described[row] = BoundaryFacet(
                around[k],
                normals[k],
                *condition_of(int(outer.numbers[row]), normals[k], around[k]),
                int(body.pieces.of_cell[cell]),
                material_of(cell),
            )
    return [outer.described[row] for row in chosen]


def no_limit_of_pressure(body: Model, table: ContactTable) -> str | None:
    """Return why and where the contact pressure has no limit as the mesh is refined, or None, see
    ``Solution``.  Collective.
    """
    columns = table.columns
    pressure = columns["pressure"]
    pressed = columns["weight"] * (pressure > 0)
    if not pressed.any():
        return None
    # The shape of each body alone does not show the singularity at the edge of the other one.
    steep = pressure > (1 + NOTABLE) * np.average(pressure, weights=pressed)
    for row in growing_rows(table):
        place = tuple(float(columns[axis][row]) for axis in "xyz" if axis in columns)
        reason = why_no_limit(body, place)
        if not reason and steep[row] and columns.get("against", {row: ""})[row]:
            reason = "at the edge of one body on another"
        if reason:
            return f"{reason}, {point_in_words(place)}"
    return None


def ends_on_another(body: Model, table: ContactTable) -> list[int]:
    """Return the rows of the contact table at ends of a contact boundary in 2D beyond which another
    body continues: there the pressure has no limit.  Collective.
    """
    ends = []
    for path in table.paths if "against" in table.columns else ():
        name = str(table.columns["against"][path[0]])
        if not name or is_closed(path) or len(path) < 2:
            continue
        x = places(table)[path]
        vertices = facet_vertices(body.tagged.mesh, body.tagged.facets(name))[:, :, :2]
        for end, inside in ((0, 1), (-1, -2)):
            way = x[end] - x[inside]
            beyond = (vertices.reshape(-1, 2) - x[end]) @ way > way @ way
            if parallel.any_rank(body.comm, beyond):
                ends.append(int(path[end]))
    return ends


def _materials(body: Model) -> Callable[[int], tuple[Hashable, ...]]:
    """Return a function from a cell to what distinguishes its material: its kind, and its expansion
    if there are initial strains.
    """
    strained = bool(body.statement.of(InitialStrain))
    parts = []
    for one in reversed(body.materials):
        cells = None if one.region is None else {*map(int, body.tagged.cells(one.region))}
        parts.append(((*one.kind, strained and one.expansion), cells))

    def of(cell: int) -> tuple[Hashable, ...]:
        within = (counts for counts, cells in parts if cells is None or cell in cells)
        return next(within, parts[-1][0])

    return of


def _conditions(body: Model) -> Callable[[int, Array, Array], tuple[str, tuple[str, ...], str]]:
    """Return a function from a facet, its normal and its corners to what is prescribed there, by
    which boundaries, and how it may touch another body.
    """
    dim = body.tagged.dimension

    @cache
    def facets_of(name: str) -> set[int]:
        return {*map(int, body.tagged.facets(name))}

    @cache
    def rank_of(rows: tuple[tuple[float, ...], ...]) -> int:
        return int(np.linalg.matrix_rank(np.array(rows), tol=1e-6))

    holding = [effect for effect in body.held if effect.where]
    touched = [
        (effect, name)
        for effect in body.contacts
        for name in (effect.boundary, effect.against)
        if name is not None
    ]

    def of(facet: int, normal: Array, corners: Array) -> tuple[str, tuple[str, ...], str]:
        supports = [effect for effect in holding if facet in facets_of(effect.where)]
        contacts = [(effect, name) for effect, name in touched if facet in facets_of(name)]
        paired = [
            "bonded" if effect.bonded else "contact" for effect, _ in contacts if effect.against
        ]
        touching = [effect for effect, _ in contacts]
        rows = [
            normal
            for effect in (*supports, *touching)
            if getattr(effect, "normal", 0.0) is not None
        ]
        for effect in supports:
            rows += [
                np.eye(dim)[k]
                for k, value in enumerate(effect.components[:dim])
                if value is not None
            ]
        names = (*(effect.boundary for effect in supports), *(name for _, name in contacts))
        if (zero := body.kinematics.zero_on_axis) and on_axis(corners, body.tagged).all():
            rows.append(np.eye(dim)[zero[0]])
        still = body.kinematics.out_of_section > 0 and any(
            effect.components[2] is not None for effect in supports
        )  # around the axis
        if not rows and not still:
            return "free", (), ""
        clamped = still or rank_of(tuple(tuple(map(float, row.round(7))) for row in rows)) == dim
        held = clamped or any(effect.friction.acts for effect in touching)
        return "held" if held else "guided", names, min(paired, default="")

    return of
