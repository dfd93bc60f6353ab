"""The pressure of a mixed element: a field of degree 1 that is a further unknown.

It is continuous within each material: with several materials it has one component for each, which
is used in the cells of this material alone.  The unknowns (y, p) of the body have

    K = [A B^T; B -C],   b = [f; -B y_D - s],

symmetric and indefinite, with C = 0 for nu = 1/2, prescribed displacements y_D, and the term s of
initial strains.  The unknowns of the pressure are scaled by Young's modulus over the spacing of the
nodes, so that all blocks have entries of one size: a factorisation without scaling needs that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem, la
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx.algebra.linalg.factorisation import has_package
from signorini_fx.algebra.linalg.rigid_unknowns import embedding
from signorini_fx.arrays import Array, Expr, Flags, Indices
from signorini_fx.errors import needs_fenicsx
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import assemble, compile_form
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.elasticity.elastic_law import (
    ElementStress,
    SceneLaw,
    compliance,
    fields_of,
)
from signorini_fx.mechanics.elasticity.moduli import Coefficient, of_materials
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.materials.protocol import Material
from signorini_fx.mechanics.scales import Scales
from signorini_fx.tuned import NOTHING_LEFT


class MixedDisplacement(fem.Function):
    """The displacement of a mixed element, together with its pressure.

    Attributes:
        hydrostatic: p = -lambda tr(epsilon), for nu = 1/2 minus the mean stress; a stress, positive
            in compression; discontinuous between cells if there are several materials.  With
            initial strains see ``MixedLaw.strain_terms``.
    """

    def __init__(self, space: fem.FunctionSpace, hydrostatic: fem.Function) -> None:
        super().__init__(space, name="displacement")
        self.hydrostatic = hydrostatic


@dataclass(frozen=True)
class MixedLaw(SceneLaw):
    """The law sigma = 2 mu epsilon - p I with the pressure p as an unknown.

    In plane strain -p is the stress across the plane as well.
    """

    pressed = True

    @cached_property
    def own(self) -> fem.FunctionSpace:
        """The space of the pressure, with m unknowns at each vertex for m materials."""
        element = ("Lagrange", 1, (self._materials,)) if self._materials > 1 else ("Lagrange", 1)
        return fem.functionspace(self.tagged.mesh, element)

    @property
    def _materials(self) -> int:
        return len(self.statement.material)

    @cached_property
    def _part(self) -> Indices:
        """Number of the material of each cell of this rank, ghosts included, shape (cells,)."""
        part = np.zeros(len(compat.geometry_cells(self.tagged.mesh)), dtype=np.int32)
        for number, material in enumerate(self.statement.material):
            part[self.tagged.cells(material.region)] = number
        return part

    @cached_property
    def _component(self) -> fem.Function:
        """The indicator vector of the material of each cell: 1 in its component, 0 in the
        others.
        """
        space = fem.functionspace(self.tagged.mesh, ("DG", 0, (self._materials,)))
        indicator = fem.Function(space)
        indicator.x.array.reshape(-1, self._materials)[space.dofmap.list[:, 0], self._part] = 1.0
        return indicator

    def _pressure(self, q: Expr) -> Expr:
        """Return the pressure, UFL, from a function or an argument of ``own``."""
        return q if self._materials == 1 else ufl.inner(self._component, q)

    @property
    def _rows(self) -> Indices:
        """The local numbers of the pressure unknowns of each cell of this rank, shape (cells,
        vertices).
        """
        return self.own.dofmap.list * self._materials + self._part[:, None]

    def _over_cells(self, values: Array) -> Array:
        """Return the mean over adjacent cells of values at cell vertices, at each owned unknown of
        the pressure; collective.

        Args:
            values: shape (cells, vertices).
        """
        sums = [fem.Function(self.own) for _ in range(2)]
        for function, added in zip(sums, (values, np.ones(values.shape)), strict=True):
            np.add.at(function.x.array, self._rows, added)
            function.x.scatter_reverse(la.InsertMode.add)
        total, times = (function.x.array[: self.count] for function in sums)
        return total / np.maximum(times, 1.0)

    def _coefficient(self, number: Callable[[Array | float, float], npt.ArrayLike]) -> Coefficient:
        """Return a coefficient that is computed from Young's modulus, a float or an array, and
        Poisson's ratio.
        """

        def of_material(one: Material, share: Array | float) -> tuple[npt.ArrayLike]:
            assert isinstance(one, LinearElastic)  # no other one has a mixed element
            return (number(one.young * share, one.poisson),)

        (coefficient,) = of_materials(self.statement, self.tagged, of_material)
        return coefficient

    @cached_property
    def _yields(self) -> Coefficient:
        """The compressibility 1 / lambda."""
        return self._coefficient(lambda young, nu: (1 + nu) * (1 - 2 * nu) / (young * nu))

    @cached_property
    def unit(self) -> float:
        """Young's modulus over the spacing of the nodes, stress per length; a pressure is this
        factor times its unknown.
        """
        scales = Scales(self.tagged.dimension, self.statement.young, self.tagged.size)
        return self.statement.young / float(scales.spacing(self.space.dofmap.index_map.size_global))

    @property
    def count(self) -> int:
        """The number of pressure unknowns that this rank owns."""
        return int(self.own.dofmap.index_map.size_local) * self._materials

    @cached_property
    def forms(self) -> tuple[fem.Form, ...]:
        """The compiled forms of A, B and -C."""
        trial = ufl.TrialFunction(self.space)
        terms = (
            *self.terms(trial, ufl.TestFunction(self.space)),
            *self._constraint(trial, ufl.TrialFunction(self.own)),
        )
        return tuple(map(compile_form, terms))

    def compiled(self, space: fem.FunctionSpace) -> tuple[fem.Form, ...]:
        return self.forms[:1]

    def parts(self, strain: Expr) -> list[tuple[Expr, int | None]]:
        """Return the parts of the stress without the pressure."""
        return [(2 * self.lame[1] * strain, None)]

    def _constraint(self, y: Expr, p: Expr) -> tuple[ufl.Form, ...]:
        """Return the terms of B and -C for a displacement and pressure unknowns p = -lambda
        tr(epsilon), in multiples of ``unit``.

            2 mu (epsilon(y), epsilon(z)) - (p, div z),    -(div y, q) - (p, q) / lambda

        (L. R. Herrmann, AIAA J. 3 (1965) 1896-1900), with the element of C. Taylor and P. Hood,
        Comput. Fluids 1 (1973) 73-100, which is stable for nu = 1/2 too.
        """
        p = self._pressure(p)
        q = self._pressure(ufl.TestFunction(self.own))
        unit = fem.Constant(self.space.mesh, default_scalar_type(self.unit))
        densities = -unit * ufl.tr(self.kinematics.strain(y)) * q, -(unit**2) * self._yields * p * q
        return tuple(self._integral(density, self.degree) for density in densities)

    def strain_terms(self, z: Expr, strain: Expr, degree: int) -> tuple[ufl.Form, ...]:
        """Return the work of e I in the constraint, ((3 + 2 mu / lambda) e, q).

        With the pressure p = 2 mu e - lambda (tr(epsilon) - 3 e) the stress is 2 mu epsilon - p I,
        as without the strain, which enters the constraint alone: div y + p / lambda = (3 + 2 mu /
        lambda) e, where the factor is (1 + nu) / nu.
        """
        q = self._pressure(ufl.TestFunction(self.own))
        return (self._integral(self._swelling * strain * q, degree),)

    def jump_terms(self, jump: fem.Function, z: Expr) -> tuple[ufl.Form, ...]:
        """Return the terms of a jump; the last one is its change of volume, tested with the
        pressure.
        """
        dilation = ufl.tr(self.kinematics.strain(jump)) * self._pressure(ufl.TestFunction(self.own))
        return *self.terms(jump, z), self._integral(-dilation, self.degree)

    def assembled(self, forms: Sequence[fem.Form], owned: int) -> tuple[Array, Array | None]:
        """Return the load vectors: initial strains act on the pressure alone, jumps on displacement
        and pressure.
        """
        *of_displacement, of_pressure = forms
        return super().assembled(of_displacement, owned)[0], assemble(of_pressure)

    def force_terms(
        self, y: fem.Function, z: Expr, moved: Expr | None = None
    ) -> tuple[ufl.Form, ...]:
        pressed = self._integral(-fields_of(y)[1] * ufl.tr(self.kinematics.strain(z)), self.degree)
        return *super().force_terms(y, z, moved), pressed

    def initial_terms(
        self, z: Expr, jump: Expr | None, strain: Expr | None, degree: int
    ) -> list[ufl.Form]:
        """Return the terms of jumps; initial strains act on the pressure alone."""
        return super().initial_terms(z, jump, None, degree)

    def prevented_terms(
        self, y: fem.Function, jump: Expr | None, strain: Expr | None, degree: int
    ) -> list[ufl.Form]:
        terms = []
        pressure = fields_of(y)[1]
        if jump is not None:
            dilation = ufl.tr(self.kinematics.strain(jump))
            terms += [
                0.5 * self.terms(jump, jump)[0],
                self._integral(-pressure * dilation / 2, self.degree),
            ]
        if strain is not None:
            terms.append(
                self._integral(
                    self._swelling * strain * (pressure / 2 - self.lame[1] * strain), degree
                )
            )
        return terms

    def dilation_terms(
        self, y: fem.Function, jump: Expr | None, strain: Expr | None, degree: int
    ) -> list[ufl.Form]:
        """Return the weak form of tr(epsilon) + p / lambda = 0, with initial strains."""
        q = self._pressure(ufl.TestFunction(self.own))
        dilation = ufl.tr(self.kinematics.strain(y if jump is None else y + jump))
        terms = [self._integral((dilation + self._yields * fields_of(y)[1]) * q, self.degree)]
        if strain is not None:
            terms.append(self._integral(-self._swelling * strain * q, degree))
        return [*terms, self._integral(q, self.degree)]

    @cached_property
    def _swelling(self) -> Coefficient:
        """The factor (1 + nu) / nu by which an initial strain enters the constraint."""
        return self._coefficient(lambda _, nu: (1 + nu) / nu)

    def stress(self, y: fem.Function, moved: Expr, initial: Expr | None) -> ElementStress:
        _, mu = self.lame
        kinematics = self.kinematics
        poisson = self._coefficient(lambda _, nu: nu)
        modulus = self._coefficient(lambda young, nu: young / (1 - nu**2))
        sigma = 2 * mu * self.elastic(moved, None, on_axis=True) - fields_of(y)[1] * ufl.Identity(3)
        of_difference = partial(
            compliance, kinematics=kinematics, lame=None, mu=mu, poisson=poisson
        )
        return ElementStress(y, kinematics, sigma, of_difference, modulus, mu)

    def _matrix(self, number: int) -> PETSc.Mat:
        matrix = fem_petsc.assemble_matrix(self.forms[number])
        matrix.assemble()
        return matrix

    @cached_property
    def divergence(self) -> PETSc.Mat:
        """The matrix B, from nodal displacements."""
        return self._matrix(1)

    @cached_property
    def compressibility(self) -> PETSc.Mat:
        """The matrix -C, with its pattern even if it is zero.

        Pressure unknowns without a cell of their material have a diagonal entry of the size of B.
        """
        matrix = self._matrix(2)
        if self._materials > 1:
            size = self.divergence.norm(PETSc.NormType.NORM_INFINITY)
            diagonal = matrix.getDiagonal()
            diagonal.getArray()[self._over_cells(np.ones(self._rows.shape)) == 0] = -size
            matrix.setDiagonal(diagonal)
        return matrix

    def joined(
        self, stiffness: PETSc.Mat, rotation: PETSc.Mat | None, fixed: Flags
    ) -> tuple[PETSc.Mat, PETSc.Mat | None, PETSc.Mat | None]:
        """Return K, and twice the matrix from its unknowns to displacements: with and without rigid
        bodies, which a mixed element does not have.

        Args:
            stiffness: A with zero rows and columns at prescribed dofs.
            rotation: from the unknowns of A to displacements; None: they are the same.
            fixed: which owned dofs are prescribed.

        Raises:
            InstallationError: PETSc has no MUMPS.
        """
        if not has_package("mumps"):
            raise needs_fenicsx(
                "PETSc has no MUMPS, which a mixed element needs: its matrix is indefinite"
            )
        divergence = (
            self.divergence.copy() if rotation is None else self.divergence.matMult(rotation)
        )
        free = divergence.createVecRight()
        free.getArray()[:] = ~fixed
        divergence.diagonalScale(R=free)
        blocks = [
            [stiffness, divergence.transpose(PETSc.Mat())],
            [divergence, self.compressibility],
        ]
        matrix = PETSc.Mat().createNest(blocks, comm=stiffness.comm).convert("aij")
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        displacements = embedding(rotation, stiffness, matrix)
        return matrix, displacements, displacements

    def lifted(self, prescribed: Array, pressure_load: Array | None = None) -> Array:
        """Return the right-hand side -B y_D of the pressure unknowns, minus the term of initial
        strains.

        Args:
            prescribed: y_D, shape (dofs,).
            pressure_load: see ``AppliedLoad``; None: zero.
        """
        displacement, divergences = self.divergence.createVecs()
        displacement.getArray()[:] = prescribed[: displacement.getLocalSize()]
        self.divergence.mult(displacement, divergences)
        lifted = -np.array(divergences.getArray(readonly=True))
        return lifted if pressure_load is None else lifted - self.unit * pressure_load

    def displacement(self, values: Array | None = None) -> MixedDisplacement:
        """Return a new displacement, zero, with these pressure unknowns.

        Args:
            values: the owned pressure unknowns; None: zero.
        """
        pressure = fem.Function(self.own, name="hydrostatic pressure")
        if values is not None:
            pressure.x.array[: self.count] = self.unit * values
            pressure.x.scatter_forward()
        if self._materials > 1:
            cellwise = fem.Function(
                fem.functionspace(self.space.mesh, ("DG", 1)), name=pressure.name
            )
            cellwise.x.array[cellwise.function_space.dofmap.list] = pressure.x.array[self._rows]
            pressure = cellwise
        return MixedDisplacement(self.space, pressure)

    def unknowns(self, displacement: fem.Function) -> Array:
        """Return the owned pressure unknowns of a displacement, shape (count,)."""
        pressure = fields_of(displacement)[1]
        values = pressure.x.array[: self.count]
        if self._materials > 1:
            values = self._over_cells(pressure.x.array[pressure.function_space.dofmap.list])
        return values / self.unit

    def encloses(self, vector: Callable[[Array], PETSc.Vec], held: Flags) -> bool:
        """Return whether supports prevent every change of volume of some part with nu = 1/2, so
        that a constant pressure there does no work.

        Args:
            vector: see ``Model.vector``.
            held: which unknowns are held, by supports or contact.
        """
        part = self._part
        pieces = find_pieces(self.space.mesh)
        comm = self.space.mesh.comm
        works = []
        soft = [
            number
            for number, material in enumerate(self.statement.material)
            if material.poisson == 0.5
        ]
        for number, assembly in product(soft, range(int(pieces.assembly.max()) + 1)):
            cells = (part == number) & (pieces.assembly[pieces.of_cell] == assembly)
            if not parallel.any_rank(comm, cells):
                continue
            force, pressure = self.divergence.createVecs()
            pressure.getArray()[:] = (
                self._over_cells(np.ones(self._rows.shape) * cells[:, None]) > 0
            )
            self.divergence.multTranspose(pressure, force)
            works.append(
                np.array(vector(np.array(force.getArray(readonly=True))).getArray(readonly=True))
            )
        if not works:
            return False
        columns = np.column_stack(works)
        columns /= np.sqrt(parallel.global_sum(comm, (columns**2).sum(axis=0)))
        triangle: Any = np.linalg.qr(
            columns[~held], mode="r"
        )  # whose singular values are those of all rows
        triangles = parallel.gather_rows(comm, triangle)
        square = np.vstack((triangles, np.zeros((len(works), len(works)))))
        return bool(np.linalg.svd(square, compute_uv=False)[-1] <= NOTHING_LEFT)
