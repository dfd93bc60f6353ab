"""The facets of the boundary and the cells near a place of ``singularities``, and what is prescribed and acts there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.mechanics.elasticity.moduli import of_materials
from signorini_fx.mechanics.loads.sampled_points import SampledPoints
from signorini_fx.mechanics.loads.supports import on_axis
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Force, InitialStrain
from signorini_fx.tuned import BESIDE_VERTEX, NO_STEP, SAME_PLACE_IN_CELL

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class BoundaryFacet:
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
        """The diagonal of the box around it, length."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def reaches(self, points: Array) -> bool:
        """Whether points of shape (n, d) are on it, but for gaps between bodies that are small beside it."""
        near = NO_STEP * self.size
        within = (points >= self.vertices.min(axis=0) - near) & (points <= self.vertices.max(axis=0) + near)
        return bool(within.all() and (np.abs((points - self.vertices[0]) @ self.normal) <= near).all())


def facets_near(body: Model, point: Array, step: float) -> list[BoundaryFacet]:
    """Exterior facets of this rank with a vertex within their size from a place."""
    mesh, dim = body.tagged.mesh, body.tagged.dimension
    mesh.topology.create_connectivity(dim - 1, dim)
    numbers = dmesh.exterior_facet_indices(mesh.topology)
    entities = facet_entities(mesh, numbers)
    cell_type = getattr(basix.CellType, mesh.topology.cell_name())
    corners = np.array(basix.topology(cell_type)[dim - 1])
    nodes = compat.geometry_cells(mesh)[entities[:, 0]]
    x = np.asarray(mesh.geometry.x[..., :dim], dtype=np.float64)
    vertices = x[np.take_along_axis(nodes, corners[entities[:, 1]], axis=1)]
    size = np.linalg.norm(np.ptp(vertices, axis=1), axis=1)
    close = np.linalg.norm(vertices - point, axis=2).min(axis=1, initial=np.inf) <= BESIDE_VERTEX * size
    facets = []
    for k in np.flatnonzero(close):
        middle = x[nodes[k][: len(basix.geometry(cell_type))]].mean(axis=0)
        normal = _normal(vertices[k], middle)
        beside = vertices[k] + SAME_PLACE_IN_CELL * (vertices[k].mean(axis=0) - vertices[k])
        traction, loaded = _traction(body, int(numbers[k]), beside, step)
        condition = _condition(body, int(numbers[k]), normal, vertices[k])
        piece = int(body.pieces.of_cell[entities[k, 0]])
        facets.append(BoundaryFacet(vertices[k], normal, traction, *condition, piece, loaded))
    return facets


def _traction(body: Model, facet: int, points: Array, step: float) -> tuple[Array, tuple[str, ...]]:
    """The loads on a facet but for pressure, shape (n, d), and their boundaries."""
    total, names = np.zeros_like(points), []
    for load in body.statement.of(Force):
        factor, current = body.statement.now(load, step)
        if load.where is not None and factor != 0 and facet in body.tagged.facets(load.where):
            assert body.coefficients is not None
            # A form of the user's own is not known at a point; without a normal there is no pressure.
            on = SampledPoints(points, np.zeros((len(points), 1, points.shape[1])), body.coefficients.whole, np.nan)
            total += factor * current.density_at(on)[:, 0]
            names.append(load.where)
    return total, tuple(names)


def _normal(vertices: Array, inside: Array) -> Array:
    """The unit normal of a facet that points away from a point inside."""
    normal = np.linalg.svd(vertices - vertices.mean(axis=0))[2][-1]
    return np.asarray(normal * np.sign(normal @ (vertices.mean(axis=0) - inside)))


