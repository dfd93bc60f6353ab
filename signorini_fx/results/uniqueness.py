"""Whether the solution of a scene is the only one on its mesh."""

from __future__ import annotations

import numpy as np

from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.contact.uniqueness import MOST_COMPONENTS, Uniqueness, uniqueness_of
from signorini_fx.linalg.schur import SchurComplement


def uniqueness(d: Discretisation, contact: ContactState, *, search: bool | None = None) -> Uniqueness:
    """The statement for a load step with a solution, given the ones before it.

    Args:
        d: the discretised scene.
        contact: its contact nodes in the solution.
        search: for other solutions; None: where this one is not proved to be the only one.
    """
    law = d.law
    # Without a coefficient the problem is the minimum of a convex functional.
    if law is None or not d.scene.has_coulomb:
        return Uniqueness(True, np.inf)
    if d.comm.size > 1:
        return Uniqueness(False, 0.0, reason="the proof is for one rank")
    elasticity = d.elasticity([])
    operator = elasticity.contact.operator
    starts, columns, values = operator.getValuesCSR()
    retained = np.unique(columns).astype(np.int32)
    if max(retained.size, len(starts) - 1) > MOST_COMPONENTS:
        return Uniqueness(
            False,
            0.0,
            reason=f"there are {len(starts) - 1} components of contact points, the proof is "
            f"for at most {MOST_COMPONENTS}",
        )
    free = ~elasticity.fixed[retained]
    rows = np.zeros((len(starts) - 1, retained.size))
    rows[np.repeat(np.arange(len(rows)), np.diff(starts)), np.searchsorted(retained, columns)] = values
    condensed = SchurComplement(elasticity.matrix, retained).dense[np.ix_(free, free)]
    return uniqueness_of(condensed, rows[:, free], law, contact, search=search)
