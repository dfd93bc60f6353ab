"""Products, in the norm of the complementary energy, of stresses that are linear on the thirds of triangles."""

from __future__ import annotations

import numpy as np

from signorini_fx.accuracy.arrays import Array
from signorini_fx.accuracy.triangles import Triangles


def from_strain(t: Triangles, strain: Array) -> Array:
    """The stress on thirds at their corners, shape (n, 3, 3, 3), of linear strains at corners, shape (n, 3, 3)."""
    own = t.stress(strain)
    centre = own.mean(axis=1)
    return np.stack([np.stack((own[:, (i + 1) % 3], own[:, (i + 2) % 3], centre), axis=1) for i in range(3)], axis=1)


def product(t: Triangles, one: Array, other: Array) -> Array:
    """Integrals of one : C^-1 other, by triangle, energies per thickness, shape (n,)."""
    first, second = (t.lame[:, k, None, None] for k in (0, 1))
    trace = first / (2 * (first + second)) * (other[..., 0] + other[..., 1])
    strain = np.stack((other[..., 0] - trace, other[..., 1] - trace, 2 * other[..., 2]), axis=-1)
    whole = (one * strain).sum(axis=(1, 2, 3)) + (one.sum(axis=2) * strain.sum(axis=2)).sum(axis=(1, 2))
    return np.asarray(t.area / (72 * t.lame[:, 1]) * whole)


def square(t: Triangles, stress: Array) -> Array:
    """Squares of the norm, by triangle, energies per thickness, shape (n,)."""
    return product(t, stress, stress).clip(min=0.0)
