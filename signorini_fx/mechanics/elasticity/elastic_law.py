"""The elastic law of a body on its mesh: all that assembles, shows and judges a stress asks it, and knows no kind.

Two laws have the displacement as their only unknown: that of isotropic materials, whose change of volume may be
integrated with fewer points, and that of others.  Another one adds a pressure, see ``elasticity.choice_of_law``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import basix
import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem
from petsc4py import PETSc

from signorini_fx.machine import compat, parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import assemble, stiffness_form
from signorini_fx.mechanics.assembly.quadrature import strain_degree
from signorini_fx.mechanics.kinematics.protocol import Kinematics, position
from signorini_fx.mechanics.mesh.tagged import TaggedMesh

if TYPE_CHECKING:
    from signorini_fx.mechanics.statement.statement import Statement

_Floats = npt.NDArray[np.float64]
# A function, and the expression that it is to be interpolated from.
Interpolation = tuple[fem.Function, fem.Expression]


@dataclass(frozen=True)
class ElementStress:
    """The stress of a displacement that the elements work with, as UFL, and what follows from its law: everything that
    shows or judges a stress takes it from here.

    Attributes:
        displacement: y, whose values may change.
        kinematics: of the displacement.
        sigma: shape (d, d); of the displacement at the time of the last ``refresh``.
        outward: the stress out of the plane; None: there is none.
        compliance: components tau of a difference of stresses -> C^-1 tau : tau.
        modulus: the largest normal stress per strain, lambda + 2 mu.
        shear_modulus: mu, the mean one of an orthotropic material; None: the body is not known to be isotropic.
        interpolated: what ``sigma`` does not see of the displacement itself.
        parts: the cells of each part within which the stress has no jumps, local numbers, ghosts included.
        move: takes jumps and initial strains to a place in the lists of factors.
    """

    displacement: fem.Function
    kinematics: Kinematics
    sigma: Any
    outward: Any
    compliance: Callable[[Any], Any]
    modulus: Any
    shear_modulus: Any
    interpolated: Sequence[Interpolation] = ()
    parts: Sequence[npt.NDArray[np.int32]] = ()
    move: Callable[[float], None] = lambda place: None

    def refresh(self, step: float) -> None:
        """Take from the displacement anew what ``sigma`` does not see of it, on all cells of this rank, at a place."""
        self.move(step)
        for function, expression in self.interpolated:
            function.interpolate(expression)

    @property
    def around(self) -> Any:
        """By what areas and lengths of the mesh are multiplied, see ``Kinematics.measure``."""
        return self.kinematics.measure(position(self.displacement))

    @property
    def components(self) -> Any:
        """The components of sigma, see ``Kinematics.pairs``, and that out of the plane where it is none of them."""
        pairs = self.kinematics.pairs
        beyond = [] if self.outward is None or (2, 2) in pairs else [self.outward]
        return ufl.as_vector([*(self.in_space[pair] for pair in pairs), *beyond])

    def squared(self, difference: Any, times: Any, dx: Any) -> Any:
        """The form of C^-1 tau : tau for a difference of stresses, its ``components``, times a factor."""
        within = ufl.as_vector([difference[k] for k in range(len(self.kinematics.pairs))])
        return times * self.compliance(within) * self.around * dx

    @property
    def in_space(self) -> Any:
        """Sigma with all components in 3D, shape (3, 3)."""
        dim = self.kinematics.dimension
        out = 0 * self.sigma[0, 0] if self.outward is None else self.outward
        components = [[self.sigma[i, j] if max(i, j) < dim else 0 * out for j in range(3)] for i in range(3)]
        if dim < 3:
            components[2][2] = out
        return ufl.as_tensor(components)


@dataclass(frozen=True)
class ElasticLaw:
    """A law whose only unknown is the displacement; its methods are collective.

    Attributes:
        pressed: whether a pressure is an unknown too, so that the matrix is indefinite.
        lame: Lame parameters as coefficients, of other materials their means; None: they are not known.
        stiffness: a ``CellwiseStiffness`` where a material is not isotropic; None: all are.
    """

    pressed: ClassVar[bool] = False

    lame: tuple[Any, Any] = field(default=(None, None), kw_only=True)
    stiffness: Any = field(default=None, kw_only=True)

    @property
    def reduced(self) -> int | None:
        """Quadrature degree of the volumetric term where it is reduced, else None."""
        return None

    @property
    def count(self) -> int:
        """Unknowns beside the displacement that this rank owns."""
        return 0

    # --- forms ---

    def terms(self, y: Any, z: Any) -> tuple[Any, ...]:
        """a(y, z) on displacements as terms to be compiled one by one, UFL."""
        raise NotImplementedError

    def strain_terms(self, z: Any, strain: Any, degree: int) -> tuple[Any, ...]:
        """The work of an initial strain, as terms to be compiled one by one, see ``work``."""
        raise NotImplementedError

    def jump_terms(self, jump: fem.Function, z: Any) -> tuple[Any, ...]:
        """That of a jump of the displacement, likewise."""
        return self.terms(jump, z)

    def work(self, forms: Sequence[fem.Form], owned: int) -> tuple[_Floats, _Floats | None]:
        """Of these terms, compiled, at the owned unknowns of the displacement, and of the pressure."""
        return sum((assemble(form) for form in forms), np.zeros(owned)), None

    def compiled(self, space: fem.FunctionSpace) -> tuple[fem.Form, ...]:
        """The terms of a(., .)."""
        terms = self.terms(ufl.TrialFunction(space), ufl.TestFunction(space))
        return tuple(stiffness_form(term, space.mesh.topology.dim) for term in terms)

    def stress(self, y: fem.Function, moved: Any, initial: Any) -> ElementStress:
        """The stress of a displacement, which jumps have ``moved``, with initial strains, None without any, UFL."""
        raise NotImplementedError

    # --- unknowns beside the displacement: there are none ---

    def joined(
        self, stiffness: PETSc.Mat, rotation: PETSc.Mat | None, turning: PETSc.Mat | None, fixed: npt.NDArray[np.bool_]
    ) -> tuple[PETSc.Mat, PETSc.Mat | None, PETSc.Mat | None]:
        """The matrix of all unknowns, and what turns them into displacements, with and without rigid bodies.

        Args:
            stiffness: of the displacement, prescribed rows and columns empty but for the diagonal.
            rotation: from its unknowns to displacements; None: they are the same.
            turning: the same without rigid bodies.
            fixed: the prescribed unknowns of the displacement of this rank.
        """
        stiffness.setOption(PETSc.Mat.Option.SPD, True)
        return stiffness, rotation, turning

    def lifted(self, prescribed: fem.Function, pressure_load: _Floats | None = None) -> _Floats:
        """The load at the other unknowns, of prescribed displacements and the ``pressure_load`` of a load: (count,)."""
        return np.empty(0)

    def displacement(self, space: fem.FunctionSpace, values: _Floats, name: str = "displacement") -> fem.Function:
        """A displacement, zero so far, with the other unknowns, shape (count,)."""
        return fem.Function(space, name=name)

    def unknowns(self, displacement: fem.Function) -> _Floats:
        """These of a displacement, shape (count,)."""
        return np.empty(0)

    def energy(self, displacement: fem.Function) -> float:
        """Twice the energy that a(., .) on displacements does not count."""
        return 0.0

    def encloses(self, vector: Callable[[_Floats], PETSc.Vec], held: npt.NDArray[np.bool_]) -> bool:
        """Whether what is ``held`` lets no incompressible body change its volume; ``vector``: see ``ElasticBody``."""
        return False


def embedding(rotation: PETSc.Mat | None, own: PETSc.Mat, whole: PETSc.Mat) -> PETSc.Mat:
    """[Q 0], from all unknowns to displacements.

    Args:
        rotation: Q, from the unknowns of ``own``; None: the identity.
        own: a matrix of these.
        whole: the matrix of all unknowns, on each rank those of ``own`` first.
    """
    rows, first = own.getSizes()[0], own.getOwnershipRange()[0]
    if rotation is None:
        starts = np.arange(rows[0] + 1, dtype=PETSc.IntType)
        columns, values = first + starts[:-1], np.ones(rows[0])
    else:
        rows = rotation.getSizes()[0]
        starts, columns, values = rotation.getValuesCSR()  # Q turns the nodes of each rank within it
    csr = (starts, (columns + whole.getOwnershipRange()[0] - first).astype(PETSc.IntType), values)
    return PETSc.Mat().createAIJ((rows, whole.getSizes()[1]), csr=csr, comm=own.comm)


def fields_of(displacement: fem.Function) -> tuple[fem.Function, ...]:
    """A displacement, and the pressure that its law has found with it."""
    return (displacement, displacement.hydrostatic) if hasattr(displacement, "hydrostatic") else (displacement,)


@dataclass(frozen=True)
class SceneLaw(ElasticLaw):
    """That of the materials of a scene.

    Attributes:
        statement: what is stated of the problem.
        tagged: its mesh.
        space: of the displacement.
    """

    statement: Statement
    tagged: TaggedMesh
    space: fem.FunctionSpace

    @property
    def kinematics(self) -> Kinematics:
        """Of the body."""
        return self.statement.kinematics_in(self.tagged.dimension)

    @property
    def degree(self) -> int:
        """Of the quadrature of a(., .); collective."""
        return strain_degree(self.space, self.kinematics)

    # --- forces at a displacement, for results ---

    def force_terms(self, y: fem.Function, z: Any, moved: Any = None) -> tuple[Any, ...]:
        """The work of the stress of y on z, as terms to be compiled one by one; ``moved``: y with jumps, if any."""
        return self.terms(y if moved is None else moved, z)

    def initial_terms(self, z: Any, jump: Any, strain: Any, degree: int) -> list[Any]:
        """That of the stress that initial strains and jumps of the displacement cause where they are prevented, as a
        load, likewise; ``degree``: of the quadrature of the strains; None: there are none.
        """
        free = () if strain is None else self.strain_terms(z, strain, degree)
        return [*free, *(() if jump is None else (-term for term in self.terms(jump, z)))]

    def prevented_terms(self, y: fem.Function, jump: Any, strain: Any, degree: int) -> list[Any]:
        """The energy of that stress, likewise: what is missing in that of ``force_terms`` on y less their load."""
        terms = [] if strain is None else [*self.free_terms(strain, degree)]
        if jump is not None:
            terms += [0.5 * term for term in self.terms(jump, jump)]
            terms += [] if strain is None else [-term for term in self.strain_terms(jump, strain, degree)]
        return terms

    def free_terms(self, strain: Any, degree: int) -> tuple[Any, ...]:
        """The energy of an initial strain that is prevented everywhere, likewise."""
        raise NotImplementedError

    def dilation_terms(self, y: fem.Function, jump: Any, strain: Any, degree: int) -> list[Any]:
        """The residual of the law of a pressure, tested with its functions, and at last the integrals of these."""
        raise NotImplementedError

    def _integral(self, density: Any, degree: int) -> Any:
        """Over the body, with a quadrature of this degree."""
        around = self.kinematics.measure(ufl.SpatialCoordinate(self.tagged.mesh))
        return density * around * ufl.dx(domain=self.tagged.mesh, metadata={"quadrature_degree": degree})


@dataclass(frozen=True)
class IsotropicLaw(SceneLaw):
    """Sigma = 2 mu epsilon + lambda theta I, with the volumetric strain theta as the stiffness sees it.

    Both strains are without the initial one, and with the jumps across sections.  Without reduced integration theta is
    tr(epsilon).  A reduced volumetric term sees tr(epsilon) at the points of its rule only.  Between them it may have
    any value, and lambda times it is any multiple of the true stress if Poisson's ratio is near 1/2.  There theta is
    interpolated between these points: constant in a cell with one point, bilinear or trilinear with two along each
    axis.  This is the pressure of the method with two fields that reduced integration is equivalent to (Malkus and
    Hughes, Comput. Methods Appl. Mech. Engrg. 15 (1978) 63-81).
    """

    reduced: int | None = None

    def terms(self, y: Any, z: Any) -> tuple[Any, ...]:
        first, second = self.kinematics.strain(y), self.kinematics.strain(z)
        if self.reduced is None:
            stress = self.lame[0] * ufl.tr(first) * ufl.Identity(first.ufl_shape[0]) + 2 * self.lame[1] * first
            return (self._integral(ufl.inner(stress, second), self.degree),)
        shearing = 2 * self.lame[1] * ufl.inner(first, second)
        volumetric = self.lame[0] * ufl.tr(first) * ufl.tr(second)
        return self._integral(shearing, self.degree), self._integral(volumetric, self.reduced)

    def strain_terms(self, z: Any, strain: Any, degree: int) -> tuple[Any, ...]:
        return self._alike(strain * ufl.tr(self.kinematics.strain(z)), degree)

    def free_terms(self, strain: Any, degree: int) -> tuple[Any, ...]:
        return self._alike(self.kinematics.directions * strain**2 / 2, degree)

    def _alike(self, product: Any, degree: int) -> tuple[Any, ...]:
        """The stress of a strain that is the same in all directions, times a product of strains."""
        shearing, volumetric = 2 * self.lame[1], self.kinematics.directions * self.lame[0]
        if self.reduced is None:
            return (self._integral((shearing + volumetric) * product, degree),)
        return self._integral(shearing * product, degree), self._integral(volumetric * product, self.reduced)

    def stress(self, y: fem.Function, moved: Any, initial: Any) -> ElementStress:
        (lame, mu), kinematics, mesh = self.lame, self.kinematics, self.tagged.mesh
        elastic = kinematics.strain(moved, on_axis=True)
        theta = ufl.tr(elastic)
        if initial is not None:
            elastic -= initial * ufl.Identity(elastic.ufl_shape[0])
            theta -= kinematics.directions * initial
        interpolated = []
        if self.reduced is not None:
            at_points = fem.functionspace(mesh, _at_points(mesh.topology.cell_name(), self.reduced))
            interpolated.append(interpolation(theta, at_points))
            theta = interpolated[-1][0]
            theta.name = "volumetric strain"
        mean = lame * theta
        sigma = 2 * mu * elastic + mean * ufl.Identity(elastic.ufl_shape[0])
        outward = sigma[2, 2] if elastic.ufl_shape[0] > self.tagged.dimension else None
        if kinematics.prevented:
            outward = mean if initial is None else mean - 2 * mu * initial
        return ElementStress(
            y,
            kinematics,
            within(sigma, len(y)),
            outward,
            lambda tau: compliance(tau, kinematics, lame, mu),
            lame + 2 * mu,
            mu,
            interpolated,
        )


def cellwise_stress(
    y: fem.Function, kinematics: Kinematics, sigma: Any, outward: Any, moduli: _Floats, shear_modulus: Any
) -> ElementStress:
    """That of moduli which are constant in each cell: components of the stress, see ``Kinematics.pairs``, over those of
    the strain, of shear twice epsilon_ij, shape (cells, m, m); collective.

    Raises:
        numpy.linalg.LinAlgError: some strain has no stress, on all ranks.
    """
    mesh, dim, m = y.function_space.mesh, y.function_space.mesh.geometry.dim, moduli.shape[2]
    inverse, error = moduli, None
    try:
        inverse = np.asarray(np.linalg.inv(moduli))
    except np.linalg.LinAlgError as found:
        error = found
    parallel.raise_together(mesh.comm, error)
    largest = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    largest.x.array[:] = moduli[:, range(dim), range(dim)].max(axis=1)
    flexibility = fem.Function(fem.functionspace(mesh, ("DG", 0, (m, m))))
    flexibility.x.array[:] = inverse.ravel()
    of_difference = sigma, outward, lambda tau: ufl.inner(ufl.dot(flexibility, tau), tau)
    return ElementStress(y, kinematics, *of_difference, largest, shear_modulus)


def compliance(tau: Any, kinematics: Kinematics, lame: Any, mu: Any, poisson: Any = 0.5) -> Any:
    """C^-1 tau : tau of an isotropic body for a stress tau, given by its components, see ``Kinematics.pairs``; without
    the first Lame parameter, which may be infinite, it follows from Poisson's ratio, but not in plane stress.
    """
    normal = [tau[k] for k, (i, j) in enumerate(kinematics.pairs) if i == j]
    shear = [tau[k] for k, (i, j) in enumerate(kinematics.pairs) if i != j]
    trace = sum(normal[1:], normal[0])
    square = sum((entry**2 for entry in normal[1:]), normal[0] ** 2)
    sheared = sum((2 * entry**2 for entry in shear[1:]), 2 * shear[0] ** 2)
    share = poisson / (1 + poisson if len(normal) == 3 else 1)
    if lame is not None:
        share = lame / (len(normal) * lame + 2 * mu)
    return (square + sheared - share * trace**2) / (2 * mu)


def within(sigma: Any, dimension: int) -> Any:
    """The components of a stress along the first axes, UFL."""
    if sigma.ufl_shape[0] == dimension:
        return sigma
    return ufl.as_matrix([[sigma[i, j] for j in range(dimension)] for i in range(dimension)])


def interpolation(value: Any, space: fem.FunctionSpace) -> Interpolation:
    """A function of a space that is to have a value."""
    with compiling():
        expression = fem.Expression(value, compat.interpolation_points(space.element), dtype=default_scalar_type)
    return fem.Function(space), expression


def _at_points(cell: str, degree: int) -> Any:
    """The discontinuous element whose nodes are the points of a Gauss rule: one point, or two along each axis."""
    if degree == 1:
        return basix.ufl.element("DG", cell, 0)
    return basix.ufl.element("DQ", cell, 1, lagrange_variant=basix.LagrangeVariant.gl_warped, discontinuous=True)
