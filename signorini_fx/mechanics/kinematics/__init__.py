"""Which displacements a body has: strains, measures, rigid motions and components of each kind, one file per kind.

The object of a problem is ``Statement.kinematics``, that of its body ``ElasticBody.kinematics``.  All others ask it
and know no kind.  Each kind says the same twice, in UFL for the solver and in NumPy for the certificate.  This package
knows neither scenes nor meshes; UFL is imported where it is needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from signorini_fx.mechanics.kinematics.axisymmetric import AXISYMMETRIC
from signorini_fx.mechanics.kinematics.cartesian import Kinematics
from signorini_fx.mechanics.kinematics.plane_strain import PLANE_STRAIN
from signorini_fx.mechanics.kinematics.plane_stress import PLANE_STRESS
from signorini_fx.mechanics.kinematics.space import SPACE
from signorini_fx.mechanics.kinematics.torsion import TORSION

KINDS = (PLANE_STRAIN, PLANE_STRESS, AXISYMMETRIC, TORSION, SPACE)
CARTESIAN = {2: PLANE_STRAIN, 3: SPACE}


def of_materials(materials: Iterable[tuple[str, bool]], dimension: int = 2) -> Kinematics:
    """That of a body with these materials, of each its hypothesis and whether it has torsion.

    Args:
        materials: of a body; the most special one counts, as all must agree.
        dimension: of the cells; those in space need no hypothesis.
    """
    names = {TORSION.words if torsion else hypothesis for hypothesis, torsion in materials}
    special = (kind for kind in (TORSION, AXISYMMETRIC, PLANE_STRESS) if kind.words in names)
    return next(special, PLANE_STRAIN) if dimension == 2 else SPACE


def of_data(scene: Mapping[str, Any], dimension: int = 2) -> Kinematics:
    """That of a scene as plain data, see ``of_materials``."""
    materials = scene.get("material") or ()
    return of_materials(((entry.get("hypothesis", ""), bool(entry.get("torsion"))) for entry in materials), dimension)


def of_components(cells: int, components: int) -> Kinematics:
    """That of forms of one's own, by the dimension of the cells and the components of the displacement."""
    return TORSION if components > cells else CARTESIAN[cells]
