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


@dataclass(frozen=True)
class FixedPoint:
    """The distance from the solution with Coulomb friction on the same mesh.

    Attributes:
        contraction: factor by which the map from friction bound to friction bound is proved to contract; infinite where
            nothing is proved.
        distance: bound of the energy norm of the distance of the displacement; None: none is known.
        bound: bound of the distance of the friction bound relative to its size, in the norm above; None: none is known.
        reason: why nothing is proved; "": there is none.
    """

    contraction: float
    distance: float | None = None
    bound: float | None = None
    reason: str = ""

    def beside(self, bound: ErrorBound) -> dict[str, Any]:
        """Entries for those of the bound of the error, JSON-safe."""
        return {
            "contraction": self.contraction if np.isfinite(self.contraction) else None,
            "fixed_point": self.distance,
            "statement": f"{bound}; {self.said(bound.size)}",
        }

    def said(self, size: float) -> str:
        """A sentence without its end.

        Args:
            size: energy norm of the displacement.
        """
        if self.distance is None or self.bound is None:
            why = self.reason or f"the contraction number is {self.contraction:.3g}, not below 1"
            return f"how far the fixed point of this mesh is from it is not known: {why}"
        displacement, friction = f"{100 * self.distance / size:.2g} %", f"{100 * self.bound:.2g} %"
        return (
            f"if linear systems are solved, the fixed point of this mesh is within {displacement} of the displacement "
            f"in the energy norm and {friction} of the friction bound (contraction number {self.contraction:.3g})"
        )


@dataclass(frozen=True)
class Uniqueness:
    """Whether a discrete solution is the only one.

    Attributes:
        proved: that it is, up to free motions.
        multiple: of the friction coefficients below which that is proved; infinite: for any; zero: for none.
        coefficient: the same as a coefficient, where all points have the same one; None: they differ, or none has one.
        others: different solutions that the search found.
        starts: from which it searched; zero: it did not.
        reason: why nothing is proved at any coefficient, or why no search was made; "": there is none.
        assumed: what a proof rests on beside the mesh; "": nothing.
    """

    proved: bool
    multiple: float
    coefficient: float | None = None
    others: tuple[Array, ...] = ()
    starts: int = 0
    reason: str = ""
    assumed: str = ""

    def __str__(self) -> str:
        """One sentence."""
        return self._said + (f"; {self.assumed}" if self.assumed and self.multiple > 0 else "")

    @property
    def _said(self) -> str:
        if self.proved and self.multiple == np.inf:
            return "the only solution on this mesh, up to free motions, whatever the loads are"
        below = f"{self.multiple:.4g} times the coefficients" if self.coefficient is None else f"{self.coefficient:.4g}"
        limit = f"with friction coefficients below {below} there is one solution on this mesh, whatever the loads are"
        if self.proved:
            return f"the only solution on this mesh: {limit}"
        found = f"{len(self.others) or 'no'} other solution{'s' * (len(self.others) != 1)} found"
        searched = f"{found} from {self.starts} starts" if self.starts else "none was searched for"
        proof = limit if self.multiple > 0 else "it is proved for no coefficient"
        return f"not proved to be the only one: {proof}{f' ({self.reason})' if self.reason else ''}; {searched}"

    def as_dict(self) -> dict[str, object]:
        """JSON-safe; null for a multiple without a limit."""
        return {
            "proved": self.proved,
            "multiple": None if self.multiple == np.inf else self.multiple,
            "coefficient": self.coefficient,
            "others": len(self.others),
            "starts": self.starts,
            "statement": str(self),
        }
