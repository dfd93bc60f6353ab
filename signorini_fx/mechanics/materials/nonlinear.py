"""The interface of nonlinear materials.  A scene with one is solved by Newton's method, see
``scenes.nonlinear``.

For finite strains a material has a stored energy per undeformed volume in two parts: that of the
shape, and that of the volume, which may be integrated with fewer points.  For small strains it has
a stress that depends on the history, with its tangent.  An example of the former:

    class Soft(Hyperelastic):
        law: Literal["soft"] = "soft"
        shear: Positive
        bulk: Positive

        def shape_energy(self, gradient):
            import ufl

            volume = ufl.det(gradient)
            return self.shear / 2 * (ufl.inner(gradient, gradient) * volume ** (-2 / 3) - 3)

        def volume_energy(self, volume):
            return self.bulk / 2 * (volume - 1) ** 2

        @property
        def constants_at_rest(self):
            return self.shear, self.bulk

F = I + grad u and J = det F have an absolute round-off of 1e-16, so that stresses at strains of
1e-10 have only six digits.  The methods whose names end in ``by_change`` take grad u and J - 1
instead, from which stresses have all digits however small they are.  Unless a material overrides
them, they call the methods above.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from signorini_fx.arrays import Array, Expr
from signorini_fx.extensions import is_of_package
from signorini_fx.mechanics.kinematics import KINDS
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.materials.protocol import Material
from signorini_fx.mechanics.statement.effect import Contradictions, Features, Resistance, Stated
from signorini_fx.tuned import NEAR_ONE

PoissonBelowHalf = Annotated[float, Field(gt=-1, lt=0.5, allow_inf_nan=False, strict=True)]
_NOT_YET = "is not possible yet with a nonlinear material"


class NonlinearMaterial(Material):
    """An isotropic material whose stress is not a linear function of the strain, see
    ``Material``.
    """

    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "nonlinear material": {
            "plane stress": "a nonlinear material in plane stress is not possible yet: take plane "
            "strain",
            "axisymmetric, torsion": "a nonlinear material with torsion is not possible yet",
            "mixed element": "a pressure as an unknown is not possible yet with a nonlinear "
            "material: take 'reduced' "
            "or 'auto'",
            "accuracy of the zone or the peak": "must be 'energy', 'pressure' or 'force' for a "
            "nonlinear body",
            "accuracy of contact on cells that lock": "cannot be estimated where cells lock: set "
            "element.volumetric = 'auto'",
            "statement of an error bound": "a nonlinear body has no guaranteed bound",
            "soft contact": "soft contact is for linear materials: leave 'overclosure' out",
            "fluid": "changes as the body moves, which is not possible yet with a nonlinear "
            "material",
            "preload": _NOT_YET,
        },
        "finite strain": {
            "prescribed rotation": "is a small rotation, but the material has finite strains: give "
            "x and y as expressions",
        },
    }
    linear = False
    isotropic = True

    @property
    def constants_at_rest(self) -> tuple[float, float]:
        """The shear and bulk modulus at small strains, stresses; by default from the keys ``young``
        and ``poisson``.
        """
        young = getattr(self, "young", None)
        poisson = getattr(self, "poisson", None)
        if young is None or poisson is None:
            raise NotImplementedError
        return young / (2 * (1 + poisson)), young / (3 * (1 - 2 * poisson))

    @cached_property
    def at_rest(self) -> LinearElastic:
        """The linear material that it is at small strains, which determines scales and
        quadrature.
        """
        shear, bulk = self.constants_at_rest
        shared = ("hypothesis", "density", "expansion", "region")
        return LinearElastic(
            young=9 * bulk * shear / (3 * bulk + shear),
            poisson=(3 * bulk - 2 * shear) / (2 * (3 * bulk + shear)),
            **{key: getattr(self, key) for key in shared if key in self.model_fields_set},
        )

    @property
    def features(self) -> Features:
        named = ("nonlinear material", "finite strain") if self.finite else ("nonlinear material",)
        return tuple((name, ()) for name in named)

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        yield from super().contradictions(statement, number)
        if self.grading is not None:
            yield ("material", number, "grading"), f"{_NOT_YET}: give regions"
        if any(not material.linear for material in statement.material[:number]):
            return
        if statement.kinematics not in KINDS:
            yield ("material", number, "hypothesis"), f"that of another package {_NOT_YET}"
        for other, beside in enumerate(statement.material):
            if beside.linear and (beside.varies or not beside.isotropic):
                yield (
                    ("material", other),
                    "is not possible yet beside a nonlinear one: give regions of isotropic ones",
                )
        if any(contact.against is not None for contact in statement.contact):
            for row, support in enumerate(statement.displacement):
                if support.holds is not None:
                    yield ("displacement", row, "holds"), f"{_NOT_YET} in contact of two bodies"
        for key, entries in statement.effects.items():
            for row, effect in enumerate(entries):
                if isinstance(effect, Resistance) and not is_of_package(type(effect)):
                    yield (key, row), _NOT_YET
        if self.finite:
            yield from self._contradictions_of_finite_strains(statement)

    def _contradictions_of_finite_strains(self, statement: Stated) -> Contradictions:
        for row, traction in enumerate(statement.effects.get("traction", ())):
            if hasattr(traction.pressure, "ufl_shape"):
                reason = (
                    "follows the body at finite strains: give a number, an expression or a "
                    "callable, not UFL"
                )
                yield ("traction", row, "pressure"), reason
        for row, rotation in enumerate(statement.effects.get("rotation", ())):
            if getattr(rotation.speed, "jumps", False):
                yield (
                    ("rotation", row, "speed"),
                    f"that jumps from place to place {_NOT_YET} at finite strains",
                )
        for other, beside in enumerate(statement.material):
            if not beside.finite:
                cure = (
                    "give law = 'saint-venant-kirchhoff', which has the constants of a linear one"
                )
                if "strains" in type(beside).model_fields:
                    cure = "give it strains = 'finite'"
                elif not beside.linear:
                    cure = f"if it stays elastic {cure}, else put a rigid foundation in its place"
                yield (
                    ("material", other),
                    f"is one of small strains, beside one of finite strains: {cure}",
                )

    # --- the methods of linear materials ---

    def stress(self, strain: Expr) -> Expr:
        return self.at_rest.stress(strain)

    @property
    def locks(self) -> bool:
        return self.at_rest.locks


class Hyperelastic(NonlinearMaterial):
    """An elastic material at finite strains, given by its stored energy; derive a material of your
    own from it.

    Gradients F = I + grad u and stresses have the shape (3, 3), in 2D and in bodies of revolution
    with the components across the mesh.  Define ``shape_energy`` or ``shape_energy_by_change``, and
    for a volumetric part ``volume_energy`` or ``volume_energy_by_change``; the solver calls the
    latter of both.

    Attributes:
        hypothesis, torsion, grading, density, region: see ``Material``.
        expansion, conductivity, specific_heat, reference_temperature: see ``Material``.

    Examples:
        >>> soft = sfx.NeoHooke(law="neo-hooke", young=50.0, poisson=0.3)
        >>> print(isinstance(soft, sfx.Hyperelastic), soft.young)
        True 50.0
    """

    finite = True

    def shape_energy(self, gradient: Expr) -> Expr:
        """Return the stored energy without the volumetric part, per undeformed volume, UFL,
        scalar.
        """
        raise NotImplementedError

    def volume_energy(self, volume: Expr) -> Expr:
        """Return the volumetric part of the energy from J = det F, UFL, scalar; zero by default."""
        return 0 * volume

    def shape_energy_by_change(self, change: Expr) -> Expr:
        """Return ``shape_energy`` from grad u, UFL of shape (3, 3).

        Its derivative keeps the digits of grad u if a material computes it without forming F.
        """
        import ufl

        return self.shape_energy(ufl.Identity(3) + change)

    def volume_energy_by_change(self, growth: Expr) -> Expr:
        """Return ``volume_energy`` from the change of volume J - 1, UFL, scalar."""
        return self.volume_energy(1 + growth)

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        yield from super().contradictions(statement, number)
        if statement.element.volumetric == "reduced" and not self.splits:
            reason = (
                f"'reduced' needs an energy of the volume alone, which {self.words} does not have"
            )
            yield ("element", "volumetric"), reason


class PathDependent(NonlinearMaterial):
    """A material whose stress depends on the history, at small strains; derive a material of your
    own from it.

    The mean stress depends on the volume alone.  The state is a row of numbers at each point, zeros
    at the beginning.  Strains and stresses have the shape (n, 3, 3).  For finite strains, which J2
    has, see ``respond_by_change``.

    Attributes:
        hypothesis, torsion, grading, density, region: see ``Material``.
        expansion, conductivity, specific_heat, reference_temperature: see ``Material``.

    Examples:
        >>> metal = sfx.J2(law="j2", young=1000.0, poisson=0.3, yield_stress=1.0)
        >>> print(isinstance(metal, sfx.PathDependent), metal.state_size)
        True 10
    """

    # How many numbers the state has at a point.
    state_size: ClassVar[int] = 0

    @property
    def features(self) -> Features:
        return (*super().features, ("material with a state", ()))

    def at_time(self, time: float) -> PathDependent:
        """Return the material for a load step that ends at this time; itself if it does not depend
        on the time.
        """
        return self

    def respond(self, strain: Array, state: Array) -> tuple[Array, Array, Array]:
        """Return the deviatoric stress, its derivative by the strain, and the new state.

        Args:
            strain: at the end of the step, without thermal strain, shape (n, 3, 3).
            state: at the end of the last load step, shape (n, ``state_size``).

        Returns:
            Shapes (n, 3, 3), (n, 6, 6) and (n, ``state_size``); rows and columns of the derivative
            are the components ``protocol.PAIRS``, with shear strains 2 epsilon_ij.
        """
        raise NotImplementedError

    def respond_by_change(self, change: Array, state: Array) -> tuple[Array, Array, Array]:
        """Return the first Piola-Kirchhoff stress without its volumetric part, its derivative by
        grad u, and the new state, for finite strains.

        Args:
            change: grad u, without thermal expansion, shape (n, 3, 3).
            state: at the end of the last load step, shape (n, ``state_size``).

        Returns:
            Shapes (n, 3, 3), (n, 9, 9) and (n, ``state_size``), tensor components row by row.
        """
        raise NotImplementedError

    def volume_energy_by_change(self, growth: Expr) -> Expr:
        """Return the volumetric energy kappa/2 ln^2 J for finite strains from J - 1, UFL,
        scalar.
        """
        return self.constants_at_rest[1] / 2 * (growth + logarithm_beyond_line(growth)) ** 2

    def plastic_strain(self, state: Array) -> Array | None:
        """Return the accumulated (equivalent) plastic strain of states for results, shape (n,);
        None if the material has none.
        """
        return None


# The deviator of a strain whose shear components are twice epsilon_ij, shape (6, 6).
DEVIATORIC = np.diag([1.0, 1.0, 1.0, 0.5, 0.5, 0.5]) - np.pad(np.full((3, 3), 1 / 3), (0, 3))


def green_strain(change: Expr) -> Expr:
    """Return Green's strain (F^T F - I)/2 from grad u, UFL, shape (3, 3)."""
    return (change + change.T + change.T * change) / 2


