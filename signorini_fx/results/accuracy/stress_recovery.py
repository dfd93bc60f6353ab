"""Error estimates of a discrete solution in the energy norm, by stress recovery."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx.algebra.linalg import petsc_options
from signorini_fx.arrays import Array, Flags, Indices, Ints
from signorini_fx.machine import parallel
from signorini_fx.machine.compat import shared_cells
from signorini_fx.mechanics.assembly.mesh_entities import (
    assemble,
    compile_form,
    measure,
    parallelepipeds,
)
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.elasticity.elastic_law import ElementStress, fields_of
from signorini_fx.mechanics.loads.initial_strains import given_strains
from signorini_fx.mechanics.loads.load_vectors import FormCoefficients
from signorini_fx.mechanics.mesh.tagged import outer_facets
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import ForceDensity, Resistance
from signorini_fx.tuned import BOUNDARY_RESIDUAL_SHARE, ROOT_OF_EPS

if TYPE_CHECKING:
    from ufl.core.expr import Expr

# Tractions that vary may jump within a facet: they are evaluated at this many more points.
_FINE_DEGREE = 20


class StressRecovery:
    """An estimate of the discretisation error; compiled once, evaluated often.

    Inside the body it is that of Zienkiewicz and Zhu: the stress is projected onto the functions of
    degree 1 that are continuous in each material, and its difference to the discontinuous stress is
    measured with the compliance. Functions of degree 2 would be so close to the stress of quadratic
    elements that half of the error were not detected. On the boundary the projection can follow the
    stress, so that it detects nothing in a cell that is alone at a corner: there the residual of
    the known traction is added.
    """

    def __init__(
        self,
        stress: Any,
        residual: Callable[[Expr], tuple[Callable[[float], None], ufl.Form | None]],
        degree: int | None = None,
    ) -> None:
        """Compile the forms of the estimate; collective.

        Args:
            stress: an ``ElementStress`` with its own displacement, or an object with displacement,
                components, parts, ``squared`` and ``refresh``.
            residual: a function from a test function that is constant in each cell to the result of
                ``boundary_residual``.
            degree: degree of an exact quadrature in the cells; None for the estimate of UFL.
        """
        self._stress = stress
        self._displacement = stress.displacement
        mesh = self._displacement.function_space.mesh
        raw = stress.components
        self._comm = mesh.comm
        self._components = len(raw)
        space = fem.functionspace(mesh, ("Lagrange", 1, (self._components,)))
        self._recovered = fem.Function(space)
        cellwise = ufl.TestFunction(fem.functionspace(mesh, ("DG", 0)))
        # The components share one matrix: dolfinx numbers the nodes of both spaces in the same way.
        scalar = fem.functionspace(mesh, ("Lagrange", 1))
        assert np.array_equal(scalar.dofmap.list, space.dofmap.list)
        product = ufl.inner(ufl.TrialFunction(scalar), ufl.TestFunction(scalar))
        weight = fem.Function(cellwise.ufl_function_space())  # 1 in one material, 0 in the others
        moment = ufl.inner(raw, ufl.TestFunction(space))
        self._weight = weight
        dx = ufl.dx if degree is None else ufl.dx(metadata={"quadrature_degree": degree})
        self._moments = compile_form(weight * moment * dx)
        self._squares = compile_form(stress.squared(self._recovered - raw, weight * cellwise, dx))
        self._mass = compile_form(weight * product * dx)
        self._parts = stress.parts
        self._move_to, unbalanced = residual(cellwise)
        self._residual = None if unbalanced is None else compile_form(unbalanced)
        # The last displacement and place, and its projected stress in each material.
        self._last: tuple[Array, float] | None = None
        self._projected = list[Array]()

    @classmethod
    @shared_cells()
    def of(cls, model: Model) -> StressRecovery:
        """Return the recovery of the stress of a scene."""
        stress = element_stress(model, model.scene_law.displacement())
        # Without the radius, and expressions in the stress, all is a product of two polynomials
        # like the strain.
        strained = any(effect.gives_strain for _, effect in model.statement.listed())
        plain = model.kinematics.uniform and not strained and not model.scene_law.pressed
        degree = model.scene_law.degree if plain and parallelepipeds(model.tagged.mesh) else None
        return cls(stress, partial(boundary_residual, model, stress), degree)

    def _choose(self, cells: Indices) -> None:
        """Restrict the forms to these cells (local numbers, ghosts included)."""
        self._weight.x.array[:] = 0.0
        self._weight.x.array[self._weight.function_space.dofmap.list[cells, 0]] = 1.0

    def _projection(self) -> PETSc.KSP:
        """Return the solver of the projection on the chosen cells, made anew each time to save
        memory; collective.
        """
        mass = fem_petsc.assemble_matrix(self._mass)
        mass.assemble()
        diagonal = mass.getDiagonal()
        diagonal.getArray()[:] = np.where(diagonal.getArray(readonly=True) == 0.0, 1.0, 0.0)
        mass.setDiagonal(diagonal, addv=PETSc.InsertMode.ADD)  # nodes of other materials
        ksp = PETSc.KSP().create(self._comm)
        ksp.setOperators(mass)
        ksp.setType(PETSc.KSP.Type.CG)
        ksp.setTolerances(rtol=ROOT_OF_EPS)
        # On a grid this is the factor itself where nodes are numbered along its lines; elsewhere it
        # saves most steps.
        ksp.setOptionsPrefix(f"{petsc_options.PREFIX}mass_")
        ksp.getPC().setType(PETSc.PC.Type.BJACOBI)
        with petsc_options.defaults({"mass_sub_pc_type": "icc"}):
            ksp.setFromOptions()
            ksp.setUp()
        return ksp

    def energy(self, y: fem.Function) -> float:
        """Return the strain energy of the stress of a displacement; collective."""
        self._fill(y, 0)
        self._recovered.x.array[:] = 0.0
        local_energy = 0.0
        for cells in self._parts:
            self._choose(cells)
            local_energy += assemble(self._squares).sum() / 2
        return parallel.total(self._comm, local_energy)

    def error(self, y: fem.Function, step: float = 0) -> float:
        """Return the energy norm sqrt(a(e, e)) of the discretisation error of a displacement, see
        ``squares``; collective.
        """
        return float(np.sqrt(parallel.global_sum(self._comm, self.squares(y, step).sum())))

    def squares(self, y: fem.Function, step: float = 0) -> Array:
        """Return the squared error of each owned cell, shape (cells,); collective."""
        total: Array = np.zeros(1)
        for cells, projected in zip(self._parts, self._of_all_parts(y, step), strict=True):
            self._choose(cells)
            self._recovered.x.array[:] = projected
            total = total + assemble(self._squares)
        if self._residual is not None:
            self._move_to(step)
            total = total + assemble(self._residual)
        return np.maximum(total, 0.0)

    def products(
        self, y: fem.Function, others: Sequence[fem.Function], step: float = 0
    ) -> list[Array]:
        """Return a(e_y, e_z) in each owned cell, where e_y and e_z are the errors of a displacement
        y and of each other displacement z, shape (cells,) each; collective.

        The squared errors of y + z and y - z differ by four times that.
        """
        sizes = [parallel.largest(self._comm, np.abs(one.x.array)) for one in (y, *others)]
        steps = [sizes[0] / size if min(size, sizes[0]) > 0 else 1.0 for size in sizes[1:]]
        found: list[Array] = [np.zeros(1) for _ in others]
        moved_y = fem.Function(y.function_space)

        def moved(number: int, sign: float) -> None:
            moved_y.x.array[:] = y.x.array + sign * steps[number] * others[number].x.array
            self._fill(moved_y, step)

        for cells, kept in zip(self._parts, self._of_all_parts(y, step), strict=True):
            self._choose(cells)
            ksp = self._projection()
            for number in range(len(others)):
                moved(number, 1.0)
                self._project(ksp)
                more = assemble(self._squares)
                moved(number, -1.0)
                self._recovered.x.array[:] = 2 * kept - self._recovered.x.array
                found[number] = found[number] + more - assemble(self._squares)
        if self._residual is not None:
            self._move_to(step)
            for number in range(len(others)):
                for sign in (1.0, -1.0):
                    moved(number, sign)
                    found[number] = found[number] + sign * assemble(self._residual)
        return [
            np.asarray(products / (4 * share), dtype=np.float64)
            for products, share in zip(found, steps, strict=True)
        ]

    def smoothed(self, y: fem.Function, step: float = 0) -> list[tuple[Indices, Array]]:
        """Return the projected stress of a displacement in each material; collective.

        Each entry has the local numbers of the cells, ghosts included, shape (m,), and
        ``ElementStress.components`` at their vertices, shape (m, vertices, components).
        """
        nodes = self._recovered.function_space.dofmap.list
        return [
            (cells, projected.reshape(-1, self._components)[nodes[cells]])
            for cells, projected in zip(self._parts, self._of_all_parts(y, step), strict=True)
        ]

    def _of_all_parts(self, y: fem.Function, step: float) -> list[Array]:
        """Return the projected stress of a displacement in each material, at all unknowns of the
        projection; the last result is cached; collective.
        """
        self._fill(y, step)
        now = np.concatenate([one.x.array for one in fields_of(self._displacement)])
        last, place = self._last or (None, step)
        same = last is not None and place == step and np.array_equal(last, now)
        if parallel.any_rank(self._comm, not same):
            self._last = now, step
            self._projected = []
            for cells in self._parts:
                self._choose(cells)
                self._project(self._projection())
                self._projected.append(self._recovered.x.array.copy())
        return self._projected

    def _fill(self, y: fem.Function, step: float) -> None:
        for function, given in zip(fields_of(self._displacement), fields_of(y), strict=True):
            function.x.array[:] = given.x.array
        self._displacement.x.scatter_forward()
        self._stress.refresh(step)

    def _project(self, ksp: PETSc.KSP) -> None:
        """Project the stress on the chosen cells."""
        moment, component = ksp.getOperators()[0].createVecs()
        values = assemble(self._moments)
        for k in range(self._components):
            moment.getArray()[:] = values[k :: self._components]
            ksp.solve(moment, component)
            self._recovered.x.array[k : values.size : self._components] = component.getArray(
                readonly=True
            )
        self._recovered.x.scatter_forward()


def boundary_residual(
    model: Model, stress: ElementStress, z: Expr
) -> tuple[Callable[[float], None], ufl.Form | None]:
    """Return a function that moves the loads of a scene to a step, and the form
    ``squared_residual`` where the traction is known.

    The traction is known outside contact, and under supports only in free components.  In
    prescribed components the displacement may differ from the prescribed one between the nodes: the
    square of the difference, times the stiffness over h, is added.
    """
    statement = model.statement
    mesh = model.tagged.mesh
    y = stress.displacement
    exterior_facets = outer_facets(mesh)
    touching = [
        name for e in model.contacts for name in (e.boundary, e.against) if name is not None
    ]
    traction_facets = np.setdiff1d(
        exterior_facets,
        np.concatenate([exterior_facets[:0], *(model.tagged.facets(name) for name in touching)]),
    )
    listed = (effect for _, effect in statement.listed() if effect.where is not None)
    effects = [one for one in listed if not isinstance(one, Displacement) or one in model.held]
    on = np.array(
        [np.isin(traction_facets, model.tagged.facets(effect.where)) for effect in effects],
        dtype=bool,
    )
    factors = [fem.Constant(mesh, default_scalar_type(1.0)) for _ in effects]
    on_boundary = model.coefficients
    assert on_boundary is not None

    def move_to(step: float) -> None:
        on_boundary.move_to(step)
        for constant, effect in zip(factors, effects, strict=True):
            constant.value, _ = statement.now(effect, step)

    def of(numbers: Ints, traction: Expr) -> tuple[Expr, list[Expr], bool]:
        residual = traction
        away = []
        acting = [(effects[k], factors[k]) for k in numbers]
        for effect, factor in acting:
            if isinstance(effect, ForceDensity):
                residual = residual + factor * effect.density(on_boundary)
            elif isinstance(effect, Resistance):
                residual = residual - effect.reaction(y, on_boundary)
        for effect, factor in acting:
            if isinstance(effect, Displacement):
                residual = _free(effect, residual, on_boundary)
                away += _away(effect, y, factor, on_boundary)
        return residual, away, any(effect.varies for effect, _ in acting)

    return move_to, squared_residual(
        stress, traction_facets, on.reshape(len(effects), traction_facets.size).T, of, z
    )


def _free(effect: Displacement, vector: Expr, on: FormCoefficients) -> Expr:
    """Return a vector without the components in which the displacement is prescribed, UFL, shape
    (d,).
    """
    if effect.normal is not None:
        return vector - ufl.inner(vector, on.normal) * on.normal
    free = [component is None for component in effect.components]
    return ufl.as_vector([vector[k] if free[k] else 0.0 for k in range(len(vector))])


def _away(effect: Displacement, y: Expr, factor: Expr, on: FormCoefficients) -> list[Expr]:
    """Return the differences between prescribed expressions and the displacement, which appear
    between the nodes, lengths, UFL.
    """
    pairs = [*zip(effect.components, y, strict=False), (effect.normal, ufl.inner(y, on.normal))]
    given = [
        (value, component)
        for value, component in pairs
        if value is not None and not isinstance(value, float)
    ]
    return [factor * on.value(value) - component for value, component in given]


def squared_residual(
    stress: ElementStress,
    facets: Indices,
    on: Flags,
    of: Callable[[Ints, Expr], tuple[Expr, list[Expr], bool]],
    z: Expr,
) -> ufl.Form | None:
    """Return the form of the squared residual of the traction, times h over the stiffness, for each
    cell; None without terms; collective.

    Args:
        stress: the stress.
        facets: the facets where the traction is known.
        on: which of k effects act on each facet, shape (facets, k).
        of: a function from the numbers of the acting effects, and minus the traction of the stress,
            to the residual traction, the differences from prescribed displacements, and whether any
            of these varies within a facet.
        z: test function, constant in each cell.
    """
    space = stress.displacement.function_space
    mesh = space.mesh
    degree = space.element.basix_element.degree
    size = fem.Function(z.ufl_function_space())  # h of each cell
    if size.x.array.size:
        size.x.array[:] = mesh.h(mesh.topology.dim, np.arange(size.x.array.size, dtype=np.int32))
    # Facets on which the same acts share a term; one column more, so that no row is empty.
    on = np.column_stack((on, np.ones(facets.size, dtype=bool)))
    kinds = np.unique(parallel.gather_rows(mesh.comm, np.unique(on, axis=0)), axis=0)
    ds = measure(mesh, [facets[(on == kind).all(axis=1)] for kind in kinds], {})
    terms = []
    assert stress.modulus is not None  # of a linear body
    for number, kind in enumerate(kinds, start=1):
        residual, away, varies = of(
            np.flatnonzero(kind[:-1]), -stress.sigma * ufl.FacetNormal(mesh)
        )
        density = BOUNDARY_RESIDUAL_SHARE * size / stress.modulus * ufl.inner(residual, residual)
        density += sum((stress.modulus / size * distance**2 for distance in away), 0 * size)
        if isinstance(density, ufl.constantvalue.Zero):  # all components are prescribed, by numbers
            continue
        terms.append(
            density
            * stress.around
            * z
            * ds(number, metadata={"quadrature_degree": _FINE_DEGREE if varies else 2 * degree})
        )
    return sum(terms[1:], terms[0]) if terms else None


def element_stress(body: Model, displacement: fem.Function, step: float = 0.0) -> ElementStress:
    """Return the stress of a scene with the initial strains of a step; collective."""
    initial, jump, move = given_strains(body.statement, body.tagged, body.space)
    of_law = body.scene_law.stress(
        displacement, displacement if jump is None else displacement + jump, initial
    )
    parts = [body.tagged.cells(material.region) for material in body.materials]
    stress = replace(of_law, parts=parts, move=move)
    stress.refresh(step)
    return stress
