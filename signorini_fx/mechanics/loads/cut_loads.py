"""The rule of quadrature of loads that jump inside facets or cells: on the parts between the jumps.

It is used where every function that a load compares with another one is affine, and the facet or cell is: there the
parts are exact.  Everywhere else the rule of the whole facet or cell stands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem, la

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.mechanics.assembly.quadrature import has_affine_parts
from signorini_fx.mechanics.statement.cut_simplices import exactly_cut
from signorini_fx.mechanics.statement.effect import Effect, Force
from signorini_fx.mechanics.statement.expressions import in_space, sample

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]

SIMPLICES = {1: basix.CellType.interval, 2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}
# Simplices with the vertices of a facet or cell, in the order of basix, that fill it.
PARTS = {
    basix.CellType.interval: ((0, 1),),
    basix.CellType.triangle: ((0, 1, 2),),
    basix.CellType.tetrahedron: ((0, 1, 2, 3),),
    basix.CellType.quadrilateral: ((0, 1, 2), (1, 3, 2)),
    basix.CellType.hexahedron: tuple((0, a, a + b, 7) for a in (1, 2, 4) for b in (1, 2, 4) if a != b),
}


@dataclass(frozen=True)
class CutRule:
    """Points on the m parts of the facets or cells of this rank that jumps of a load cut, ``statement.effect.Points``.

    Attributes:
        entities: these facets or cells, local numbers.
        cells: the cell that each part is in, shape (m,).
        places: points in the reference cell, shape (m, q, across).
        size: length, area or volume that each point stands for, shape (m, q).
        position: X, shape (m, q, d).
        normal: outward unit normals, shape (m, 1, d); zero in cells.
        density: mass per volume, shape (m, 1).
        whole: from an effect to the integral of its ``weighting``.
    """

    entities: Indices
    cells: Indices
    places: Array
    size: Array
    position: Array
    normal: Array
    density: Array
    whole: Callable[[Effect], float]

    @property
    def displacement(self) -> Array:
        """None, shape (m, q, d)."""
        return np.zeros_like(self.position)

    def total(self, effect: Effect) -> float:
        """See ``Coefficients``."""
        return self.whole(effect)

    def value(self, value: Any) -> Array:
        """A number or an expression, shape (m, q)."""
        flat = self.position.reshape(-1, self.position.shape[2])
        return sample(value, in_space(flat)).reshape(self.size.shape)

    def vector(self, values: tuple[Any, ...]) -> Array:
        """Values along the axes, shape (m, q, d)."""
        return np.stack([self.value(value) for value in values[: self.position.shape[2]]], axis=2)

    def integrals(self, force: Array, space: fem.FunctionSpace) -> Array:
        """A force per area or volume, shape (m, q, d), with the shape functions, at the owned dofs; collective."""
        element, found = space.element.basix_element, fem.Function(space)
        flat = self.places.reshape(-1, self.places.shape[2])
        shape = element.tabulate(0, flat)[0, ..., 0].reshape(*self.size.shape, -1) if flat.size else np.zeros((0, 0, 0))
        at_nodes = found.x.array.reshape(-1, force.shape[2])
        if flat.size:
            weighted = self.size[..., None] * force
            np.add.at(at_nodes, space.dofmap.list[self.cells], np.einsum("mqn,mqd->mnd", shape, weighted))
        found.x.scatter_reverse(la.InsertMode.add)
        return np.array(found.x.array[: space.dofmap.index_map.size_local * space.dofmap.index_map_bs])


def cut_rule(load: Force, on: Any) -> CutRule | None:
    """The rule of a load at one time; None if nothing is cut; collective.

    Args:
        load: the load.
        on: ``FormCoefficients``.
    """
    if not load.jumps or not has_affine_parts(on.space.mesh, in_body=load.where is None):
        return None
    found = _rule(load, on)
    return found if parallel.any_rank(on.space.mesh.comm, found.entities.size > 0) else None


def _rule(load: Force, on: Any) -> CutRule:
    mesh, boundary = on.space.mesh, load.where
    across, cell = mesh.topology.dim, getattr(basix.CellType, mesh.topology.cell_name())
    if boundary is None:
        every = np.arange(mesh.topology.index_map(across).size_local, dtype=np.int32)
        entities, kind, sides = np.column_stack((every, 0 * every)), cell, [list(range(len(basix.geometry(cell))))]
    else:
        every = on.tagged.facets(boundary)
        entities, kind = facet_entities(mesh, every), basix.cell.subentity_types(cell)[across - 1][0]
        sides = basix.topology(cell)[across - 1]
    fillings = np.array(PARTS[kind])
    # The corners of the simplices that fill each facet or cell, in the reference cell and in the body.
    corners = basix.geometry(cell)[np.array(sides)[:, fillings]][entities[:, 1]]
    number = np.repeat(np.arange(len(entities)), len(fillings))
    corners = corners.reshape(-1, *corners.shape[2:])
    nodes = mesh.geometry.x[compat.geometry_cells(mesh)[entities[number, 0]]][..., :across]
    x = np.zeros((0, corners.shape[1], across))
    if corners.size:  # a rank may have no facet of the boundary, and basix ends the run without points
        flat = compat.geometry_element(mesh).tabulate(0, corners.reshape(-1, across))[0, ..., 0]
        x = np.einsum("nkg,ngd->nkd", flat.reshape(*corners.shape[:2], nodes.shape[1]), nodes)
    owner, parts, exact = exactly_cut(x, load.jumps)
    is_cut = np.bincount(number[owner], minlength=len(entities)) > len(fillings)
    is_cut &= np.bincount(number, ~exact, len(entities)) == 0
    chosen = is_cut[number[owner]]
    owner, parts = owner[chosen], parts[chosen]
    k = corners.shape[1]
    # None of its points is on the boundary of a part, where the load jumps.
    scheme, degree = basix.QuadratureType.gauss_jacobi, load.degree(on.statement.element.degree)
    points, weights = basix.make_quadrature(SIMPLICES[k - 1], degree, rule=scheme)
    local = np.column_stack((1 - points.sum(axis=1), points)) @ parts
    edges = x[owner, 1:] - x[owner, :1]
    volume = np.sqrt(np.abs(np.linalg.det(edges @ edges.swapaxes(1, 2)))) * np.abs(np.linalg.det(parts))
    position = local @ x[owner]
    cells = entities[number[owner], 0]
    size = volume[:, None] * weights * on.kinematics.measure(np.moveaxis(position, -1, 0))
    normal = np.zeros((len(owner), 1, across))
    if boundary is not None and owner.size:
        outward = edges[:, 0, ::-1] * [1.0, -1.0] if across == 2 else np.cross(edges[:, 0], edges[:, 1])
        away = x[owner].mean(axis=1) - nodes[owner].mean(axis=1)
        outward *= np.sign(np.einsum("md,md->m", outward, away))[:, None]
        normal = (outward / np.linalg.norm(outward, axis=1)[:, None])[:, None]
    more = ((0, 0), (0, 0), (0, mesh.geometry.dim - across))
    density = on.density
    mass = np.full(len(cells), float(density.value)) if isinstance(density, fem.Constant) else _in_cells(density, cells)
    places = np.einsum("mqk,mkt->mqt", local, corners[owner])
    return CutRule(
        every[is_cut], cells, places, size, np.pad(position, more), np.pad(normal, more), mass[:, None], on.whole
    )


def _in_cells(function: fem.Function, cells: Indices) -> Array:
    """The values of a function that is constant in each cell, shape (m,)."""
    return np.asarray(function.x.array[function.function_space.dofmap.list[cells, 0]])
