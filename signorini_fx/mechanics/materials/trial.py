"""What a material of a user's own says of itself, tried before anything is assembled with it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from signorini_fx.errors import SceneError
from signorini_fx.extensions import is_of_package
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.materials.protocol import PAIRS, Array, stress_of
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, DIFFERENCE_STEP, SAME_TANGENT

_ROTATION = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
_STRETCHED = np.array([[1.3, 0.2, 0.0], [-0.1, 0.8, 0.0], [0.0, 0.0, 1.1]])
# A body in the plane has no shear across the mesh.
_STRAIN = np.array([[0.6, 0.3, 0.0], [0.3, -0.2, 0.0], [0.0, 0.0, 0.4]])


def check_materials(materials: Iterable[Any]) -> None:
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
    try:
        if material.linear:
            return _fault_of_linear(material, name)
        from signorini_fx.mechanics.materials.nonlinear import Hyperelastic, PathDependent

        if not all(0 < modulus < np.inf for modulus in material.constants_at_rest):
            return f"constants_at_rest of {name} are {material.constants_at_rest}: both must be positive"
        if isinstance(material, Hyperelastic):
            return _fault_of_energy(material)
        if isinstance(material, PathDependent):
            return _fault_of_response(material)
    except NotImplementedError:
        return f"{name} does not say {'its stress' if material.linear else 'all that a nonlinear material says'}"
    except Exception as error:
        return f"{name} fails: {type(error).__name__}: {error}"
    return f"{name} is neither Hyperelastic nor PathDependent"


def _fault_of_linear(material: Any, name: str) -> str:
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


def _fault_of_energy(material: Any) -> str:
    import ufl
    from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

    name, modulus = type(material).__name__, max(material.constants_at_rest)

    def shape(gradient: Array) -> float:
        energy = apply_algebra_lowering(material.shape_energy(ufl.as_matrix(gradient.tolist())))
        return float(ufl.as_ufl(energy)(()))

    def whole(gradient: Array) -> float:
        volume = ufl.as_ufl(float(np.linalg.det(gradient)))
        return shape(gradient) + float(ufl.as_ufl(material.volume_energy(volume))(()))

    before, after = shape(_STRETCHED), shape(_ROTATION @ _STRETCHED)
    if not np.isfinite([before, after, whole(_STRETCHED)]).all():
        return f"the energy of {name} is not finite"
    if not abs(after - before) <= SAME_TANGENT * modulus:
        return f"shape_energy of {name} is not objective: a rotation of the body changes it"
    step = np.finfo(np.float64).eps ** 0.25  # where both errors of second differences are small
    behind, rest, ahead = (whole(np.eye(3) + k * step * _STRAIN) for k in (-1, 0, 1))
    if not abs(ahead - behind) <= 2 * step * SAME_TANGENT * modulus:
        return f"{name} has a stress without strain"
    twice = _components(_STRAIN) @ material.at_rest.stiffness @ _components(_STRAIN)
    if not abs((ahead - 2 * rest + behind) / step**2 - twice) <= SAME_TANGENT * modulus:
        return f"constants_at_rest of {name} are not those of its energy"
    return ""


def _fault_of_response(material: Any) -> str:
    name, modulus, drawn = type(material).__name__, max(material.constants_at_rest), np.random.default_rng(0)
    strain = drawn.standard_normal((64, 3, 3)) * np.geomspace(1e-5, 1e-1, 64)[:, None, None]
    strain = (strain + strain.swapaxes(1, 2)) / 2
    direction, small = strain[0] / np.linalg.norm(strain[0]), DIFFERENCE_STEP**2
    state: Array = np.zeros((len(strain), material.state_size))
    for time, factor in ((1.0, 1.0), (2.0, 2.0), (4.0, -0.5)):
        material = material.at_time(time)
        tried = factor * strain
        tried.flags.writeable = state.flags.writeable = False  # the solver keeps both
        stress, tangent, grown = material.respond(tried, state)
        if not np.abs(np.trace(stress, axis1=1, axis2=2)).max() <= SAME_TANGENT * modulus:
            return f"respond of {name} gives a stress that is not deviatoric"
        if not np.isfinite(tangent).all() or not np.array_equal(material.respond(tried, state)[0], stress):
            return f"respond of {name} is not finite, or gives something else when it is called again"
        ahead, behind = (material.respond(tried + sign * small * direction, state)[0] for sign in (1, -1))
        change = (ahead - behind) / (2 * small)
        wrong = np.abs(np.array([change[:, i, j] for i, j in PAIRS]).T - tangent @ _components(direction)).max(axis=1)
        if not np.median(wrong) <= SAME_TANGENT * modulus:  # some may yield in between
            return f"the derivative that respond of {name} gives is not that of its stress"
        state = grown
    return ""


def _components(strain: Array) -> Array:
    """The components ``PAIRS`` of a strain, of shear twice epsilon_ij."""
    return np.array([strain[i, j] * (1 if i == j else 2) for i, j in PAIRS])
