"""The constitutive law: linear elasticity in two and three dimensions; see ``scene.orthotropic`` for that of wood."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator
from pydantic_core import PydanticKnownError

from signorini_fx.kinematics.cartesian import Kinematics, position
from signorini_fx.kinematics.space import SPACE
from signorini_fx.scene.effect import Contradictions, Effect, Features
from signorini_fx.scene.orthotropic import Orthotropic
from signorini_fx.scene.values import Finite, NonNegative, Positive, SampledValue


def _filled() -> Any:
    """The default of what an orthotropic material fills in."""
    return Field(default=None, validate_default=True)


_ORTHOTROPIC = "is not possible yet with an orthotropic material"


class LinearElastic(Effect):
    """Linear elasticity, isotropic or orthotropic.

    Attributes:
        orthotropic: constants that depend on the direction, instead of ``young`` and ``poisson``; None: they do not.
        young: Young's modulus E > 0, stress; of an orthotropic material its largest one.
        poisson: Poisson's ratio nu in (-1, 0.5); 0.5 too in plane stress, and where ``element.volumetric`` is mixed; of
            an orthotropic material a mean, which only settings follow.
        grading: between 0 and 1, by which ``young``, the largest, is multiplied: its value in the middle of each cell;
            None: 1 everywhere.
        poisson_grading: likewise, from 0 to 1, by which ``poisson``, the largest, is multiplied.
        hypothesis: plane strain, plane stress, or axisymmetric, if the mesh has two dimensions.  An axisymmetric mesh
            is half of a section: x[0] >= 0 is the radius, x[1] is along the axis, forces are those of a revolution.
        torsion: whether an axisymmetric body also moves around its axis; the components z are those around it, along
            x[2], so that an angle about x[1] moves a point by -angle x[0].
        density: mass per volume, which ``gravity`` and ``rotation`` need; None: it is not known.
        expansion: coefficient of thermal expansion, 1 / temperature, which ``temperature`` needs; None: not known.
        region: name of the part of the body that is made of this material; None: all of it.
    """

    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "orthotropic material": {
            "mixed element": f"{_ORTHOTROPIC}: take 'full'",
            "reduced integration": f"{_ORTHOTROPIC}: take 'full'",
            "initial strain": f"{_ORTHOTROPIC}, whose expansion depends on the direction too",
        },
        "graded Poisson's ratio": {
            "orthotropic material": "is not possible yet where a material has a poisson_grading"
        },
    }

    orthotropic: Orthotropic | None = None
    young: Positive = _filled()
    poisson: Annotated[float, Field(gt=-1, le=0.5, allow_inf_nan=False, strict=True)] = _filled()
    grading: SampledValue | None = None
    poisson_grading: SampledValue | None = None
    hypothesis: Literal["plane strain", "plane stress", "axisymmetric"] = "plane strain"
    torsion: bool = False
    density: NonNegative | None = None
    expansion: Finite | None = None
    region: str | None = None

    @field_validator("young", "poisson", mode="before")
    @classmethod
    def _of_axes(cls, constant: Any, info: ValidationInfo) -> Any:
        if "orthotropic" not in info.data:  # which is wrong, and reported
            return 0.1 if constant is None else constant
        axes = info.data["orthotropic"]
        if axes is None and constant is None:
            raise PydanticKnownError("missing")
        if axes is None:
            return constant
        if constant is not None:
            raise ValueError("is one of the constants in orthotropic: leave it out here")
        first, second = axes.mean_lame
        return max(axes.young) if info.field_name == "young" else first / (2 * (first + second))

    @property
    def lame(self) -> tuple[float, float]:
        """Lame parameters (lambda, mu) of section 2.1, stresses, before grading; lambda is the reduced one for plane
        stress, and infinite elsewhere for nu = 1/2; means of an orthotropic material.

        Plane strain has those of three dimensions.
        """
        if self.orthotropic is not None:
            return self.orthotropic.mean_lame
        if self.poisson == 0.5 and self.hypothesis != "plane stress":
            return math.inf, self.young / (2 * (1 + self.poisson))
        return self.lame_of(self.young, self.poisson)

    def lame_of(self, young: Any, poisson: Any) -> tuple[Any, Any]:
        """The same for other numbers, or arrays of them."""
        mu = young / (2 * (1 + poisson))
        if self.hypothesis == "plane stress":
            return young * poisson / (1 - poisson**2), mu
        return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), mu

    @property
    def graded(self) -> bool:
        """Whether a modulus varies within the material."""
        return self.grading is not None or self.poisson_grading is not None

    @property
    def hooke(self) -> tuple[float, float]:
        """(a, b) of Hooke's law sigma = a epsilon + b tr(epsilon) I, stresses, for the second opinion."""
        if self.orthotropic is not None:
            first, second = self.orthotropic.mean_lame
            return 2 * second, first
        squeezed = 1 - self.poisson if self.hypothesis == "plane stress" else 1 - 2 * self.poisson
        return self.hooke_of(self.young, self.poisson) if squeezed > 0 else (self.young / (1 + self.poisson), math.inf)

    def hooke_of(self, young: Any, poisson: Any) -> tuple[Any, Any]:
        """The same for other numbers, or arrays of them."""
        a = young / (1 + poisson)
        squeezed = 1 - poisson if self.hypothesis == "plane stress" else 1 - 2 * poisson
        return a, a * poisson / squeezed

    def stiffest(self, *, mixed: bool) -> float:
        """The largest normal stress per strain, without the pressure of a ``mixed`` element."""
        if self.orthotropic is not None:
            return float(np.linalg.inv(self.orthotropic.compliance).diagonal().max())
        return sum(self.hooke[: 1 if mixed else 2])

    @property
    def directions(self) -> int:
        """In how many directions a strain that is the same in all of them meets the Lame parameters: in plane stress
        it is free out of the plane.
        """
        return 2 if self.hypothesis == "plane stress" else 3

    @property
    def plane_modulus(self) -> float:
        """Stress per strain along a line without lateral stress: E / (1 - nu^2), in plane stress E; at most this if
        the material is orthotropic.
        """
        if self.orthotropic is not None:
            return self.stiffest(mixed=False)
        return self.young if self.hypothesis == "plane stress" else self.young / (1 - self.poisson**2)

    @property
    def locks(self) -> bool:
        """Whether fully integrated elements lock visibly."""
        isotropic = self.orthotropic is None
        return isotropic and self.poisson >= LOCKING_POISSON and self.hypothesis != "plane stress"

    @property
    def friction_indication(self) -> float:
        """The friction coefficient above which several solutions are to be expected: sqrt(3 - 4 nu) / (2 - 2 nu).

        This is an indication, not a theorem.  On a half-plane a wave exp(i k s) of the pressure changes the tangential
        displacement, and this the pressure; for every k, the fixed-point iteration contracts below this coefficient
        (1 / sqrt(S_NN C_TT), with the stiffness S and the compliance C of the surface, does not depend on k).  A bound
        for uniqueness that is both proved and independent of the mesh is not known: a solution exists for every
        coefficient in two dimensions (Ballard and Iurlano, arXiv:2303.16298), the discrete one is unique below a bound
        that decreases to zero with the mesh size (Hild, Int. J. Appl. Math. Comput. Sci. 12 (2002) 41-50), and examples
        with several solutions are known.  For an orthotropic material there is no indication.
        """
        if self.orthotropic is not None:
            return math.inf
        nu = self.poisson / (1 + self.poisson) if self.hypothesis == "plane stress" else self.poisson
        return math.sqrt(3 - 4 * nu) / (2 - 2 * nu)

    @property
    def features(self) -> Features:
        """See ``Effect``."""
        listed = (
            ("orthotropic material", "orthotropic", self.orthotropic is not None),
            ("graded material", "grading", self.graded),
            ("graded Poisson's ratio", "poisson_grading", self.poisson_grading is not None),
        )
        return tuple((name, (key,)) for name, key, used in listed if used)

    def contradictions(self, scene: Any, number: int) -> Contradictions:
        """See ``Effect``."""
        if self.hypothesis != scene.material[0].hypothesis:
            yield ("material", number), "all materials must have the same hypothesis"
        if self.torsion and self.hypothesis != "axisymmetric":
            yield ("material", number, "torsion"), 'needs hypothesis = "axisymmetric": other bodies have no axis'
        if self.torsion != scene.material[0].torsion:
            yield ("material", number, "torsion"), "must be the same in all materials"
        if scene.element.volumetric == "mixed":
            if not self.poisson > 0:
                yield ("material", number, "poisson"), "must be above 0 where element.volumetric = 'mixed'"
            if number == 0 and scene.element.degree != 2:
                yield ("element", "degree"), "must be 2 for 'mixed', whose pressure has one degree less"
        elif self.poisson == 0.5 and self.hypothesis != "plane stress":
            cure = 'element = { degree = 2, volumetric = "mixed" }, whose pressure is an unknown of its own'
            yield ("material", number, "poisson"), f"must be below 0.5: an incompressible body needs {cure}"


