"""What a material says.  All that assembles, judges and tells of one asks these methods and knows
no kind.

The fields of its class are its constants.  Strains and stresses are symmetric tensors along its
axes, which are those of space unless it has others, see ``orthotropic``.  ``stress`` is linear, and
UFL, as in ``demos/extensions/material.py``.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator

from signorini_fx.arrays import Array, Expr
from signorini_fx.mechanics.kinematics import CARTESIAN, HYPOTHESES, hypotheses
from signorini_fx.mechanics.kinematics.protocol import tensors
from signorini_fx.mechanics.statement.effect import Contradictions, Effect, Features, Stated
from signorini_fx.mechanics.statement.values import Finite, NonNegative, Positive, SampledValue

# The components of a symmetric tensor in 3D, in the order of ``Kinematics.pairs``.
PAIRS = tuple(CARTESIAN[3].pairs)


_FULL = "must be 'full' with an anisotropic material"


def _known_hypothesis(name: str) -> str:
    """Itself, if there is one of this name."""
    if name not in HYPOTHESES and name not in hypotheses():
        raise ValueError(f"must be one of {', '.join(map(repr, hypotheses()))}, got {name!r}")
    return name


class Material(Effect):
    """A material, linear elastic unless it states otherwise; a material of your own derives from
    it.

    Attributes:
        hypothesis: plane strain, plane stress, or axisymmetric, if the mesh has two dimensions, or
            one of another package, see ``kinematics``.  An axisymmetric mesh is half of a section:
            x[0] >= 0 is the radius, x[1] is along the axis, forces are those of a revolution.
        torsion: whether an axisymmetric body also moves around its axis; the components z are those
            around it, along x[2], so that an angle about x[1] moves a point by -angle x[0].
        grading: between 0 and 1, by which the moduli, the largest, are multiplied: its value in the
            middle of each cell; None: 1 everywhere.
        density: mass per volume, which ``gravity`` and ``rotation`` need; None: it is not known.
        expansion: coefficient of thermal expansion, 1 / temperature, which ``temperature`` needs;
            None: not known.
        conductivity: power per length and temperature, which ``heat`` needs; None: not known.
        specific_heat: energy per mass and temperature, by which heat takes time; None: heat is
            steady in each load step.
        reference_temperature: at which it has no thermal strain; None: 0.
        region: name of the part of the body that is made of this material; None: all of it.

    Examples:
        >>> class Foam(sfx.Material):
        ...     modulus: float
        ...
        ...     def stress(self, strain):
        ...         return self.modulus * strain
        >>> result = sfx.solve(scene.model_copy(update={"material": Foam(modulus=10.0)}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0. 4.]
    """

    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "anisotropic material": {
            "mixed element": f"{_FULL}: its pressure would not follow from the change of volume",
            "reduced integration": f"{_FULL}: its mean stress does not follow from the change of "
            "volume",
        },
    }
    key = "material"
    # Whether the stress is a linear function of the strain, as it is said here; else see
    # ``nonlinear``.
    linear: ClassVar[bool] = True
    # Whether it knows strains that are not small.
    finite: ClassVar[bool] = False
    # Whether a part of it follows the volume alone, and may be integrated with fewer points.
    splits: ClassVar[bool] = True
    # Whether it keeps its volume where it flows, as if it were nearly incompressible.
    flows: ClassVar[bool] = False
    # Whether the stress is a epsilon + b tr(epsilon) I, whose terms may be integrated apart or have
    # a pressure.
    isotropic: ClassVar[bool] = False
    # How much it expands along its axes, relative to ``expansion``.
    free_strain: ClassVar[tuple[float, float, float]] = (1.0, 1.0, 1.0)

    grading: SampledValue | None = None
    hypothesis: Annotated[str, AfterValidator(_known_hypothesis)] = "plane strain"
    torsion: bool = False
    density: NonNegative | None = None
    expansion: Finite | None = None
    conductivity: Positive | None = None
    specific_heat: Positive | None = None
    reference_temperature: Finite | None = None
    region: str | None = None

    # --- what a material must say, unless it has ``stiffness`` ---

    def stress(self, strain: Expr) -> Expr:
        """Return the stress of a strain, UFL, both with shape (3, 3)."""
        raise NotImplementedError

    # --- what it may say ---

    def axes(self, x: Array) -> Array:
        """Return the unit vectors along the axes at points ``x``, shape (3, n), as the columns of
        (n, 3, 3); not finite where they have no direction.
        """
        return np.broadcast_to(np.eye(3), (x.shape[1], 3, 3))

    @property
    def at_rest(self) -> Material:
        """Return the linear material at small strains."""
        return self

    @property
    def varies(self) -> bool:
        """Return whether moduli or axes vary within the material."""
        return self.grading is not None

    def dimension_problems(self, dimension: int) -> Contradictions:
        """Yield what does not fit to a mesh of a dimension: the path of the key, and why."""
        yield from ()

    # --- what follows ---

    @property
    def stiffness(self) -> Array:
        """Stresses ``PAIRS`` from strains, of shear twice epsilon_ij, along the axes, shape (6,
        6).
        """
        return stiffness_of(self)

    @property
    def compliance(self) -> Array:
        """Return the inverse of the stiffness, shape (6, 6)."""
        return np.asarray(np.linalg.inv(self.stiffness))

    @property
    def natural_modulus(self) -> float:
        """Return the largest Young's modulus along the axes, a stress, from which scales and
        settings follow.
        """
        return float(1 / self.compliance.diagonal()[:3].min())

    @property
    def lame(self) -> tuple[float, float]:
        """Return the Lame parameters of the isotropic material whose stiffness is the mean over all
        directions (W. Voigt, Lehrbuch der Kristallphysik, Teubner, 1910).
        """
        c = self.stiffness
        normal = np.trace(c[:3, :3])
        lateral = c[0, 1] + c[0, 2] + c[1, 2]
        shear = np.trace(c[3:, 3:])
        mu = float((normal - lateral + 3 * shear) / 15)
        return float((normal + 2 * lateral) / 9) - 2 * mu / 3, mu

    def stiffest(self, *, pressed: bool) -> float:
        """Return the largest normal stress per strain.

        Args:
            pressed: without the part of a pressure that is an unknown.
        """
        return float(self.stiffness.diagonal().max())

    @property
    def locks(self) -> bool:
        """Return whether fully integrated elements lock visibly."""
        return False

    @property
    def features(self) -> Features:
        return () if self.isotropic else (("anisotropic material", ()),)

    @property
    def kind(self) -> tuple[object, ...]:
        """Return what two regions of the same material have in common."""
        of_heat = "expansion", "conductivity", "specific_heat"
        apart = "region", "density", "yield_stress", *of_heat
        return type(self), *(
            getattr(self, key) for key in type(self).model_fields if key not in apart
        )

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        if self.hypothesis != statement.material[0].hypothesis:
            yield ("material", number), "all materials must have the same hypothesis"
        if self.torsion and self.hypothesis != "axisymmetric":
            yield (
                ("material", number, "torsion"),
                'needs hypothesis = "axisymmetric": other bodies have no axis',
            )
        if self.torsion != statement.material[0].torsion:
            yield ("material", number, "torsion"), "must be the same in all materials"

    @property
    def words(self) -> str:
        """Return the name of the material in messages."""
        return f"the material {getattr(self, 'law', '')!r}"


@cache
def stiffness_of(material: Material) -> Array:
    """Return the stiffness by ``Material.stress``, from one unit strain after the other."""
    return np.column_stack([stress_of(material, strain) for strain in np.eye(len(PAIRS))])


def stress_of(material: Material, components: Array) -> Array:
    """Return the stresses ``PAIRS`` by ``Material.stress``, of strains that are twice epsilon_ij in
    shear, shape (6,).
    """
    import ufl
    from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

    strain = tensors(components / [1, 1, 1, 2, 2, 2], PAIRS)
    stress = apply_algebra_lowering(material.stress(ufl.as_matrix(strain.tolist())))
    return np.array([float(stress[pair](())) for pair in PAIRS])
