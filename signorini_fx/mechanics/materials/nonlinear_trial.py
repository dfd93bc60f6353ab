"""What a nonlinear material of a user's own says of itself, tried before anything is assembled with it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from signorini_fx.mechanics.materials.nonlinear import (
    Hyperelastic,
    PathDependent,
    inverse_transposed,
)
from signorini_fx.mechanics.materials.protocol import PAIRS, Array
from signorini_fx.tuned import ENERGY_DIFFERENCE, SAME_STRESS, TRIED_STRAINS


def fault_of_nonlinear(material: Any) -> str:
    """What it does not keep; "": nothing was found."""
    name = type(material).__name__
    try:
        if not all(0 < modulus < np.inf for modulus in material.constants_at_rest):
            return f"constants_at_rest of {name} are {material.constants_at_rest}: both must be positive"
        if isinstance(material, Hyperelastic):
            return _fault_of_energy(material)
        if isinstance(material, PathDependent):
            return _fault_of_response(material)
    except NotImplementedError:
        return f"{name} does not say all that a nonlinear material says"
    except Exception as error:
        return f"{name} fails: {type(error).__name__}: {error}"
    return f"{name} is neither Hyperelastic nor PathDependent"


def _gradients() -> list[Array]:
    """Deformation gradients, with the same numbers in every run."""
    drawn, gradients = np.random.default_rng(0), []
    for size in TRIED_STRAINS:
        gradient = np.eye(3)
        gradient[:2, :2] += size * drawn.standard_normal((2, 2))
        gradient[2, 2] += size * drawn.random()
        gradients.append(gradient)
    return gradients


def _fault_of_energy(material: Hyperelastic) -> str:
    import ufl
    from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

    name, modulus = type(material).__name__, max(material.constants_at_rest)

    def shape(gradient: Array) -> float:
        change = ufl.as_matrix((gradient - np.eye(3)).tolist())
        return _number(apply_algebra_lowering(material.shape_energy_by_change(change)))

    def volume(amount: float) -> float:
        return _number(material.volume_energy_by_change(ufl.as_ufl(float(amount) - 1)))

    for gradient in _gradients():
        amount = float(np.linalg.det(gradient))
        change = gradient - np.eye(3)
        stress = material.shape_stress_by_change(change)
        pressure = float(material.volume_stress_by_change(np.array(amount - 1)))
        if not np.abs(_slope(shape, gradient) - stress).max() <= SAME_STRESS * modulus:
            return f"shape_stress_at of {name} is not the derivative of its shape_energy"
        ahead, behind = (volume(amount + sign * ENERGY_DIFFERENCE) for sign in (1, -1))
        if not abs((ahead - behind) / (2 * ENERGY_DIFFERENCE) - pressure) <= SAME_STRESS * modulus:
            return f"volume_stress_at of {name} is not the derivative of its volume_energy"
        turned = _ROTATION @ gradient - np.eye(3)
        if not np.abs(material.shape_stress_by_change(turned) - _ROTATION @ stress).max() <= SAME_STRESS * modulus:
            return f"shape_stress_at of {name} is not objective: a rotation of the body changes it"
    if not np.abs(_piola(material, np.eye(3))).max() <= SAME_STRESS * modulus:
        return f"{name} has a stress without strain"
    for strain in _units():
        small = ENERGY_DIFFERENCE * strain
        sides = [_piola(material, np.eye(3) + sign * small) / (2 * ENERGY_DIFFERENCE) for sign in (1, -1)]
        if not np.abs(sides[0] - sides[1] - material.at_rest.stress_at(strain)).max() <= SAME_STRESS * modulus:
            return f"constants_at_rest of {name} are not those of its energy"
    return ""


def _fault_of_response(material: PathDependent) -> str:
    name, modulus, drawn = type(material).__name__, max(material.constants_at_rest), np.random.default_rng(0)
    strain = drawn.standard_normal((64, 3, 3)) * np.geomspace(1e-5, 1e-1, 64)[:, None, None]
    strain = (strain + strain.swapaxes(1, 2)) / 2
    state: Array = np.zeros((len(strain), material.state_size))
    for time, factor in ((1.0, 1.0), (2.0, 2.0), (4.0, -0.5)):
        material = material.at_time(time)
        stress, tangent, grown = material.respond(factor * strain, state)
        if not np.abs(np.trace(stress, axis1=1, axis2=2)).max() <= SAME_STRESS * modulus:
            return f"respond of {name} gives a stress that is not deviatoric"
        if not np.abs(material.respond_at(factor * strain, state) - stress).max() <= SAME_STRESS * modulus:
            return f"respond_at of {name} is not its respond"
        for column, unit in enumerate(_units()):
            small = ENERGY_DIFFERENCE**2 * unit
            ahead, behind = (material.respond(factor * strain + sign * small, state)[0] for sign in (1, -1))
            change = (ahead - behind) / (2 * ENERGY_DIFFERENCE**2)
            wrong = np.abs(np.array([change[:, i, j] for i, j in PAIRS]).T - tangent[:, :, column]).max(axis=1)
            if not np.median(wrong) <= SAME_STRESS * modulus:  # some may yield in between
                return f"the derivative that respond of {name} gives is not that of its stress"
        state = grown
    return ""


def _piola(material: Hyperelastic, gradient: Array) -> Array:
    """The first Piola-Kirchhoff stress."""
    volume = np.linalg.det(gradient)
    pressure = float(material.volume_stress_by_change(volume - 1)) * volume
    shape = material.shape_stress_by_change(gradient - np.eye(3))
    return np.asarray(shape + pressure * inverse_transposed(gradient))


def _units() -> list[Array]:
    """Strains, of shear 1/2, in the order of ``PAIRS``."""
    units: list[Array] = [np.zeros((3, 3)) for _ in PAIRS]
    for unit, (i, j) in zip(units, PAIRS, strict=True):
        unit[i, j] += 0.5
        unit[j, i] += 0.5
    return units


def _slope(energy: Callable[[Array], float], gradient: Array) -> Array:
    """The derivative by central differences; of shears across a plane mesh it is zero."""
    slope = np.zeros((3, 3))
    for i, j in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 2)]:
        change = np.zeros((3, 3))
        change[i, j] = ENERGY_DIFFERENCE
        slope[i, j] = (energy(gradient + change) - energy(gradient - change)) / (2 * ENERGY_DIFFERENCE)
    return slope


def _number(expression: Any) -> float:
    """The value of a UFL expression of numbers."""
    import ufl

    return float(ufl.as_ufl(expression)(()))


_ROTATION = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
