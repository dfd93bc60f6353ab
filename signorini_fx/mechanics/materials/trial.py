"""The check of a user's own material, before anything is assembled with it."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from signorini_fx.arrays import Array
from signorini_fx.errors import SceneError
from signorini_fx.extensions import is_of_package
from signorini_fx.mechanics.kinematics import tensors
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.materials.protocol import PAIRS, Material, stress_of
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, DIFFERENCE_STEP, SAME_TANGENT

if TYPE_CHECKING:
    from signorini_fx.mechanics.materials.nonlinear import Hyperelastic, PathDependent

# Strains, of shear 1/2, in the order of ``PAIRS``.
_UNITS = tensors(np.diag([1.0, 1.0, 1.0, 0.5, 0.5, 0.5]), PAIRS)
_ROTATION = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])


def check_materials(materials: Iterable[Material]) -> None:
    """Raise a ``SceneError`` with the faults of all materials that are not of this package."""
    problems = [
        (f"material[{number}]", fault)
        for number, material in enumerate(materials)
        if not is_of_package(type(material)) and (fault := fault_of(material))
    ]
    if problems:
        raise SceneError(problems)


def fault_of(material: Material) -> str:
    """Return what is wrong with a material; "" if nothing was found."""
    name = type(material).__name__
    try:
        if material.linear:
            return _fault_of_linear(material, name)
        from signorini_fx.mechanics.materials.nonlinear import Hyperelastic, PathDependent

        if not isinstance(material, Hyperelastic | PathDependent):
            return f"{name} is neither Hyperelastic nor PathDependent"
        if not all(0 < modulus < np.inf for modulus in material.constants_at_rest):
            return (
                f"constants_at_rest of {name} are {material.constants_at_rest}: both must be "
                "positive"
            )
        if isinstance(material, Hyperelastic):
            return _fault_of_energy(material)
        return _fault_of_response(material)
    except NotImplementedError:
        return f"{name} must define {'stress()' if material.linear else 'all methods of its base'}"
    except Exception as error:
        return f"{name} fails: {type(error).__name__}: {error}"


def _fault_of_linear(material: Material, name: str) -> str:
    """Return what is wrong with a linear material: its stress must be linear in the strain, with a
    symmetric positive definite stiffness; "" if nothing was found.
    """
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
        return (
            f"stress of {name} does no work on some strain: its stiffness has the eigenvalue "
            f"{least:g}"
        )
    if np.shape(material.free_strain) != (3,) or not np.isfinite(material.free_strain).all():
        return f"free_strain of {name} must be three finite numbers"
    if not material.isotropic:
        return ""
    first, second = material.lame
    expected = np.diag([2 * second] * 3 + [second] * 3)
    expected[:3, :3] += first
    if np.abs(stiffness - expected).max() > tiny:
        return f"{name}.isotropic is True, but its stress depends on the direction of the strain"
    derived = isinstance(material, LinearElastic)
    return (
        ""
        if derived
        else f"{name} has isotropic = True: derive it from LinearElastic, or leave that out"
    )


def _fault_of_energy(material: Hyperelastic) -> str:
    import ufl
    from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

    name = type(material).__name__
    modulus = max(material.constants_at_rest)
    drawn = np.random.default_rng(0)

    def shape(change: Array) -> float:
        energy = apply_algebra_lowering(
            material.shape_energy_by_change(ufl.as_matrix(change.tolist()))
        )
        return float(ufl.as_ufl(energy)(()))

    def whole(change: Array) -> float:
        growth = float(np.linalg.det(np.eye(3) + change)) - 1
        return shape(change) + float(
            ufl.as_ufl(material.volume_energy_by_change(ufl.as_ufl(growth)))(())
        )

    change = np.zeros((3, 3))
    # A strain of rubber.
    change[:2, :2] = 0.2 * drawn.standard_normal((2, 2))
    change[2, 2] = 0.2 * drawn.random()
    before = shape(change)
    after = shape(_ROTATION @ (np.eye(3) + change) - np.eye(3))
    if not np.isfinite([before, after, whole(change)]).all():
        return f"the energy of {name} is not finite"
    if not abs(after - before) <= SAME_TANGENT * modulus:
        return f"shape_energy of {name} is not objective: a rotation of the body changes it"
    # A 2D body has no shear across the mesh.
    units = {k: _UNITS[k] for k, pair in enumerate(PAIRS) if pair not in ((0, 2), (1, 2))}
    first = DIFFERENCE_STEP
    second = np.finfo(np.float64).eps ** 0.25  # where both errors of differences are small
    for unit in units.values():
        if (
            not abs(whole(first * unit) - whole(-first * unit))
            <= 2 * first * SAME_TANGENT * modulus
        ):
            return f"{name} has a stress without strain"
    stiffness = material.at_rest.stiffness
    for (i, one), (j, other) in product(units.items(), repeat=2):
        corners = product((second, -second), repeat=2)
        twice = sum(np.sign(a * b) * whole(a * one + b * other) for a, b in corners)
        if not abs(twice / (4 * second**2) - stiffness[i, j]) <= SAME_TANGENT * modulus:
            return f"constants_at_rest of {name} are not those of its energy"
    return ""


def _fault_of_response(material: PathDependent) -> str:
    name = type(material).__name__
    modulus = max(material.constants_at_rest)
    drawn = np.random.default_rng(0)
    strain = drawn.standard_normal((64, 3, 3)) * np.geomspace(1e-5, 1e-1, 64)[:, None, None]
    strain = (strain + strain.swapaxes(1, 2)) / 2
    state: Array = np.zeros((len(strain), material.state_size))
    for time, factor in ((1.0, 1.0), (2.0, 2.0), (4.0, -0.5)):
        material = material.at_time(time)
        tried = factor * strain
        tried.flags.writeable = state.flags.writeable = False  # the solver keeps both
        stress, tangent, grown = material.respond(tried, state)
        if not np.abs(np.trace(stress, axis1=1, axis2=2)).max() <= SAME_TANGENT * modulus:
            return f"respond of {name} gives a stress that is not deviatoric"
        if not np.isfinite(tangent).all() or not np.array_equal(
            material.respond(tried, state)[0], stress
        ):
            return (
                f"respond of {name} is not finite, or gives something else when it is called again"
            )
        for column in range(len(PAIRS)):
            small = DIFFERENCE_STEP**2 * _UNITS[column]
            ahead, behind = (
                material.respond(factor * strain + sign * small, state)[0] for sign in (1, -1)
            )
            change = (ahead - behind) / (2 * DIFFERENCE_STEP**2)
            wrong = np.abs(
                np.array([change[:, i, j] for i, j in PAIRS]).T - tangent[:, :, column]
            ).max(axis=1)
            if not np.median(wrong) <= SAME_TANGENT * modulus:  # some may yield in between
                return f"the derivative that respond of {name} gives is not that of its stress"
        state = grown
    return ""
