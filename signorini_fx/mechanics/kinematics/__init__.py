"""The kinematics of bodies: strains, measures, rigid motions and displacement components of each
kind, such as plane strain or 3D.

A problem has its kinematics as ``Statement.kinematics``, a body as ``Model.kinematics``; all other
code uses this interface without distinguishing kinds.  The ``hypothesis`` of a material may name
kinematics of another package, an instance of ``Kinematics``.  UFL is imported where it is needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from signorini_fx.errors import InstallationError
from signorini_fx.extensions import KINEMATICS, load, names_of
from signorini_fx.mechanics.kinematics.protocol import (
    AXISYMMETRIC,
    PLANE_STRAIN,
    PLANE_STRESS,
    SPACE,
    TORSION,
    Kinematics,
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
