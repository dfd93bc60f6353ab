"""Active sets that hold the body: what to do with sets that would leave a rigid motion free.

A linear step with such sets has no solution although the problem may have one: the sets of an iterate are only a guess.
Statics decides first: if no admissible contact tractions could balance the load, nothing holds the body, and that is
said by name.  Otherwise some of the nodes that are about to be released are kept, half of them if that is enough, those
that ask for it least.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.optimize import linprog

from signorini_fx import parallel
from signorini_fx.boundary import ContactBoundary
from signorini_fx.complementarity import ActiveSets, Nodal, RegularisedData, length
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
    resultant: npt.NDArray[np.float64],
) -> tuple[ActiveSets, Status | None, bool]:
    """Sets near ``following`` that hold the body, or how the body gets away; collective.

    Args:
        following: the sets that the iterate asks for.
        sets: those that it was computed with.
        pressure: lambda of the iterate with ``sets``.
        shear: mu of the iterate with ``sets``.
        data: the problem.
        boundary: the contact nodes.
        motions: rigid motions of the body.
        resultant: what the load does on the rigid motions, shape (3,).

    Returns:
        The sets, the name of the outcome where there is no equilibrium, and whether the sets differ from ``following``.
    """
    if motions.free.shape[1] == 0 or motions.held_by(boundary, following.contact, _stick(following, data)):
        return following, None, False
    bound = data.friction_bound(pressure)
    everywhere: npt.NDArray[np.bool_] = np.ones(boundary.size, dtype=bool)
    able = (bound > 0) if data.has_friction else ~everywhere
    if not motions.held_by(boundary, everywhere, able | _stick(following, data)):
        return following, Status.NOT_HELD, False
    if not balance_exists(data, boundary, motions, resultant):
        pressed = parallel.global_sum(boundary.comm, np.dot(boundary.weight, pressure)) > 0
        pressing = pressed and resultant.any()  # without a load a pressure is round-off
        return following, Status.SLIDES if data.has_friction and pressing else Status.OPEN, False
    slipping = _ranked(boundary, ~sets.slip & following.slip & able, length(shear) - bound)
    opening = _ranked(boundary, sets.contact & ~following.contact, -pressure)
    for slipping_counts, opening_counts in (True, False), (False, True), (True, True):
        for share in _shares(max(_count(boundary, slipping), _count(boundary, opening))):
            kept_stick = _least(boundary, slipping, share) if slipping_counts else ~everywhere
            kept_contact = _least(boundary, opening, share) if opening_counts else ~everywhere
            stick = kept_stick | (kept_contact & able & ~sets.slip)
            held = replace(following, contact=following.contact | kept_contact).sticking(stick)
            if motions.held_by(boundary, held.contact, _stick(held, data)):
                return held, None, True
    # The iterate is still far from a solution: hold the body with all that could, and let the next iterates release.
    contact = following.contact | sets.contact
    everything = replace(following, contact=contact).sticking(contact & able)
    if motions.held_by(boundary, contact, _stick(everything, data)):
        return everything, None, True
    return sets, None, True


def fewest_ties(
    sets: ActiveSets,
    opening: Nodal,
    slipping: Nodal,
    boundary: ContactBoundary,
    motions: RigidMotions,
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """A few nodes that, tied to where they are, hold a body that the sets do not hold; collective.

    Args:
        sets: the sets.
        opening: by how much open nodes violate contact, stress; infinite where a node cannot be tied along its normal.
        slipping: by how much slipping nodes violate stick, stress; infinite where a node cannot be tied sideways.
        boundary: the contact nodes.
        motions: rigid motions of the body.

    Returns:
        Nodes to tie along their normal, and sideways: those with the least violation, as many as it takes.
    """
    along = _ranked(boundary, np.isfinite(opening) & ~sets.contact, opening)
    across = _ranked(boundary, np.isfinite(slipping) & sets.slip, slipping)
    normal, nothing, count = sets.contact, np.zeros_like(sets.contact), 1
    stick = ~sets.slip & np.isfinite(slipping)
    most = max(_count(boundary, along), _count(boundary, across))
    while True:
        tied_along, tied_across = ((places >= 0) & (places < count) for places in (along, across))
        for pair in (nothing, tied_across), (tied_along, nothing), (tied_along, tied_across):
            if motions.held_by(boundary, normal | pair[0], stick | pair[1]):
                return pair
        if count >= most:
            return tied_along, tied_across
        count *= 2


def balance_exists(
    data: RegularisedData,
    boundary: ContactBoundary,
    motions: RigidMotions,
    resultant: npt.NDArray[np.float64],
) -> bool:
    """Whether admissible contact tractions can balance the load on the free rigid motions; collective.

    lambda >= 0 (any sign where contact is bilateral) and |mu| <= F g, or <= F lambda, with the resultant of the load: a
    linear programme with one to three equations.  Where it has no solution there is no static equilibrium, whatever the
    body's shape and stiffness.  Its unknowns are nodal forces over the size of the resultant, because the tolerances of
    the programme are absolute.
    """
    if not resultant.any():  # nothing presses: every position off the foundation is as good as another
        return False
    modes = boundary.free[:, :, None] * (motions.at(boundary.x) @ motions.free)
    normal = np.einsum("ij,ijk->ik", boundary.normal, modes)
    tangential = np.einsum("ij,ijk->ik", boundary.tangents[:, :, 0], modes)
    zero = np.zeros(boundary.size)
    given = zero if data.bound is None else boundary.weight * data.bound
    coupling = zero if data.coupling is None else data.coupling
    bilateral = zero if data.bilateral is None else data.bilateral.astype(float)
    table = parallel.gather_rows(boundary.comm, np.column_stack((normal, tangential, given, coupling, bilateral)))
    k = motions.free.shape[1]
    normal, tangential = table[:, :k], table[:, k : 2 * k]
    given, coupling, bilateral = table[:, 2 * k :].T
    n = len(table)
    # mu <= given + coupling lambda and -mu <= given + coupling lambda; an infinite bound is no row.
    finite = np.isfinite(given)
    cone, unit = -sparse.diags(coupling).tocsr()[finite], sparse.identity(n, format="csr")[finite]
    rows, limits = sparse.bmat([[cone, unit], [cone, -unit]]), np.tile(given[finite], 2)
    scale = max(float(np.abs(resultant).max()), 1e-300)
    result = linprog(
        np.zeros(2 * n),
        A_ub=rows,
        b_ub=limits / scale,
        A_eq=np.hstack((normal.T, tangential.T)),
        b_eq=motions.free.T @ resultant / scale,
        bounds=[(None if sign else 0.0, None) for sign in bilateral] + [(None, None)] * n,
    )
    return bool(result.status == 0)


def _stick(sets: ActiveSets, data: RegularisedData) -> npt.NDArray[np.bool_]:
    return ~sets.slip if data.has_friction else np.zeros_like(sets.contact)


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