# Above this Poisson's ratio the fully integrated elements lock visibly.
LOCKING_POISSON = 0.45

Entry = LinearElastic


# --- its form --------------------------------------------------------------------------------------------------------


def elastic_degree(cell: str, degree: int, geometry: int) -> int:
    """Quadrature degree of a(., .) for elements of ``degree`` on cells whose geometry has degree ``geometry``, which is
    0 for quadrilaterals and hexahedra if their maps are affine (``body.quadrature``); see also
    ``Kinematics.further_degrees``.

    The degree of epsilon(y) : epsilon(z) times the Jacobian's determinant on simplices and along each axis of
    parallelepipeds; on other quadrilaterals and hexahedra, where the integrand is rational, that of the products of all
    polynomials in it.  UFL estimates the same on these in the plane; it is stated here because the certificate
    integrates without UFL.
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
    directions: int = 3,
    kinematics: Kinematics = SPACE,
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
        kinematics: see ``elastic_forms``.
    """
    import ufl

    dilation, around = ufl.tr(kinematics.strain(z)), kinematics.measure(position(z))
    dx = ufl.dx(metadata={"quadrature_degree": degree})
    density = strain * dilation * around
    if reduced is None:
        return ((2 * mu + directions * lame) * density * dx,)
    return 2 * mu * density * dx, directions * lame * density * ufl.dx(metadata={"quadrature_degree": reduced})


