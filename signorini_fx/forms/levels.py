"""Errors and costs of the solutions of a ``ContactProblem``."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem

from signorini_fx.accuracy.data_error import DataError
from signorini_fx.accuracy.error_estimates import Errors, combined
from signorini_fx.accuracy.level_results import compliance_of
from signorini_fx.algorithms.task import Outcome
from signorini_fx.body.assembly import facet_entities
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.contact_table import contact_table
from signorini_fx.results.stresses import RawStresses


def errors_of(
    stress: RawStresses, u: fem.Function, state: ContactState, facets: Any, names: Any, outcome: Outcome, modulus: float
) -> Errors:
    """Estimated errors of a solution; collective.

    Args:
        stress: of it.
        u: the displacement.
        state: its contact points.
        facets: of each contact.
        names: of each contact.
        outcome: how it ended.
        modulus: by which the compliance of the contact law is made a length.
    """
    mesh = u.function_space.mesh
    squares = stress.recovery().squares(u)
    zero = np.zeros(squares.size)
    cells = facet_entities(mesh, np.concatenate(facets))[:, 0]
    blur = compliance_of(outcome, mesh.comm) * modulus
    table = contact_table(state, names)
    return combined(state.boundary, table, cells, squares, DataError(zero, zero, 0.0), stress.energy(), blur)
