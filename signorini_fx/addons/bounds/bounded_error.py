"""The bound of an error with what follows from it, and steps of its proof that do not depend on the dimension."""

from __future__ import annotations

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import SAME_LENGTH

_EPS = float(np.finfo(float).eps)
# Share of displacements and forces below which they are round-off.
ROUND_OFF = 64 * _EPS
# Why contact tractions are not known for a part of the body that moves freely without them.
UNBALANCED = "no admissible tractions near the nodal ones balance the loads"


def small_rests(loads: Array, tractions: Array, pieces: list[tuple[int, Ints]]) -> Array:
    """What loads and contact tractions may leave on free motions as round-off, force, shape (k,).

    A piece has its own scale, above the round-off of all pieces together, which are solved for together.

    Args:
        loads: their work on the motions, shape (k,).
        tractions: the sum of the sizes of that of the tractions, shape (k,).
        pieces: that have free motions, with the columns of these.
    """
    size, tolerance = np.abs(loads) + tractions, np.zeros(len(loads))
    for _, columns in pieces:
        tolerance[columns] = ROUND_OFF * size[columns].max() + _EPS * size.max()
    return tolerance


def work_of_loads(energy: float, above: float, size: float, error: float, cells: int) -> tuple[float, float]:
    """Bounds of the work of the loads, which is a(u, u) / 2 less the smallest energy.

    Args:
        energy: of the admissible displacement, loads included.
        above: a bound of its distance from the smallest one.
        size: energy norm of the computed displacement.
        error: bound of that of its error.
        cells: how many contributions are summed up.
    """
    tiny = ROUND_OFF * cells**0.5 * (abs(energy) + size**2)
    return (
        float(max(size - error, 0.0) ** 2 / 2 - energy - tiny),
        float((size + error) ** 2 / 2 - energy + above + tiny),
    )


def out(normals: Array, excess: Array, free: Array, tiny: float) -> Array:
    """A small displacement in free directions, shape (d,), whose components along normals are at least an excess."""
    along = normals @ free
    size = np.linalg.norm(along, axis=1)
    stuck = size <= SAME_LENGTH
    if (excess[stuck] > 4 * tiny).any():
        # By more than the round-off of this proof; what is more than that of a scene is refused at its nodes.
        raise Refused("supports leave no way out of the foundation")
    along, excess, normals = along[~stuck], excess[~stuck].clip(min=0.0), normals[~stuck]
    if not len(along):
        return np.zeros(len(free))
    together = along.sum(axis=0)
    if (along @ together).min() < 0.1 * float(together @ together) / len(along):
        displacement = np.asarray(np.linalg.lstsq(along, excess, rcond=None)[0], dtype=np.float64)  # faces at a corner
        if ((along @ displacement) < excess - tiny).any():
            raise Refused("the faces of the foundation meet at too sharp a corner")
        return displacement
    return np.asarray(together * (excess / (along @ together)).max())
