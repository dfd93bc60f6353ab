"""Products, in the norm of the complementary energy, of stresses that are linear on the thirds of triangles."""

from __future__ import annotations

import numpy as np

from signorini_fx.bounds.arrays import Array
from signorini_fx.bounds.triangles import Triangles


def from_strain(t: Triangles, strain: Array) -> Array:
    """The stress on thirds at their corners, shape (n, 3, 3, 3), of linear strains at corners, shape (n, 3, 3)."""
    corner_stress = t.stress(strain)
    centre = corner_stress.mean(axis=1)
    return np.stack(
        [np.stack((corner_stress[:, (i + 1) % 3], corner_stress[:, (i + 2) % 3], centre), axis=1) for i in range(3)],
        axis=1,
    )


def product(t: Triangles, sigma: Array, tau: Array) -> Array:
    """Integrals of one : C^-1 other, by triangle, energies per thickness, shape (n,)."""
    first, second = (t.lame[:, k, None, None] for k in (0, 1))
    trace = first / (2 * (first + second)) * (tau[..., 0] + tau[..., 1])
    strain = np.stack((tau[..., 0] - trace, tau[..., 1] - trace, 2 * tau[..., 2]), axis=-1)
    sums = (sigma * strain).sum(axis=(1, 2, 3)) + (sigma.sum(axis=2) * strain.sum(axis=2)).sum(axis=(1, 2))
    return np.asarray(t.area / (72 * t.lame[:, 1]) * sums)


def square(t: Triangles, stress: Array) -> Array:
    """Squares of the norm, by triangle, energies per thickness, shape (n,)."""
    return product(t, stress, stress).clip(min=0.0)
