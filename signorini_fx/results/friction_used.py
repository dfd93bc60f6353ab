"""How much of its friction a body uses that supports do not hold."""

from __future__ import annotations

from signorini_fx.algebra.contact.friction import as_given
from signorini_fx.algebra.contact.motions import total_work
from signorini_fx.algebra.contact.reactions import largest_multiple, reactions
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model


def friction_used(model: Model, contact: ContactState, step: float) -> float | None:
    """The share of its friction that the loads of a solution use: with friction bounds as they are, the nodes in
    contact balance the loads up to 1 / share of their size; of several bodies the largest; collective.

    It sets no limit, because pressures and friction bounds change with the loads.

    Returns:
        None without friction, or if supports hold the body.
    """
    count = model.motions.free.shape[1]
    if not count or not model.applied or not contact.has_friction:
        return None
    load = total_work(
        [
            (factor, model.motions.load_of(one.pushing, model.comm, None if one.driven is None else one.driven.forces))
            for factor, one in model.applied_at(step)
        ],
        count,
    )
    motions, touching = model.motions.at(contact.boundary), contact.bilateral | contact.in_contact
    present = reactions(motions, as_given(contact.bound), contact.bilateral, touching)
    shares = []
    for number, columns in motions.assemblies:
        if load[columns].any():
            multiple = largest_multiple(present.of(number, columns), load[columns])
            if multiple > 0:
                shares.append(1 / multiple)
    return max(shares, default=None)
