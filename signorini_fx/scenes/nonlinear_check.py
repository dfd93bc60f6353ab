"""What ``check`` says of a scene with nonlinear materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

from signorini_fx.forms.nonlinear.problem import MOST_ITERATIONS
from signorini_fx.mechanics.body.nonlinear_law import volume_degree
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import History
from signorini_fx.scenes.nonlinear import ProblemOfScene
from signorini_fx.solving.check.cost import Cost
from signorini_fx.tuned import NEWTON_SOLVES

# A ``checks.ListedEffect``, which is not imported: ``checks`` asks this module.
Effect = TypeVar("Effect", bound=Any)


def newton_effects(statement: Statement, body: Model, listed: Sequence[Effect]) -> tuple[Effect, ...]:
    """The effects of a scene with its body as it is solved, after all its checks; collective.

    Args:
        statement: of the scene.
        body: the linear one that it is at small strains.
        listed: the effects, as of that body.

    Raises:
        SceneError: a setting or a shape does not fit.
    """
    ProblemOfScene.of(statement, body, History())
    large = statement.finite_strains
    kind = f"{statement.kinematics_in(body.tagged.dimension).words}, {'finite' if large else 'small'} strains"
    inner = " with the contact problem of its tangent in each iteration" if statement.contact else ""
    why = f"always; {kind}, Newton's method{inner}"
    changed: dict[str, dict[str, Any]] = {
        "elasticity": {"name": "nonlinear body", "why": why},
        "reduced integration": {"on": volume_degree(statement, body.tagged) is not None},
    }
    return tuple(replace(effect, **changed.get(effect.name, {})) for effect in listed)


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
