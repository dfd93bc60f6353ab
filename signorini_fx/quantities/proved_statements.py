"""Statements that are proved about a solution, with their numbers; add-ons find the proofs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from signorini_fx.arrays import Array


class Refused(Exception):
    """A problem has no bound; the message gives the reason."""


def with_assumed(statement: str, assumed: str) -> str:
    """Return a statement followed by its assumptions, if there are any."""
    return "; ".join(filter(None, (statement, assumed)))


class Interval(tuple[float, float]):
    """A lower and an upper bound of a quantity, which print their assumptions.

    Attributes:
        assumed: the assumptions beside the data; "": none.
    """

    assumed: str

    def __new__(cls, low: float, high: float, assumed: str = "") -> Self:
        """Return the interval between two numbers."""
        found = super().__new__(cls, (low, high))
        found.assumed = assumed
        return found

    def __getnewargs__(self) -> tuple[float, float, str]:
        """Return the arguments of the constructor, for copies on other ranks."""
        return (*self, self.assumed)

    def __str__(self) -> str:
        """Return the interval as one sentence."""
        return with_assumed(f"between {self[0]:.6g} and {self[1]:.6g}", self.assumed)


@dataclass(frozen=True, repr=False)
class ErrorBound:
    """A bound of the error of a computed displacement; energy norms are the square root of a(y, y).

    Attributes:
        error: bound of the energy norm of the error, everything included.
        size: energy norm of the computed displacement.
        duality: its part from the gap between the primal and dual functionals, which ``moved``
            enlarges as a sum of squares.
        moved: its part from replacing the computed displacement by one without penetration.
        round_off: its part from round-off of sums and linear systems.
        squares: contributions of the cells to the square of ``error``, shape (cells,).
        assumed: the assumptions beside the data; "": none.
    """

    error: float
    size: float
    duality: float
    moved: float
    round_off: float
    squares: Array
    assumed: str = ""

    @property
    def relative(self) -> float:
        """Bound of the error relative to the energy norm of the exact solution; infinite if nothing
        is proved.
        """
        return self.error / (self.size - self.error) if self.error < self.size else np.inf

    @property
    def strain_energy(self) -> tuple[float, float]:
        """Bounds of the strain energy of the exact solution, energy (in 2D per thickness)."""
        return max(self.size - self.error, 0.0) ** 2 / 2, (self.size + self.error) ** 2 / 2

    def __str__(self) -> str:
        """Return the bound as one sentence."""
        if not np.isfinite(self.relative):
            return with_assumed("the bound of the error is larger than the solution", self.assumed)
        low, high = self.strain_energy
        return with_assumed(
            f"at most {100 * self.relative:.3g} % in the energy norm; strain energy between "
            f"{low:.6g} and {high:.6g}",
            self.assumed,
        )

    def as_dict(self) -> dict[str, float | list[float] | str | None]:
        """Return the bound as a dictionary, ready for JSON; a relative error without a bound is
        None.
        """
        return {
            "relative_error": self.relative if np.isfinite(self.relative) else None,
            "strain_energy": list(self.strain_energy),
            **{name: getattr(self, name) for name in ("error", "duality", "moved", "round_off")},
            "guaranteed": bool(np.isfinite(self.error)),
            "statement": str(self),
        }
