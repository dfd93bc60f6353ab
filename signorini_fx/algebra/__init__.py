"""The method: contact problems given by matrices, and the algorithms that solve them.

Contact laws at points, the regularised problem and its active sets, outer algorithms, and linear
algebra.  This layer works with matrices and values at contact points only, without forms, meshes,
materials or scenes.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

from signorini_fx.tuned import PROBLEMS_PER_STEP


def step_limit(max_iterations: int) -> int:
    """Return the number of linear solves that all attempts at one load step may take together.

    Args:
        max_iterations: linear solves allowed for one problem.
    """
    return PROBLEMS_PER_STEP * max_iterations


@dataclass(frozen=True)
class Settings:
    """Algorithms, their parameters and limits; see ``statement.settings.SolverSettings`` for their
    meaning.
    """

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
        """Copy the settings from an object that has attributes of the same names."""
        return cls(**{field.name: getattr(source, field.name) for field in fields(cls)})

    def limited(self, name: Literal["max_iterations", "max_outer_iterations"]) -> bool:
        """Return whether a limit is lower than its default: then the user has set it, and reaching
        it is not a failure.
        """
        return bool(getattr(self, name) < getattr(type(self), name))
