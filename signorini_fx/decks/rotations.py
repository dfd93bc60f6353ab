"""Whether a deck with NLGEOM has another answer than linear elasticity, by the rotations that the solution has."""

from __future__ import annotations

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded

from signorini_fx import parallel
from signorini_fx.body.deformation import neglected_strain
from signorini_fx.decks.content import Deck
from signorini_fx.decks.keywords import SMALL
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import LINEAR_IN_DECK


def judged_rotations(solution: Solution, deck: Deck | None) -> tuple[str, bool]:
    """What the solution says of NLGEOM, and whether the answer of the deck is another one; collective.

    Args:
        solution: of the scene that was drafted from the deck.
        deck: on the first rank what was read from it.

    Returns:
        An empty text, if the deck does not ask for NLGEOM or there is no solution.
    """
    block = parallel.on_root(solution.comm, lambda: None if deck is None else deck.nonlinear)
    if block is None or not solution.converged:
        return "", False
    moments = [solution.at(step) for step in solution.shown_steps]
    pairs = [neglected_strain(moment.discretisation, moment.displacement) for moment in moments]
    rotation, share = max(pairs, key=lambda pair: pair[1])
    size = f"they are up to {rotation:.2g} rad, and {100 * share:.2g} % of the strain is neglected"
    return f"{block.origin}: {SMALL}: {size}", share > LINEAR_IN_DECK
