"""The elastic law of a body on its mesh, with one interface for all that assembles, shows or checks
a stress.

Two laws have the displacement as their only unknown: that of isotropic materials, whose volumetric
term may be integrated with fewer points, and that of other materials, with a stiffness for each
cell.  A third one has a pressure as a further unknown (``mixed_pressure``).
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
from signorini_fx.mechanics.kinematics import Kinematics, components, position
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.statement import Statement

# A function, and the expression from which it is interpolated.
Interpolation = tuple[fem.Function, fem.Expression]


@dataclass(frozen=True)
class ElementStress:
    """The stress of a displacement as UFL, as the stiffness sees it, and quantities of its law.

    Everything that shows or checks a stress takes it from here.
    """

    displacement: fem.Function  # y, whose values may change
    kinematics: Kinematics  # of the displacement
    in_space: Expr  # the stress, shape (3, 3), up to date after ``refresh``
    # Returns C^-1 tau : tau from the components tau of a difference of stresses.
    compliance: Callable[[Expr], Expr]
    modulus: Expr | None  # the largest normal stress per strain, lambda + 2 mu
    # mu, of an orthotropic material a mean; None: the body is not known to be isotropic
    shear_modulus: Coefficient | None
    # Functions in the stress that must be interpolated from the displacement.
    interpolated: Sequence[Interpolation] = ()
    # The cells of each part within which the stress has no jumps, local numbers, ghosts included.
    parts: Sequence[Indices] = ()
    # Sets jumps and initial strains to a place in the lists of factors.
    move: Callable[[float], None] = lambda place: None

    def refresh(self, step: float) -> None:
        """Update interpolated functions from the displacement, on all cells of this rank, with
        jumps and initial strains at a place in the lists of factors.
        """
        self.move(step)
        for function, expression in self.interpolated:
            function.interpolate(expression)

    @property
    def around(self) -> Expr:
        """The factor of areas and lengths of the mesh, see ``Kinematics.measure``."""
        return self.kinematics.measure(position(self.displacement))

    @property
    def sigma(self) -> Expr:
        """The stress along the axes of the displacement, UFL, shape (d, d)."""
        axes = range(self.kinematics.dimension)
        return ufl.as_matrix([[self.in_space[i, j] for j in axes] for i in axes])

    @property
    def components(self) -> Expr:
        """The components ``Kinematics.stressed`` of the stress, UFL, shape (m,)."""
        return ufl.as_vector([self.in_space[pair] for pair in self.kinematics.stressed])

    def squared(self, difference: Expr, times: Expr, dx: ufl.Measure) -> ufl.Form:
        """Return the form of C^-1 tau : tau times a factor.

        Args:
            difference: tau, a difference of stresses by its ``components``.
            times: the factor.
            dx: the measure.
        """
        within = ufl.as_vector([difference[k] for k in range(len(self.kinematics.pairs))])
        return times * self.compliance(within) * self.around * dx


def fields_of(displacement: fem.Function) -> tuple[fem.Function, ...]:
    """Return the displacement, and with a mixed element its pressure too."""
    return (
        (displacement, displacement.hydrostatic)
        if hasattr(displacement, "hydrostatic")
        else (displacement,)
    )


@dataclass(frozen=True)
class SceneLaw:
    """The elastic law of the materials of a scene; its methods are collective."""

    # Whether a pressure is an unknown too, so that the matrix is indefinite.
    pressed: ClassVar[bool] = False

    statement: Statement
    tagged: TaggedMesh
    space: fem.FunctionSpace  # of the displacement
    # Lame parameters as coefficients; for materials that are not isotropic some mean of them
    lame: tuple[Coefficient, Coefficient]
    stiffness: CellwiseStiffness | None = None  # None: all materials are isotropic
    # Quadrature degree of the volumetric term if it is reduced, else None.
    reduced: int | None = None

    @property
    def kinematics(self) -> Kinematics:
        """The kinematics of the body."""
        return self.statement.kinematics_in(self.tagged.dimension)

    @cached_property
    def degree(self) -> int:
        """The quadrature degree of a(., .)."""
        return strain_degree(self.space, self.kinematics)

    def displacement(self) -> fem.Function:
        """Return a new displacement, zero, which may carry further unknowns."""
        return fem.Function(self.space, name="displacement")

    @property
    def uniform_strain(self) -> Expr:
        """The strain tensor of a unit initial strain, UFL, shape (3, 3)."""
        return self.kinematics.uniform_strain

    def parts(self, strain: Expr) -> list[tuple[Expr, int | None]]:
        """Return the stress of a strain as a sum of parts, UFL, shape (3, 3).

        Each part comes with the quadrature degree of its work, None if that is not reduced.
        """
        raise NotImplementedError

    def stress(self, y: fem.Function, moved: Expr, initial: Expr | None) -> ElementStress:
        """Return the stress of a displacement.

        Args:
            y: the displacement.
            moved: the displacement with jumps across sections, UFL.
            initial: the initial strain, UFL; None: none.
        """
        raise NotImplementedError

    def elastic(
        self, y: Expr | None, initial: Expr | None, *, on_axis: bool = False, apart: bool = False
    ) -> Expr:
        """Return the elastic strain: that of a displacement minus the initial strain, UFL, shape
        (3, 3).

        Args:
            y: the displacement; None: zero.
            initial: the initial strain; None: zero.
            on_axis: whether limits are needed where x[0] = 0, see ``Kinematics.gradient``.
            apart: whether it is for the reduced part, at the points of its rule.
        """
        if y is None:
            strain = ufl.zero(3, 3)
        elif apart and self.reduced == 1:
            strain = ufl.sym(self.kinematics.mean_gradient(y))
        else:
            strain = self.kinematics.strain(y, on_axis=on_axis)
        return strain if initial is None else strain - initial * self.uniform_strain

    def _strains(self, y: Expr | None, initial: Expr | None = None) -> tuple[Expr, Expr]:
        """Return the elastic strain for the full and for the reduced part, see ``elastic``."""
        return self.elastic(y, initial), self.elastic(y, initial, apart=True)

    # --- works, as terms to be compiled one by one ---

    def terms(self, y: Expr, z: Expr) -> tuple[ufl.Form, ...]:
        """Return the terms of a(y, z), UFL."""
        return self._work(self._strains(y), self._strains(z), self.degree)

    def strain_terms(self, z: Expr, strain: Expr, degree: int) -> tuple[ufl.Form, ...]:
        """Return the terms of the load of an initial strain, see ``assembled``.

        Args:
            z: the test function.
            strain: the initial strain.
            degree: of the quadrature.
        """
        return self._work((strain * self.uniform_strain,) * 2, self._strains(z), degree)

    def jump_terms(self, jump: fem.Function, z: Expr) -> tuple[ufl.Form, ...]:
        """Return the terms of a jump of the displacement, see ``assembled``."""
        return self.terms(jump, z)

    def force_terms(
        self, y: fem.Function, z: Expr, moved: Expr | None = None
    ) -> tuple[ufl.Form, ...]:
        """Return the terms of the work of the stress of y on z.

        Args:
            y: the displacement.
            z: the test function.
            moved: y with jumps; None: there are none.
        """
        return self.terms(y if moved is None else moved, z)

    def initial_terms(
        self, z: Expr, jump: Expr | None, strain: Expr | None, degree: int
    ) -> list[ufl.Form]:
        """Return the terms of the load from initial strains, and from jumps of the displacement;
        empty without both.

        Args:
            z: the test function.
            jump: the jump of the displacement; None: none.
            strain: the initial strain; None: none.
            degree: quadrature degree of the strain terms.
        """
        free = () if strain is None else self.strain_terms(z, strain, degree)
        return [*free, *(() if jump is None else (-term for term in self.terms(jump, z)))]

    def prevented_terms(
        self, y: fem.Function, jump: Expr | None, strain: Expr | None, degree: int
    ) -> list[ufl.Form]:
        """Return the energy of the stress that prevented initial strains and jumps cause; with a
        pressure, what both add to the strain energy of y.

        It completes the strain energy: half the work ``force_terms`` of y on itself, minus the work
        of their load, plus this.
        """
        degree = degree if jump is None else max(degree, self.degree)
        prevented = self._strains(jump, strain)
        return [0.5 * term for term in self._work(prevented, prevented, degree)]

    def dilation_terms(
        self, y: fem.Function, jump: Expr | None, strain: Expr | None, degree: int
    ) -> list[ufl.Form]:
        """Return the residual of the volumetric law of a pressure, tested with its functions, and
        as the last term the integrals of these functions.
        """
        raise NotImplementedError

    def _work(
        self, strains: tuple[Expr, Expr], tested: tuple[Expr, Expr], degree: int
    ) -> tuple[ufl.Form, ...]:
        """Return the work of the stress of some strains on tested strains.

        Args:
            strains: for the full and the reduced part, see ``_strains``.
            tested: likewise.
            degree: quadrature degree of the parts that are not reduced.
        """
        parts = zip(*map(self.parts, strains), strict=True)
        return tuple(
            self._integral(ufl.inner(part, tested[0]), degree)
            if reduced is None
            else self._integral(ufl.inner(apart, tested[1]), reduced)
            for (part, reduced), (apart, _) in parts
        )

    def _integral(self, density: Expr, degree: int) -> ufl.Form:
        """Return the integral of a density over the body, with this quadrature degree."""
        around = self.kinematics.measure(ufl.SpatialCoordinate(self.tagged.mesh))
        return (
            density
            * around
            * ufl.dx(domain=self.tagged.mesh, metadata={"quadrature_degree": degree})
        )

    def compiled(self, space: fem.FunctionSpace) -> tuple[fem.Form, ...]:
        """Return the compiled terms of a(., .)."""
        terms = self.terms(ufl.TrialFunction(space), ufl.TestFunction(space))
        return tuple(stiffness_form(term, space.mesh.topology.dim) for term in terms)

    def assembled(self, forms: Sequence[fem.Form], owned: int) -> tuple[Array, Array | None]:
        """Return the load vector of an initial strain or a jump, at the owned unknowns of the
        displacement and at those of the pressure; the second is None without a pressure.

        Args:
            forms: the compiled terms.
            owned: number of owned dofs of the displacement.
        """
        return sum((assemble(form) for form in forms), np.zeros(owned)), None


@dataclass(frozen=True)
class IsotropicLaw(SceneLaw):
    """The isotropic law sigma = 2 mu epsilon + lambda theta I, with the volumetric strain theta as
    the stiffness sees it.

    Initial strains are subtracted from both strains, and jumps across sections are added.  Without
    reduced integration theta is tr(epsilon).  A reduced volumetric term uses tr(epsilon) at the
    points of its rule only; elsewhere tr(epsilon) may have any value, and lambda times it may be
    any multiple of the true stress if Poisson's ratio is near 1/2.  Therefore theta is interpolated
    between these points: constant in a cell with one point, bilinear or trilinear with two along
    each axis.  This is the pressure of the method with two fields that reduced integration is
    equivalent to (Malkus and Hughes, Comput. Methods Appl. Mech. Engrg. 15 (1978) 63-81).
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
    """The elastic law with a stiffness matrix for each cell."""

    stiffness: CellwiseStiffness

    @property
    def uniform_strain(self) -> Expr:
        return self._tensor(self.stiffness.free_strain)

    def parts(self, strain: Expr) -> list[tuple[Expr, int | None]]:
        strains = components(strain, self.kinematics.stressed)
        return [(self._tensor(ufl.dot(self.stiffness.stiffness, strains)), None)]

    def _tensor(self, values: Expr) -> Expr:
        """Return the tensor with these components, UFL, shape (3, 3)."""
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
    """Return the stress for moduli that are constant in each cell; collective.

    Args:
        y: the displacement.
        kinematics: of the body.
        sigma: its stress, UFL, shape (3, 3).
        moduli: matrix from strain to stress in each cell, components ``Kinematics.pairs`` with
            shear strains 2 epsilon_ij, shape (cells, m, m).
        shear_modulus: mu; None: the body is not known to be isotropic.

    Raises:
        LinAlgError: a matrix is singular on some rank.
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
    """Return C^-1 tau : tau of an isotropic body, UFL.

    Args:
        tau: components of a stress, see ``Kinematics.pairs``.
        kinematics: of the body.
        lame: first Lame parameter; None: it may be infinite, and Poisson's ratio is used, which
            does not cover plane stress.
        mu: shear modulus.
        poisson: Poisson's ratio, used without ``lame``.
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
    """Return the discontinuous element whose nodes are the points of a Gauss rule: one point for
    degree 1, else two along each axis.
    """
    if degree == 1:
        return basix.ufl.element("DG", cell, 0)
    return basix.ufl.element(
        "DQ", cell, 1, lagrange_variant=basix.LagrangeVariant.gl_warped, discontinuous=True
    )
