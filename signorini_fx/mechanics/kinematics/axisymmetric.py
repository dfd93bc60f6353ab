"""A body of revolution about x[1], of which the mesh is half of a section: x[0] is the radius r."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.kinematics.protocol import SPACE, Kinematics, position
from signorini_fx.tuned import DIGITS_OF_FILES

_Floats = npt.NDArray[np.float64]


def off_axis(y: Any) -> Any:
    """Whether a place of UFL is off the axis, by more than the round-off of coordinates in files."""
    import ufl

    x = position(y)
    size = ufl.sqrt(abs(ufl.JacobianDeterminant(ufl.domain.extract_unique_domain(y))))
    return ufl.gt(x[0], DIGITS_OF_FILES * size)


@dataclass(frozen=True)
class BodyOfRevolution(Kinematics):
    """Displacements along the radius and the axis, which do not depend on the angle.

    The strain has y_0 / r along the circumference, and forces are those of a revolution.
    """

    def refused_axis(self, axis: tuple[float, ...] | None, about: tuple[float, ...] | None = None) -> str:
        if axis is not None and len(axis) == 2 and axis[0] == 0 and (about or (0.0,))[0] == 0:
            return ""
        return "must be that of the body: axis = [0.0, 1.0]"

    def depth(self, size: float) -> float:
        """The length of half a revolution."""
        return math.pi * size

    def strain(self, y: Any, *, on_axis: bool = False) -> Any:
        """On the axis its limit along the circumference is the radial strain."""
        import ufl

        in_section, radius = ufl.sym(ufl.grad(y)), position(y)[0]
        along = y[0] / radius
        if on_axis:
            off = off_axis(y)
            along = ufl.conditional(off, y[0] / ufl.conditional(off, radius, 1), y[0].dx(0))
        rows = [[in_section[i, j] if max(i, j) < 2 else 0 for j in range(3)] for i in range(3)]
        rows[2][2] = along
        return ufl.as_tensor(rows)

    def gradient(self, y: Any) -> Any:
        """With the stretch of the circumference."""
        import ufl

        slope, stretch = ufl.grad(y), y[0] / position(y)[0]
        return ufl.as_tensor([[slope[0, 0], slope[0, 1], 0], [slope[1, 0], slope[1, 1], 0], [0, 0, stretch]])

    def measure(self, x: Any) -> Any:
        """The length of the circumference."""
        return 2 * math.pi * x[0]


# What has no meaning, and what nobody has derived yet.
REFUSED = {
    "bending": "a section that stays in place does not bend",
    "guaranteed bound": "a guaranteed bound of axisymmetric bodies is not known yet",
    "moment": "there is none on a body of revolution",
    "motion of a tool": "an axisymmetric tool moves along its axis x[1] alone",
}
AXISYMMETRIC = BodyOfRevolution(
    "axisymmetric",
    2,
    ((0, 1),),
    normal_out=True,
    whole=True,
    uniform=False,
    further_degrees=2,
    motions_without_strain=(False, True, False),
    zero_on_axis=(0,),
    least_x=0.0,
    refuses={**REFUSED, "prescribed rotation": "is no axisymmetric motion"},
)


@dataclass(frozen=True)
class TwistedBody(BodyOfRevolution):
    """A body of revolution that also moves around its axis: elements with twist (CGAX in Abaqus).

    The displacement has three components, which do not depend on the angle: radial, axial, and around the axis.  The
    last one is z, along x[2] out of the section: what turns by an angle about x[1] moves by -angle x[0] along it.
    """

    def strain(self, y: Any, *, on_axis: bool = False) -> Any:
        """Adds the shears gamma_02 = r d(y_2 / r)/dr and gamma_12 = dy_2/dx_1 of torsion, which vanish on the axis."""
        import ufl

        radius, around = position(y)[0], [-y[2], 0, y[0]]
        along = ufl.as_vector(around) / radius
        if on_axis:
            off = off_axis(y)
            limits = (-ufl.grad(y)[2, 0], 0, ufl.grad(y)[0, 0])
            ratios = (component / ufl.conditional(off, radius, 1) for component in around)
            along = ufl.as_vector([ufl.conditional(off, *pair) for pair in zip(ratios, limits, strict=True)])
        return ufl.sym(ufl.grad(y) + ufl.outer(along, ufl.unit_vector(2, 3)))


TORSION = TwistedBody(
    "axisymmetric, torsion",
    3,
    SPACE.rotations,
    out_of_section=1,
    whole=True,
    uniform=False,
    further_degrees=2,
    motions_without_strain=(False, True, False, False, True, False),
    zero_on_axis=(0, 2),
    least_x=0.0,
    refuses={
        **REFUSED,
        "contact of two bodies": "is not possible yet where material.torsion is true: model the stiffer body as rigid, "
        "or both in 3D",
        "driven foundation": "is not possible yet where material.torsion is true",
        "friction axes": "is not possible yet where material.torsion is true",
    },
)
