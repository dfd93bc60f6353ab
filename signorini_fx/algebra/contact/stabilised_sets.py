"""Active sets that hold the body: what to do with sets that would leave a rigid motion free.

A linear step with such sets has no solution although the problem may have one: the sets of an iterate are only a guess.
Statics decides first: if no admissible contact tractions could balance the load, nothing holds the body, and a status
says so.  Otherwise some of the nodes that are about to be released are kept, half of them if that is enough, those that
are closest to staying.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.motions import FreeMotions
from signorini_fx.algebra.contact.nodal_vectors import Nodal, length
from signorini_fx.algebra.contact.points import ContactPoints
from signorini_fx.machine import parallel
from signorini_fx.records import Status


def hold(
    following: ActiveSets,
    sets: ActiveSets,
    multipliers: Callable[[], tuple[Nodal, Nodal]],
    data: RegularisedData,
    motions: FreeMotions,
    escaping: Callable[[], Status | None],
) -> tuple[ActiveSets, Status | None, bool]:
    """Sets near ``following`` that hold the body, the status if it moves away, and whether they differ from
    ``following``; ``sets``: with which the iterate was computed, whose ``multipliers`` are asked for; ``escaping``: how
    the body moves away whatever the sets are, see ``statics.no_balance``, None: it may stay; collective.
    """
    unresisted = motions.unheld(following.contact, _stick(following, data))
    if not unresisted.any():
        return following, None, False
    pressure, shear = multipliers()
    # The convergence test ends the iteration: such numbers have no order to choose sets by.
    if parallel.any_rank(motions.points.comm, not (np.isfinite(pressure).all() and np.isfinite(shear).all())):
        return following, None, False
    bound = data.friction_bound(pressure)
    points, everywhere = motions.points, motions.points.everywhere
    able = (bound > 0) if data.bound is not None else ~everywhere
    if not motions.held_by(everywhere, able | _stick(following, data)):
        return following, Status.NOT_HELD, False
    leaving = escaping()
    if leaving is not None:
        return following, leaving, False
    # In 3D a slipping node, too, resists a change of its direction of slip.
    unresisted = motions.unheld(following.contact, _stick(following, data), following.turned)
    if not unresisted.any():
        return following, None, False
    unresisted_points = unresisted[motions.of_point]  # only motions that the sets do not resist
    slipping = _ranked(points, unresisted_points & ~sets.slip & following.slip & able, length(shear) - bound)
    opening = _ranked(points, unresisted_points & sets.contact & ~following.contact, -pressure)
    for slipping_counts, opening_counts in (True, False), (False, True), (True, True):
        for share in _shares(max(_count(points, slipping), _count(points, opening))):
            kept_stick = _least(points, slipping, share) if slipping_counts else ~everywhere
            kept_contact = _least(points, opening, share) if opening_counts else ~everywhere
            stick = kept_stick | (kept_contact & able & ~sets.slip)
            held = replace(following, contact=following.contact | kept_contact).sticking(stick)
            if holds(held, data, motions):
                return held, None, True
    # The iterate is still far from a solution: hold the body with all nodes that can, and let the next iterates
    # release.
    contact = following.contact | (unresisted_points & sets.contact)
    everything = replace(following, contact=contact).sticking(unresisted_points & contact & able)
    if holds(everything, data, motions):
        return everything, None, True
    if holds(sets, data, motions):
        return sets, None, True
    # Sets of a problem with another friction bound need not hold it either.
    return (
        replace(following, contact=following.contact | unresisted_points).sticking(unresisted_points & able),
        None,
        True,
    )


def holds(sets: ActiveSets, data: RegularisedData, motions: FreeMotions) -> bool:
    """Whether sets resist every rigid motion, in 3D also by slip in another direction; collective."""
    return motions.held_by(sets.contact, _stick(sets, data), sets.turned)


def _stick(sets: ActiveSets, data: RegularisedData) -> npt.NDArray[np.bool_]:
    return ~sets.slip if data.bound is not None else np.zeros_like(sets.contact)


def _ranked(points: ContactPoints, candidates: npt.NDArray[np.bool_], violation: Nodal) -> npt.NDArray[np.int64]:
    """Place of each candidate in the order of the violation over all ranks, from 0; -1 for the other nodes."""
    # Position breaks ties: a uniform state would otherwise keep all of them or none.
    ranking = np.column_stack((violation, points.x))
    places = {
        row: position
        for position, row in enumerate(sorted(map(tuple, parallel.gather_rows(points.comm, ranking[candidates]))))
    }
    result = np.full(candidates.size, -1, dtype=np.int64)
    result[candidates] = [places[tuple(row)] for row in ranking[candidates]]
    return result


def _count(points: ContactPoints, places: npt.NDArray[np.int64]) -> int:
    return int(parallel.global_sum(points.comm, np.array(np.count_nonzero(places >= 0))))


def _shares(count: int) -> list[float]:
    """Half, three quarters, ... of the candidates, finally all but one; nothing if there is only one."""
    shares = [1 - 0.5**power for power in range(1, 64) if 0.5**power * count > 1]
    return [*shares, 1 - 1 / count] if count > 1 else []


def _least(points: ContactPoints, places: npt.NDArray[np.int64], share: float) -> npt.NDArray[np.bool_]:
    """The share of the candidates with the least violation, never all of them."""
    count = _count(points, places)
    return (places >= 0) & (places < min(round(share * count), count - 1))
