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

from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from signorini_fx import compat, parallel
from signorini_fx.body.assembly import facet_entities
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.loads import SampledPoints
from signorini_fx.body.moduli import of_materials
from signorini_fx.body.supports import on_axis
from signorini_fx.scene.effect import Force, InitialStrain
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
# A gap or an overlap of bodies, or a step between their sides, that is less than this share of a facet is none.
_NEAR = 0.1
# Share of a facet by which the load beside a vertex is taken within it, and share of a load that is a jump.
_WITHIN, _JUMP = 1e-6, 1e-3


@dataclass(frozen=True)
class _Facet:
    """An exterior facet.

    Attributes:
        vertices: shape (n, d).
        normal: outward, shape (d,).
        traction: just beside each vertex, but for pressure, shape (n, d); not a number where it is not known.
        kind: what is prescribed there.
        names: by which boundaries.
        piece: number of the connected piece of the mesh that it is of.
        paired: how it may touch another body: "contact", "bonded", or "" if it does not.
        loaded: the boundaries whose loads act there.
    """

    vertices: Array
    normal: Array
    traction: Array
    kind: str
    names: tuple[str, ...]
    paired: str
    piece: int
    loaded: tuple[str, ...]

    @property
    def size(self) -> float:
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def reaches(self, points: Array) -> bool:
        """Whether points of shape (n, d) are on it, but for gaps between bodies that are small beside it."""
        near = _NEAR * self.size
        within = (points >= self.vertices.min(axis=0) - near) & (points <= self.vertices.max(axis=0) + near)
        return bool(within.all() and (np.abs((points - self.vertices[0]) @ self.normal) <= near).all())


def why_no_limit(body: Discretisation, place: tuple[float, ...], step: float = 0.0) -> str | None:
    """Why the stress at a place, or within one facet from it, has no limit; None if nothing is known; collective.

    Contact boundaries count as pressed, with friction as held.

    Args:
        body: the body.
        place: a point, length, shape (d,).
        step: the load step that the loads are those of, its place in the lists of factors.
    """
    every = [facet for own in body.comm.allgather(_facets_near(body, np.array(place), step)) for facet in own]
    found = [_where_materials_meet(body, np.array(place), every)]
    for one, other in combinations(every, 2):
        if one.piece != other.piece:
            continue
        distance = np.linalg.norm(one.vertices[:, None] - other.vertices[None], axis=2)
        first, second = np.nonzero(distance <= 1e-8 * body.tagged.size)
        size = min(one.size, other.size)
        near = np.linalg.norm(one.vertices[first] - place, axis=1) <= _BESIDE * size
        if len(first) == body.tagged.dimension - 1 and near.any():
            others = [facet for facet in every if facet.piece != one.piece and facet.reaches(one.vertices[first])]
            found += [_reason(one, other, others), _where_loads_jump(one, other, first, second)]
    return min((reason for reason in found if reason is not None), default=None)


def _reason(one: _Facet, other: _Facet, others: list[_Facet]) -> str | None:
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
    names = sorted({*one.names, *other.names} - ({*one.names} & {*other.names} if not alike else set()))
    return f"it is at the end of the boundar{'ies' if len(names) > 1 else 'y'} {' and '.join(names)}"


def _corner(normal: Array, other: Array, toward: Array) -> tuple[float, float]:
    """How far the normal turns from one facet to another one, and the angle within the body between them, degrees.

    Args:
        normal: of the one.
        other: that of the other one.
        toward: from the one to the other.
    """
    turn = float(np.degrees(np.arccos(np.clip(normal @ other, -1.0, 1.0))))
    return turn, 180 + turn if toward @ normal > 0 else 180 - turn


def _where_loads_jump(
    one: _Facet, other: _Facet, first: npt.NDArray[np.int64], second: npt.NDArray[np.int64]
) -> str | None:
    """Whether a load along the boundary jumps where two facets meet that share these vertices of theirs.

    A boundary that only guides is a mirror: a load that ends there at a right angle, or acts along it, is one that
    jumps.
    """
    turn = float(np.degrees(np.arccos(np.clip(one.normal @ other.normal, -1.0, 1.0))))
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
    names = sorted({*one.loaded, *other.loaded})
    return f"it is where the load along the boundar{'ies' if len(names) > 1 else 'y'} {' and '.join(names)} jumps"


