"""The elastic law of a body on its mesh: all that assembles, shows and judges a stress asks it, and
knows no kind.

Two laws have the displacement as their only unknown: that of isotropic materials, whose change of
volume may be integrated with fewer points, and that of others, by the stiffness in each cell.
Another one adds a pressure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import default_scalar_type, fem
from ufl.finiteelement import AbstractFiniteElement

from signorini_fx.arrays import Array, Expr, Indices
from signorini_fx.machine import compat, parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import assemble, stiffness_form, strain_degree
from signorini_fx.mechanics.elasticity.moduli import CellwiseStiffness, Coefficient
from signorini_fx.mechanics.kinematics.protocol import Kinematics, components, position
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.statement import Statement

# A function, and the expression that it is to be interpolated from.
Interpolation = tuple[fem.Function, fem.Expression]


@dataclass(frozen=True)
class ElementStress:
    """The stress of a displacement that the elements work with, as UFL, and what follows from its
    law: everything that shows or judges a stress takes it from here.
    """

    displacement: fem.Function  # y, whose values may change
    kinematics: Kinematics  # of the displacement
    in_space: Expr  # shape (3, 3); of the displacement at the time of the last ``refresh``
    # From the components tau of a difference of stresses: C^-1 tau : tau.
    compliance: Callable[[Expr], Expr]
    modulus: Expr | None  # the largest normal stress per strain, lambda + 2 mu
    # mu, the mean one of an orthotropic material; None: the body is not known to be isotropic
    shear_modulus: Coefficient | None
    interpolated: Sequence[Interpolation] = ()  # what it does not see of the displacement itself
    # The cells of each part within which the stress has no jumps, local numbers, ghosts included.
    parts: Sequence[Indices] = ()
    move: Callable[[float], None] = lambda place: None  # takes jumps and initial strains to a place

    def refresh(self, step: float) -> None:
        """Take from the displacement anew what the stress does not see of it, on all cells of this
        rank, at a place.
        """
        self.move(step)
        for function, expression in self.interpolated:
            function.interpolate(expression)

    @property
    def around(self) -> Expr:
        """Return the factor of areas and lengths of the mesh, see ``Kinematics.measure``."""
        return self.kinematics.measure(position(self.displacement))

    @property
    def sigma(self) -> Expr:
        """Along the axes of the displacement, shape (d, d)."""
        axes = range(self.kinematics.dimension)
        return ufl.as_matrix([[self.in_space[i, j] for j in axes] for i in axes])

    @property
    def components(self) -> Expr:
        """Return the components of the strain that the strain energy contains, shape (m,)."""
        return ufl.as_vector([self.in_space[pair] for pair in self.kinematics.stressed])

    def squared(self, difference: Expr, times: Expr, dx: ufl.Measure) -> ufl.Form:
        """Return the form of C^-1 tau : tau for a difference of stresses, its ``components``, times
        a factor.
        """
        within = ufl.as_vector([difference[k] for k in range(len(self.kinematics.pairs))])
        return times * self.compliance(within) * self.around * dx


def fields_of(displacement: fem.Function) -> tuple[fem.Function, ...]:
    """Return a displacement, and the pressure that its law has found with it."""
    return (
        (displacement, displacement.hydrostatic)
        if hasattr(displacement, "hydrostatic")
        else (displacement,)
    )


@dataclass(frozen=True)
class SceneLaw:
    """The law of the materials of a scene; its methods are collective."""

    pressed: ClassVar[bool] = (
        False  # whether a pressure is an unknown too, so that the matrix is indefinite
    )

    statement: Statement
    tagged: TaggedMesh
    space: fem.FunctionSpace  # of the displacement
    # Lame parameters as coefficients, of materials that are not isotropic their means
    lame: tuple[Coefficient, Coefficient]
    stiffness: CellwiseStiffness | None = None  # where a material is not isotropic; None: all are
    reduced: int | None = (
        None  # quadrature degree of the volumetric term where it is reduced, else None
    )

    @property
    def kinematics(self) -> Kinematics:
        """Return the kinematics of the body."""
        return self.statement.kinematics_in(self.tagged.dimension)

    @cached_property
    def degree(self) -> int:
        """Return the degree of the quadrature of a(., .); collective."""
        return strain_degree(self.space, self.kinematics)

    def displacement(self) -> fem.Function:
        """Return a displacement, zero so far."""
        return fem.Function(self.space, name="displacement")

    @property
    def uniform_strain(self) -> Expr:
        """The initial strain of one, UFL, shape (3, 3)."""
        return self.kinematics.uniform_strain

    def parts(self, strain: Expr) -> list[tuple[Expr, int | None]]:
        """Return the stress of a strain, UFL, both of shape (3, 3), as a sum: each part with the
        quadrature degree of its work where it is reduced, else None.
        """
        raise NotImplementedError

    def stress(self, y: fem.Function, moved: Expr, initial: Expr | None) -> ElementStress:
        """Return the stress of a displacement, which jumps have ``moved``, with initial strains,
        None without any, UFL.
        """
        raise NotImplementedError

    def elastic(
        self, y: Expr | None, initial: Expr | None, *, on_axis: bool = False, apart: bool = False
    ) -> Expr:
        """Return the strain of a displacement, None: zero, without the initial one, None: zero,
        UFL, shape (3, 3).

        ``apart``: whether it is that of the reduced part, at its points.
        """
        if y is None:
            strain = ufl.zero(3, 3)
        elif apart and self.reduced == 1:
            strain = ufl.sym(self.kinematics.mean_gradient(y))
        else:
            strain = self.kinematics.strain(y, on_axis=on_axis)
        return strain if initial is None else strain - initial * self.uniform_strain

    def _strains(self, y: Expr | None, initial: Expr | None = None) -> tuple[Expr, Expr]:
        """Return strains of the whole and of the reduced part, see ``elastic``."""
        return self.elastic(y, initial), self.elastic(y, initial, apart=True)

    # --- works, as terms to be compiled one by one ---

    def terms(self, y: Expr, z: Expr) -> tuple[ufl.Form, ...]:
        """a(y, z) on displacements, UFL."""
        return self._work(self._strains(y), self._strains(z), self.degree)

    def strain_terms(self, z: Expr, strain: Expr, degree: int) -> tuple[ufl.Form, ...]:
        """Return the terms of an initial strain, see ``assembled``.

        ``degree``: of the quadrature.
        """
        return self._work((strain * self.uniform_strain,) * 2, self._strains(z), degree)

    def jump_terms(self, jump: fem.Function, z: Expr) -> tuple[ufl.Form, ...]:
        """Return the terms of a jump of the displacement, see ``assembled``."""
        return self.terms(jump, z)

    def force_terms(
        self, y: fem.Function, z: Expr, moved: Expr | None = None
    ) -> tuple[ufl.Form, ...]:
        """Return the terms of the work of the stress of y on z.

        ``moved``: y with jumps, if any.
        """
        return self.terms(y if moved is None else moved, z)

    def initial_terms(
        self, z: Expr, jump: Expr | None, strain: Expr | None, degree: int
    ) -> list[ufl.Form]:
        """Return the terms of the load by the stress of initial strains and of jumps of the
        displacement that are prevented, or None if there are none.

        ``degree``: of the quadrature of the strains.
        """
        free = () if strain is None else self.strain_terms(z, strain, degree)
        return [*free, *(() if jump is None else (-term for term in self.terms(jump, z)))]

    def prevented_terms(
        self, y: fem.Function, jump: Expr | None, strain: Expr | None, degree: int
    ) -> list[ufl.Form]:
        """Return the energy of that stress: what is missing in that of ``force_terms`` on y less
        their load.
        """
        degree = degree if jump is None else max(degree, self.degree)
        prevented = self._strains(jump, strain)
        return [0.5 * term for term in self._work(prevented, prevented, degree)]

    def dilation_terms(
        self, y: fem.Function, jump: Expr | None, strain: Expr | None, degree: int
    ) -> list[ufl.Form]:
        """Return the residual of the law of a pressure, tested with its functions, and at last the
        integrals of these.
        """
        raise NotImplementedError

    def _work(
        self, strains: tuple[Expr, Expr], tested: tuple[Expr, Expr], degree: int
    ) -> tuple[ufl.Form, ...]:
        """Return the work of the stress of such strains on others."""
        parts = zip(*map(self.parts, strains), strict=True)
        return tuple(
            self._integral(ufl.inner(part, tested[0]), degree)
            if reduced is None
            else self._integral(ufl.inner(apart, tested[1]), reduced)
            for (part, reduced), (apart, _) in parts
        )

    def _integral(self, density: Expr, degree: int) -> ufl.Form:
        """Over the body, with a quadrature of this degree."""
        around = self.kinematics.measure(ufl.SpatialCoordinate(self.tagged.mesh))
        return (
            density
            * around
            * ufl.dx(domain=self.tagged.mesh, metadata={"quadrature_degree": degree})
        )

    def compiled(self, space: fem.FunctionSpace) -> tuple[fem.Form, ...]:
        """Return the terms of a(., .)."""
        terms = self.terms(ufl.TrialFunction(space), ufl.TestFunction(space))
        return tuple(stiffness_form(term, space.mesh.topology.dim) for term in terms)

    def assembled(self, forms: Sequence[fem.Form], owned: int) -> tuple[Array, Array | None]:
        """Compiled terms of an initial strain or a jump at the owned unknowns of the displacement,
        and of the pressure,
        None: there is none.
        """
        return sum((assemble(form) for form in forms), np.zeros(owned)), None


@dataclass(frozen=True)
class IsotropicLaw(SceneLaw):
    """Sigma = 2 mu epsilon + lambda theta I, with the volumetric strain theta as the stiffness sees
    it.

    Both strains are without the initial one, and with the jumps across sections.  Without reduced
    integration theta is tr(epsilon).  A reduced volumetric term sees tr(epsilon) at the points of
    its rule only.  Between them it may have any value, and lambda times it is any multiple of the
    true stress if Poisson's ratio is near 1/2.  There theta is interpolated between these points:
    constant in a cell with one point, bilinear or trilinear with two along each axis.  This is the
    pressure of the method with two fields that reduced integration is equivalent to (Malkus and
    Hughes, Comput. Methods Appl. Mech. Engrg. 15 (1978) 63-81).
    """

    def parts(self, strain: Expr) -> list[tuple[Expr, int | None]]:
        lame, mu = self.lame
        apart = self.reduced
        mean = lame * ufl.tr(strain) * self.uniform_strain
        return (
            [(mean + 2 * mu * strain, None)]
            if apart is None
            else [(2 * mu * strain, None), (mean, apart)]
        )

    def stress(self, y: fem.Function, moved: Expr, initial: Expr | None) -> ElementStress:
        lame, mu = self.lame
        kinematics = self.kinematics
        mesh = self.tagged.mesh
        strain = self.elastic(moved, initial, on_axis=True)
        theta = ufl.tr(strain)
        interpolated = []
        if self.reduced is not None:
            at_points = fem.functionspace(
                mesh, element_at_points(mesh.topology.cell_name(), self.reduced)
            )
            with compiling():
                points = compat.interpolation_points(at_points.element)
                mean = ufl.tr(self.elastic(moved, initial, apart=True))
                expression = fem.Expression(mean, points, dtype=default_scalar_type)
            theta = fem.Function(at_points)
            interpolated.append((theta, expression))
        sigma = lame * theta * self.uniform_strain + 2 * mu * strain
        of_difference = partial(compliance, kinematics=kinematics, lame=lame, mu=mu)
        return ElementStress(y, kinematics, sigma, of_difference, lame + 2 * mu, mu, interpolated)


@dataclass(frozen=True)
class CellwiseLaw(SceneLaw):
    """The elastic law with a stiffness for each cell."""

    stiffness: CellwiseStiffness

    @property
    def uniform_strain(self) -> Expr:
        return self._tensor(self.stiffness.free_strain)

    def parts(self, strain: Expr) -> list[tuple[Expr, int | None]]:
        strains = components(strain, self.kinematics.stressed)
        return [(self._tensor(ufl.dot(self.stiffness.stiffness, strains)), None)]

    def _tensor(self, values: Expr) -> Expr:
        """Return a tensor from its components, UFL, shape (3, 3)."""
        at = {
            pair: k
            for k, (i, j) in enumerate(self.kinematics.stressed)
            for pair in ((i, j), (j, i))
        }
        return ufl.as_tensor(
            [[values[at[i, j]] if (i, j) in at else 0 for j in range(3)] for i in range(3)]
        )

    def stress(self, y: fem.Function, moved: Expr, initial: Expr | None) -> ElementStress:
        ((sigma, _),) = self.parts(self.elastic(moved, initial, on_axis=True))
        m = len(self.kinematics.pairs)
        stiffness = self.stiffness.stiffness
        moduli = stiffness.x.array.reshape(-1, *stiffness.ufl_shape)[:, :m, :m]
        return cellwise_stress(y, self.kinematics, sigma, moduli, self.lame[1])


def cellwise_stress(
    y: fem.Function,
    kinematics: Kinematics,
    sigma: Expr,
    moduli: Array,
    shear_modulus: Coefficient | None,
) -> ElementStress:
    """Return the stress in 3D by moduli that are constant in each cell: components of the stress,
    see ``Kinematics.pairs``, over those of the strain, of shear twice epsilon_ij, shape (cells, m,
    m); a LinAlgError on all ranks where some strain has no stress; collective.
    """
    mesh = y.function_space.mesh
    dim = y.function_space.mesh.geometry.dim
    m = moduli.shape[2]
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
    return ElementStress(
        y,
        kinematics,
        sigma,
        lambda tau: ufl.inner(ufl.dot(flexibility, tau), tau),
        largest,
        shear_modulus,
    )


def compliance(
    tau: Expr,
    kinematics: Kinematics,
    lame: Coefficient | None,
    mu: Coefficient,
    poisson: Coefficient | float = 0.5,
) -> Expr:
    """C^-1 tau : tau of an isotropic body for a stress tau, given by its components, see
    ``Kinematics.pairs``; without the first Lame parameter, which may be infinite, it follows from
    Poisson's ratio, but not in plane stress.
    """
    normal = [tau[k] for k, (i, j) in enumerate(kinematics.pairs) if i == j]
    trace = sum(normal[1:], normal[0])
    square = ufl.inner(tau, tau) + sum(
        tau[k] ** 2 for k, (i, j) in enumerate(kinematics.pairs) if i != j
    )
    share = poisson / (1 + poisson if len(normal) == 3 else 1)
    if lame is not None:
        share = lame / (len(normal) * lame + 2 * mu)
    return (square - share * trace**2) / (2 * mu)


def element_at_points(cell: str, degree: int) -> AbstractFiniteElement:
    """Return the discontinuous element whose nodes are the points of a Gauss rule: one point, or
    two along each axis.
    """
    if degree == 1:
        return basix.ufl.element("DG", cell, 0)
    return basix.ufl.element(
        "DQ", cell, 1, lagrange_variant=basix.LagrangeVariant.gl_warped, discontinuous=True
    )
