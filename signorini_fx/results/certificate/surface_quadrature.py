"""Integrals over parts of the boundary by quadrature in NumPy, without any compiled form, for the certificates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem

from signorini_fx.machine import compat
from signorini_fx.mechanics.assembly import contact_forms
from signorini_fx.mechanics.assembly.mesh_entities import adjugates, facet_entities, node_positions, over_ranks
from signorini_fx.mechanics.assembly.shared_cache import shared_in
from signorini_fx.results.certificate.rigid_part import RigidPart
from signorini_fx.tuned import ZERO_SUM

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]
# Points that are looked at together: few enough for the caches of a processor.
_TOGETHER = 10_000


@dataclass(frozen=True)
class ReferencePoints:
    """Points in the reference cell: shape functions of the displacement (q, n) and of the geometry (q, g), derivatives
    of the latter along the d reference directions (d, q, g), and the functions that contact tests with (q, n): the
    shape functions, or the hats of the vertices where contact averages.
    """

    shape: Array
    place: Array
    stretch: Array
    test: Array


@dataclass(frozen=True)
class QuadratureFacets:
    """Points on facets with the same place in their reference cell.

    Attributes:
        cells: cells of the facets, shape (f,).
        table: shape functions at the points.
        moment: outward normal times the area (in 2D: length) of the point, shape (f, q, across).
    """

    cells: Indices
    table: ReferencePoints
    moment: Array


class SurfaceQuadrature:
    """Integrals of the shape functions of a vector Lagrange space over facets; all methods are collective.

    Args:
        space: of the displacement.

    Attributes:
        space: of the displacement.
        owned: number of nodes that this rank owns.
        dimension: d, of displacements.
        across: dimension of the cells; less than d of a section in 3D, which lies in x[2] = 0.
    """

    def __init__(self, space: fem.FunctionSpace) -> None:
        mesh = space.mesh
        self.space = space
        self.owned = int(space.dofmap.index_map.size_local)
        self.dimension = int(mesh.geometry.dim)
        self.across = int(mesh.topology.dim)
        self.cell_type = getattr(basix.CellType, mesh.topology.cell_name())
        self._facet = basix.cell.subentity_types(self.cell_type)[self.across - 1][0]
        self._shapes = space.element.basix_element
        self._hats = None
        if self.cell_type == basix.CellType.tetrahedron and self._shapes.degree == 2:
            self._hats = basix.create_element(basix.ElementFamily.P, self.cell_type, 1)
        self._geometry = compat.geometry_element(mesh)
        self._corners = compat.geometry_cells(mesh)
        self.cell_nodes = space.dofmap.list
        self._x = mesh.geometry.x[:, : self.across]
        self._moments: dict[str, Array] = {}
        self._of_mesh: dict[str, Any] = {}

    @shared_in("_of_mesh")
    def at_nodes(self) -> Array:
        """Positions of the nodes of this rank, length, shape (nodes, 3)."""
        return node_positions(self.space)

    @shared_in("_of_mesh")
    def pieces(self) -> RigidPart:
        """The pieces of the mesh."""
        return RigidPart(self.space, self.at_nodes[: self.owned, : self.dimension])

    def facets(self, boundary: Any) -> Indices:
        """The exterior facets of a part of the boundary on this rank: here the part is a list of them."""
        return np.asarray(boundary, dtype=np.int32)

    @property
    def averaging(self) -> bool:
        """Whether contact averages over nodes: on quadratic tetrahedra."""
        return self._hats is not None

    def moments(self, boundary: Any, factor: Array | None = None) -> Array:
        """Outward normal times the area (in 2D: length) of each node of a boundary, the integral
        of its basis function, shape (owned nodes, d).

        Args:
            boundary: see ``facets``.
            factor: of the measure, at all nodes of this rank, shape (nodes,); None: 1.
        """
        if factor is not None or not isinstance(boundary, str):
            return self._integrated(boundary, factor)
        if boundary not in self._moments:
            self._moments[boundary] = self._integrated(boundary, None)
            self._moments[boundary].setflags(write=False)
        return self._moments[boundary]

    def _integrated(self, boundary: Any, factor: Array | None) -> Array:
        total, degree = self.zero(), self._shapes.degree
        rule = basix.make_quadrature(self._facet, contact_forms.lumped_degree(degree, self._geometry.degree))
        if self.across == 2 and (factor is None or degree > 1):  # the nodal rule, which has the same integrals
            places, weights = {
                1: ([0.0, 1.0], [0.5, 0.5]),  # trapezoidal rule
                2: ([0.0, 1.0, 0.5], [1 / 6, 1 / 6, 2 / 3]),  # Simpson's rule
            }[degree]
            rule = np.array(places)[:, None], np.array(weights)
        for facets in self._facets(boundary, rule[0], rule[1], factor):
            of_nodes = _clean(facets.table.test).T @ facets.moment
            np.add.at(total[:, : self.across], self.cell_nodes[facets.cells], of_nodes)
        return self.over_ranks(total)

    def products(self, boundary: Any, factor: Array | None = None) -> Any:
        """Integrals of test times shape functions over the facets of this rank, scipy sparse, shape (nodes, nodes).

        Where contact averages the test functions are dual to the hats on each facet.
        """
        degree = contact_forms.lumped_degree(self._shapes.degree, self._geometry.degree)
        rule = basix.make_quadrature(self._facet, degree)
        size = len(self.zero())
        integrals = sp.csr_array((size, size))
        for facets in self._facets(boundary, rule[0], rule[1], factor):
            test, shape = _clean(facets.table.test), _clean(facets.table.shape)
            area = np.linalg.norm(facets.moment, axis=2)
            values = np.einsum("qi,cq,qj->cij", test, area, shape)
            if self.averaging:  # dual to the hats on this facet, the fourth of which is zero
                mass = np.einsum("qi,cq,qk->cik", test, area, test)
                values = values.sum(axis=2)[:, :, None] * (np.linalg.pinv(mass, rcond=1e-10, hermitian=True) @ values)
                values[np.abs(values) <= ZERO_SUM * np.abs(values).max(initial=0.0)] = 0.0
            nodes = self.cell_nodes[facets.cells]
            rows, columns = (np.broadcast_to(numbers, values.shape) for numbers in (nodes[:, :, None], nodes[:, None]))
            nonzero = values != 0
            integrals += sp.csr_array((values[nonzero], (rows[nonzero], columns[nonzero])), shape=(size, size))
        return integrals

    def with_ghosts(self, values: Array) -> Array:
        """Values at the owned nodes, shape (owned nodes, d), with those of the ghosts, shape (nodes, d)."""
        function = fem.Function(self.space)
        function.x.array[: values.size] = values.ravel()
        function.x.scatter_forward()
        return np.array(function.x.array.reshape(-1, self.dimension))

    def over_ranks(self, values: Array) -> Array:
        """What all ranks contribute to the nodes of this one, from shape (nodes, d) to (owned nodes, d)."""
        return over_ranks(values.ravel(), self.space).reshape(-1, self.dimension)

    # --- how ---------------------------------------------------------------------------------------------------------

    def zero(self) -> Array:
        """No forces at the nodes of this rank, ghosts included, shape (n, d)."""
        index_map = self.space.dofmap.index_map
        return np.zeros((index_map.size_local + index_map.num_ghosts, self.dimension))

    def _table(self, points: Array) -> ReferencePoints:
        shape, geometry = self._shapes.tabulate(0, points)[0, ..., 0], self._geometry.tabulate(1, points)[..., 0]
        test = shape
        if self._hats is not None:
            hats = self._hats.tabulate(0, points)[0, ..., 0]  # vertices come first
            test = np.pad(hats, ((0, 0), (0, test.shape[1] - hats.shape[1])))
        return ReferencePoints(shape, geometry[0], geometry[1:], test)

    def jacobian(self, cells: Indices, table: ReferencePoints) -> Array:
        """dx_i / dX_k at the points, shape (across (i), across (k), cells, q)."""
        x = self._x[self._corners[cells]]
        return np.array([[x[:, :, i] @ stretch.T for stretch in table.stretch] for i in range(self.across)])

    def _facets(
        self, boundary: Any, places: Array, weight: Array, factor: Array | None = None
    ) -> Iterator[QuadratureFacets]:
        """The facets of a boundary with points at ``places`` of the reference facet, shape (q, across - 1).

        Args:
            boundary: see ``facets``.
            places: see above.
            weight: of the points, shape (q,).
            factor: see ``moments``.
        """
        entities = facet_entities(self.space.mesh, self.facets(boundary))
        vertices = basix.geometry(self.cell_type)
        for side, corner in enumerate(basix.topology(self.cell_type)[self.across - 1]):
            cells = entities[entities[:, 1] == side, 0]
            if cells.size == 0:
                continue
            start, *ends = vertices[corner[: self.across]]
            along = np.array(ends) - start
            table = self._table(start + places @ along)
            across = np.array([along[0, 1], -along[0, 0]]) if self.across == 2 else np.cross(*along)
            across *= np.sign(across @ (start - vertices.mean(axis=0)))
            for facet_cells in np.array_split(cells, 1 + cells.size * len(places) // _TOGETHER):
                # Where the facet is warped, the middle of a cell may be on its outer side: the reference cell tells.
                jacobian = self.jacobian(facet_cells, table)
                adjugate, determinant = adjugates(jacobian)
                normal = np.sign(determinant)[:, :, None] * np.einsum("kicq,k->cqi", adjugate, across)
                if factor is not None:
                    normal *= (np.nan_to_num(factor)[self.cell_nodes[facet_cells]] @ table.shape.T)[:, :, None]
                yield QuadratureFacets(facet_cells, table, weight[:, None] * normal)


def _clean(functions: Array) -> Array:
    """Without the round-off of those that are zero."""
    return np.where(np.abs(functions) < ZERO_SUM, 0.0, functions)
