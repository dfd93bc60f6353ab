"""The sets of the first linear solve that a scene asks for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.statement.settings import Box
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import SAME_LENGTH


def first_sets(statement: Statement, boundary: ContactBoundary) -> tuple[ActiveSets, int]:
    """The sets of the first linear solve and its number (section 7: 0 if a solve only computes the start)."""
    region = statement.solver.initial_contact
    full_contact = ActiveSets.all_in_contact(*boundary.tangents.shape[::2])
    if isinstance(region, str):
        return full_contact, 0
    if isinstance(region, Box):
        near = SAME_LENGTH * np.ptp(parallel.gather_rows(boundary.comm, boundary.x), axis=0).max()
        inside: npt.NDArray[np.bool_] = np.ones(boundary.size, dtype=bool)
        for axis, (low, high) in enumerate((region.x, region.y, region.z)[: boundary.x.shape[1]]):
            inside &= (boundary.x[:, axis] >= low - near) & (boundary.x[:, axis] <= high + near)
    else:
        inside = sample(region, in_space(boundary.x)) > 0
    if parallel.global_sum(boundary.comm, np.array(np.count_nonzero(inside))) == 0:
        raise SceneError([("solver.initial_contact", "holds no contact node")])
    return ActiveSets.of(inside, full_contact.direction), 1
