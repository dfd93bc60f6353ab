"""Which displacements a body has: strains, measures, rigid motions and components of each kind.

The object of a problem is ``Statement.kinematics``, that of its body ``Model.kinematics``;
all others ask it and know no kind.  Materials name that of another package, an object with the base
``Kinematics``, as their ``hypothesis``. UFL is imported where it is needed.
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
# What materials call those of this package.
HYPOTHESES = {kind.words: kind for kind in (PLANE_STRAIN, PLANE_STRESS, AXISYMMETRIC)}


def hypotheses() -> tuple[str, ...]:
    """Return the names that materials may give the kinematics of a plane mesh; none is imported."""
    return (*HYPOTHESES, *(name for name in names_of(KINEMATICS) if name not in HYPOTHESES))


def of_hypothesis(name: str) -> Kinematics:
    """Return the kinematics of a name in ``hypotheses``; an ``InstallationError`` where their
    package is missing.
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
    """Return the kinematics of a body with these materials, by their hypotheses and torsion: the
    most special one, as all must agree.

    ``dimension``: of the cells; materials in 3D need no hypothesis.
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
    """Return the kinematics of a scene as plain data, see ``of_materials``."""
    materials = scene.get("material") or ()
    return of_materials(
        ((entry.get("hypothesis", ""), bool(entry.get("torsion"))) for entry in materials),
        dimension,
    )


def of_components(cells: int, components: int) -> Kinematics:
    """Return the kinematics of forms, by the dimension of the cells and the components of the
    displacement.
    """
    return TORSION if components > cells else CARTESIAN[cells]