def growth(change: Expr) -> Expr:
    """Return J - 1 from grad u, the sum of its principal invariants, UFL."""
    import ufl

    return ufl.tr(change) + (ufl.tr(change) ** 2 - ufl.tr(change * change)) / 2 + ufl.det(change)


def strain_beyond_growth(change: Expr) -> Expr:
    """Return tr E - (J - 1) from grad u, with Green's strain E, UFL.

    It is quadratic in small grad u, and is computed without cancellation.
    """
    import ufl

    return (
        ufl.inner(change, change) - ufl.tr(change) ** 2 + ufl.tr(change * change)
    ) / 2 - ufl.det(change)


# The powers of the series that replace differences with cancellation.
_POWERS = range(2, 7)


def power_beyond_line(change: Expr, power: float) -> Expr:
    """Return (1 + x)^p - 1 - p x, UFL; for small x by its series, so that its derivative keeps the
    digits of x.
    """
    factors = []
    factor = power
    for k in _POWERS:
        factor *= (power - k + 1) / k
        factors.append(factor)
    return _beyond_line(change, factors, (1 + change) ** power - 1 - power * change)


def logarithm_beyond_line(change: Expr) -> Expr:
    """Return ln(1 + x) - x, UFL; for small x by its series."""
    import ufl

    factors = [(-1) ** (k + 1) / k for k in _POWERS]
    return _beyond_line(change, factors, ufl.ln(1 + change) - change)


def _beyond_line(change: Expr, factors: Sequence[float], far: Expr) -> Expr:
    """Return a power series that begins with x^2 where x is small, else ``far``, UFL.

    Args:
        change: x.
        factors: coefficients of x^2, x^3 and so on.
        far: the value for other x.
    """
    import ufl

    series = factors[-1]
    for factor in factors[-2::-1]:
        series = factor + change * series
    return ufl.conditional(ufl.lt(abs(change), NEAR_ONE), change**2 * series, far)


def deviator(tensor: Array) -> Array:
    """Return the deviatoric part of tensors, shape (..., 3, 3)."""
    return tensor - np.trace(tensor, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) / 3
