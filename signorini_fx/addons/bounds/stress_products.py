"""Squares of stresses that are linear on the parts of divided cells, and of strains that are linear on the cells."""

from __future__ import annotations

import numpy as np

from signorini_fx.addons.bounds.arrays import Array
from signorini_fx.addons.bounds.simplices import FACETS, TWICE, Simplices


def from_strain(t: Simplices, strain: Array) -> Array:
    """The stress on the parts of cells at their corners, see ``LocalStress.stress``, of linear strains at corners."""
    corner_stress = t.stress(strain)
    centre = np.repeat(corner_stress.mean(axis=1)[:, None, None], t.dimension + 1, axis=1)
    return np.concatenate((corner_stress[:, FACETS[t.dimension]], centre), axis=2)


def square(t: Simplices, stress: Array) -> Array:
    """Integrals of sigma : C^-1 sigma of stresses on the parts, by cell, energies, shape (n,)."""
    d, strain = t.dimension, t.strain(stress) * TWICE[t.dimension]
    sums = (stress * strain).sum(axis=(1, 2, 3)) + (stress.sum(axis=2) * strain.sum(axis=2)).sum(axis=(1, 2))
    return np.asarray(t.volume / ((d + 1) ** 2 * (d + 2)) * sums).clip(min=0.0)


def energy(t: Simplices, strain: Array) -> Array:
    """Squares of energy norms of linear strains at corners, by cell, see ``square``."""
    d, stress = t.dimension, t.stress(strain) * TWICE[t.dimension]
    sums = (stress * strain).sum(axis=(1, 2)) + (stress.sum(axis=1) * strain.sum(axis=1)).sum(axis=1)
    return np.asarray(t.volume / ((d + 1) * (d + 2)) * sums)
