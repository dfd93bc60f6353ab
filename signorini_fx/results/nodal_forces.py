"""Nodal forces, weights and normals by quadrature in NumPy, without any compiled form.

The certificate is based on this module.  It uses no UFL forms, FFCx kernels, assembled matrices or vectors,
condensation, or contact boundary of the solver.  Both sides share the mesh with its named
boundaries, the tables of shape functions (basix), the values of the scene's expressions, and the quadrature degrees,
which are part of the discrete problem.  Loads that are given as UFL expressions in Python are the exception:
only a compiled form can integrate them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx import parallel
from signorini_fx.body import forms
from signorini_fx.body.assembly import adjugates, assemble
from signorini_fx.body.discretisation import reduced_degree
from signorini_fx.body.loads import compile_loads, load_degree, stresses, traction_degree
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.records import Inventory
from signorini_fx.results.surface_quadrature import Facets, SurfaceQuadrature
from signorini_fx.scene.expressions import Expression, in_space, sample
from signorini_fx.scene.load_steps import factor_at
from signorini_fx.scene.model import LinearElastic, PrescribedDisplacement, Scene, SurfaceTraction

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]

# Cells processed at a time: few enough for the caches, and enough to make the overhead of the loop negligible.
_CHUNK = 4096


def hooke(material: LinearElastic) -> tuple[float, float]:
    """(a, b) of Hooke's law sigma = a epsilon + b tr(epsilon) I, stresses."""
    a = material.young / (1 + material.poisson)
    squeezed = 1 - 2 * material.poisson if material.hypothesis == "plane strain" else 1 - material.poisson
    return a, a * material.poisson / squeezed


class NodalForces(SurfaceQuadrature):
    """Forces on the nodes of a Lagrange space, from a scene and its mesh alone; all methods are collective.

    Args:
        scene: the scene.
        tagged: its mesh.
        space: the vector Lagrange space of the displacement.
    """

    def __init__(self, scene: Scene, tagged: TaggedMesh, space: fem.FunctionSpace) -> None:
        super().__init__(space)
        self.scene = scene
        self.tagged = tagged
        self._own_cells = int(space.mesh.topology.index_map(self.dimension).size_local)

    def facets(self, boundary: str) -> Indices:
        """Those of a boundary of the mesh, by its name."""
        return self.tagged.facets(boundary)

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
                    part = Facets(cells, table, np.empty(0))
                    at = self._positions(part)
                    force = np.stack([self._values(value, part, at) for value in values], axis=2)
                    force *= (weight * np.abs(adjugates(jacobian)[1]))[:, :, None]
                    np.add.at(total, self._nodes[cells], factor * (table.shape.T @ force))
        return self.over_ranks(total) + compiled

    # --- how ---------------------------------------------------------------------------------------------------------

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

    def _positions(self, part: Facets) -> Array:
        return part.table.place @ self._x[self._corners[part.cells]]

    def _values(self, value: Any, part: Facets, at: Array) -> Array:
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
