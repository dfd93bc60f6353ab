"""Isotropic linear elasticity in two and three dimensions, and its forms."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar

from pydantic import Field

from signorini_fx.mechanics.kinematics.cartesian import SPACE
from signorini_fx.mechanics.kinematics.protocol import Kinematics, position
from signorini_fx.mechanics.materials.protocol import Material
from signorini_fx.mechanics.statement.effect import Contradictions, Features
from signorini_fx.mechanics.statement.values import Positive, SampledValue
from signorini_fx.mechanics.statement.volumetric import treatment_of
from signorini_fx.tuned import LOCKING_POISSON, SAME_NUMBER


class LinearElastic(Material):
    """Isotropic linear elasticity.

    Attributes:
        young: Young's modulus E > 0, stress, which ``grading`` multiplies.
        poisson: Poisson's ratio nu in (-1, 0.5); 0.5 too in plane stress, and with a pressure as an unknown.
        poisson_grading: from 0 to 1, by which ``poisson``, the largest, is multiplied, likewise.
        yield_stress: by von Mises, a stress, which gives ``utilisation`` and changes nothing else; None: not known.
        hypothesis, torsion, grading, density, expansion, region: see ``Material``.
    """

    isotropic: ClassVar[bool] = True

    young: Positive
    poisson: Annotated[float, Field(gt=-1, le=0.5, allow_inf_nan=False, strict=True)]
    poisson_grading: SampledValue | None = None
    yield_stress: Positive | None = None

    def stress(self, strain: Any) -> Any:
        import ufl

        lame, mu = self.lame_of(self.young, self.poisson, prevented=True)
        return 2 * mu * strain + lame * ufl.tr(strain) * ufl.Identity(3)

    @property
    def features(self) -> Features:
        graded = self.poisson_grading is not None
        return (*super().features, *((("graded Poisson's ratio", ("poisson_grading",)),) if graded else ()))

    @property
    def yields_at(self) -> float:
        return math.inf if self.yield_stress is None else self.yield_stress

    @property
    def varies(self) -> bool:
        return self.grading is not None or self.poisson_grading is not None

    @property
    def natural_modulus(self) -> float:
        return self.young

    @property
    def lame(self) -> tuple[float, float]:
        """Lame parameters (lambda, mu) of section 2.1, stresses, before grading; lambda is the reduced one for plane
        stress, and infinite elsewhere for nu = 1/2.

        Plane strain has those of three dimensions.
        """
        if self.poisson == 0.5 and self.hypothesis != "plane stress":
            return math.inf, self.young / (2 * (1 + self.poisson))
        return self.lame_of(self.young, self.poisson)

    def lame_of(self, young: Any, poisson: Any, *, prevented: bool = False) -> tuple[Any, Any]:
        """The same for other numbers, or arrays of them; ``prevented``: those of three dimensions anyway."""
        mu = young / (2 * (1 + poisson))
        if self.hypothesis == "plane stress" and not prevented:
            return young * poisson / (1 - poisson**2), mu
        return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), mu

    def stiffest(self, *, pressed: bool) -> float:
        first, second = self.lame
        return 2 * second if pressed else 2 * second + first

    @property
    def locks(self) -> bool:
        """See ``Material``; of nonlinear materials the ratio follows from moduli, with round-off."""
        return self.poisson >= LOCKING_POISSON * (1 - SAME_NUMBER) and self.hypothesis != "plane stress"

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        yield from super().contradictions(statement, number)
        apart = not all(material.isotropic for material in statement.material)
        if apart and self.poisson_grading is not None:
            reason = "is not possible yet where another material is anisotropic"
            yield ("material", number, "poisson_grading"), reason
        if treatment_of(statement).pressed:
            setting = repr(statement.element.volumetric)
            if not self.poisson > 0:
                yield ("material", number, "poisson"), f"must be above 0 where element.volumetric = {setting}"
            if number == 0 and statement.element.degree != 2:
                yield ("element", "degree"), f"must be 2 for {setting}, whose pressure has one degree less"
        elif self.poisson == 0.5 and (apart or self.hypothesis != "plane stress"):
            cure = 'element = { degree = 2, volumetric = "mixed" }, whose pressure is an unknown of its own'
            yield ("material", number, "poisson"), f"must be below 0.5: an incompressible body needs {cure}"


# --- its form --------------------------------------------------------------------------------------------------------


def elastic_degree(cell: str, degree: int, geometry: int) -> int:
    """Quadrature degree of a(., .) for elements of ``degree`` on cells whose geometry has degree ``geometry``, which is
    0 for quadrilaterals and hexahedra if their maps are affine (``assembly.quadrature``); see also
    ``Kinematics.further_degrees``.

    The degree of epsilon(y) : epsilon(z) times the Jacobian's determinant on simplices and along each axis of
    parallelepipeds; on other quadrilaterals and hexahedra, where the integrand is rational, that of the products of all
    polynomials in it.  UFL estimates the same on these in 2D.
    """
    if cell in ("triangle", "tetrahedron"):
        return 2 * (degree - 1) + (2 if cell == "triangle" else 3) * (geometry - 1)
    return 2 * (degree + geometry)


def elastic_forms(
    y: Any, z: Any, lame: Any, mu: Any, degree: int, reduced: int | None = None, *, kinematics: Kinematics = SPACE
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
        kinematics: give strain and measure.

    Returns:
        One term, or two if the volumetric one is reduced: FFCx 0.9 compiles a form wrongly that contains a one-point
        rule and another rule on quadrilaterals.
    """
    import ufl

    dx = ufl.dx(metadata={"quadrature_degree": degree})
    trial_strain, test_strain = kinematics.strain(y), kinematics.strain(z)
    around = kinematics.measure(position(z))
    if reduced is None:
        stress = lame * ufl.tr(trial_strain) * ufl.Identity(trial_strain.ufl_shape[0]) + 2 * mu * trial_strain
        return (ufl.inner(stress, test_strain) * around * dx,)
    shearing = ufl.inner(trial_strain, test_strain)
    volumetric = lame * ufl.tr(trial_strain) * ufl.tr(test_strain)
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
    kinematics: Kinematics = SPACE,
) -> tuple[Any, ...]:
    """The work of the stress of an initial strain, a(strain I, z), as terms to be compiled one by one.

    Its stress is (2 mu + k lambda) strain I, with k ``kinematics.directions``.

    Args:
        z: test function.
        strain: in each direction, a number.
        lame: see ``elastic_forms``.
        mu: see ``elastic_forms``.
        degree: quadrature degree.
        reduced: see ``elastic_forms``: free expansion is without stress only if both are integrated alike.
        kinematics: see ``elastic_forms``.
    """
    import ufl

    dilation, around = ufl.tr(kinematics.strain(z)), kinematics.measure(position(z))
    dx = ufl.dx(metadata={"quadrature_degree": degree})
    density, directions = strain * dilation * around, kinematics.directions
    if reduced is None:
        return ((2 * mu + directions * lame) * density * dx,)
    return 2 * mu * density * dx, directions * lame * density * ufl.dx(metadata={"quadrature_degree": reduced})
