"""The interface of materials; all other code uses it without distinguishing kinds.

The fields of a material class are its constants.  Strains and stresses are symmetric tensors along
the axes of the material, which are the coordinate axes unless it has others, see ``orthotropic``.
``stress`` is linear, and UFL, as in ``demos/extensions/material.py``.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator

from signorini_fx.arrays import Array, Expr
from signorini_fx.mechanics.kinematics import CARTESIAN, HYPOTHESES, hypotheses, tensors
from signorini_fx.mechanics.statement.effect import Contradictions, Effect, Features, Stated
from signorini_fx.mechanics.statement.values import Finite, NonNegative, Positive, SampledValue

# The components of a symmetric tensor in 3D, in the order of ``Kinematics.pairs``.
PAIRS = tuple(CARTESIAN[3].pairs)


_FULL = "must be 'full' with an anisotropic material"


def _known_hypothesis(name: str) -> str:
    """Return a hypothesis unchanged if it is known, else raise a ``ValueError``."""
    if name not in HYPOTHESES and name not in hypotheses():
        raise ValueError(f"must be one of {', '.join(map(repr, hypotheses()))}, got {name!r}")
    return name


class Material(Effect):
    """A material, linear elastic by default; derive a material of your own from it.

    Attributes:
        hypothesis: plane strain, plane stress, or axisymmetric, if the mesh has two dimensions, or
            one of another package, see ``kinematics``.  An axisymmetric mesh is half of a section:
            x[0] >= 0 is the radius, x[1] is along the axis, forces are those of a revolution.
        torsion: whether an axisymmetric body also moves around its axis; the components z are those
            around it, along x[2], so that an angle about x[1] moves a point by -angle x[0].
        grading: factor between 0 and 1 of the moduli, which are given at their largest; its value
            at the midpoint of each cell counts; None: 1 everywhere.
        density: mass per volume, which ``gravity`` and ``rotation`` need; None: it is not known.
        expansion: coefficient of thermal expansion, 1 / temperature, which ``temperature`` needs;
            None: not known.
        conductivity: power per length and temperature, which ``heat`` needs; None: not known.
        specific_heat: energy per mass and temperature, which makes heat conduction transient;
            None: it is steady in each load step.
        reference_temperature: temperature without thermal strain; None: 0.
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
    # Whether the stress is a linear function of the strain, ``stress``; else see ``nonlinear``.
    linear: ClassVar[bool] = True
    # Whether it has finite strains.
    finite: ClassVar[bool] = False
    # Whether a part of its energy depends on the volume alone, and may be integrated with fewer
    # points.
    splits: ClassVar[bool] = True
    # Whether plastic flow keeps its volume, so that it is nearly incompressible there.
    flows: ClassVar[bool] = False
    # Whether the stress is a epsilon + b tr(epsilon) I; then the terms may have different
    # quadratures, or a pressure as an unknown.
    isotropic: ClassVar[bool] = False
    # Thermal strains along its axes, relative to ``expansion``.
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

    # --- what a material must define, unless it has ``stiffness`` ---

    def stress(self, strain: Expr) -> Expr:
        """Return the stress of a strain, UFL, both with shape (3, 3)."""
        raise NotImplementedError

    # --- what it may define ---

    def axes(self, x: Array) -> Array:
        """Return the unit vectors along the material axes, as the columns of shape (n, 3, 3).

        They are not finite where they have no direction.

        Args:
            x: points, shape (3, n).
        """
        return np.broadcast_to(np.eye(3), (x.shape[1], 3, 3))

    @property
    def at_rest(self) -> Material:
        """The linear material that it is at small strains."""
        return self

    @property
    def varies(self) -> bool:
        """Whether moduli or axes vary within the material."""
        return self.grading is not None

    def dimension_problems(self, dimension: int) -> Contradictions:
        """Yield the path of a key and a message for each value that does not fit meshes of this
        dimension.
        """
        yield from ()

    # --- what follows ---

    @property
    def stiffness(self) -> Array:
        """The matrix from strains to stresses, components ``PAIRS`` along the axes with shear
        strains 2 epsilon_ij, shape (6, 6).
        """
        return stiffness_of(self)

    @property
    def compliance(self) -> Array:
        """The inverse of the stiffness, shape (6, 6)."""
        return np.asarray(np.linalg.inv(self.stiffness))

    @property
    def natural_modulus(self) -> float:
        """The largest Young's modulus along the axes, a stress, from which scales and settings
        follow.
        """
        return float(1 / self.compliance.diagonal()[:3].min())

    @property
    def lame(self) -> tuple[float, float]:
        """The Lame parameters of the isotropic material whose stiffness is the mean over all
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
            pressed: whether to leave out the part of the stress that is an unknown pressure.
        """
        return float(self.stiffness.diagonal().max())

    @property
    def locks(self) -> bool:
        """Whether fully integrated elements lock visibly."""
        return False

    @property
    def features(self) -> Features:
        return () if self.isotropic else (("anisotropic material", ()),)

    @property
    def kind(self) -> tuple[object, ...]:
        """A key that is the same for two regions with the same elastic behaviour."""
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
        """The name of the material in messages."""
        return f"the material {getattr(self, 'law', '')!r}"


@cache
def stiffness_of(material: Material) -> Array:
    """Return the stiffness of a material, one column for each unit strain in
    ``Material.stress``.
    """
    return np.column_stack([stress_of(material, strain) for strain in np.eye(len(PAIRS))])


def stress_of(material: Material, components: Array) -> Array:
    """Return the stress components ``PAIRS`` from strain components with shears 2 epsilon_ij, both
    of shape (6,).
    """
    import ufl
    from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

    strain = tensors(components / [1, 1, 1, 2, 2, 2], PAIRS)
    stress = apply_algebra_lowering(material.stress(ufl.as_matrix(strain.tolist())))
    return np.array([float(stress[pair](())) for pair in PAIRS])
