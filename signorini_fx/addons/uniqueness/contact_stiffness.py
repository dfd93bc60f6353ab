"""The stiffness of the contact points of a scene, condensed, for what is proved of its discrete solutions."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.linalg.blocks import by_entries
from signorini_fx.algebra.linalg.schur import SchurComplement
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.features import refused_by

# Features of a scene that the proof does not know.
REFUSES = {"driven foundation": "not tried where a force moves a foundation"}
# More components of contact points than this are not looked at: the matrices are dense.
_MOST_COMPONENTS = 1200


def contact_stiffness(model: Model, step: float | None = None) -> tuple[Nodal, Nodal] | str:
    """The stiffness and the contact map for ``uniqueness_of``, with Coulomb friction; or why there is no proof.

    Args:
        model: the model.
        step: the place of the load step in the lists of factors; None: the last one.
    """
    law, load_step = model.law, model.statement.steps - 1 if step is None else step
    assert law is not None
    for wrong, reason in (
        # What is an unknown as well the stiffness takes as fixed.
        *((True, f"not tried where {clause}") for clause in model.statement.sought_at(load_step).values()),
        *((True, reason) for _, reason in refused_by(model.statement, REFUSES)),
        (law.ends_open is not None, "where a point opens, its friction ends with a jump"),
        (bool(law.laws), law.unknown),
        (model.comm.size > 1, "the proof is for one rank"),
    ):
        if wrong:
            return reason
    elasticity = model.elasticity([])
    operator = elasticity.contact.operator
    starts, columns, values = operator.getValuesCSR()
    retained = np.unique(columns).astype(np.int32)
    if max(retained.size, len(starts) - 1) > _MOST_COMPONENTS:
        return f"there are {len(starts) - 1} components of contact points, the proof is for at most {_MOST_COMPONENTS}"
    free = ~elasticity.contact.fixed[retained]
    rows = np.zeros((len(starts) - 1, retained.size))
    rows[np.repeat(np.arange(len(rows)), np.diff(starts)), np.searchsorted(retained, columns)] = values
    try:
        of = by_entries(elasticity.matrix), retained, (), elasticity.positions
        condensed = SchurComplement(*of, definite=elasticity.definite).dense[np.ix_(free, free)]
    except PETSc.Error:
        return "a part of the body moves freely though its contact points are fixed"
    return condensed, rows[:, free]
