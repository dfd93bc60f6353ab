"""What ``check`` says of a scene with nonlinear materials."""

from __future__ import annotations

from dataclasses import replace

from signorini_fx.forms.nonlinear.problem import MOST_ITERATIONS
from signorini_fx.mechanics.body.nonlinear_law import volume_degree
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import History
from signorini_fx.scenes.nonlinear import ProblemOfScene
from signorini_fx.solving.check.cost import Cost
from signorini_fx.tuned import NEWTON_SOLVES


def newton_acting(statement: Statement, body: Model, acting: tuple[str, ...]) -> tuple[str, ...]:
    """What acts in a scene with its body as it is solved, after all its checks; collective.

    Args:
        statement: of the scene.
        body: the linear one that it is at small strains.
        acting: what acts on that body, itself first.

    Raises:
        SceneError: a setting or a shape does not fit.
    """
    ProblemOfScene.of(statement, body, History())
    strains = "finite" if statement.finite_strains else "small"
    inner = " with the contact problem of its tangent in each iteration" if statement.contact else ""
    kind = statement.kinematics_in(body.tagged.dimension).words
    reduced = ["reduced integration"] * (volume_degree(statement, body.tagged) is not None)
    others = [one for one in acting[1:] if one != "reduced integration"]
    return f"nonlinear body ({kind}, {strains} strains, Newton's method{inner})", *reduced, *others


def newton_cost(linear: Cost, steps: int) -> Cost:
    """The cost from that of the linear body: each linear solve has a factorisation."""
    solves = NEWTON_SOLVES[0] * steps, NEWTON_SOLVES[1] * steps
    seconds = solves[0] * linear.factorisation_seconds, solves[1] * linear.factorisation_seconds
    low, high = (new / old if old > 0 else 1.0 for new, old in zip(seconds, linear.seconds, strict=True))
    finer = linear.next_seconds[0] * low, linear.next_seconds[1] * high
    return replace(linear, linear_solves=solves, seconds=seconds, next_seconds=finer)


def newton_plan() -> tuple[tuple[str, tuple[str, ...], str], ...]:
    """See ``attempts_for``."""
    return (("a load step", ("Newton's method", "half the step"), f"at most {MOST_ITERATIONS} iterations each"),)
