"""A body of revolution that also moves around its axis.

Its displacement has three components: radial, axial, and around the axis.  They are called x, y and z, and z is along
x[2], out of the section: what turns by an angle about x[1] moves by -angle x[0] along it.  Other programs call such
elements generalised axisymmetric, with twist (CGAX in Abaqus).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.kinematics.axisymmetric import REFUSED, BodyOfRevolution, off_axis
from signorini_fx.mechanics.kinematics.protocol import SPACE, position

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class TwistedBody(BodyOfRevolution):
    """Displacements of a body of revolution with all three components, which do not depend on the angle."""

    def strain(self, y: Any, *, on_axis: bool = False) -> Any:
        """See ``Kinematics``; to that without torsion it adds the shears gamma_02 = r d(y_2 / r)/dr and gamma_12 =
        dy_2/dx_1; on the axis there is no shear.
        """
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