def mixed_strain_form(q: Any, strain: Any, swelling: Any, degree: int, *, kinematics: Kinematics = SPACE) -> Any:
    """The work of an initial strain e I in the constraint of the mixed element, ((3 + 2 mu / lambda) e, q).

    With the pressure p = 2 mu e - lambda (tr(epsilon) - 3 e) the stress is 2 mu epsilon - p I, as without the strain,
    which enters the constraint alone: div y + p / lambda = (3 + 2 mu / lambda) e.

    Args:
        q: test function of the pressure.
        strain: e, a number.
        swelling: 3 + 2 mu / lambda = (1 + nu) / nu.
        degree: quadrature degree.
        kinematics: see ``elastic_forms``.
    """
    import ufl

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
        kinematics: see ``elastic_forms``.

    Returns:
        The form of (y, z), that of (y, q), and that of (p, q).
    """
    import ufl

    (y, p), (z, q) = unknowns, tests
    trial_strain, around = kinematics.strain(y), kinematics.measure(position(z))
    shearing, dilation = ufl.inner(trial_strain, kinematics.strain(z)), ufl.tr(trial_strain)
    dx = ufl.dx(metadata={"quadrature_degree": degree})
    densities = 2 * mu * shearing, -unit * dilation * q, -(unit**2) * compressibility * p * q
    return tuple(density * around * dx for density in densities)
