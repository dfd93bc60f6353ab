"""Statics of a body on its foundation: which loads admissible contact tractions can balance, and how many times over.

Whether the load W is in the set C of the resultants of admissible tractions (``reactions``) does not depend on the
stiffness of the body.  The direction r from the nearest point of C to W is a motion, and both answers are checked by
plain arithmetic:

- tractions that leave nothing of W are a balance;
- if W does more work on r than any admissible tractions can take, there is none, however the body deforms.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.motions import FreeMotions
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.contact.reactions import Reactions, combination, nearest, reactions
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.tuned import AT_REST, LARGEST_BALANCING_FORCE, NO_FORCE


@dataclass(frozen=True)
class Escape:
    """How an assembly moves away because no admissible contact tractions balance its load.

    Attributes:
        status: ``SLIDES``: it would be held if friction had no limit; ``TIPS``: it turns about nodes that stay where
            they are; ``OPEN``: it leaves the foundation; ``NOT_HELD``: nothing resists a motion.
        assembly: its number.
        motion: that the load drives, as coefficients of the free motions, shape (k,); its size means nothing.
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


def escape(contact: Reactions, load: Nodal) -> tuple[Status, Nodal] | None:
    """How a load moves one assembly away, and the motion that it drives, shape (k,); None: not proved.

    Args:
        contact: the reactions of the assembly.
        load: its work on the motions, shape (k,), not zero.
    """
    near = nearest(contact, load)
    if not near.unbalanced:
        return None
    if contact.friction.any():
        rough = nearest(contact.rough, load)
        if not rough.unbalanced:
            return Status.SLIDES, along_contact(contact, near.motion, near.pressed)
        near = rough
    if not near.pressed.size:
        return Status.OPEN, near.motion
    motion = along_contact(contact, near.motion, near.pressed)
    at_nodes = np.concatenate((contact.normal[:, None], contact.tangential), axis=1) @ motion
    still = np.abs(at_nodes[near.pressed]).max() <= AT_REST * np.abs(at_nodes).max()
    return (Status.TIPS if still else Status.OPEN), motion


def along_contact(contact: Reactions, motion: Nodal, pressed: npt.NDArray[np.int64]) -> Nodal:
    """A motion that keeps pressed nodes in contact, shape (k,).

    Where friction follows the pressure, the motion on which tractions can do no more work lifts slipping nodes off; the
    body does not.  The motion is returned as it is if nothing else is left of it.
    """
    rows = contact.normal[pressed]
    sliding: Nodal = motion - np.linalg.lstsq(rows, rows @ motion, rcond=NO_FORCE)[0] if len(rows) else motion
    return sliding if np.linalg.norm(sliding) > NO_FORCE * np.linalg.norm(motion) else motion


def separable(contact: Reactions) -> bool:
    """Whether one assembly can move off its foundation at all nodes at once, without slip where friction is given.

    Then no pressures are in balance: without a load there are none, and nothing says where the body is.
    """
    if contact.bilateral.any():
        return False
    zero = np.zeros_like(contact.given)
    with_distance = replace(
        contact.unlimited(contact.given > 0),
        normal=np.column_stack((contact.normal, zero + 1.0)),
        tangential=np.concatenate((contact.tangential, np.zeros_like(contact.tangential[:, :, :1])), axis=2),
    )
    return nearest(with_distance, np.eye(contact.normal.shape[1] + 1)[-1], unlimited=True).unbalanced


def squeezed(contact: Reactions, gap: Nodal) -> bool:
    """Whether one assembly is held by its foundation without a load, as in an interference fit.

    Its nodes overlap with the foundation wherever it is if pressures in balance do work on the gaps that is negative.

    Args:
        contact: its contact nodes.
        gap: at these nodes, length, shape (n,).
    """
    size = float(np.abs(gap).max(initial=0.0))
    if size == 0.0:
        return False
    rows = np.column_stack((contact.normal, gap / size + NO_FORCE))
    rows = np.concatenate((rows, -np.column_stack((contact.normal, gap / size - NO_FORCE))[contact.bilateral]))
    rows /= np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), NO_FORCE)
    *_, residual = combination(rows, -np.eye(rows.shape[1])[-1], [])
    return bool(np.linalg.norm(residual) <= NO_FORCE)


def null_space(rows: Nodal, share: float = NO_FORCE) -> Nodal:
    """Directions, one per column, perpendicular to all rows but for a share of them, round-off.

    By singular values: the squares that the eigenvalues of a product are would be round-off below its own.
    """
    k = rows.shape[1]
    _, values, directions = np.linalg.svd(np.linalg.qr(np.concatenate((rows, np.zeros((k, k)))), mode="r"))
    null: Nodal = directions[values <= share * values[:1]].T
    return null


def largest_multiple(contact: Reactions, load: Nodal) -> float:
    """The largest multiple of a load that admissible tractions balance; infinite beyond ``LARGEST_BALANCING_FORCE``.

    The motion that a larger multiple drives shows how much the tractions can do against it at most: Newton's method for
    the largest one.

    Args:
        contact: the reactions of one assembly.
        load: its work on the motions, shape (k,), not zero.
    """
    multiple, size = LARGEST_BALANCING_FORCE, float(np.linalg.norm(load))
    while True:
        near = nearest(contact, multiple * load)
        if not near.unbalanced:
            return np.inf if multiple == LARGEST_BALANCING_FORCE else multiple
        *_, limited = contact.against(near.motion, size)
        least = max(0.0, float(limited @ near.motion)) * size / float(load @ near.motion)
        if least == 0.0 or least >= multiple * (1 - NO_FORCE):
            return least
        multiple = least
