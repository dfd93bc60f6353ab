"""Checks outcomes without equilibrium by a cone programme of statics; see ``conditions``."""

from __future__ import annotations

from itertools import product

import numpy as np

from benchmarks.stability.oracle.body import Body
from benchmarks.stability.oracle.conditions import Contact, null_motions
from benchmarks.stability.oracle.convex import cvxopt
from benchmarks.stability.oracle.elements import Array

# Forces that nothing else limits, in units of all loads.
_MOST = 1e4
# CVXOPT may fail by round-off: it is asked for less then.
_ACCURACIES = (1e-9, 1e-8, 1e-7)


def held(body: Body, contact: Contact) -> bool:
    """Whether contact and stick everywhere would hold every piece of the body: stick that follows
    pressure where no support takes the pressure.

    A motion that is resisted 1e4 times less than it moves the contact counts as free: facets of a
    cylinder do not hold a turn.
    """
    motions = null_motions(body)
    if motions.shape[1] == 0:
        return True
    moves = contact.moves(motions)
    rows = [np.einsum("nik,ni->nk", moves, contact.normal)]
    dim = contact.x.shape[1]
    normal = sum(contact.operator[k::dim].multiply(contact.normal[:, [k]]) for k in range(dim))
    movable = np.einsum(
        "nmi,mij->nmj", normal.toarray().reshape(-1, *body.x.shape), np.eye(dim) - body.held
    )
    rubs = contact.rubs & ((contact.given > 0) | (abs(movable).max(axis=(1, 2)) > 1e-9))
    rows += [np.einsum("nik,ni->nk", moves, contact.tangents[:, k])[rubs] for k in range(dim - 1)]
    values = np.linalg.svd(np.concatenate(rows), compute_uv=False)
    largest = np.linalg.norm(moves.reshape(-1, motions.shape[1]), ord=2)
    return bool(np.sum(values > 1e-4 * largest) == motions.shape[1])


def slack(body: Body, contact: Contact, step: int) -> tuple[float, Array]:
    """How far contact forces that balance the loads can stay inside all their limits, as a share of
    the loads.

    Positive: there is an equilibrium with room to spare.  Zero or negative: there is none, or one
    on the edge; NaN: the programme does not know.  And the contact pressure that leaves so much.
    """
    motions = null_motions(body)
    count, points = motions.shape[1], len(contact.weight)
    if count == 0:
        return 1.0, np.zeros(points)
    loads = body.load(step)
    scale = float(np.abs(loads).sum())
    if scale == 0:
        return 0.0, np.zeros(points)
    moves = contact.moves(motions)
    share = contact.weight / contact.weight.sum()
    rubs = np.flatnonzero(contact.rubs)
    # Unknowns: normal forces, d - 1 tangential forces of each point that rubs (over the scale), the
    # room.
    across = contact.x.shape[1] - 1
    size = points + across * len(rubs) + 1
    balance = np.zeros((count, size))
    balance[:, :points] = np.einsum("nik,ni->kn", moves, contact.normal)
    along = np.einsum("nik,nti->knt", moves, contact.tangents)[:, rubs]
    balance[:, points:-1] = along.reshape(count, -1)
    resultant = motions.T @ loads / scale
    # Independent equations only: a motion that no force resists must have no resultant.
    left, values, _ = np.linalg.svd(balance[:, :-1], full_matrices=False)
    resisted = values > 1e-9 * values[0]
    if np.abs(resultant - left[:, resisted] @ (left[:, resisted].T @ resultant)).max() > 1e-9:
        return -1.0, np.zeros(points)
    balance, resultant = left[:, resisted].T @ balance, left[:, resisted].T @ resultant
    rows, limits, cones = [], [], []

    def less(limit: float, *entries: tuple[int, float]) -> None:
        found = np.zeros(size)
        for column, value in entries:
            found[column] = value
        rows.append(found)
        limits.append(limit)

    room = size - 1
    less(1.0, (room, 1.0))
    for point in np.flatnonzero(contact.bilateral):
        less(_MOST, (point, 1.0))
        less(_MOST, (point, -1.0))
    for point in np.flatnonzero(~contact.bilateral):
        less(0.0, (point, -1.0), (room, share[point]))
    straight = len(rows)
    for first, point in zip(range(points, room, across), rubs, strict=True):
        given, cap = (
            contact.weight[point] * value / scale
            for value in (contact.given[point], contact.cap[point])
        )
        # The radius of each cone as a limit and entries: what the tangential force may not exceed.
        heads: list[tuple[float, list[tuple[int, float]]]] = []
        if contact.given[point] > 0:
            heads.append((min(given, _MOST), []))
        else:
            if np.isfinite(cap):
                heads.append((cap, []))
            if not contact.bilateral[point]:
                heads.append((0.0, [(point, -contact.coefficient[point])]))
        if not heads:
            heads.append((_MOST, []))
        for limit, entries in heads:
            less(limit, *entries, (room, share[point]))
            for axis in range(across):
                less(0.0, (first + axis, -1.0))
            cones.append(1 + across)
    cost = np.zeros(size)
    cost[-1] = -1.0
    matrix = cvxopt.matrix
    arguments = (
        *(
            matrix(cost),
            matrix(np.array(rows)),
            matrix(np.array(limits)),
            {"l": straight, "q": cones, "s": []},
        ),
        *(matrix(balance), matrix(resultant)),
    )
    for accuracy, solver in product(_ACCURACIES, ("ldl", "chol")):
        options = {
            "show_progress": False,
            "abstol": accuracy / 10,
            "reltol": accuracy,
            "feastol": accuracy,
        }
        try:
            found = cvxopt.solvers.conelp(*arguments, kktsolver=solver, options=options)
        except (ValueError, ArithmeticError):
            continue
        if found["status"] == "primal infeasible":
            return -1.0, np.zeros(points)
        if found["status"] == "optimal":
            best = np.array(found["x"]).ravel()
            return float(best[-1]), best[:points] * scale / contact.weight
    return float("nan"), np.zeros(points)
