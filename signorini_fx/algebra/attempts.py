"""The plan of attempts: what a solve tries, in which order, and how many linear solves that may take.

An attempt begins at a state and ends with an outcome, one after the other until one of them settles the matter.
Attempts nest: those at a load step consist of problems with friction, and these of regularised problems with a
given friction bound.  This module alone says which there are: the log calls them by
these names, and the page made of docs/theory.md lists them.
"""

from __future__ import annotations

from dataclasses import dataclass

from signorini_fx.tuned import PROBLEMS_PER_STEP


@dataclass(frozen=True)
class Attempt:
    """One way to go on after another one has failed: its name in the log, and what it does, for the documentation."""

    name: str
    what: str

    def __str__(self) -> str:
        return self.name


FULL_STEPS = Attempt("full steps", "the semi-smooth Newton method of the scene")
EXACT_SOLVES = Attempt(
    "exact linear solves",
    "the same iteration again, where linear solves with a loose tolerance failed; with a "
    "factorisation, where a Krylov method failed and the memory is large enough",
)
CONVEX = Attempt("interior point", "the problem as a convex programme, which has no sets that could cycle")
FIXED_POINT = Attempt("fixed point", "Coulomb friction as a sequence of problems with given friction bounds")
MONOLITHIC = Attempt("monolithic Newton", "Coulomb friction in one iteration, unless there is a cap")
METHOD = Attempt("the method of the scene", "`algorithm` and `coulomb` of the scene, with what is tried for them")
AUGMENTED = Attempt(
    "augmented Lagrangian",
    "with a small gamma and friction bounds that follow the pressure, unless there is a cap; its limit is the solution "
    "without regularisation",
)
HALF = Attempt("half the increment", "in a ramp: the same for half the increment of the load")

# What each attempt is an attempt at, from the inside out; the first of each is what is done if nothing goes wrong.
PLAN: dict[str, tuple[Attempt, ...]] = {
    "problem with given friction": (FULL_STEPS, EXACT_SOLVES, CONVEX),
    "Coulomb friction": (FIXED_POINT, MONOLITHIC, AUGMENTED),
    "load step": (METHOD, HALF),
}


def step_limit(max_iterations: int) -> int:
    """Linear solves that all attempts at a load step together may take; ``max_iterations``: those for one problem."""
    return PROBLEMS_PER_STEP * max_iterations


def for_coulomb(*, monolithic: bool, first: bool, fallbacks: bool, augmented: bool = True) -> tuple[Attempt, ...]:
    """What is tried for one problem with Coulomb friction; ``monolithic``: whether its monolithic form is to be had,
    and ``first`` whether that is tried first, with the fixed point as its documented fall-back.
    """
    if not monolithic:
        return (FIXED_POINT,)
    ways = (MONOLITHIC, FIXED_POINT) if first else (FIXED_POINT, MONOLITHIC)
    if not fallbacks:
        return ways if first else ways[:1]
    return (*ways, AUGMENTED) if augmented else ways
