"""How much of its friction a body uses that supports do not hold."""

from __future__ import annotations

from signorini_fx.algebra.contact.friction import as_given
from signorini_fx.algebra.contact.motions import total_work
from signorini_fx.algebra.contact.nodal_vectors import Nodal
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
    if not model.motions.free.shape[1] or not model.applied or not contact.has_friction:
        return None
    load = load_on(model, step)
    motions, touching = model.motions.at(contact.boundary), contact.bilateral | contact.in_contact
    present = reactions(motions, as_given(contact.bound), contact.bilateral, touching)
    shares = []
    for number, columns in motions.assemblies:
        if load[columns].any():
            multiple = largest_multiple(present.of(number, columns), load[columns])
            if multiple > 0:
                shares.append(1 / multiple)
    return max(shares, default=None)


def load_on(model: Model, step: float) -> Nodal:
    """The work of the loads of a load step on the free motions, shape (k,); collective."""
    motions = model.motions
    loads = [
        (factor, motions.load_of(load.pushing, model.comm, None if load.driven is None else load.driven.forces))
        for factor, load in model.applied_at(step)
    ]
    return total_work(loads, motions.free.shape[1])
