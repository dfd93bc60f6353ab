"""Statics of a body on its foundation: which loads admissible contact tractions can balance, and how many times over.

Whether the load W is in the set C of the resultants of admissible tractions (``reactions``) does not depend on the
stiffness of the body.  The direction r from the nearest point of C to W is a motion, and both answers are checked by
plain arithmetic:

- tractions that leave nothing of W are a balance;
- if W does more work on r than any admissible tractions can take, there is none, however the body deforms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.motions import FreeMotions
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.machine import parallel
from signorini_fx.records import Status


@dataclass(frozen=True)
class Escape:
    """How an assembly moves away because no admissible contact tractions balance its load: it ``SLIDES``, held if
    friction had no limit, ``TIPS`` about nodes that stay where they are, leaves the foundation (``OPEN``), or nothing
    resists a motion (``NOT_HELD``); and the motion that the load drives, as coefficients of the free motions, shape
    (k,), whose size means nothing.
    """

    status: Status
    assembly: int
    motion: Nodal


def no_balance(
    law: PointFriction | None,
    bilateral: npt.NDArray[np.bool_],
    motions: FreeMotions,
    load: Nodal,
    gap: Nodal | None = None,
) -> Escape | None:
    """A proof that a contact problem has no solution, to be asked before anything is tried; collective.

    It holds for any number of contacts, for frictionless contact, any friction below its envelope, in 2D
    and in 3D, and whatever the gaps and the stiffness are: all contact nodes may press.  None proves
    nothing: where the law lets the pressure choose, an equilibrium of rigid bodies need not be one of elastic bodies.

    Args:
        law: the friction law itself, not the bound of an iterate; stresses; None without friction.
        bilateral: nodes whose contact cannot open, shape (n,).
        motions: free rigid motions at the contact points.
        load: the work of the loads on the free motions, zero where it is round-off (``ElasticSystem.resultant``),
            shape (k,).
        gap: of the body as its loads alone deform it, lengths, shape (n,): a body without a resultant, with no given
            friction, and not squeezed by its foundation, then counts as one that leaves it; None, where that is not
            known: only if it can move off without touching, because strains may press it on otherwise.

    Returns:
        How the first assembly moves away that does, of those that loads drive, then of others; None if that is not
        proved of any of them.
    """
    if not load.size:
        return None
    from signorini_fx.algebra.contact.reactions import escape, reactions, separable, squeezed

    everywhere = motions.points.everywhere
    able = ~everywhere if law is None else law.acts
    unheld = motions.unheld(everywhere, able)
    all_reactions = reactions(motions, law, bilateral)
    gaps = None if gap is None else parallel.gather_rows(motions.points.comm, gap[:, None])[:, 0]
    for number, columns in sorted(motions.assemblies, key=lambda assembly: not load[assembly[1]].any()):
        contact, work = all_reactions.of(number, columns), load[columns]
        escaping: tuple[Status, Nodal] | None = None
        if unheld[number] or not contact.given.size:
            escaping = Status.NOT_HELD if unheld[number] else Status.OPEN, work
        elif work.any():
            escaping = escape(contact, work)
        else:
            # A given friction acts without a pressure, and then holds the body.
            apart = (
                gaps is not None
                and not contact.given.any()
                and not squeezed(contact, gaps[all_reactions.assembly == number])
            )
            if apart or separable(contact):
                escaping = Status.OPEN, work
        if escaping is not None:
            motion = np.zeros(load.size)
            motion[columns] = escaping[1]
            return Escape(escaping[0], number, motion)
    return None
