"""The bound of an error with what follows from it, and steps of its proof that do not depend on the dimension."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from signorini_fx.bounds.arrays import Array, Ints
from signorini_fx.bounds.bounded_scene import Grounds, Refused

_EPS = float(np.finfo(float).eps)
# Share of displacements and forces below which they are round-off.
ROUND_OFF = 64 * _EPS
# Why contact tractions are not known for a part of the body that moves freely without them.
UNBALANCED = "no admissible tractions near the nodal ones balance the loads"
# Lengths below this share of the size of the body are equal.
SAME_LENGTH = 1e-9


class Interval(tuple[float, float]):
    """Two bounds of a quantity, which print what they rest on.

    Attributes:
        grounds: what it rests on.
    """

    grounds: Grounds

    def __new__(cls, low: float, high: float, grounds: Grounds) -> Self:
        """Between two numbers."""
        found = super().__new__(cls, (low, high))
        found.grounds = grounds
        return found

    def __str__(self) -> str:
        """One sentence."""
        return self.grounds.of(f"between {self[0]:.6g} and {self[1]:.6g}")


@dataclass(frozen=True, repr=False)
class ErrorBound:
    """A bound of the error of a computed displacement; energy norms are the square root of a(y, y).

    Attributes:
        error: bound of the energy norm of the error, everything included.
        size: energy norm of the computed displacement.
        duality: its share from the gap between both functionals, which ``moved`` enlarges as a sum of squares.
        data: that of loads between what the stress holds of them.
        moved: that of the displacement without penetration instead of the computed one.
        round_off: that of sums and linear systems.
        squares: contributions of the cells to the square of ``error``, shape (cells,).
        grounds: what the statement rests on, and whether it is a bound at all.
        work: bounds of the work of the loads, energies per thickness; None with friction.
    """

    error: float
    size: float
    duality: float
    data: float
    moved: float
    round_off: float
    squares: Array
    grounds: Grounds
    work: tuple[float, float] | None = None

    @property
    def relative(self) -> float:
        """Bound of the error relative to the energy norm of the exact solution; infinite where it proves nothing."""
        return self.error / (self.size - self.error) if self.error < self.size else np.inf

    @property
    def strain_energy(self) -> tuple[float, float]:
        """Bounds of the strain energy of the exact solution, an energy per thickness."""
        return max(self.size - self.error, 0.0) ** 2 / 2, (self.size + self.error) ** 2 / 2

    def __str__(self) -> str:
        """One sentence."""
        if not np.isfinite(self.relative):
            return self.grounds.of("the bound of the error is larger than the solution")
        low, high = self.strain_energy
        sentence = (
            f"at most {100 * self.relative:.3g} % in the energy norm; strain energy between {low:.6g} and {high:.6g}"
        )
        if self.work is not None:
            sentence += f"; work of the loads between {self.work[0]:.6g} and {self.work[1]:.6g}"
        return self.grounds.of(sentence)

    def as_dict(self) -> dict[str, Any]:
        """JSON-safe; null for a relative error without a bound."""
        return {
            "relative_error": self.relative if np.isfinite(self.relative) else None,
            "strain_energy": list(self.strain_energy),
            "work": None if self.work is None else list(self.work),
            **{name: getattr(self, name) for name in ("error", "duality", "data", "moved", "round_off")},
            "guaranteed": not self.grounds.estimated,
            "statement": str(self),
        }


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
        raise Refused("a support pushes the body into its foundation")
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