def _where_materials_meet(body: Discretisation, place: Array, boundary: list[_Facet]) -> str | None:
    """Whether materials meet at the boundary, or their interface has a corner, within a facet of a place; collective.

    Those of bodies that touch do not, unless they are bonded.

    It shows in the angles, in space solid angles, that the cells of each material have at a vertex.
    """
    if len(body.scene.material) == 1:
        return None
    every = _cells_near(body, place)
    whole = 2 * np.pi if body.tagged.dimension == 2 else 4 * np.pi
    found: list[str] = []
    for vertex, joined in ((one.vertex, one.joined) for one in every):
        here = [
            one
            for one in every
            if one.joined == joined and np.linalg.norm(one.vertex - vertex) <= 1e-8 * body.tagged.size
        ]
        angles = {kind: sum(one.angle for one in here if one.kind == kind) for kind in (one.kind for one in here)}
        if len(angles) == 1 or np.linalg.norm(vertex - place) > _BESIDE * min(one.length for one in here):
            continue
        total = sum(angles.values())
        facets = [
            facet
            for facet in boundary
            if facet.paired != "bonded"
            and (np.linalg.norm(facet.vertices - vertex, axis=1) <= 1e-8 * body.tagged.size).any()
        ]
        # A flat boundary that only guides is a mirror.
        mirror = bool(facets) and all(facet.kind == "guided" for facet in facets) and abs(2 * total / whole - 1) < 1e-6
        inside = mirror or abs(total / whole - 1) < 1e-6
        if inside and len(angles) == 2 and abs(2 * min(angles.values()) / total - 1) <= _CURVED / 180:
            continue
        found.append(
            "it is at a corner of the interface of materials"
            if inside
            else "it is where materials meet at the boundary"
        )
    return min(found, default=None)


class _CellAtVertex(NamedTuple):
    """A cell at one of its vertices, shape (d,): its kind of material, a number of all pieces that bonds join to its
    own, its angle there, its longest edge there.
    """

    vertex: Array
    kind: int
    joined: int
    angle: float
    length: float


def _cells_near(body: Discretisation, place: Array) -> list[_CellAtVertex]:
    """The cells of all ranks at each vertex near a place, which is within an edge of it; collective."""
    mesh, dim = body.tagged.mesh, body.tagged.dimension
    cell_type = getattr(basix.CellType, mesh.topology.cell_name())
    corners = basix.geometry(cell_type)
    neighbours = [
        [end for edge in basix.topology(cell_type)[1] if corner in edge for end in edge if end != corner]
        for corner in range(len(corners))
    ]
    cells = np.arange(mesh.topology.index_map(dim).size_local)
    x = np.asarray(mesh.geometry.x[..., :dim], dtype=np.float64)
    vertices = x[compat.geometry_cells(mesh)[cells][:, : len(corners)]]
    strained = bool(body.scene.of(InitialStrain))

    def kind_of(material: Any) -> tuple[Any, ...]:
        return (
            material.orthotropic,
            material.lame,
            material.grading,
            material.poisson_grading,
            strained and material.expansion,
        )

    kinds = [kind_of(material) for material in body.scene.material]
    (number,) = of_materials(body.scene, body.tagged, lambda one: (float(kinds.index(kind_of(one))),))
    kind = number.x.array[number.function_space.dofmap.list[cells, 0]]
    joined, of_cell = _joined_pieces(body), body.pieces.of_cell
    edges = vertices[:, neighbours] - vertices[:, :, None]
    length = np.linalg.norm(edges, axis=3)
    distance, reach = np.linalg.norm(vertices - place, axis=2), _BESIDE * length.max(axis=2)
    close = distance <= parallel.largest(body.comm, reach[distance <= reach])
    own = [
        _CellAtVertex(
            vertices[cell, corner],
            int(kind[cell]),
            int(joined[of_cell[cell]]),
            _angle(edges[cell, corner]),
            float(length[cell, corner].max()),
        )
        for cell, corner in np.argwhere(close)
    ]
    return [one for rows in body.comm.allgather(own) for one in rows]


