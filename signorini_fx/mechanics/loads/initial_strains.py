"""The initial strains of a scene as the stress sees them, and whether they have values everywhere in the body."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx import default_scalar_type, fem

from signorini_fx.errors import SceneError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.loads.load_vectors import FormCoefficients
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.effect import InitialStrain
from signorini_fx.mechanics.statement.expressions import Expression, sample
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import Inventory
from signorini_fx.tuned import LARGEST_NUMBER


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


def check_strains(statement: Statement, tagged: TaggedMesh) -> None:
    """Whether the values of initial strains are finite at the nodes of the mesh in all load steps; collective.

    A callable is asked at the nodes of its region alone, see ``BodyCoefficients.value_in``.

    Raises:
        SceneError: they are not.
    """
    problems, x = [], tagged.mesh.geometry.x.T.astype(np.float64)
    for path, effect in statement.listed():
        if not isinstance(effect, InitialStrain):
            continue
        region = getattr(effect, "region", None)
        if region is not None and region not in tagged.regions:
            continue  # said where names are looked at
        inside = None if region is None else np.unique(compat.geometry_cells(tagged.mesh)[tagged.cells(region)])
        for step in range(statement.steps if effect.timed else 1):
            for key, value in effect.at_time(statement.time_at(step)).given.items():
                error: SceneError | None = None
                try:
                    at = x if inside is None or isinstance(value, Expression) else x[:, inside]
                    valid = bool((np.abs(sample(value, at)) <= LARGEST_NUMBER).all())
                except SceneError as found:
                    valid, error = True, found
                parallel.raise_together(tagged.mesh.comm, error)
                if parallel.any_rank(tagged.mesh.comm, not valid):
                    problems.append(
                        (f"{path}.{key}", f"must be a number up to {LARGEST_NUMBER:g} at all nodes of the mesh")
                    )
    if problems:
        raise SceneError(list(dict.fromkeys(problems)))
