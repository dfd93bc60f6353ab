"""The constitutive law: isotropic linear elasticity in two and three dimensions."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field

from signorini_fx.scene.effect import Contradictions, Effect
from signorini_fx.scene.values import Finite, NonNegative, Positive, SampledValue


class LinearElastic(Effect):
    """Isotropic linear elasticity.

    Attributes:
        young: Young's modulus E > 0, stress.
        poisson: Poisson's ratio nu in (-1, 0.5).
        grading: between 0 and 1, by which ``young``, the largest, is multiplied: its value in the middle of each cell;
            None: 1 everywhere.
        hypothesis: plane strain, plane stress, or axisymmetric, if the mesh has two dimensions.  An axisymmetric mesh
            is half of a section: x[0] >= 0 is the radius, x[1] is along the axis, forces are those of a revolution.
        density: mass per volume, which ``gravity`` and ``rotation`` need; None: it is not known.
        expansion: coefficient of thermal expansion, 1 / temperature, which ``temperature`` needs; None: not known.
        region: name of the part of the body that is made of this material; None: all of it.
    """

    young: Positive
    poisson: Annotated[float, Field(gt=-1, lt=0.5, allow_inf_nan=False, strict=True)]
    grading: SampledValue | None = None
    hypothesis: Literal["plane strain", "plane stress", "axisymmetric"] = "plane strain"
    density: NonNegative | None = None
    expansion: Finite | None = None
    region: str | None = None

    @property
    def lame(self) -> tuple[float, float]:
        """Lame parameters (lambda, mu) of section 2.1, stresses, before grading; lambda is the reduced one for plane
        stress.

        Plane strain has those of three dimensions.
        """
        mu = self.young / (2 * (1 + self.poisson))
        if self.hypothesis == "plane stress":
            return self.young * self.poisson / (1 - self.poisson**2), mu
        return self.young * self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson)), mu

    @property
    def hooke(self) -> tuple[float, float]:
        """(a, b) of Hooke's law sigma = a epsilon + b tr(epsilon) I, stresses, for the second opinion."""
        a = self.young / (1 + self.poisson)
        squeezed = 1 - self.poisson if self.hypothesis == "plane stress" else 1 - 2 * self.poisson
        return a, a * self.poisson / squeezed

    @property
    def directions(self) -> int:
        """In how many directions a strain that is the same in all of them meets the Lame parameters: in plane stress
        it is free out of the plane.
        """
        return 2 if self.hypothesis == "plane stress" else 3

    @property
    def plane_modulus(self) -> float:
        """Stress per strain along a line without lateral stress: E / (1 - nu^2), in plane stress E."""
        return self.young if self.hypothesis == "plane stress" else self.young / (1 - self.poisson**2)

    @property
    def locks(self) -> bool:
        """Whether fully integrated elements lock visibly."""
        return self.poisson >= LOCKING_POISSON and self.hypothesis != "plane stress"

    @property
    def friction_indication(self) -> float:
        """The friction coefficient above which several solutions are to be expected: sqrt(3 - 4 nu) / (2 - 2 nu).

        This is an indication, not a theorem.  On a half-plane a wave exp(i k s) of the pressure changes the tangential
        displacement, and this the pressure; for every k, the fixed-point iteration contracts below this coefficient
        (1 / sqrt(S_NN C_TT), with the stiffness S and the compliance C of the surface, does not depend on k).  A bound
        for uniqueness that is both proved and independent of the mesh is not known: a solution exists for every
        coefficient in two dimensions (Ballard and Iurlano, arXiv:2303.16298), the discrete one is unique below a bound
        that decreases to zero with the mesh size (Hild, Int. J. Appl. Math. Comput. Sci. 12 (2002) 41-50), and examples
        with several solutions are known.
        """
        nu = self.poisson / (1 + self.poisson) if self.hypothesis == "plane stress" else self.poisson
        return math.sqrt(3 - 4 * nu) / (2 - 2 * nu)

    def contradictions(self, scene: Any, place: int) -> Contradictions:
        """See ``Effect``."""
        if self.hypothesis != scene.material[0].hypothesis:
            yield ("material", place), "all materials must have the same hypothesis"
        if self.hypothesis == "axisymmetric" and scene.accuracy is not None and place == 0:
            if scene.accuracy.of != "energy":
                yield ("accuracy", "of"), "has an estimate for energy only, where the body is axisymmetric"
            if scene.accuracy.refinement != "uniform":
                yield ("accuracy", "refinement"), "must be 'uniform' where the body is axisymmetric"


# Above this Poisson's ratio the fully integrated elements lock visibly.
LOCKING_POISSON = 0.45

Entry = LinearElastic


