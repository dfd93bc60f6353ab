"""What a nonlinear material of a user's own says of itself, tried before anything is assembled with it."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from signorini_fx.mechanics.materials.nonlinear import Hyperelastic, PathDependent
from signorini_fx.mechanics.materials.protocol import PAIRS, Array
from signorini_fx.tuned import DIFFERENCE_STEP, SAME_TANGENT, TRIED_STRAINS


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

    def shape(change: Array) -> float:
        return _number(apply_algebra_lowering(material.shape_energy_by_change(ufl.as_matrix(change.tolist()))))

    def whole(change: Array) -> float:
        growth = float(np.linalg.det(np.eye(3) + change)) - 1
        return shape(change) + _number(material.volume_energy_by_change(ufl.as_ufl(growth)))

    for gradient in _gradients():
        before, after = shape(gradient - np.eye(3)), shape(_ROTATION @ gradient - np.eye(3))
        if not np.isfinite([before, after, whole(gradient - np.eye(3))]).all():
            return f"the energy of {name} is not finite"
        if not abs(after - before) <= SAME_TANGENT * modulus:
            return f"shape_energy of {name} is not objective: a rotation of the body changes it"
    # A body in the plane has no shear across the mesh.
    units = {k: unit for k, unit in enumerate(_units()) if PAIRS[k] not in ((0, 2), (1, 2))}
    first, second = DIFFERENCE_STEP, np.finfo(np.float64).eps ** 0.25  # where both errors of differences are small
    for unit in units.values():
        if not abs(whole(first * unit) - whole(-first * unit)) <= 2 * first * SAME_TANGENT * modulus:
            return f"{name} has a stress without strain"
    stiffness = material.at_rest.stiffness
    for (i, one), (j, other) in product(units.items(), repeat=2):
        corners = product((second, -second), repeat=2)
        change = sum(np.sign(a * b) * whole(a * one + b * other) for a, b in corners)
        if not abs(change / (4 * second**2) - stiffness[i, j]) <= SAME_TANGENT * modulus:
            return f"constants_at_rest of {name} are not those of its energy"
    return ""


def _fault_of_response(material: PathDependent) -> str:
    name, modulus, drawn = type(material).__name__, max(material.constants_at_rest), np.random.default_rng(0)
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
        if not np.isfinite(tangent).all() or not np.array_equal(material.respond(tried, state)[0], stress):
            return f"respond of {name} is not finite, or gives something else when it is called again"
        for column, unit in enumerate(_units()):
            small = DIFFERENCE_STEP**2 * unit
            ahead, behind = (material.respond(factor * strain + sign * small, state)[0] for sign in (1, -1))
            change = (ahead - behind) / (2 * DIFFERENCE_STEP**2)
            wrong = np.abs(np.array([change[:, i, j] for i, j in PAIRS]).T - tangent[:, :, column]).max(axis=1)
            if not np.median(wrong) <= SAME_TANGENT * modulus:  # some may yield in between
                return f"the derivative that respond of {name} gives is not that of its stress"
        state = grown
    return ""


def _units() -> list[Array]:
    """Strains, of shear 1/2, in the order of ``PAIRS``."""
    units: list[Array] = [np.zeros((3, 3)) for _ in PAIRS]
    for unit, (i, j) in zip(units, PAIRS, strict=True):
        unit[i, j] += 0.5
        unit[j, i] += 0.5
    return units


def _number(expression: Any) -> float:
    """The value of a UFL expression of numbers."""
    import ufl

    return float(ufl.as_ufl(expression)(()))


_ROTATION = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