def _condition(body: Model, facet: int, normal: Array, corners: Array) -> tuple[str, tuple[str, ...], str]:
    """What is prescribed on a facet, by which boundaries, and how it may touch another body."""
    statement, tagged, dim = body.statement, body.tagged, body.tagged.dimension
    holding = [effect for effect in statement.displacement if effect.where and effect.holding]
    supports = [effect for effect in holding if facet in tagged.facets(effect.where)]
    contacts = [
        (effect, name)
        for effect in statement.contact
        for name in (effect.boundary, effect.against)
        if name is not None and facet in tagged.facets(name)
    ]
    paired = ["bonded" if effect.bonded else "contact" for effect, _ in contacts if effect.against]
    touching = [effect for effect, _ in contacts]
    rows: list[Array] = [normal for effect in (*supports, *touching) if getattr(effect, "normal", 0.0) is not None]
    for effect in supports:
        rows += [np.eye(dim)[k] for k, value in enumerate(effect.components[:dim]) if value is not None]
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


class CellAtVertex(NamedTuple):
    """A cell at one of its vertices, shape (d,): its kind of material, a number of all pieces that bonds join to its
    own, its angle there, its longest edge there.
    """

    vertex: Array
    kind: int
    joined: int
    angle: float
    length: float


def size_of_cells(body: Model, point: Array) -> float:
    """The largest diagonal of the cells with a vertex within theirs from a place, length; collective."""
    mesh, dim = body.tagged.mesh, body.tagged.dimension
    corners = len(basix.geometry(getattr(basix.CellType, mesh.topology.cell_name())))
    x = np.asarray(mesh.geometry.x[..., :dim], dtype=np.float64)
    vertices = x[compat.geometry_cells(mesh)[: mesh.topology.index_map(dim).size_local, :corners]]
    size = np.linalg.norm(np.ptp(vertices, axis=1), axis=1)
    return parallel.largest(body.comm, size[np.linalg.norm(vertices - point, axis=2).min(axis=1) <= size])


def cells_near(body: Model, point: Array) -> list[CellAtVertex]:
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
    strained = bool(body.statement.of(InitialStrain))

    def kind_of(material: Any) -> tuple[Any, ...]:
        return *material.kind, strained and material.expansion

    kinds = [kind_of(material) for material in body.statement.material]
    (number,) = of_materials(body.statement, body.tagged, lambda entry: (float(kinds.index(kind_of(entry))),))
    kind = number.x.array[number.function_space.dofmap.list[cells, 0]]
    joined, of_cell = _joined_pieces(body), body.pieces.of_cell
    edges = vertices[:, neighbours] - vertices[:, :, None]
    length = np.linalg.norm(edges, axis=3)
    distance, reach = np.linalg.norm(vertices - point, axis=2), BESIDE_VERTEX * length.max(axis=2)
    close = distance <= parallel.largest(body.comm, reach[distance <= reach])
    local_cells = [
        CellAtVertex(
            vertices[cell, corner],
            int(kind[cell]),
            int(joined[of_cell[cell]]),
            _angle(edges[cell, corner]),
            float(length[cell, corner].max()),
        )
        for cell, corner in np.argwhere(close)
    ]
    return [entry for rows in body.comm.allgather(local_cells) for entry in rows]


def _joined_pieces(body: Model) -> npt.NDArray[np.int64]:
    """For each connected piece of the mesh one number of all pieces that bonds join to it; collective."""
    joined = np.arange(body.pieces.count)
    for effect in body.statement.contact:
        if effect.against is not None and effect.bonded:
            facets = np.concatenate([body.tagged.facets(name) for name in (effect.boundary, effect.against)])
            local_pieces = np.unique(body.pieces.of_cell[facet_entities(body.tagged.mesh, facets)[:, 0]])
            pieces = sorted({piece for rows in body.comm.allgather(local_pieces.tolist()) for piece in rows})
            joined[np.isin(joined, joined[pieces])] = joined[pieces].min()
    return joined


def _angle(edges: Array) -> float:
    """The angle between two directions, or the solid angle between three, shape (d, d)."""
    along = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    pairs = along @ along.T
    if len(along) == 2:
        return float(np.arccos(np.clip(pairs[0, 1], -1.0, 1.0)))
    # Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125-126.
    below = 1 + pairs[0, 1] + pairs[0, 2] + pairs[1, 2]
    return float(2 * np.arctan2(abs(np.linalg.det(along)), below))
