"""The terms of a(., .) of the materials of a scene."""

from __future__ import annotations

from typing import Any

from dolfinx import fem

from signorini_fx.body.cellwise_stiffness import CellwiseStiffness, cellwise_form
from signorini_fx.body.quadrature import strain_degree
from signorini_fx.kinematics.cartesian import Kinematics
from signorini_fx.materials.isotropic import elastic_forms

# Their names.
ELASTIC_FORMS = ("elasticity", "reduced volumetric elasticity")


def elastic_terms(
    space: fem.FunctionSpace,
    y: Any,
    z: Any,
    *,
    lame: tuple[Any, Any],
    stiffness: CellwiseStiffness | None,
    reduced: int | None,
    kinematics: Kinematics,
) -> tuple[Any, ...]:
    """a(y, z), as terms to be compiled one by one; collective.

    Args:
        space: of the displacement.
        y: trial function, or any displacement.
        z: test function.
        lame: Lame parameters as coefficients.
        stiffness: of materials that are not isotropic; None: all are.
        reduced: quadrature degree of the volumetric term where it is reduced, else None.
        kinematics: of the body.
    """
    degree = strain_degree(space, kinematics)
    if stiffness is not None:
        return (cellwise_form(y, z, stiffness, degree, kinematics),)
    return elastic_forms(y, z, *lame, degree, reduced, kinematics=kinematics)
