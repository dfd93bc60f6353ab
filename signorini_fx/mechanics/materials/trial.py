"""What is asked of a material of a user's own before anything is assembled with it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from signorini_fx.errors import SceneError
from signorini_fx.extensions import is_of_package
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.materials.protocol import PAIRS, Material, stress_of
from signorini_fx.tuned import CERTIFICATE_TOLERANCE


def check_materials(materials: Iterable[Material]) -> None:
    """Refuse materials that are not what they say.

    Raises:
        SceneError: there are some.
    """
    problems = [
        (f"material[{number}]", fault)
        for number, material in enumerate(materials)
        if not is_of_package(type(material)) and (fault := fault_of(material))
    ]
    if problems:
        raise SceneError(problems)


def fault_of(material: Any) -> str:
    """Why a solution with a material means nothing; "": nothing was found."""
    name = type(material).__name__
    if not material.linear:
        from signorini_fx.mechanics.materials.nonlinear_trial import fault_of_nonlinear

        return fault_of_nonlinear(material)
    try:
        return _fault_of_linear(material, name)
    except NotImplementedError:
        return f"{name} does not say its stress"
    except Exception as error:
        return f"{name} fails: {type(error).__name__}: {error}"


def _fault_of_linear(material: Material, name: str) -> str:
    """Its stress is taken from unit strains, by a matrix that must have an energy."""
    stiffness = material.stiffness
    together = stress_of(material, np.ones(len(PAIRS)))
    if not np.isfinite(stiffness).all():
        return f"stress of {name} is not finite"
    tiny = CERTIFICATE_TOLERANCE * np.abs(stiffness).max()
    if not np.abs(together - stiffness.sum(axis=1)).max() <= tiny:
        return f"stress of {name} is no linear function of the strain"
    if np.abs(stiffness - stiffness.T).max() > tiny:
        return f"stress of {name} has no energy: its stiffness is not symmetric"
    if not (least := np.linalg.eigvalsh((stiffness + stiffness.T) / 2)[0]) > 0:
        return f"stress of {name} does no work on some strain: its stiffness has the eigenvalue {least:g}"
    if np.shape(material.free_strain) != (3,) or not np.isfinite(material.free_strain).all():
        return f"free_strain of {name} must be three finite numbers"
    if not material.isotropic:
        return ""
    first, second = material.lame
    expected = np.diag([2 * second] * 3 + [second] * 3)
    expected[:3, :3] += first
    if np.abs(stiffness - expected).max() > tiny:
        return f"{name} is not isotropic, as it says: its stress follows the direction of the strain"
    derived = isinstance(material, LinearElastic)
    return "" if derived else f"{name} has isotropic = True: derive it from LinearElastic, or leave that out"
