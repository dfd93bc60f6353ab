"""Whether a scene is in equilibrium: which rigid motions supports and contact resist, which loads they balance.

The statements are proved: the forces on a linear body in equilibrium do no work on any motion without strain that its
supports leave free.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.linalg import null_space

from signorini_fx.algebra.contact.statics import Reactions, escape, reactions, squeezed
from signorini_fx.machine import parallel
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.rigid.motion_names import names_of
from signorini_fx.records import Finding, Status
from signorini_fx.results.contact_figures import load_on
from signorini_fx.tuned import NO_FORCE

_Rows = npt.NDArray[np.float64]


def equilibrium(body: Model) -> list[Finding]:
    """Motions without strain that the supports leave free: whether contact can resist them, and balance the loads.

    Each assembly of pieces is checked separately.
    """
    motions, boundary, data = body.motions, body.boundary, body.data
    if motions.free.shape[1] == 0:
        return []
    all_reactions: tuple[Reactions, _Rows] | None = None
    if boundary is not None and data is not None:
        gap = parallel.gather_rows(boundary.comm, data.gap[:, None])[:, 0]
        all_reactions = reactions(motions.at(boundary), body.law, data.bilateral), gap
    loads = [load_on(body, step) for step in range(body.statement.steps)]
    findings = []
    for number in map(int, np.unique(motions.assembly)):
        columns = motions.assembly == number
        contact, without_load = None, False
        if all_reactions is not None:
            contact = all_reactions[0].of(number, columns)
            without_load = squeezed(contact, all_reactions[1][all_reactions[0].assembly == number])
        assembly_loads = [load[columns] for load in loads]
        findings.append(_equilibrium_of(body, number, columns, contact, assembly_loads, without_load=without_load))
    return findings


def _equilibrium_of(
    body: Model,
    number: int,
    columns: npt.NDArray[np.bool_],
    contact: Reactions | None,
    loads: list[_Rows],
    *,
    without_load: bool,
) -> Finding:
    """Whether one assembly is in equilibrium, from its columns of free motions and the work of each load step on them;
    ``without_load``: whether its foundation holds it without a load.
    """
    motions, statement = body.motions, body.statement
    free = motions.of_all[:, columns]
    several = motions.pieces.count > 1
    members = np.flatnonzero(motions.pieces.assembly == number)
    subject = "the body"
    if several:
        subject = motions.pieces.called(int(members[0])) if members.size == 1 else "bodies that may touch"
    tangential = np.zeros((0, free.shape[1])) if contact is None else contact.tangential[contact.friction]
    normal = np.zeros((0, free.shape[1])) if contact is None else contact.normal
    resisting = np.concatenate((normal, tangential.reshape(-1, free.shape[1]), np.zeros((free.shape[1],) * 2)))
    loose = null_space(np.linalg.qr(resisting, mode="r"), rcond=NO_FORCE)
    if loose.shape[1]:
        names = names_of(free @ loose, motions, members)
        who, advice = "the supports do not resist", "prescribe a displacement"
        if contact is not None:
            who, advice = "neither the supports nor the contact resists", f"{advice}, or add friction"
        return Finding("warning", "displacement", f"nothing holds {subject}: {who} {names}; {advice}")
    assert contact is not None
    away = [escape(contact, load) if load.any() else None for load in loads]
    of_it = f" of {subject}" if several else ""
    steps = [step for step, way in enumerate(away, start=1) if way is not None]
    if steps:
        when = ""
        if len(loads) > 1:
            when = f"{'load step' if statement.automatic_steps is None else 'factor'} {steps[0]}: "
        status, motion = next(way for way in away if way is not None)
        drives, cannot, cure = _WAYS[status]
        names = names_of(free @ motion[:, None], motions, members, one_way=True)
        return Finding(
            "warning",
            statement.forces_at,
            f"{when}there is no static equilibrium{of_it}: the loads {drives} {names}, {cannot}: "
            f"{cure}, or prescribe a displacement{_provided(body)}",
        )
    with_base_bound = contact.given[:, None, None] > 0
    stuck = np.linalg.matrix_rank((with_base_bound * contact.tangential).reshape(-1, free.shape[1])) == free.shape[1]
    text = f"the supports do not hold {names_of(free, motions, members)}: contact must"
    if any(load.any() for load in loads) or stuck or without_load or contact.bilateral.any() or imposed(body):
        return Finding("note", "displacement", f"{subject}: {text}" if several else text)
    message = f"{text}, but no load presses {subject} on its foundation: its position is not determined"
    return Finding("warning", statement.forces_at, message)


def _provided(body: Model) -> str:
    """What a proof that friction cannot hold a body rests on where a law of a user's own has said it."""
    if body.law is None or not body.law.laws:
        return ""
    known = f"; {body.law.unknown}" if body.law.unknown else ""
    return (
        f"{known}, provided that this bound is nowhere larger than the law says, which was tried at samples of the "
        "pressure"
    )


# What loads do, what does not stop it, and what may.
_WAYS = {
    Status.SLIDES: ("make it slide by", "which friction cannot stop", "lower the load, raise the friction"),
    Status.TIPS: (
        "tip it over by",
        "which the contact cannot stop",
        "lower the load, let it act closer to the contact",
    ),
    Status.OPEN: ("drive", "which neither the supports nor the contact can stop", "change the direction of the loads"),
}


def imposed(body: Model) -> bool:
    """Whether supports or rigid bodies are moved in any load step; collective."""
    applied = [load for step in range(body.statement.steps) for factor, load in body.applied_at(step) if factor]
    moved = [
        bool(load.prescribed.x.array.any()) or (load.driven is not None and bool(load.driven.motion.any()))
        for load in applied
    ]
    return parallel.any_rank(body.comm, any(moved))