# --- its form --------------------------------------------------------------------------------------------------------


def strain(y: Any) -> Any:
    """Linearised strain, epsilon(y) of section 2.1, shape (d, d)."""
    import ufl

    return ufl.sym(ufl.grad(y))


def stress(y: Any, lame: Any, mu: Any) -> Any:
    """Stress sigma(y) = lambda tr(epsilon) I + 2 mu epsilon of section 2.1, shape (d, d)."""
    import ufl

    epsilon = strain(y)
    return lame * ufl.tr(epsilon) * ufl.Identity(len(y)) + 2 * mu * epsilon


def hoop_strain(y: Any, radius: Any) -> Any:
    """The strain along the circumference of an axisymmetric body, y_r / r; on the axis its limit, the radial strain."""
    import ufl

    inside = ufl.conditional(ufl.gt(radius, 0), radius, 1)
    return ufl.conditional(ufl.gt(radius, 0), y[0] / inside, y[0].dx(0))


def elastic_degree(cell: str, degree: int, geometry: int, *, axisymmetric: bool = False) -> int:
    """Quadrature degree of a(., .) for elements of ``degree`` on cells whose geometry has degree ``geometry``.

    The degree of epsilon(y) : epsilon(z) times the Jacobian's determinant on simplices; on quadrilaterals and
    hexahedra, where the integrand is rational, that of the products of all polynomials in it.  UFL estimates the same
    in the plane; it is stated here because the certificate integrates without UFL.  The radius and the hoop strain of
    axisymmetric bodies, which is rational, take two degrees more.
    """
    if axisymmetric:
        return elastic_degree(cell, degree, geometry) + 2
    if cell in ("triangle", "tetrahedron"):
        return 2 * (degree - 1) + (2 if cell == "triangle" else 3) * (geometry - 1)
    return 2 * (degree + geometry)


def elastic_forms(
    y: Any, z: Any, lame: Any, mu: Any, degree: int, reduced: int | None = None, *, radius: Any = None
) -> tuple[Any, ...]:
    """a(y, z) of section 2.1, as terms to be compiled one by one.

    Args:
        y: trial function.
        z: test function.
        lame: first Lame parameter.
        mu: second Lame parameter.
        degree: quadrature degree.
        reduced: quadrature degree of the volumetric term lambda tr(epsilon y) tr(epsilon z); None: as exact as the
            rest.
        radius: of an axisymmetric body; None: it is not.

    Returns:
        One term, or two if the volumetric one is reduced: FFCx 0.9 compiles a form wrongly that contains a one-point
        rule and another rule on quadrilaterals.
    """
    import ufl

    dx = ufl.dx(metadata={"quadrature_degree": degree})
    if reduced is None and radius is None:
        return (ufl.inner(stress(y, lame, mu), strain(z)) * dx,)
    shearing, first, second = ufl.inner(strain(y), strain(z)), ufl.tr(strain(y)), ufl.tr(strain(z))
    around = 1
    if radius is not None:
        shearing, around = shearing + y[0] / radius * z[0] / radius, 2 * math.pi * radius
        first, second = first + y[0] / radius, second + z[0] / radius
    volumetric = lame * first * second
    if reduced is None:
        return ((2 * mu * shearing + volumetric) * around * dx,)
    return (
        2 * mu * shearing * around * dx,
        volumetric * around * ufl.dx(metadata={"quadrature_degree": reduced}),
    )


def initial_strain_forms(
    z: Any,
    strain: Any,
    lame: Any,
    mu: Any,
    degree: int,
    reduced: int | None = None,
    *,
    directions: int = 3,
    radius: Any = None,
) -> tuple[Any, ...]:
    """The work of the stress of an initial strain, a(strain I, z), as terms to be compiled one by one.

    Its stress is (2 mu + k lambda) strain I, with k directions; in plane strain the one out of the plane is among them.

    Args:
        z: test function.
        strain: in each direction, a number.
        lame: see ``elastic_forms``.
        mu: see ``elastic_forms``.
        degree: quadrature degree.
        reduced: see ``elastic_forms``: free expansion is without stress only if both are integrated alike.
        directions: see ``LinearElastic.directions``.
        radius: see ``elastic_forms``.
    """
    import ufl

    dilation, around = ufl.div(z), 1
    if radius is not None:
        dilation, around = dilation + z[0] / radius, 2 * math.pi * radius
    dx = ufl.dx(metadata={"quadrature_degree": degree})
    density = strain * dilation * around
    if reduced is None:
        return ((2 * mu + directions * lame) * density * dx,)
    return 2 * mu * density * dx, directions * lame * density * ufl.dx(metadata={"quadrature_degree": reduced})
