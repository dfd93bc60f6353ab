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
    slipping = _ranked(boundary, (sets.slip == 0) & (following.slip != 0) & able, np.abs(shear) - bound)
    opening = _ranked(boundary, sets.contact & ~following.contact, -pressure)
    for slipping_counts, opening_counts in (True, False), (False, True), (True, True):
        for share in _shares(max(_count(boundary, slipping), _count(boundary, opening))):
            kept_stick = _least(boundary, slipping, share) if slipping_counts else ~everywhere
            kept_contact = _least(boundary, opening, share) if opening_counts else ~everywhere
            stick = kept_stick | (kept_contact & able & (sets.slip == 0))
            held = ActiveSets(following.contact | kept_contact, np.where(stick, 0, following.slip).astype(np.int8))
            if motions.held_by(boundary, held.contact, _stick(held, data)):
                return held, None
    pressing = parallel.global_sum(boundary.comm, np.dot(boundary.weight, pressure)) > 0
    return following, Status.SLIDES if data.has_friction and pressing else Status.OPEN


def _stick(sets: ActiveSets, data: RegularisedData) -> npt.NDArray[np.bool_]:
    return (sets.slip == 0) if data.has_friction else np.zeros_like(sets.contact)


def _ranked(boundary: ContactBoundary, candidates: npt.NDArray[np.bool_], violation: Nodal) -> npt.NDArray[np.int64]:
    """Place of each candidate in the order of the violation over all ranks, from 0; -1 for the other nodes."""
    # Position breaks ties: a uniform state would otherwise keep all of them or none.
    ranking = np.column_stack((violation, boundary.x))
    places = {
        row: place
        for place, row in enumerate(sorted(map(tuple, parallel.gather_rows(boundary.comm, ranking[candidates]))))
    }
    result = np.full(candidates.size, -1, dtype=np.int64)
    result[candidates] = [places[tuple(row)] for row in ranking[candidates]]
    return result


def _count(boundary: ContactBoundary, places: npt.NDArray[np.int64]) -> int:
    return int(parallel.global_sum(boundary.comm, np.array(np.count_nonzero(places >= 0))))


def _shares(count: int) -> list[float]:
    """Half, three quarters, ... of the candidates, at last all but one; nothing where there is only one."""
    shares = [1 - 0.5**power for power in range(1, 64) if 0.5**power * count > 1]
    return [*shares, 1 - 1 / count] if count > 1 else []


def _least(boundary: ContactBoundary, places: npt.NDArray[np.int64], share: float) -> npt.NDArray[np.bool_]:
    """The share of the candidates with the least violation, never all of them."""
    count = _count(boundary, places)
    return (places >= 0) & (places < min(round(share * count), count - 1))
