"""Nodal forces, weights and normals by quadrature in NumPy, without any compiled form.

The certificate is based on this module.  It uses no UFL forms, FFCx kernels, assembled matrices or vectors,
condensation, or contact boundary of the solver.  Both sides share the mesh with its named
boundaries, the tables of shape functions (basix), the values of the scene's expressions, and the quadrature degrees,
which are part of the discrete problem.  Loads that are given as UFL expressions in Python are the exception:
only a compiled form can integrate them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem, la

from signorini_fx import compat, parallel
from signorini_fx.body import forms
from signorini_fx.body.assembly import adjugates, assemble, facet_entities
from signorini_fx.body.discretisation import reduced_degree
from signorini_fx.body.loads import compile_loads, load_degree, stresses, traction_degree
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.records import Inventory
from signorini_fx.scene.expressions import Expression, in_space, sample
from signorini_fx.scene.load_steps import factor_at
from signorini_fx.scene.model import LinearElastic, PrescribedDisplacement, Scene, SurfaceTraction

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]

# A basis function counts as zero below this; otherwise nodes beside a facet would get a part of it.
_ROUND_OFF = 1e-12
# Cells processed at a time: few enough for the caches, and enough to make the overhead of the loop negligible.
_CHUNK = 4096


def hooke(material: LinearElastic) -> tuple[float, float]:
    """(a, b) of Hooke's law sigma = a epsilon + b tr(epsilon) I, stresses."""
    a = material.young / (1 + material.poisson)
    squeezed = 1 - 2 * material.poisson if material.hypothesis == "plane strain" else 1 - material.poisson
    return a, a * material.poisson / squeezed


@dataclass(frozen=True)
class _Table:
    """Points in the reference cell: shape functions of the displacement (q, n) and of the geometry (q, g), their
    derivatives along the d reference directions, (d, q, n) and (d, q, g), and the functions that contact tests with
    (q, n): the shape functions, or the hats of the vertices where contact averages.
    """

    shape: Array
    slope: Array
    place: Array
    stretch: Array
    test: Array


@dataclass(frozen=True)
class _Facets:
    """Points on facets with the same place in their reference cell.

    Attributes:
        cells: cells of the facets, shape (f,).
        table: shape functions at the points.
        moment: outward normal times the area (in the plane: length) of the point, shape (f, q, d).
    """

    cells: Indices
    table: _Table
    moment: Array


