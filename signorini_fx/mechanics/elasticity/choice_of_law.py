"""Which elastic law a scene has."""

from __future__ import annotations

from functools import partial
from typing import Any

from dolfinx import fem

from signorini_fx.errors import together
from signorini_fx.mechanics.assembly.pieces import BodyPieces
from signorini_fx.mechanics.elasticity.cellwise_stiffness import CellwiseLaw, CellwiseStiffness, cellwise_stiffness
from signorini_fx.mechanics.elasticity.elastic_law import IsotropicLaw, SceneLaw
from signorini_fx.mechanics.elasticity.moduli import check_covers, lame_coefficients, reduced_degree
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.settings import treatment_of
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import Inventory

# Lame parameters, the stiffness of each cell, and the degree of the reduced term, see ``SceneLaw``.
Moduli = tuple[tuple[Any, Any], CellwiseStiffness | None, int | None]


def moduli_of(statement: Statement, tagged: TaggedMesh) -> Moduli:
    """Those of the materials of a scene on its mesh; collective.

    Raises:
        SceneError: with all that the mesh reveals of them, see the functions below.
    """
    lame, stiffness, reduced, _ = together(
        partial(lame_coefficients, statement, tagged),
        partial(cellwise_stiffness, statement, tagged),
        partial(reduced_degree, statement, tagged.mesh),
        partial(check_covers, statement, tagged),
    )
    return lame, stiffness, reduced


def elastic_law(
    statement: Statement,
    tagged: TaggedMesh,
    space: fem.FunctionSpace,
    inventory: Inventory,
    pieces: BodyPieces | None = None,
    moduli: Moduli | None = None,
) -> SceneLaw:
    """That of a scene on its mesh; collective.

    Args:
        statement: what is stated of the problem.
        tagged: its mesh.
        space: of the displacement.
        inventory: where forms are compiled.
        pieces: into which the mesh falls; None: only terms and stresses are asked for.
        moduli: those of the scene; None: they are computed.
    """
    lame, stiffness, reduced = moduli or moduli_of(statement, tagged)
    if treatment_of(statement).pressed:
        from signorini_fx.mechanics.elasticity.mixed_pressure import MixedLaw

        return MixedLaw(statement, tagged, space, pieces, inventory, lame=lame)
    if stiffness is not None:
        return CellwiseLaw(statement, tagged, space, lame=lame, stiffness=stiffness)
    return IsotropicLaw(statement, tagged, space, reduced, lame=lame)
