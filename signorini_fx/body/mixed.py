"""The pressure of a mixed element: a continuous field of degree 1, whose unknowns follow those of the displacement.

With the form of ``effects.material.mixed_forms`` the unknowns (y, p) of the body have

    K = [A B^T; B -C],   b = [f; -B y_D - s],

with C = 0 for nu = 1/2, the prescribed displacements y_D, and the work s of initial strains.  K is symmetric and
indefinite.  Contact acts on the displacement alone, and what is left of K on its unknowns once all others are
eliminated is positive semi-definite.

The unknowns of the pressure are multiples of Young's modulus over the spacing of the nodes.  So the three blocks have
entries of one size in any units, which a factorisation that does not scale needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.body.quadrature import strain_degree
from signorini_fx.effects.material import LinearElastic, mixed_forms
from signorini_fx.errors import InstallationError
from signorini_fx.linalg.full import has_package
from signorini_fx.records import Inventory

_Floats = npt.NDArray[np.float64]
# What is compiled for it.
MIXED_FORMS = ("elasticity", "divergence", "compressibility")
# Forces of a constant pressure below this share of what its parts have are round-off.
_ROUND_OFF = 1e-10


class MixedDisplacement(fem.Function):
    """The displacement of a mixed element, with the pressure that belongs to it.

    Attributes:
        hydrostatic: p = -lambda tr(epsilon), for nu = 1/2 minus the mean stress; a stress, positive in compression.
            With initial strains see ``effects.material.mixed_strain_form``.
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
class MixedPressure:
    """What the mixed element adds to the displacement; all but ``count`` is collective.

    Attributes:
        space: of the displacement, of degree 2.
        material: of the body.
        unit: of the unknowns of the pressure, stress.
        inventory: what was compiled and assembled.
    """

    space: fem.FunctionSpace
    material: LinearElastic
    unit: float
    inventory: Inventory

    @cached_property
    def own(self) -> fem.FunctionSpace:
        """Of the pressure."""
        return fem.functionspace(self.space.mesh, ("Lagrange", 1))

    @property
    def count(self) -> int:
        """Unknowns of the pressure that this rank owns."""
        return int(self.own.dofmap.index_map.size_local)

    @cached_property
    def forms(self) -> tuple[fem.Form, ...]:
        """The compiled forms of A, B and -C."""
        space, mesh, material = self.space, self.space.mesh, self.material
        axisymmetric = material.hypothesis == "axisymmetric"
        lame, shear = material.lame
        mu, unit, compressibility = (
            fem.Constant(mesh, default_scalar_type(number)) for number in (shear, self.unit, 1 / lame)
        )
        terms = mixed_forms(
            (ufl.TrialFunction(space), ufl.TrialFunction(self.own)),
            (ufl.TestFunction(space), ufl.TestFunction(self.own)),
            mu,
            unit,
            compressibility,
            strain_degree(space, axisymmetric=axisymmetric),
            radius=ufl.SpatialCoordinate(mesh)[0] if axisymmetric else None,
        )
        return tuple(
            self.inventory.compile(name, partial(fem.form, term)) for name, term in zip(MIXED_FORMS, terms, strict=True)
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
        """-C, with its pattern where it is zero."""
        return self._matrix(2)

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
            raise InstallationError("PETSc has no MUMPS, which a mixed element needs: its matrix is indefinite")
        divergence = self.divergence.copy() if rotation is None else self.divergence.matMult(rotation)
        free = divergence.createVecRight()
        free.getArray()[:] = ~fixed
        divergence.diagonalScale(R=free)
        blocks = [[stiffness, divergence.transpose(PETSc.Mat())], [divergence, self.compressibility]]
        found = PETSc.Mat().createNest(blocks, comm=stiffness.comm).convert("aij")
        found.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return found

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
        given, found = self.divergence.createVecs()
        given.getArray()[:] = prescribed.x.array[: given.getLocalSize()]
        self.divergence.mult(given, found)
        lifted = -np.array(found.getArray(readonly=True))
        return lifted if swelling is None else lifted - self.unit * swelling

    def displacement(self, values: _Floats, name: str = "displacement") -> MixedDisplacement:
        """A displacement, zero so far, with the pressure whose owned unknowns are given, shape (count,)."""
        pressure = fem.Function(self.own, name="hydrostatic pressure")
        pressure.x.array[: self.count] = self.unit * values
        pressure.x.scatter_forward()
        return MixedDisplacement(self.space, pressure, name)

    def unknowns(self, displacement: fem.Function) -> _Floats:
        """The unknowns of its pressure, the inverse of ``displacement``, shape (count,)."""
        return np.asarray(hydrostatic_of(displacement).x.array[: self.count] / self.unit)

    def energy(self, values: _Floats) -> float:
        """(p, p) / lambda of owned unknowns, twice the energy of the change of volume."""
        given, found = self.compressibility.createVecs()
        given.getArray()[:] = values
        self.compressibility.mult(given, found)
        return -float(given.dot(found))

    @cached_property
    def constant(self) -> _Floats:
        """The forces of a constant pressure at the owned unknowns of the displacement."""
        found, pressure = self.divergence.createVecs()
        pressure.set(1.0)
        self.divergence.multTranspose(pressure, found)
        return np.array(found.getArray(readonly=True))

    def encloses(self, forces: _Floats, held: npt.NDArray[np.bool_]) -> bool:
        """Whether a constant pressure of an incompressible body does no work, because of what is held.

        Args:
            forces: ``constant`` by the unknowns that ``held`` is of.
            held: unknowns of this rank.
        """
        if self.material.poisson < 0.5:
            return False
        comm, work = self.space.mesh.comm, np.abs(forces)
        free, every = (parallel.global_max(comm, parallel.local_max(one)) for one in (work[~held], work))
        return bool(free <= _ROUND_OFF * every)
