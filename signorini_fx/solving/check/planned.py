"""What a scene will try, in which order, and how many linear solves that may take: its part of the plan of attempts."""

from __future__ import annotations

from signorini_fx.algebra.attempts import (
    EXACT_SOLVES,
    FULL_STEPS,
    HALF,
    METHOD,
    PLAN,
    for_coulomb,
    step_limit,
)
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import FAILED_RAMP, FAILED_STEP


def attempts_for(statement: Statement) -> tuple[tuple[str, tuple[str, ...], str], ...]:
    """Rows of what is tried for, the attempts in order, and their limit; none without contact."""
    s, ramp = statement.solver, statement.automatic_steps is not None
    if not statement.contact:
        return ()
    limit = step_limit(s.max_iterations)
    problem = PLAN["problem with given friction"] if s.fallbacks else (FULL_STEPS, EXACT_SOLVES)
    rows = [("a problem with given friction", problem, f"at most {s.max_iterations} linear solves each")]
    if statement.has_coulomb:
        bilateral = any(contact.kind == "bilateral" for contact in statement.contact)
        ways = for_coulomb(
            monolithic=not bilateral and all(contact.friction.has_derivative for contact in statement.contact),
            first=s.coulomb == "newton",
            fallbacks=s.fallbacks,
            augmented=all(contact.interface != "overclosures" for contact in statement.contact),
        )
        rows.append(("Coulomb friction", ways, f"at most {s.max_outer_iterations} problems each"))
    rows.append(("a load step", (METHOD,), f"at most {limit} linear solves together"))
    if ramp:
        solves_limit = (
            f"an increment that fails takes at most {FAILED_STEP} times the linear solves of the load step before it, "
            f"all that fail together {FAILED_RAMP} times those that do not"
        )
        rows.append(("a load step of the ramp", (METHOD, HALF), solves_limit))
    return tuple((purpose, tuple(map(str, names)), solves_limit) for purpose, names, solves_limit in rows)
