"""Whether a deck with NLGEOM has another answer than linear elasticity, by the rotations that the solution has."""

from __future__ import annotations

from dataclasses import replace

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.keywords import SMALL, Grade
from signorini_fx.machine import parallel
from signorini_fx.mechanics.body.deformation import neglected_strain
from signorini_fx.records import Finding
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import LINEAR_IN_DECK


def judged_rotations(solution: Solution, deck: Deck | None) -> Solution:
    """The solution with what it says of NLGEOM: it lacks large rotations that change the answer of the deck, or has a
    note that they do not; collective.

    Args:
        solution: of the scene that was drafted from the deck.
        deck: on the first rank what was read from it.

    Returns:
        The same, if the deck does not ask for NLGEOM, the scene has finite strains, or there is no solution.
    """
    origin = parallel.on_root(
        solution.comm, lambda: "" if deck is None or deck.nonlinear is None or deck.finite else deck.nonlinear.origin
    )
    if not origin or not solution.converged:
        return solution
    moments = [solution.at(step) for step in solution.shown_steps]
    pairs = [neglected_strain(moment.model, moment.displacement) for moment in moments]
    rotation, share = max(pairs, key=lambda pair: pair[1])
    size = f"they are up to {rotation:.2g} rad, and {100 * share:.2g} % of the strain is neglected"
    told = f"{origin}: {SMALL}: {size}"
    if share > LINEAR_IN_DECK:
        incomplete = (*solution.statement.incomplete, told)
        model = replace(solution.model, statement=replace(solution.statement, incomplete=incomplete))
        return replace(solution, model=model)
    note = Finding("note", "displacement", f"{told}: it {Grade.NOTED}")
    return replace(solution, found=lambda: (*solution.found(), note))


def lacks_finite_strains(solution: Solution) -> bool:
    """Whether a graded solution lacks the large rotations that its deck asks for."""
    return any(SMALL in remark for remark in solution.statement.incomplete)
