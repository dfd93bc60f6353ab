"""Active sets that hold the body: what to do with sets that would leave a rigid motion free.

A linear step with such sets has no solution although the problem may have one: the sets of an iterate are only a guess.
Then half of the nodes that are about to be released are kept, those that ask for it least.  If one node after the
other is given up in this way and the last one is still to go, nothing holds the body, and its name is said instead of
a zero pivot.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.boundary import ContactBoundary
from signorini_fx.complementarity import ActiveSets, Nodal, RegularisedData
from signorini_fx.results import Status
from signorini_fx.rigid import RigidMotions


def hold(
    following: ActiveSets,
    sets: ActiveSets,
    pressure: Nodal,
    shear: Nodal,
    data: RegularisedData,
    boundary: ContactBoundary,
    motions: RigidMotions,
) -> tuple[ActiveSets, Status | None]:
    """Sets near ``following`` that hold the body, and None; or ``following`` and how the body gets away; collective.

    Args:
        following: the sets that the iterate asks for.
        sets: those that it was computed with.
        pressure: lambda of the iterate with ``sets``.
        shear: mu of the iterate with ``sets``.
        data: the problem.
        boundary: the contact nodes.
        motions: rigid motions of the body.
    """
    if motions.free.shape[1] == 0 or motions.held_by(boundary, following.contact, _stick(following, data)):
        return following, None
    bound = data.friction_bound(pressure)
    everywhere: npt.NDArray[np.bool_] = np.ones(boundary.size, dtype=bool)
    able = (bound > 0) if data.has_friction else ~everywhere
    if not motions.held_by(boundary, everywhere, able | _stick(following, data)):
        return following, Status.NOT_HELD
    opening = sets.contact & ~following.contact
    slipping = (sets.slip == 0) & (following.slip != 0) & able
    if data.has_friction and motions.held_by(boundary, following.contact, able & following.contact):
        # The contact that is left could hold the body if enough of it stuck.
        kept = _least(boundary, slipping, np.abs(shear) - bound)
        held = ActiveSets(following.contact, np.where(kept, 0, following.slip).astype(np.int8))
        status = Status.SLIDES
    else:
        kept = _least(boundary, opening, -pressure)
        held = ActiveSets(following.contact | kept, np.where(kept & able, 0, following.slip).astype(np.int8))
        status = Status.OPEN
    if motions.held_by(boundary, held.contact, _stick(held, data)):
        return held, None
    return following, status


def _stick(sets: ActiveSets, data: RegularisedData) -> npt.NDArray[np.bool_]:
    return (sets.slip == 0) if data.has_friction else np.zeros_like(sets.contact)


def _least(boundary: ContactBoundary, candidates: npt.NDArray[np.bool_], violation: Nodal) -> npt.NDArray[np.bool_]:
    """The half of the candidates with the least violation, over all ranks; none if there is only one."""
    # Position breaks ties: a uniform state would otherwise keep all of them or none.
    ranking = np.column_stack((violation, boundary.x))
    every = sorted(map(tuple, parallel.gather_rows(boundary.comm, ranking[candidates])))
    if len(every) <= 1:
        return np.zeros_like(candidates)
    last = every[len(every) // 2 - 1]
    return candidates & np.array([tuple(row) <= last for row in ranking], dtype=bool)
