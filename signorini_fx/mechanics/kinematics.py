"""The kinematics of bodies: strains, measures, rigid motions and displacement components of each
kind, such as plane strain or 3D.

A problem has its kinematics as ``Statement.kinematics``, a body as ``Model.kinematics``; all other
code uses this interface without distinguishing kinds.  The ``hypothesis`` of a material may name
kinematics of another package, an instance of ``Kinematics``.  UFL is imported where it is needed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np

from signorini_fx.arrays import Array, Expr, FieldValue, Flags
from signorini_fx.errors import InstallationError
from signorini_fx.extensions import KINEMATICS, load, names_of
from signorini_fx.tuned import DIGITS_OF_FILES


@dataclass(frozen=True)
class Kinematics:
    """The displacement components of a body, with their strains, measures and rigid motions."""

    words: str  # its name
    dimension: int  # d, components of the displacement
    # The two axes of each rotation, which turns the first towards the second; in 3D the rotation
    # about x[0] is first.
    rotations: tuple[tuple[int, int], ...]
    # Whether the strain has a component along x[2], across the mesh.
    normal_out: bool = False
    out_of_section: int = 0  # components of the displacement along x[2], which is across the mesh
    # Whether strain across the mesh is prevented, so that there is a stress in this direction.
    prevented: bool = False
    # Whether forces are those of the whole body; else they are per unit thickness.
    whole: bool = False
    # Whether areas and lengths of the mesh are those of the body, up to ``depth``.
    uniform: bool = True
    # Added to the quadrature degree of products of strains that are not polynomials, as with 1 / r.
    further_degrees: int = 0
    # Which translations and rotations about the origin have no strain; None: all.
    motions_without_strain: tuple[bool, ...] | None = None
    zero_on_axis: tuple[int, ...] = ()  # components of the displacement that vanish where x[0] = 0
    least_x: float = -np.inf  # the smallest x[0] that a mesh may have
    axis: tuple[float, ...] | None = None  # the only axis of rotations; None: any
    # Features that it cannot be combined with, and the message for each.
    refuses: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def motions(self) -> int:
        """The number of rigid motions: d translations and the rotations."""
        return self.dimension + len(self.rotations)

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """The index pairs of the strain components that do work: normal ones, shears, and zz with
        ``normal_out``.
        """
        axes = range(self.dimension)
        return [
            *((k, k) for k in axes),
            *combinations(axes, 2),
            *([(2, 2)] if self.normal_out else []),
        ]

    @property
    def stressed(self) -> list[tuple[int, int]]:
        """The index pairs of the stress components that may not be zero: ``pairs``, with
        ``prevented`` also zz.
        """
        return [*self.pairs, *([(2, 2)] if self.prevented else [])]

    @property
    def uniform_strain(self) -> Expr:
        """The unit strain in all directions, in plane stress without that across the mesh, UFL,
        shape (3, 3).
        """
        import ufl

        return ufl.as_tensor(
            [[int(i == j and (i, j) in self.stressed) for j in range(3)] for i in range(3)]
        )

    def turned(self, arms: Array, vectors: Array) -> Array:
        """Return arms x vectors, shape (..., d), as moments, one per rotation, shape (...,
        rotations).
        """
        pairs = (
            (arms[..., i] * vectors[..., j], arms[..., j] * vectors[..., i])
            for i, j in self.rotations
        )
        return np.stack([positive - negative for positive, negative in pairs], axis=-1)

    @cached_property
    def unbalanced(self) -> Flags:
        """Flags of the rigid motions for which forces on the whole body do not cancel by symmetry,
        shape (motions,).
        """
        return np.array(self.motions_without_strain or (True,) * self.motions)

    def refused_axis(
        self, axis: Sequence[float] | None, about: Sequence[float] | None = None
    ) -> str:
        """Return why nothing can act along or about this axis; "" if it can.

        Args:
            axis: direction of the axis; None: x[2].
            about: a point on it; None: the origin.
        """
        return ""

    def depth(self, size: float) -> float:
        """Return the factor from areas of the mesh to volumes of a body of this size, roughly."""
        return 1.0

    # --- forms ------------------------------------------------------------------------------------

    def strain(self, y: Expr, *, on_axis: bool = False) -> Expr:
        """Return the linearised strain epsilon(y) of section 2.1, UFL, shape (3, 3).

        Args:
            y: the displacement.
            on_axis: see ``gradient``.
        """
        import ufl

        return ufl.sym(self.gradient(y, on_axis=on_axis))

    def gradient(self, y: Expr, *, on_axis: bool = False) -> Expr:
        """Return the displacement gradient in 3D, with components across the mesh, UFL, shape (3,
        3).

        Args:
            y: the displacement.
            on_axis: whether it is evaluated where x[0] = 0 too, as a limit.
        """
        import ufl

        return padded(ufl.grad(y), self.dimension)

    def mean_gradient(self, y: Expr) -> Expr:
        """Return a tensor whose value at the midpoint of a cell is the mean of ``gradient`` over
        the volume of the cell, except for shears of torsion, UFL, shape (3, 3).
        """
        return self.gradient(y)

    def measure(self, x: FieldValue) -> FieldValue | float:
        """Return the factor of areas and lengths of the mesh at x.

        Args:
            x: UFL of shape (d,), or numbers of shape (d, n).
        """
        return 1

    def measure_at(self, x: Array) -> Array:
        """Return ``measure`` at points of shape (d, n), not negative by round-off."""
        return np.maximum(self.measure(x), 0.0)


# Plane stress, of a thin body without stress across its plane, is implemented by the materials.
SPACE = Kinematics("in 3D", 3, ((1, 2), (2, 0), (0, 1)), whole=True)
PLANE_STRAIN = Kinematics("plane strain", 2, ((0, 1),), prevented=True)
PLANE_STRESS = Kinematics(
    "plane stress",
    2,
    ((0, 1),),
    refuses={"mixed element": "'mixed' is not needed in plane stress, where nothing locks"},
)


def padded(tensor: Expr, dimension: int, outward: Expr | float = 0) -> Expr:
    """Return a tensor extended to shape (3, 3) with zeros and one normal component across the mesh,
    UFL.

    Args:
        tensor: UFL.
        dimension: d; a tensor in 3D is returned unchanged.
        outward: the component across the mesh.
    """
    import ufl

    if dimension == 3:
        return tensor
    rows = [[tensor[i, j] if max(i, j) < 2 else 0 for j in range(3)] for i in range(3)]
    rows[2][2] = outward
    return ufl.as_tensor(rows)


def components(tensor: Expr, pairs: Iterable[tuple[int, int]]) -> Expr:
    """Return the components of a strain as a UFL vector, shears as 2 epsilon_ij."""
    import ufl

    return ufl.as_vector([tensor[i, j] if i == j else 2 * tensor[i, j] for i, j in pairs])


def tensors(values: Array, pairs: Iterable[tuple[int, int]]) -> Array:
    """Return symmetric tensors, shape (..., 3, 3), from components, shape (..., pairs)."""
    tensors = np.zeros((*values.shape[:-1], 3, 3))
    for column, (i, j) in enumerate(pairs):
        tensors[..., i, j] = tensors[..., j, i] = values[..., column]
    return tensors


def position(y: Expr) -> Expr:
    """Return the spatial coordinate on the domain of an expression, UFL."""
    import ufl

    return ufl.SpatialCoordinate(ufl.domain.extract_unique_domain(y))


# --- bodies of revolution about x[1], of which the mesh is half of a section: x[0] is the radius r


def off_axis(y: Expr) -> Expr:
    """Return a UFL condition: whether a point is farther from the axis than the round-off of
    coordinates in files.
    """
    import ufl

    x = position(y)
    size = ufl.sqrt(abs(ufl.JacobianDeterminant(ufl.domain.extract_unique_domain(y))))
    return ufl.gt(x[0], DIGITS_OF_FILES * size)


# Second moments of area of the reference cells about their midpoints, divided by their area.
_SECOND_MOMENTS = {
    "quadrilateral": [[1 / 12, 0], [0, 1 / 12]],
    "triangle": [[1 / 18, -1 / 36], [-1 / 36, 1 / 18]],
}


@dataclass(frozen=True)
class BodyOfRevolution(Kinematics):
    """An axisymmetric body, with displacements along the radius and the axis that do not depend on
    the angle.

    The strain along the circumference is y_0 / r; forces are those of the full revolution.
    """

    whole: bool = True
    uniform: bool = False
    further_degrees: int = 2
    least_x: float = 0.0
    axis: tuple[float, ...] | None = (0.0, 1.0)

    def refused_axis(
        self, axis: Sequence[float] | None, about: Sequence[float] | None = None
    ) -> str:
        if axis is not None and len(axis) == 2 and axis[0] == 0 and (about or (0.0,))[0] == 0:
            return ""
        return "must be that of the body: axis = [0.0, 1.0]"

    def depth(self, size: float) -> float:
        """Return the circumference of a circle whose diameter is this size."""
        return math.pi * size

    def gradient(self, y: Expr, *, on_axis: bool = False) -> Expr:
        """Return the gradient with the circumferential stretch, whose limit on the axis is the
        radial strain.
        """
        import ufl

        stretch = y[0] / position(y)[0]
        if on_axis:
            off = off_axis(y)
            stretch = ufl.conditional(
                off, y[0] / ufl.conditional(off, position(y)[0], 1), y[0].dx(0)
            )
        return padded(ufl.grad(y), 2, stretch)

    def mean_gradient(self, y: Expr) -> Expr:
        """Return the gradient averaged over the volume of the cell, in which larger radii weigh
        more, with the mean circumferential stretch.
        """
        import ufl

        from signorini_fx.machine import compat

        radius = position(y)[0]
        domain = ufl.domain.extract_unique_domain(y)
        jacobian = ufl.Jacobian(domain)
        own = ufl.as_matrix(_SECOND_MOMENTS[compat.cell_name(domain)])
        moments = jacobian * own * jacobian.T
        curved = ufl.grad(ufl.grad(y))
        i, j, k = ufl.indices(3)
        slopes = ufl.grad(y) + ufl.as_tensor(curved[i, j, k] * moments[k, 0] / radius, (i, j))
        stretch = (y[0] + ufl.inner(moments, ufl.grad(ufl.grad(y[0]))) / 2) / radius
        return padded(slopes, 2, stretch)

    def measure(self, x: FieldValue) -> FieldValue:
        """Return the length of the circumference, 2 pi r."""
        return 2 * math.pi * x[0]


# Features that have no meaning for bodies of revolution, or are not available yet.
REFUSED = {
    "bending": "a section that stays in place does not bend",
    "guaranteed bound": "axisymmetric bodies have no guaranteed bound",
    "moment": "there is none on a body of revolution",
    "motion of a rigid body": "an axisymmetric rigid body moves along its axis x[1] only",
}
AXISYMMETRIC = BodyOfRevolution(
    "axisymmetric",
    2,
    ((0, 1),),
    normal_out=True,
    motions_without_strain=(False, True, False),
    zero_on_axis=(0,),
    refuses={**REFUSED, "prescribed rotation": "is no axisymmetric motion"},
)


@dataclass(frozen=True)
class TwistedBody(BodyOfRevolution):
    """A body of revolution that also twists around its axis, as elements with twist do (CGAX in
    Abaqus).

    The displacement has three components, which do not depend on the angle: radial, axial, and
    circumferential.  The last one is z, along x[2] out of the section: a rotation by an angle about
    x[1] is a displacement of -angle x[0] along x[2].
    """

    def gradient(self, y: Expr, *, on_axis: bool = False) -> Expr:
        """Return the gradient with the shears of torsion gamma_02 = r d(y_2 / r)/dr and gamma_12 =
        dy_2/dx_1, which vanish on the axis.
        """
        import ufl

        radius = position(y)[0]
        around = [-y[2], 0, y[0]]
        along = ufl.as_vector(around) / radius
        if on_axis:
            off = off_axis(y)
            limits = (-ufl.grad(y)[2, 0], 0, ufl.grad(y)[0, 0])
            ratios = (component / ufl.conditional(off, radius, 1) for component in around)
            along = ufl.as_vector(
                [ufl.conditional(off, *pair) for pair in zip(ratios, limits, strict=True)]
            )
        return ufl.grad(y) + ufl.outer(along, ufl.unit_vector(2, 3))


TORSION = TwistedBody(
    "axisymmetric, torsion",
    3,
    SPACE.rotations,
    out_of_section=1,
    motions_without_strain=(False, True, False, False, True, False),
    zero_on_axis=(0, 2),
    refuses={
        **REFUSED,
        "contact of two bodies": "is not possible yet where material.torsion is true: model the "
        "stiffer body as rigid, "
        "or both in 3D",
        "driven foundation": "is not possible yet where material.torsion is true",
        "friction axes": "is not possible yet where material.torsion is true",
    },
)


KINDS = (PLANE_STRAIN, PLANE_STRESS, AXISYMMETRIC, TORSION, SPACE)
CARTESIAN = {2: PLANE_STRAIN, 3: SPACE}
# The kinematics of this package that materials may name as their hypothesis.
HYPOTHESES = {kind.words: kind for kind in (PLANE_STRAIN, PLANE_STRESS, AXISYMMETRIC)}


def hypotheses() -> tuple[str, ...]:
    """Return the hypotheses that materials on a 2D mesh may name; nothing is imported."""
    return (*HYPOTHESES, *(name for name in names_of(KINEMATICS) if name not in HYPOTHESES))


def of_hypothesis(name: str) -> Kinematics:
    """Return the kinematics of a name in ``hypotheses``.

    Raises:
        InstallationError: the package of the kinematics is missing, or provides something else.
    """
    if name in HYPOTHESES:
        return HYPOTHESES[name]
    if name not in names_of(KINEMATICS):
        raise InstallationError(f"the hypothesis {name!r} is of a package that is not installed")
    kinematics = load(KINEMATICS, name)
    if not isinstance(kinematics, Kinematics):
        raise InstallationError(f"{name!r}, which another package adds, is no Kinematics")
    return kinematics


def of_materials(materials: Iterable[tuple[str, bool]], dimension: int = 2) -> Kinematics:
    """Return the kinematics of a body with these materials.

    All materials must agree (this is checked elsewhere); if not, the most special one is returned.

    Args:
        materials: hypothesis and torsion of each.
        dimension: of the cells; in 3D no hypothesis is needed.
    """
    if dimension != 2:
        return SPACE
    names = {TORSION.words if torsion else hypothesis for hypothesis, torsion in materials} - {
        "",
        PLANE_STRAIN.words,
    }
    if not names:
        return PLANE_STRAIN
    special = [kind for kind in (TORSION, AXISYMMETRIC, PLANE_STRESS) if kind.words in names]
    return special[0] if special else of_hypothesis(min(names))


def of_data(scene: Mapping[str, Any], dimension: int = 2) -> Kinematics:
    """Return the kinematics of a scene given as plain data, see ``of_materials``."""
    materials = scene.get("material") or ()
    return of_materials(
        ((entry.get("hypothesis", ""), bool(entry.get("torsion"))) for entry in materials),
        dimension,
    )


def of_components(cells: int, components: int) -> Kinematics:
    """Return the kinematics of a user's forms: Cartesian, or with torsion if the displacement has
    more components than the cells have dimensions.
    """
    return TORSION if components > cells else CARTESIAN[cells]
