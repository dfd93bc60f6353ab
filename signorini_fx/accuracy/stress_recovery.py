"""Error estimates of a discrete solution in the energy norm, by stress recovery."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import compress
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx import mesh as dmesh
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.body.assembly import assemble, measure
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.element_stress import ElementStress
from signorini_fx.body.loads import FormCoefficients
from signorini_fx.scene.effect import Effect
from signorini_fx.scene.load_steps import factor_at
from signorini_fx.tuned import BOUNDARY_RESIDUAL_SHARE

_PROJECTION_TOLERANCE = 1e-6
# Tractions that vary may jump within a facet: they are evaluated at this many more points.
_FINE_DEGREE = 20


class StressRecovery:
    """An estimate of the discretisation error; compiled and assembled once, evaluated often.

    Inside the body it is that of Zienkiewicz and Zhu: the stress is projected onto the functions of degree 1 that are
    continuous in each material, and its difference to the discontinuous stress is measured with the compliance.
    Functions of degree 2 would be so close to the stress of quadratic elements that half of the error were not
    detected. On the boundary the projection can follow the stress, so that it detects nothing in a cell that is alone
    at a corner: there the residual of the known traction is added.
    """

    def __init__(self, discretisation: Discretisation) -> None:
        d = discretisation
        self._comm, self._inventory = d.tagged.mesh.comm, d.inventory
        self._displacement = fem.Function(d.space)
        self._components = d.tagged.dimension * (d.tagged.dimension + 1) // 2
        space = fem.functionspace(d.tagged.mesh, ("Lagrange", 1, (self._components,)))
        self._recovered = fem.Function(space)
        cellwise = ufl.TestFunction(fem.functionspace(d.tagged.mesh, ("DG", 0)))
        self._stress = ElementStress(d, self._displacement)
        sigma = self._stress.sigma
        raw = voigt(sigma)
        density = compliance(self._recovered - raw, *d.lame) * cellwise
        # The components share one matrix: dolfinx numbers the nodes of both spaces in the same way.
        scalar = fem.functionspace(d.tagged.mesh, ("Lagrange", 1))
        assert np.array_equal(scalar.dofmap.list, space.dofmap.list)
        product = ufl.inner(ufl.TrialFunction(scalar), ufl.TestFunction(scalar))
        weight = fem.Function(cellwise.ufl_function_space())  # 1 in one material, 0 in the others
        compiled = d.inventory.compile
        moment = ufl.inner(raw, ufl.TestFunction(space))
        self._weight = weight
        self._moments = compiled("stress moments", lambda: fem.form(weight * moment * ufl.dx))
        self._squares = compiled("stress recovery error", lambda: fem.form(weight * density * ufl.dx))
        mass = compiled("stress mass", lambda: fem.form(weight * product * ufl.dx))
        self._parts = [(cells, self._projection(mass, cells)) for cells in _materials(d)]
        self._factors, residual = _boundary_residual(d, self._displacement, sigma, cellwise)
        self._residual = None if residual is None else compiled("boundary residual", lambda: fem.form(residual))

    def _choose(self, cells: npt.NDArray[np.int32]) -> None:
        """Restrict the forms to these cells (local numbers, ghosts included)."""
        self._weight.x.array[:] = 0.0
        self._weight.x.array[self._weight.function_space.dofmap.list[cells, 0]] = 1.0

    def _projection(self, form: fem.Form, cells: npt.NDArray[np.int32]) -> PETSc.KSP:
        """The solver of the projection on these cells."""
        self._choose(cells)
        mass = fem_petsc.assemble_matrix(form)
        mass.assemble()
        diagonal = mass.getDiagonal()
        diagonal.getArray()[:] = np.where(diagonal.getArray(readonly=True) == 0.0, 1.0, 0.0)
        mass.setDiagonal(diagonal, addv=PETSc.InsertMode.ADD)  # nodes of other materials
        self._inventory.matrices.append("stress mass")
        ksp = PETSc.KSP().create(self._comm)
        ksp.setOperators(mass)
        ksp.setType(PETSc.KSP.Type.CG)
        ksp.getPC().setType(PETSc.PC.Type.JACOBI)
        ksp.setTolerances(rtol=_PROJECTION_TOLERANCE)
        return ksp

    def error(self, dofs: npt.NDArray[np.float64]) -> float:
        """Energy norm sqrt(a(e, e)) of the discretisation error of a displacement, see ``squares``; collective."""
        return float(np.sqrt(parallel.global_sum(self._comm, self.squares(dofs).sum())))

    def squares(self, dofs: npt.NDArray[np.float64], step: float = 0) -> npt.NDArray[np.float64]:
        """Its square for each owned cell, shape (cells,); collective.

        Args:
            dofs: those of the displacement, the owned ones first.
            step: the load step that they belong to.
        """
        self._fill(dofs)
        total = sum(self._projected(*part) for part in self._parts)
        if self._residual is not None:
            for constant, factors in self._factors:
                constant.value = factor_at(factors, step)
            total = total + assemble(self._residual)
        return np.maximum(total, 0.0)

    def smoothed(self, dofs: npt.NDArray[np.float64]) -> list[tuple[npt.NDArray[np.int32], npt.NDArray[np.float64]]]:
        """The projected stress of a displacement in each material, see ``squares``; collective.

        Returns:
            The cells (local numbers, ghosts included), shape (m,), and at their vertices the stress as ``voigt`` has
            it, shape (m, vertices, components).
        """
        self._fill(dofs)
        space, found = self._recovered.function_space, []
        for cells, ksp in self._parts:
            self._project(cells, ksp)
            found.append((cells, self._recovered.x.array.reshape(-1, self._components)[space.dofmap.list[cells]]))
        return found

    def _fill(self, dofs: npt.NDArray[np.float64]) -> None:
        space = self._displacement.function_space
        owned = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
        self._displacement.x.array[:owned] = dofs[:owned]
        self._displacement.x.scatter_forward()
        self._stress.refresh()

    def _projected(self, cells: npt.NDArray[np.int32], ksp: PETSc.KSP) -> npt.NDArray[np.float64]:
        """The estimate of the projection in one material for each owned cell."""
        self._project(cells, ksp)
        return assemble(self._squares)

    def _project(self, cells: npt.NDArray[np.int32], ksp: PETSc.KSP) -> None:
        """Project the stress in one material, to which the forms are then restricted."""
        self._choose(cells)
        moment, component = ksp.getOperators()[0].createVecs()
        values = assemble(self._moments)
        for k in range(self._components):
            moment.getArray()[:] = values[k :: self._components]
            ksp.solve(moment, component)
            self._recovered.x.array[k : values.size : self._components] = component.getArray(readonly=True)
        self._recovered.x.scatter_forward()


def _materials(d: Discretisation) -> list[npt.NDArray[np.int32]]:
    """The cells of each material, ghosts included."""
    index_map = d.tagged.mesh.topology.index_map(d.tagged.dimension)
    if len(d.scene.material) == 1:
        return [np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)]
    return [d.tagged.cells(str(material.region)) for material in d.scene.material]


def _boundary_residual(d: Discretisation, y: Any, sigma: Any, z: Any) -> tuple[list[tuple[Any, Any]], Any]:
    """The squared residual of the traction, times h over the stiffness, of each cell.

    Only where the traction is known: not in contact, and for prescribed displacements only in free components.  In the
        other components the displacement may differ between the nodes: its square, times the stiffness over h.

    Returns:
        Constants with their values for each load step, and the form; None where there is no such boundary.
    """
    scene, mesh = d.scene, d.tagged.mesh
    n = ufl.FacetNormal(mesh)
    every = dmesh.exterior_facet_indices(mesh.topology)
    known = np.setdiff1d(every, np.concatenate([d.tagged.facets(e.boundary) for e in scene.contact] or [every[:0]]))
    # Facets with the same effects share a term.
    effects = [effect for _, effect in scene.listed() if effect.where is not None]
    on = np.ones((known.size, len(effects) + 1), dtype=bool)  # one column more, so that no row is empty
    for k, effect in enumerate(effects):
        on[:, k] = np.isin(known, d.tagged.facets(effect.where))
    kinds = np.unique(parallel.gather_rows(mesh.comm, np.unique(on, axis=0)), axis=0)
    size = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    index_map = mesh.topology.index_map(d.tagged.dimension)
    count = index_map.size_local + index_map.num_ghosts
    stiffness = d.lame[0] + 2 * d.lame[1]
    size.x.array[:] = mesh.h(d.tagged.dimension, np.arange(count, dtype=np.int32)) if count else 0.0
    factors = [(fem.Constant(mesh, default_scalar_type(1.0)), scene.factors_of(effect)) for effect in effects]
    on_boundary = FormCoefficients(d.space)
    ds = measure(mesh, [known[(on == kind).all(axis=1)] for kind in kinds], {})
    terms = []
    for number, kind in enumerate(kinds, start=1):
        residual, away = -sigma * n, []
        here = [(effects[k], factors[k][0]) for k in np.flatnonzero(kind[:-1])]
        for effect, factor in here:
            residual = residual + effect.traction(y, factor, on_boundary)
        for effect, factor in here:
            residual = effect.free(residual, on_boundary)
            away += effect.away(y, factor, on_boundary)
        density = BOUNDARY_RESIDUAL_SHARE * size / stiffness * ufl.inner(residual, residual)
        density += sum((stiffness / size * distance**2 for distance in away), 0 * size)
        if isinstance(density, ufl.constantvalue.Zero):  # all components are prescribed, by numbers
            continue
        terms.append(density * z * ds(number, metadata={"quadrature_degree": _degree(d, compress(effects, kind))}))
    return factors, sum(terms[1:], terms[0]) if terms else None


def _degree(d: Discretisation, effects: Iterable[Effect]) -> int:
    """Quadrature degree on facets with these effects."""
    return _FINE_DEGREE if any(effect.varies for effect in effects) else 2 * d.scene.element.degree


def compliance(tau: Any, lame: Any, mu: Any) -> Any:
    """C^-1 tau : tau for a stress tau as ``voigt`` has it."""
    dim = 2 if len(tau) == 3 else 3
    trace = sum((tau[k] for k in range(1, dim)), tau[0])
    square = sum((tau[k] ** 2 for k in range(1, dim)), tau[0] ** 2)
    shear = sum((2 * tau[k] ** 2 for k in range(dim + 1, len(tau))), 2 * tau[dim] ** 2)
    return (square + shear - lame / (dim * lame + 2 * mu) * trace**2) / (2 * mu)


def voigt(sigma: Any) -> Any:
    """The components of a symmetric tensor: xx, yy, xy in the plane, xx, yy, zz, xy, xz, yz in space."""
    dim = sigma.ufl_shape[0]
    return ufl.as_vector(
        [*(sigma[k, k] for k in range(dim)), *(sigma[i, k] for i in range(dim) for k in range(i + 1, dim))]
    )
