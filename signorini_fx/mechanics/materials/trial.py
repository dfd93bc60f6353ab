"""What a material of a user's own says of itself, tried before anything is assembled with it."""

from __future__ import annotations

from collections.abc import Iterable

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


def fault_of(material: Material) -> str:
    """What a material says of itself and does not keep; "": nothing was found."""
    if not material.linear:
        from signorini_fx.mechanics.materials.nonlinear_trial import fault_of_nonlinear

        return fault_of_nonlinear(material)
    name = type(material).__name__
    try:
        stiffness = material.stiffness
        together = stress_of(material, np.ones(len(PAIRS)))
    except NotImplementedError:
        return f"{name} does not say its stress"
    except Exception as error:
        return f"stress of {name} is no linear function of the strain: {type(error).__name__}: {error}"
    if not np.isfinite(stiffness).all():
        return f"stress of {name} is not finite"
    scale = np.abs(stiffness).max()
    if not np.abs(together - stiffness.sum(axis=1)).max() <= CERTIFICATE_TOLERANCE * scale:
        return f"stress of {name} is no linear function of the strain"
    least, most = np.linalg.eigvalsh((stiffness + stiffness.T) / 2)[[0, -1]]
    if np.abs(stiffness - stiffness.T).max() > CERTIFICATE_TOLERANCE * scale:
        return f"stress of {name} has no energy: its stiffness is not symmetric"
    if not least > 0:
        return f"stress of {name} does no work on some strain: its stiffness has the eigenvalue {least:g}"
    return _fault_of_moduli(material) or _fault_of_constants(material, most)


def _fault_of_moduli(material: Material) -> str:
    """They are positive, and bound the eigenvalues of the elasticity."""
    name = type(material).__name__
    try:
        low, high = map(float, material.moduli)
        missed = material.missed()
    except NotImplementedError:
        return f"{name} does not say its moduli"
    except Exception as error:
        return f"moduli of {name} are no two numbers: {type(error).__name__}: {error}"
    if missed > CERTIFICATE_TOLERANCE:
        least, most = material.eigenvalues
        return f"moduli of {name} are {low:g} and {high:g}, not bounds of its eigenvalues {least:g} to {most:g}"
    return ""


def _fault_of_constants(material: Material, most: float) -> str:
    """What it says of its expansion, and of its directions."""
    name, free = type(material).__name__, np.asarray(material.free_strain, dtype=np.float64)
    if free.shape != (3,) or not np.isfinite(free).all():
        return f"free_strain of {name} must be three finite numbers"
    if material.isotropic:
        first, second = material.lame
        expected = np.diag([2 * second] * 3 + [second] * 3)
        expected[:3, :3] += first
        if np.abs(material.stiffness - expected).max() > CERTIFICATE_TOLERANCE * most:
            return f"{name} is not isotropic, as it says: its stress follows the direction of the strain"
        if not isinstance(material, LinearElastic):
            return f"{name} has isotropic = True: derive it from LinearElastic, or leave that out"
    return ""
