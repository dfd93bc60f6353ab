"""What can be proved of a solution, in words and figures; add-ons find the proofs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Refused(Exception):
    """A problem that has no bound here, with the reason."""


@dataclass(frozen=True)
class Grounds:
    """What a statement rests on, in words.

    Attributes:
        estimated: why it is an estimate and no guaranteed bound; "": it is one.
        assumed: what else is assumed; "": nothing but the data.
    """

    estimated: str = ""
    assumed: str = ""

    def of(self, statement: str) -> str:
        """The statement with its grounds."""
        estimate = f"an estimate and no guaranteed bound, as {self.estimated}: " if self.estimated else ""
        return estimate + "; ".join(filter(None, (statement, self.assumed)))


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

    def __getnewargs__(self) -> Any:
        """What a copy on another rank is made of."""
        return (*self, self.grounds)

    def __str__(self) -> str:
        """One sentence."""
        return self.grounds.of(f"between {self[0]:.6g} and {self[1]:.6g}")


@dataclass(frozen=True, repr=False)
class ErrorBound:
    """A bound of the error of a computed displacement; energy norms are the square root of a(y, y),
    with springs of twice the energy of body and springs.

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
        strained: energy norm of the computed displacement without the springs; None: it is ``size``.
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
    strained: float | None = None

    @property
    def relative(self) -> float:
        """Bound of the error relative to the energy norm of the exact solution; infinite where it proves nothing."""
        return self.error / (self.size - self.error) if self.error < self.size else np.inf

    @property
    def strain_energy(self) -> tuple[float, float]:
        """Bounds of the strain energy of the exact solution, an energy per thickness."""
        size = self.size if self.strained is None else self.strained
        return max(size - self.error, 0.0) ** 2 / 2, (size + self.error) ** 2 / 2

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
            "guaranteed": not self.grounds.estimated and bool(np.isfinite(self.error)),
            "statement": str(self),
        }
