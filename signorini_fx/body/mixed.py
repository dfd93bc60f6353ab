"""The pressure of a mixed element: a field of degree 1, whose unknowns follow those of the displacement.

It is continuous within each material, and jumps between them.  With several materials it has one component for each,
which counts in the cells of this material alone; those of nodes elsewhere are zero.

With the form ``mixed_forms`` the unknowns (y, p) of the body have

    K = [A B^T; B -C],   b = [f; -B y_D - s],

with C = 0 for nu = 1/2, the prescribed displacements y_D, and the work s of initial strains.  K is symmetric and
indefinite.  Contact acts on the displacement alone, and what is left of K on its unknowns once all others are
eliminated is positive semi-definite.

The unknowns of the pressure are multiples of Young's modulus over the spacing of the nodes.  So the three blocks have
entries of one size in any units, which a factorisation that does not scale needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem, la
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx import compat, parallel
from signorini_fx.body.moduli import isotropic
from signorini_fx.body.pieces import BodyPieces
from signorini_fx.body.quadrature import strain_degree
from signorini_fx.errors import needs_fenicsx
from signorini_fx.kinematics.cartesian import Kinematics, position
from signorini_fx.kinematics.space import SPACE
from signorini_fx.linalg.factorisation import has_package
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.records import Inventory
from signorini_fx.scene.model import Scene
from signorini_fx.tuned import SAME_ENTRY

_Floats = npt.NDArray[np.float64]
# What is compiled for it.
MIXED_FORMS = ("elasticity", "divergence", "compressibility")


class MixedDisplacement(fem.Function):
    """The displacement of a mixed element, with the pressure that belongs to it.

    Attributes:
        hydrostatic: p = -lambda tr(epsilon), for nu = 1/2 minus the mean stress; a stress, positive in compression;
            of several materials discontinuous between cells.  With initial strains see
            ``mixed_strain_form``.
    """

    def __init__(self, space: fem.FunctionSpace, hydrostatic: fem.Function, name: str = "displacement") -> None:
        super().__init__(space, name=name)
        self.hydrostatic = hydrostatic


def hydrostatic_of(displacement: fem.Function) -> fem.Function:
    """The pressure of a displacement.

    Raises:
        ValueError: it has none, such as a copy of one that has.
    """
    if not isinstance(displacement, MixedDisplacement):
        raise ValueError("this displacement is without the pressure that belongs to it: take that of the solution")
    return displacement.hydrostatic


@dataclass(frozen=True)
class PressureSpace:
    """The unknowns of the pressure, m at each vertex for m materials.

    Attributes:
        own: the space of these.
        part: number of the material of each cell of this rank, ghosts included, shape (cells,).
    """

    own: fem.FunctionSpace
    part: npt.NDArray[np.int32]

    @classmethod
    def of(cls, scene: Scene, tagged: TaggedMesh) -> PressureSpace:
        """That of the materials of a scene."""
        m = len(scene.material)
        part = np.zeros(len(compat.geometry_cells(tagged.mesh)), dtype=np.int32)
        for number, material in enumerate(scene.material):
            if m > 1:
                part[tagged.cells(str(material.region))] = number
        return cls(fem.functionspace(tagged.mesh, ("Lagrange", 1, (m,)) if m > 1 else ("Lagrange", 1)), part)

    @property
    def materials(self) -> int:
        """M, their number."""
        return int(self.own.dofmap.index_map_bs)

    @cached_property
    def _component(self) -> fem.Function:
        """1 in the component of the material of each cell, 0 in the others."""
        space = fem.functionspace(self.own.mesh, ("DG", 0, (self.materials,)))
        indicator = fem.Function(space)
        indicator.x.array.reshape(-1, self.materials)[space.dofmap.list[:, 0], self.part] = 1.0
        return indicator

    def scalar(self, q: Any) -> Any:
        """A function or an argument of the space as a pressure, UFL."""
        return q if self.materials == 1 else ufl.inner(self._component, q)

    @property
    def rows(self) -> npt.NDArray[np.int32]:
        """The unknowns of the pressure in each cell of this rank, shape (cells, vertices)."""
        return self.own.dofmap.list * self.materials + self.part[:, None]

    def alive(self) -> npt.NDArray[np.bool_]:
        """Which of the unknowns that this rank owns are at a vertex of their material, shape (count,); collective."""
        return self.over_cells(np.ones(self.rows.shape)) > 0

    def over_cells(self, values: _Floats) -> _Floats:
        """The mean of values in cells, shape (cells, vertices), at each unknown of this rank, shape (count,), zero
        where it has no cell; collective.
        """
        sums = [fem.Function(self.own) for _ in range(2)]
        for function, added in zip(sums, (values, np.ones(values.shape)), strict=True):
            np.add.at(function.x.array, self.rows, added)
            function.x.scatter_reverse(la.InsertMode.add)
        total, times = (function.x.array[: self.count] for function in sums)
        return total / np.maximum(times, 1.0)

    @property
    def count(self) -> int:
        """Unknowns that this rank owns."""
        return int(self.own.dofmap.index_map.size_local) * self.materials


@dataclass(frozen=True)
class MixedPressure:
    """What the mixed element adds to the displacement; all but ``count`` is collective.

    Attributes:
        space: of the displacement, of degree 2.
        pressures: of the unknowns of the pressure.
        moduli: mu and 1 / lambda as coefficients.
        incompressible: the parts of the body with nu = 1/2, of one material and joined: which cells of this rank,
            ghosts included, are in each of them, shape (parts, cells).
        kinematics: of the body.
        unit: of the unknowns of the pressure, stress.
        inventory: what was compiled and assembled.
    """

    space: fem.FunctionSpace
    pressures: PressureSpace
    moduli: tuple[Any, Any]
    incompressible: npt.NDArray[np.bool_]
    kinematics: Kinematics
    unit: float
    inventory: Inventory

    @classmethod
    def of(
        cls,
        scene: Scene,
        tagged: TaggedMesh,
        space: fem.FunctionSpace,
        pieces: BodyPieces,
        unit: float,
        inventory: Inventory,
    ) -> MixedPressure:
        """That of the materials of a scene; bodies that are not joined have a pressure each."""
        mu, yields = isotropic(
            scene, tagged, lambda young, nu: (young / (2 * (1 + nu)), (1 + nu) * (1 - 2 * nu) / (young * nu))
        )
        pressures = PressureSpace.of(scene, tagged)
        soft = [number for number, material in enumerate(scene.material) if material.poisson == 0.5]
        joined, last = pieces.assembly[pieces.of_cell], int(pieces.assembly.max()) + 1
        part_cells = [(pressures.part == number) & (joined == assembly) for number in soft for assembly in range(last)]
        parts = np.array(part_cells, dtype=bool).reshape(len(part_cells), joined.size)
        cell_yields = (
            yields.x.array[yields.function_space.dofmap.list[:, 0]] if isinstance(yields, fem.Function) else 0.0
        )
        sums = parallel.global_sum(
            space.mesh.comm, np.array([parts.sum(axis=1), (parts * (cell_yields > 0)).sum(axis=1)])
        )
        incompressible = (sums[0] > 0) & (sums[1] == 0)  # and nu = 1/2 in all of its cells
        return cls(
            space,
            pressures,
            (mu, yields),
            parts[incompressible],
            scene.kinematics_in(tagged.dimension),
            unit,
            inventory,
        )

    @property
    def own(self) -> fem.FunctionSpace:
        """Of the unknowns of the pressure."""
        return self.pressures.own

    @property
    def count(self) -> int:
        """Unknowns of the pressure that this rank owns."""
        return self.pressures.count

    @cached_property
    def forms(self) -> tuple[fem.Form, ...]:
        """The compiled forms of A, B and -C."""
        terms = self.terms(ufl.TrialFunction(self.space), ufl.TrialFunction(self.own))
        return tuple(
            self.inventory.compile(name, partial(fem.form, term)) for name, term in zip(MIXED_FORMS, terms, strict=True)
        )

    def terms(self, y: Any, p: Any) -> tuple[Any, ...]:
        """A, B and -C of a displacement and unknowns of the pressure, functions or arguments, UFL."""
        space, mesh, scalar = self.space, self.space.mesh, self.pressures.scalar
        mu, compressibility = self.moduli
        return mixed_forms(
            (y, scalar(p)),
            (ufl.TestFunction(space), scalar(ufl.TestFunction(self.own))),
            mu,
            fem.Constant(mesh, default_scalar_type(self.unit)),
            compressibility,
            strain_degree(space, self.kinematics),
            kinematics=self.kinematics,
        )

    def _matrix(self, number: int) -> PETSc.Mat:
        form = self.forms[number]
        self.inventory.matrices.append(MIXED_FORMS[number])
        matrix = fem_petsc.assemble_matrix(form)
        matrix.assemble()
        return matrix

    @cached_property
    def divergence(self) -> PETSc.Mat:
        """B, from displacements at the nodes."""
        return self._matrix(1)

    @cached_property
    def compressibility(self) -> PETSc.Mat:
        """-C, with its pattern where it is zero; unknowns that count for nothing have an entry like those of B."""
        matrix = self._matrix(2)
        if self.pressures.materials > 1:
            size = self.divergence.norm(PETSc.NormType.NORM_INFINITY)
            diagonal = matrix.getDiagonal()
            diagonal.getArray()[~self.pressures.alive()] = -size
            matrix.setDiagonal(diagonal)
        return matrix

    def joined(self, stiffness: PETSc.Mat, rotation: PETSc.Mat | None, fixed: npt.NDArray[np.bool_]) -> PETSc.Mat:
        """K.

        Args:
            stiffness: A, prescribed rows and columns empty but for the diagonal.
            rotation: from the unknowns of A to displacements; None: they are the same.
            fixed: the prescribed unknowns of A of this rank.

        Raises:
            InstallationError: PETSc has no MUMPS.
        """
        if not has_package("mumps"):
            raise needs_fenicsx("PETSc has no MUMPS, which a mixed element needs: its matrix is indefinite")
        divergence = self.divergence.copy() if rotation is None else self.divergence.matMult(rotation)
        free = divergence.createVecRight()
        free.getArray()[:] = ~fixed
        divergence.diagonalScale(R=free)
        blocks = [[stiffness, divergence.transpose(PETSc.Mat())], [divergence, self.compressibility]]
        matrix = PETSc.Mat().createNest(blocks, comm=stiffness.comm).convert("aij")
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return matrix

    def embedding(self, stiffness: PETSc.Mat, rotation: PETSc.Mat | None, joined: PETSc.Mat) -> PETSc.Mat:
        """[Q 0], from the unknowns of K to displacements, with Q ``rotation``; see ``joined``."""
        rows, first = stiffness.getSizes()[0], stiffness.getOwnershipRange()[0]
        if rotation is None:
            starts = np.arange(rows[0] + 1, dtype=PETSc.IntType)
            columns, values = first + starts[:-1], np.ones(rows[0])
        else:
            rows = rotation.getSizes()[0]
            starts, columns, values = rotation.getValuesCSR()  # Q turns the nodes of each rank within it
        csr = (starts, (columns + joined.getOwnershipRange()[0] - first).astype(PETSc.IntType), values)
        return PETSc.Mat().createAIJ((rows, joined.getSizes()[1]), csr=csr, comm=stiffness.comm)

    def lifted(self, prescribed: fem.Function, swelling: _Floats | None = None) -> _Floats:
        """-B y_D of prescribed displacements, with the ``swelling`` of a load, see ``AppliedLoad``, shape (count,)."""
        displacement, divergences = self.divergence.createVecs()
        displacement.getArray()[:] = prescribed.x.array[: displacement.getLocalSize()]
        self.divergence.mult(displacement, divergences)
        lifted = -np.array(divergences.getArray(readonly=True))
        return lifted if swelling is None else lifted - self.unit * swelling

    def displacement(self, values: _Floats, name: str = "displacement") -> MixedDisplacement:
        """A displacement, zero so far, with the pressure whose owned unknowns are given, shape (count,)."""
        pressure = fem.Function(self.own, name="hydrostatic pressure")
        pressure.x.array[: self.count] = self.unit * values
        pressure.x.scatter_forward()
        if self.pressures.materials > 1:
            space = fem.functionspace(self.space.mesh, ("DG", 1))
            cellwise = fem.Function(space, name=pressure.name)
            cellwise.x.array[space.dofmap.list] = pressure.x.array[self.pressures.rows]
            pressure = cellwise
        return MixedDisplacement(self.space, pressure, name)

    def unknowns(self, displacement: fem.Function) -> _Floats:
        """The unknowns of its pressure, the inverse of ``displacement``, shape (count,)."""
        pressure = hydrostatic_of(displacement)
        values = pressure.x.array[: self.count]
        if self.pressures.materials > 1:
            values = self.pressures.over_cells(pressure.x.array[pressure.function_space.dofmap.list])
        return np.asarray(values / self.unit)

    def energy(self, values: _Floats) -> float:
        """(p, p) / lambda of owned unknowns, twice the energy of the change of volume."""
        pressure, product = self.compressibility.createVecs()
        pressure.getArray()[:] = values
        self.compressibility.mult(pressure, product)
        return -float(pressure.dot(product))

    @cached_property
    def constant(self) -> list[_Floats]:
        """The forces of a constant pressure in each incompressible part at the owned unknowns of the displacement."""
        forces, ones = [], np.ones(self.pressures.rows.shape)
        for cells in self.incompressible:
            force, pressure = self.divergence.createVecs()
            pressure.getArray()[:] = self.pressures.over_cells(ones * cells[:, None]) > 0
            self.divergence.multTranspose(pressure, force)
            forces.append(np.array(force.getArray(readonly=True)))
        return forces

    def encloses(self, forces: Sequence[_Floats], held: npt.NDArray[np.bool_]) -> bool:
        """Whether pressures that are constant in incompressible parts do no work, because of what is held.

        Args:
            forces: ``constant`` by the unknowns that ``held`` is of.
            held: unknowns of this rank.
        """
        if not forces:
            return False
        columns, comm = np.column_stack(forces), self.space.mesh.comm
        columns /= np.sqrt(parallel.global_sum(comm, (columns**2).sum(axis=0)))
        triangle: Any = np.linalg.qr(columns[~held], mode="r")  # whose singular values are those of all rows
        triangles = parallel.gather_rows(comm, triangle)
        square = np.vstack((triangles, np.zeros((len(forces), len(forces)))))
        return bool(np.linalg.svd(square, compute_uv=False)[-1] <= SAME_ENTRY)


def mixed_strain_form(q: Any, strain: Any, swelling: Any, degree: int, *, kinematics: Kinematics = SPACE) -> Any:
    """The work of an initial strain e I in the constraint of the mixed element, ((3 + 2 mu / lambda) e, q).

    With the pressure p = 2 mu e - lambda (tr(epsilon) - 3 e) the stress is 2 mu epsilon - p I, as without the strain,
    which enters the constraint alone: div y + p / lambda = (3 + 2 mu / lambda) e.

    Args:
        q: test function of the pressure.
        strain: e, a number.
        swelling: 3 + 2 mu / lambda = (1 + nu) / nu.
        degree: quadrature degree.
        kinematics: see ``materials.isotropic.elastic_forms``.
    """
    return swelling * strain * q * kinematics.measure(position(q)) * ufl.dx(metadata={"quadrature_degree": degree})


def mixed_forms(
    unknowns: tuple[Any, Any],
    tests: tuple[Any, Any],
    mu: Any,
    unit: Any,
    compressibility: Any,
    degree: int,
    *,
    kinematics: Kinematics = SPACE,
) -> tuple[Any, ...]:
    """The mixed form with the pressure p = -lambda tr(epsilon) as an unknown, in multiples of a unit.

        2 mu (epsilon(y), epsilon(z)) - (p, div z),    -(div y, q) - (p, q) / lambda

    (L. R. Herrmann, AIAA J. 3 (1965) 1896-1900).  With a continuous pressure of one degree less than the displacement
    it is the element of C. Taylor and P. Hood, Comput. Fluids 1 (1973) 73-100, which is stable for nu = 1/2 too.

    Args:
        unknowns: trial functions of displacement and pressure.
        tests: test functions of both.
        mu: second Lame parameter.
        unit: of the pressure, stress.
        compressibility: 1 / lambda.
        degree: quadrature degree.
        kinematics: see ``materials.isotropic.elastic_forms``.

    Returns:
        The form of (y, z), that of (y, q), and that of (p, q).
    """
    (y, p), (z, q) = unknowns, tests
    trial_strain, around = kinematics.strain(y), kinematics.measure(position(z))
    shearing, dilation = ufl.inner(trial_strain, kinematics.strain(z)), ufl.tr(trial_strain)
    dx = ufl.dx(metadata={"quadrature_degree": degree})
    densities = 2 * mu * shearing, -unit * dilation * q, -(unit**2) * compressibility * p * q
    return tuple(density * around * dx for density in densities)
