"""What of a deck its solution has lost: what can be said with the solution only."""

from __future__ import annotations

from signorini_fx.addons.decks.draft import Draft
from signorini_fx.addons.decks.kept_partners import judged_partners
from signorini_fx.addons.decks.rotations import judged_rotations
from signorini_fx.results.solution import Solution


def graded_solution(solution: Solution, draft: Draft | None) -> Solution:
    """The solution with what it lacks of the deck that its scene was drafted from, as far as it says that itself: large
    rotations, and contact that follows surfaces; collective.

    Args:
        solution: of the scene that was drafted.
        draft: on the first rank; None on the others.
    """
    return judged_partners(judged_rotations(solution, None if draft is None else draft.deck), draft)
