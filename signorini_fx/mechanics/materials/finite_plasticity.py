"""Plasticity at finite strains from a law of small strains: the logarithm of the elastic stretch
takes the place of the strain (J. C. Simo, Comput. Methods Appl. Mech. Eng. 99 (1992) 61-112).

F = F_e F_p, b_e = F C_p^-1 F^T with C_p = F_p^T F_p, and epsilon = 1/2 ln b_e.  A load step starts
with the trial b_e from the C_p of its beginning; plastic flow, which has the axes of b_e, reduces
epsilon.  The Kirchhoff stress is J sigma.  C_p refers to the undeformed body, so that the result
does not depend on rotations.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from signorini_fx.arrays import Array
from signorini_fx.mechanics.materials.protocol import PAIRS
from signorini_fx.tuned import NEAR_ONE

# Coefficients of artanh(z) / z in powers of z^2, for small z.
_SERIES = (1.0, 1 / 3, 1 / 5, 1 / 7)


def respond_at_finite_strains(
    respond: Callable[[Array, Array], tuple[Array, Array, Array]], change: Array, state: Array
) -> tuple[Array, Array, Array]:
    """Return stress, tangent and state as ``PathDependent.respond_by_change`` of a plastic
    material.

    Args:
        respond: the isotropic law of small strains, see ``PathDependent.respond``: from a strain
            and a state to the deviatoric stress, its derivative, and the new state.
        change: F - I, shape (n, 3, 3).
        state: C_p^-1 - I and the accumulated plastic strain, shape (n, 10).
    """
    with np.errstate(invalid="ignore"):
        inside_out = ~(np.linalg.det(np.eye(3) + change) > 0)  # or not finite: no stress
    change = np.where(inside_out[:, None, None], 0.0, change)
    turned = change.swapaxes(1, 2)
    gradient = np.eye(3) + change
    inverse = np.linalg.inv(gradient)
    before = state[:, :9].reshape(-1, 3, 3)
    green = change + turned + change @ turned
    values, axes = np.linalg.eigh(green + gradient @ before @ gradient.swapaxes(1, 2))
    strain = np.log1p(values) / 2
    elastic = np.concatenate((np.zeros((len(state), 9)), state[:, 9:]), axis=1)
    stress, tangent, flown = respond(strain[:, :, None] * np.eye(3), elastic)

    across = axes.swapaxes(1, 2)
    back = inverse.swapaxes(1, 2)
    piola = axes @ stress @ across @ back
    # Derivatives by F_kl of b_e, of the strain and of the stress, along the axes of b_e.
    moved = (np.eye(3) + before) @ gradient.swapaxes(1, 2) @ axes
    of_stretch = axes[:, :, None, :, None] * moved[:, None, :, None, :]
    of_strain = (of_stretch + of_stretch.swapaxes(3, 4)).reshape(-1, 9, 3, 3)
    of_strain *= _slopes_of_logarithms(values)[:, None]
    i, j = np.transpose(PAIRS)
    rows = of_strain[:, :, i, j] * np.where(i == j, 1.0, 2.0)
    of_stress = np.empty_like(of_strain)
    of_stress[:, :, i, j] = of_stress[:, :, j, i] = rows @ tangent
    by_stress = axes[:, None] @ of_stress @ (across @ back)[:, None]
    by_inverse = piola.swapaxes(1, 2)[:, None, :, :, None] * back[:, :, None, None, :]
    derivative = by_stress - by_inverse.reshape(by_stress.shape)

    left = axes * np.expm1(2 * (strain - flown[:, :9:4]))[:, None] @ across
    new = np.concatenate((state[:, :9], flown[:, 9:]), axis=1)
    flows = flown[:, 9] > state[:, 9]
    new[flows, :9] = (inverse @ (left - green) @ back)[flows].reshape(-1, 9)
    piola[inside_out] = np.nan
    return piola, derivative.reshape(-1, 9, 9).swapaxes(1, 2), new


def _slopes_of_logarithms(values: Array) -> Array:
    """Return the divided differences of 1/2 ln(1 + x) between values, shape (n, 3, 3), from shape
    (n, 3).
    """
    differences = values[:, :, None] - values[:, None, :]
    sums = 2 + values[:, :, None] + values[:, None, :]
    half = differences / sums
    series = np.polynomial.polynomial.polyval(half**2, _SERIES) / sums
    near = np.abs(half) < NEAR_ONE
    far = np.arctanh(half) / np.where(near, 1.0, differences)
    return np.where(near, series, far)