def _joined_pieces(body: Discretisation) -> npt.NDArray[np.int64]:
    """For each connected piece of the mesh one number of all pieces that bonds join to it; collective."""
    found = np.arange(body.pieces.count)
    for effect in body.scene.contact:
        if effect.against is not None and effect.kind == "bonded":
            facets = np.concatenate([body.tagged.facets(name) for name in (effect.boundary, effect.against)])
            own = np.unique(body.pieces.of_cell[facet_entities(body.tagged.mesh, facets)[:, 0]])
            pieces = sorted({piece for rows in body.comm.allgather(own.tolist()) for piece in rows})
            found[np.isin(found, found[pieces])] = found[pieces].min()
    return found


def _angle(edges: Array) -> float:
    """The angle between two directions, or the solid angle between three, shape (d, d)."""
    along = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    pairs = along @ along.T
    if len(along) == 2:
        return float(np.arccos(np.clip(pairs[0, 1], -1.0, 1.0)))
    # Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125-126.
    below = 1 + pairs[0, 1] + pairs[0, 2] + pairs[1, 2]
    return float(2 * np.arctan2(abs(np.linalg.det(along)), below))


def _facets_near(body: Discretisation, place: Array, step: float) -> list[_Facet]:
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
        beside = vertices[k] + _WITHIN * (vertices[k].mean(axis=0) - vertices[k])
        traction, loaded = _traction(body, int(numbers[k]), beside, step)
        condition = _condition(body, int(numbers[k]), normal, vertices[k])
        piece = int(body.pieces.of_cell[entities[k, 0]])
        found.append(_Facet(vertices[k], normal, traction, *condition, piece, loaded))
    return found


def _traction(body: Discretisation, facet: int, points: Array, step: float) -> tuple[Array, tuple[str, ...]]:
    """The loads on a facet but for pressure, shape (n, d), and their boundaries."""
    total, names = np.zeros_like(points), []
    for load in body.scene.of(Force):
        factor, now = body.scene.now(load, step)
        if load.where is not None and factor != 0 and facet in body.tagged.facets(load.where):
            # A form of the user's own is not known at a point; without a normal there is no pressure.
            on = SampledPoints(points, np.zeros((len(points), 1, points.shape[1])), body.coefficients.whole, np.nan)
            total += factor * now.density_at(on)[:, 0]
            names.append(load.where)
    return total, tuple(names)


def _normal(vertices: Array, inside: Array) -> Array:
    """The unit normal of a facet that points away from a point inside."""
    normal = np.linalg.svd(vertices - vertices.mean(axis=0))[2][-1]
    return np.asarray(normal * np.sign(normal @ (vertices.mean(axis=0) - inside)))


def _condition(body: Discretisation, facet: int, normal: Array, corners: Array) -> tuple[str, tuple[str, ...], str]:
    """What is prescribed on a facet, by which boundaries, and how it may touch another body."""
    scene, tagged, dim = body.scene, body.tagged, body.tagged.dimension
    supports = [effect for effect in scene.displacement if effect.where and facet in tagged.facets(effect.where)]
    contacts = [
        (effect, name)
        for effect in scene.contact
        for name in (effect.boundary, effect.against)
        if name is not None and facet in tagged.facets(name)
    ]
    paired = ["bonded" if effect.kind == "bonded" else "contact" for effect, _ in contacts if effect.against]
    touching = [effect for effect, _ in contacts]
    rows: list[Array] = [normal for effect in (*supports, *touching) if getattr(effect, "normal", 0.0) is not None]
    for effect in supports:
        rows += [np.eye(dim)[k] for k, value in enumerate(effect.components[:dim]) if value is not None]
    names = (*(effect.boundary for effect in supports), *(name for _, name in contacts))
    if body.scene.axisymmetric and on_axis(corners, body.tagged).all():
        rows.append(np.eye(dim)[0])
    still = scene.torsion and any(effect.components[2] is not None for effect in supports)  # around the axis
    if not rows and not still:
        return "free", (), ""
    whole = still or np.linalg.matrix_rank(np.array(rows), tol=1e-6) == dim
    held = whole or any(effect.friction.acts for effect in touching)
    return "held" if held else "guided", names, min(paired, default="")
