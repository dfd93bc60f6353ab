"""Checks outcomes without equilibrium by a linear programme of statics."""

from __future__ import annotations

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import linprog

from benchmarks.stability.oracle.body import Body
from benchmarks.stability.oracle.conditions import Contact, free_dofs
from benchmarks.stability.oracle.elements import Array


def free_motions(body: Body, step: int) -> Array:
    """Rigid motions of the pieces that the supports allow, a column each."""
    fixed = ~free_dofs(body, step)
    rigid = body.rigid
    motions = rigid @ null_space(rigid[fixed], rcond=1e-9) if fixed.any() else rigid
    if not body.scene.get("springs") or motions.shape[1] == 0:
        return motions
    energies, turned = np.linalg.eigh(motions.T @ (body.springs @ motions))
    return np.asarray(motions @ turned[:, energies <= 1e-9 * energies.max()])


def held(body: Body, contact: Contact, step: int) -> bool:
    """Whether contact and stick everywhere would hold every piece of the body.

    A motion that is resisted 1e4 times less than it moves the contact counts as free: facets of an arc do not hold a
    turn.
    """
    motions = free_motions(body, step)
    if motions.shape[1] == 0:
        return True
    moves = motions.reshape(-1, 2, motions.shape[1])[contact.nodes]
    sticks = ((contact.given > 0) | (contact.coefficient > 0)) & (contact.cap > 0)
    rows = [np.einsum("nik,ni->nk", moves, contact.normal)]
    rows.append(np.einsum("nik,ni->nk", moves, contact.tangent)[sticks])
    values = np.linalg.svd(np.concatenate(rows), compute_uv=False)
    largest = np.linalg.norm(moves.reshape(-1, motions.shape[1]), ord=2)
    return bool(np.sum(values > 1e-4 * largest) == motions.shape[1])


def slack(body: Body, contact: Contact, step: int) -> tuple[float, Array]:
    """How far contact forces that balance the loads can stay inside all their limits, as a share of the loads.

    Positive: there is an equilibrium with room to spare.  Zero or negative: there is none, or one on the edge.  And the
    contact pressure that leaves so much.
    """
    motions = free_motions(body, step)
    count = motions.shape[1]
    nodes = len(contact.nodes)
    if count == 0:
        return 1.0, np.zeros(nodes)
    resultant = motions.T @ body.load(step)
    scale = float(np.abs(body.load(step)).sum())
    if scale == 0:
        return 0.0, np.zeros(nodes)
    moves = motions.reshape(-1, 2, count)[contact.nodes]
    share = contact.weight / contact.weight.sum()
    # Unknowns: normal forces, tangential forces (over the scale), the room.
    balance = np.zeros((count, 2 * nodes + 1))
    balance[:, :nodes] = np.einsum("nik,ni->kn", moves, contact.normal)
    balance[:, nodes:-1] = np.einsum("nik,ni->kn", moves, contact.tangent)
    given = contact.weight * contact.given / scale
    cap = contact.weight * contact.cap / scale
    rubs = ((contact.given > 0) | (contact.coefficient > 0)) & (contact.cap > 0)
    rows, limits = [], []
    for node in np.flatnonzero(~contact.bilateral):
        row = np.zeros(2 * nodes + 1)
        row[node], row[-1] = -1.0, share[node]
        rows.append(row)
        limits.append(0.0)
    for node in np.flatnonzero(rubs):
        for sign in (1.0, -1.0):
            row = np.zeros(2 * nodes + 1)
            row[nodes + node], row[-1] = sign, share[node]
            if np.isfinite(cap[node]):
                rows.append(row.copy())
                limits.append(cap[node])
            if not contact.bilateral[node] or contact.coefficient[node] == 0:
                row[node] = -contact.coefficient[node]
                rows.append(row)
                limits.append(given[node])
    bounds = [(None, None)] * nodes + [(None, None) if rub else (0.0, 0.0) for rub in rubs] + [(None, 1.0)]
    cost = np.zeros(2 * nodes + 1)
    cost[-1] = -1.0
    # Where no force is limited the margin itself is limited.
    found = linprog(
        cost,
        A_ub=np.array(rows) if rows else None,
        b_ub=np.array(limits) if rows else None,
        A_eq=balance,
        b_eq=resultant / scale,
        bounds=bounds,
        method="highs",
    )
    if found.status != 0:
        return -1.0, np.zeros(nodes)
    return float(-found.fun), found.x[:nodes] * scale / contact.weight