class NodalForces:
    """Forces on the nodes of a Lagrange space, from a scene and its mesh alone; all methods are collective.

    Args:
        scene: the scene.
        tagged: its mesh.
        space: the vector Lagrange space of the displacement.
    """

    def __init__(self, scene: Scene, tagged: TaggedMesh, space: fem.FunctionSpace) -> None:
        mesh = tagged.mesh
        self.scene = scene
        self.tagged = tagged
        self.space = space
        self.owned = int(space.dofmap.index_map.size_local)
        self._cell = getattr(basix.CellType, mesh.topology.cell_name())
        self._facet = basix.cell.subentity_types(self._cell)[tagged.dimension - 1][0]
        self._shapes = space.element.basix_element
        self._hats = None
        if self._cell == basix.CellType.tetrahedron and scene.element.degree == 2:
            self._hats = basix.create_element(basix.ElementFamily.P, self._cell, 1)
        self._geometry = compat.geometry_element(mesh)
        self._own_cells = int(mesh.topology.index_map(mesh.topology.dim).size_local)
        self._corners = compat.geometry_cells(mesh)
        self._nodes = space.dofmap.list
        self.dimension = tagged.dimension
        self._x = mesh.geometry.x[:, : self.dimension]

    def internal(self, displacement: Array) -> Array:
        """a(y, .) from nodal displacements with ghosts, shape (nodes, d); forces, shape (owned nodes, d)."""
        degree = forms.elastic_degree(self._cell.name, self.scene.element.degree, self._geometry.degree)
        reduced = reduced_degree(self.scene, self.tagged.mesh)
        a, b = self._moduli()
        if reduced is None:
            return self.over_ranks(self._stress_work(displacement, degree, a, b))
        return self.over_ranks(
            self._stress_work(displacement, degree, a, np.zeros(1))
            + self._stress_work(displacement, reduced, np.zeros(1), b)
        )

    def strain_energy(self, displacement: fem.Function) -> float:
        """a(y, y) / 2, an energy per thickness."""
        y = displacement.x.array.reshape(-1, self.dimension)
        return float(parallel.global_sum(self.tagged.mesh.comm, np.sum(self.internal(y) * y[: self.owned]))) / 2

    def external(self, step: float, scale: float = 1.0) -> Array:
        """L of a load step times ``scale``, shape (owned nodes, d)."""
        scene, degree = self.scene, load_degree(self.scene.element.degree)
        total = self._zero()
        compiled = np.zeros((self.owned, self.dimension))
        for load in scene.loads:
            factor = scale * factor_at(scene.factors_of(load), step)
            if isinstance(load, PrescribedDisplacement):
                continue
            values = load.components[: self.dimension]
            if any(hasattr(value, "ufl_shape") for value in stresses(load)):
                compiled += factor * self._compiled(load)
            elif isinstance(load, SurfaceTraction):
                rule = basix.make_quadrature(self._facet, traction_degree(load, scene.element.degree))
                for facets in self._facets(load.boundary, *rule):
                    at = self._positions(facets)
                    pressure = self._values(load.pressure, facets, at)
                    area = np.linalg.norm(facets.moment, axis=2, keepdims=True)
                    traction = np.stack([self._values(value, facets, at) for value in values], axis=2)
                    force = area * traction - pressure[:, :, None] * facets.moment
                    np.add.at(total, self._nodes[facets.cells], factor * (facets.table.shape.T @ force))
            else:
                points, weight = basix.make_quadrature(self._cell, degree)
                table = self._table(points)
                for cells in self._chunks():
                    jacobian = self._jacobian(cells, table)
                    part = _Facets(cells, table, np.empty(0))
                    at = self._positions(part)
                    force = np.stack([self._values(value, part, at) for value in values], axis=2)
                    force *= (weight * np.abs(adjugates(jacobian)[1]))[:, :, None]
                    np.add.at(total, self._nodes[cells], factor * (table.shape.T @ force))
        return self.over_ranks(total) + compiled

    @property
    def averaging(self) -> bool:
        """Whether contact averages over nodes: on quadratic tetrahedra."""
        return self._hats is not None

    def moments(self, boundary: str) -> Array:
        """Outward normal times the area (in the plane: length) of each node of a boundary, the integral
        of its basis function, shape (owned nodes, d).
        """
        total, degree = self._zero(), self.scene.element.degree
        rule = basix.make_quadrature(self._facet, forms.lumped_degree(degree, self._geometry.degree))
        if self.dimension == 2:  # the nodal rule, which has the same integrals
            places, weights = {
                1: ([0.0, 1.0], [0.5, 0.5]),  # trapezoidal rule
                2: ([0.0, 1.0, 0.5], [1 / 6, 1 / 6, 2 / 3]),  # Simpson's rule
            }[degree]
            rule = np.array(places)[:, None], np.array(weights)
        for facets in self._facets(boundary, *rule):
            np.add.at(total, self._nodes[facets.cells], _clean(facets.table.test).T @ facets.moment)
        return self.over_ranks(total)

    def products(self, boundary: str) -> Any:
        """Integrals of test times shape functions over the facets of this rank, scipy sparse, shape (nodes, nodes)."""
        rule = basix.make_quadrature(self._facet, forms.lumped_degree(self.scene.element.degree, self._geometry.degree))
        size = len(self._zero())
        found = sp.csr_array((size, size))
        for facets in self._facets(boundary, *rule):
            test, shape = _clean(facets.table.test), _clean(facets.table.shape)
            area = np.linalg.norm(facets.moment, axis=2)
            values = np.einsum("qi,cq,qj->cij", test, area, shape)
            nodes = self._nodes[facets.cells]
            rows, columns = (np.broadcast_to(own, values.shape) for own in (nodes[:, :, None], nodes[:, None]))
            there = values != 0
            found += sp.csr_array((values[there], (rows[there], columns[there])), shape=(size, size))
        return found

    def with_ghosts(self, values: Array) -> Array:
        """Values at the owned nodes, shape (owned nodes, d), with those of the ghosts, shape (nodes, d)."""
        function = fem.Function(self.space)
        function.x.array[: values.size] = values.ravel()
        function.x.scatter_forward()
        return np.array(function.x.array.reshape(-1, self.dimension))

    def over_ranks(self, values: Array) -> Array:
        """What all ranks contribute to the nodes of this one, from shape (nodes, d) to (owned nodes, d)."""
        function = fem.Function(self.space)
        function.x.array[:] = values.ravel()
        function.x.scatter_reverse(la.InsertMode.add)
        return np.array(function.x.array.reshape(-1, self.dimension)[: self.owned])

    # --- how ---------------------------------------------------------------------------------------------------------

    def _zero(self) -> Array:
        index_map = self.space.dofmap.index_map
        return np.zeros((index_map.size_local + index_map.num_ghosts, self.dimension))

    def _chunks(self) -> Iterator[Indices]:
        for first in range(0, self._own_cells, _CHUNK):
            yield np.arange(first, min(first + _CHUNK, self._own_cells), dtype=np.int32)

    def _moduli(self) -> tuple[Array, Array]:
        """(a, b) of Hooke's law, of all cells alike or cell by cell."""
        materials = self.scene.material
        if len(materials) == 1:
            a, b = hooke(materials[0])
            return np.array([a]), np.array([b])
        moduli = np.full((2, len(self._corners)), np.nan)
        for material in materials:
            assert material.region is not None
            moduli[:, self.tagged.cells(material.region)] = np.array(hooke(material))[:, None]
        return moduli[0], moduli[1]

    def _table(self, points: Array) -> _Table:
        shape, geometry = (element.tabulate(1, points)[..., 0] for element in (self._shapes, self._geometry))
        test = shape[0]
        if self._hats is not None:
            hats = self._hats.tabulate(0, points)[0, ..., 0]  # vertices come first
            test = np.pad(hats, ((0, 0), (0, test.shape[1] - hats.shape[1])))
        return _Table(shape[0], shape[1:], geometry[0], geometry[1:], test)

    def _jacobian(self, cells: Indices, table: _Table) -> Array:
        """dx_i / dX_k at the points, shape (d (i), d (k), cells, q)."""
        x = self._x[self._corners[cells]]
        return np.array([[x[:, :, i] @ stretch.T for stretch in table.stretch] for i in range(self.dimension)])

    def _stress_work(self, u: Array, degree: int, a: Array, b: Array) -> Array:
        """(a epsilon(y) + b tr(epsilon(y)) I, epsilon(z)) by quadrature of ``degree``, on this rank alone."""
        points, weight = basix.make_quadrature(self._cell, degree)
        table, total, axes = self._table(points), self._zero(), range(self.dimension)
        for cells in self._chunks():
            first, second = (m[:, None] if m.size == 1 else m[cells, None] for m in (a, b))
            inverse, determinant = adjugates(self._jacobian(cells, table))
            inverse /= determinant  # dX_k / dx_j
            nodal = u[self._nodes[cells]]
            reference = np.array([[nodal[:, :, i] @ slope.T for slope in table.slope] for i in axes])
            gradient = np.einsum("ikcq,kjcq->ijcq", reference, inverse)
            stress = first * (gradient + gradient.swapaxes(0, 1)) / 2
            mean = second * np.einsum("iicq->cq", gradient)
            for i in axes:
                stress[i, i] += mean
            flux = weight * np.abs(determinant) * np.einsum("ijcq,kjcq->ikcq", stress, inverse)
            forces = np.zeros_like(nodal)
            for i in axes:
                for k in axes:
                    forces[:, :, i] += flux[i, k] @ table.slope[k]
            for i in axes:
                total[:, i] += np.bincount(self._nodes[cells].ravel(), forces[:, :, i].ravel(), minlength=len(total))
        return total

    def _facets(self, boundary: str, places: Array, weight: Array) -> Iterator[_Facets]:
        """The facets of a boundary with points at ``places`` of the reference facet, shape (q, d - 1)."""
        entities = facet_entities(self.tagged.mesh, self.tagged.facets(boundary))
        vertices = basix.geometry(self._cell)
        for side, corner in enumerate(basix.topology(self._cell)[self.dimension - 1]):
            cells = entities[entities[:, 1] == side, 0]
            if cells.size == 0:
                continue
            start, *ends = vertices[corner[: self.dimension]]
            along = np.array(ends) - start
            table = self._table(start + places @ along)
            across = np.array([along[0, 1], -along[0, 0]]) if self.dimension == 2 else np.cross(*along)
            across *= np.sign(across @ (start - vertices.mean(axis=0)))
            # Where the facet is warped, the middle of a cell may be on its outer side: the reference cell tells.
            adjugate, determinant = adjugates(self._jacobian(cells, table))
            normal = np.sign(determinant)[:, :, None] * np.einsum("kicq,k->cqi", adjugate, across)
            yield _Facets(cells, table, weight[:, None] * normal)

    def _positions(self, part: _Facets) -> Array:
        return part.table.place @ self._x[self._corners[part.cells]]

    def _values(self, value: Any, part: _Facets, at: Array) -> Array:
        """A load at points: a number, an expression, or a callable, which the discretisation interpolates at nodes."""
        if isinstance(value, float | Expression):
            return sample(value, in_space(at.reshape(-1, self.dimension))).reshape(at.shape[:2])
        nodes = self._nodes[part.cells]
        x = self.space.tabulate_dof_coordinates()[nodes.ravel(), : self.dimension]
        return sample(value, in_space(x)).reshape(nodes.shape) @ part.table.shape.T

    def _compiled(self, load: Any) -> Array:
        """A load with UFL expressions, by its own form."""
        import ufl

        facets = {} if not isinstance(load, SurfaceTraction) else {load.boundary: self.tagged.facets(load.boundary)}
        _, form = compile_loads([load], self.space, ufl.TestFunction(self.space), facets, Inventory())
        assert form is not None
        return assemble(form).reshape(-1, self.dimension)


def _clean(functions: Array) -> Array:
    """Without the round-off of those that are zero."""
    return np.where(np.abs(functions) < _ROUND_OFF, 0.0, functions)
