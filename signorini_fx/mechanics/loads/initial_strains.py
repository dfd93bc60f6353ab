"""The initial strains of a scene as the stress sees them, and whether they have values everywhere in the body."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from dolfinx import default_scalar_type, fem

from signorini_fx.mechanics.loads.load_vectors import FormCoefficients
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.effect import InitialStrain
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import Inventory


def initial_strain(
    statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace, step: float
) -> tuple[Any, Callable[[float], None]]:
    """All initial strains together in each direction, UFL, and what moves them to a place in the lists of factors.

    Args:
        statement: what is stated of the problem.
        tagged: its mesh.
        space: of the displacement.
        step: where they are to begin with.

    Returns:
        None in place of the strain where there is none.
    """
    effects = [effect for effect in statement.of(InitialStrain) if effect.acts]
    if not effects:
        return None, lambda step: None
    on = FormCoefficients(statement, tagged, space, Inventory())  # of its own: other stresses are at other places
    factors = [fem.Constant(tagged.mesh, default_scalar_type(0.0)) for _ in effects]

    def move_to(step: float) -> None:
        on.move_to(step)
        for constant, effect in zip(factors, effects, strict=True):
            constant.value, _ = statement.now(effect, step)

    move_to(step)
    return sum(factor * effect.strain(on) for factor, effect in zip(factors, effects, strict=True)), move_to
