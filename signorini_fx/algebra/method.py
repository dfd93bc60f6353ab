"""How a contact problem is to be solved: what the strategy of algorithms reads, and the names of what is tried.

Attempts nest: those at a load step consist of problems with friction, and these of problems with a given friction
bound.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

from signorini_fx.tuned import PROBLEMS_PER_STEP

INTERIOR_POINT, FIXED_POINT, MONOLITHIC = "interior point", "fixed point", "monolithic Newton"
AUGMENTED, HALF = "augmented Lagrangian", "half the increment"


def step_limit(max_iterations: int) -> int:
    """Linear solves that all attempts at a load step together may take; ``max_iterations``: those for one problem."""
    return PROBLEMS_PER_STEP * max_iterations


@dataclass(frozen=True)
class Settings:
    """Algorithms, their parameters and limits; ``statement.settings.SolverSettings`` explains them."""

    algorithm: Literal["auto", "ssn", "continuation", "path-following", "alm"] = "auto"
    coulomb: Literal["auto", "fp", "newton"] = "auto"
    gamma_n: float | Literal["auto"] = "auto"
    gamma_t: float | Literal["auto"] = "auto"
    sigma: float | Literal["auto"] = "auto"
    gamma_first: float | Literal["auto"] = "auto"
    gamma_factor: float = 1.0
    inner_iterations: int | Literal["auto"] = "auto"
    max_iterations: int = 100
    max_outer_iterations: int = 100
    tolerance: float = 1e-7
    fallbacks: bool = True

    @classmethod
    def of(cls, source: object) -> Settings:
        """Those of an object that has the same attributes and more."""
        return cls(**{field.name: getattr(source, field.name) for field in fields(cls)})

    def limited(self, name: Literal["max_iterations", "max_outer_iterations"]) -> bool:
        """Whether a limit is lower than its default: then the user has set it, and reaching it is not a failure."""
        return bool(getattr(self, name) < getattr(type(self), name))
