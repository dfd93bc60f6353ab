"""Statics of a body on its foundation: which loads admissible contact tractions can balance, and up
to which multiple.

Admissible are lambda >= 0, of any sign where contact is bilateral, and |mu| <= min(g + F lambda,
cap).  Their resultants on the rigid motions that the supports leave free form a convex set C, the
sum of a cone and of a bounded set.  Whether the load W is in C does not depend on the stiffness of
the body.  The direction r from the nearest point of C to W is a motion, and both answers are
checked by plain arithmetic:

- tractions that leave nothing of W are a balance;
- if W does more work on r than any admissible tractions can take, there is none, however the body
  deforms.

The nearest point is found by the active-set method of Lawson and Hanson (*Solving Least Squares
Problems*, chapter 23), with columns generated on demand: for each motion the tractions that do most
work against it are known in closed form, also for the disc of |mu|.  No disc is replaced by a
polygon, and no status of an external solver has to be trusted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from signorini_fx.algebra.contact.friction import PointFriction, as_given
from signorini_fx.algebra.contact.motions import FreeMotions
from signorini_fx.arrays import Array, Flags, Ints, length, quotient, unit
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.tuned import (
    CERTIFICATE_TOLERANCE,
    LARGEST_BALANCING_FORCE,
    NO_FORCE,
    NOTHING_LEFT,
    ZERO_COMPONENT,
)

# Columns that one motion adds, for each dimension; largest number of motions, and of motions
# without progress.
_COLUMNS = 4
_ROUNDS = 400
_PATIENCE = 3


@dataclass(frozen=True)
class Escape:
    """How an assembly moves away because no admissible contact tractions balance its load.

    Attributes:
        status: ``SLIDES`` (unlimited friction would hold it), ``TIPS`` about nodes that do not
            move, ``OPEN`` (it leaves the foundation), or ``NOT_HELD`` (nothing resists a motion).
        assembly: number of the assembly.
    """

    status: Status
    assembly: int


def no_balance(
    law: PointFriction | None,
    bilateral: Flags,
    motions: FreeMotions,
    load: Array,
    gap: Array | None = None,
) -> Escape | None:
    """Return a proof that a contact problem has no solution: how the first assembly moves away,
    assemblies with loads first; None if there is no proof.  Collective.

    The proof holds for any number of contacts, without friction and for any friction below its
    envelope, in 2D and in 3D, whatever the gaps and the stiffness are, as all contact nodes may
    press. None proves nothing: where the friction bound depends on the pressure, an equilibrium of
    rigid bodies need not be one of elastic bodies.

    Args:
        law: the friction law itself, not the bound of an iterate, stresses; None: without friction.
        bilateral: nodes whose contact cannot open, shape (n,).
        motions: free rigid motions, k of them.
        load: its work on the free motions, zero where it is round-off
            (``ElasticSystem.resultant``), shape (k,).
        gap: of the body deformed by its loads alone, length, shape (n,).  A body without a
            resultant and without given friction then leaves the foundation unless its foundation
            squeezes it. None if the gap is not known: it then leaves only if it can move off
            without touching, because strains may press it on.
    """
    if not load.size:
        return None
    everywhere = motions.points.everywhere
    able = ~everywhere if law is None else law.acts
    unheld = motions.unheld(everywhere, able)
    all_reactions = reactions(motions, law, bilateral)
    gaps = None if gap is None else parallel.gather_rows(motions.points.comm, gap[:, None])[:, 0]
    for number, columns in sorted(
        motions.assemblies, key=lambda assembly: not load[assembly[1]].any()
    ):
        contact = all_reactions.of(number, columns)
        work = load[columns]
        if unheld[number] or not contact.given.size:
            return Escape(Status.NOT_HELD if unheld[number] else Status.OPEN, number)
        if work.any():
            if (escaping := escape(contact, work)) is not None:
                return Escape(escaping[0], number)
        else:
            # Given friction acts without a pressure, so it holds the body.
            apart = (
                gaps is not None
                and not contact.given.any()
                and not squeezed(contact, gaps[all_reactions.assembly == number])
            )
            if apart or separable(contact):
                return Escape(Status.OPEN, number)
    return None


@dataclass(frozen=True)
class Reactions:
    """What the n contact nodes of all ranks can do against k rigid motions; the same on every rank.

    Attributes:
        normal: each motion along the normal of each node, shape (n, k); zero at a node that cannot
            press.
        tangential: each motion along the tangents, shape (n, d - 1, k).
        given: given part of the friction bound, a force, shape (n,); may be infinite.
        coefficient: F where the bound depends on the pressure, shape (n,).
        cap: the largest bound, a force, shape (n,); infinite where there is none.
        bilateral: whether the contact cannot open, shape (n,).
        assembly: number of the assembly of each node, shape (n,).
    """

    normal: Array
    tangential: Array
    given: Array
    coefficient: Array
    cap: Array
    bilateral: Flags
    assembly: Ints

    def of(self, number: int, columns: Flags) -> Reactions:
        """Return the reactions of one assembly: its nodes, and its motions given by the mask
        ``columns``.
        """
        normal, tangential, *others = (
            values[self.assembly == number] for values in vars(self).values()
        )
        return Reactions(normal[:, columns], tangential[:, :, columns], *others)

    @property
    def friction(self) -> Flags:
        """The nodes with friction, shape (n,)."""
        return (self.given > 0) | (self.coefficient > 0)

    def unlimited(self, where: Flags) -> Reactions:
        """Return the reactions with unlimited given friction at some nodes, and no given friction
        at the others.
        """
        bound = np.where(where, np.inf, 0.0)
        return replace(self, given=bound, cap=np.full_like(bound, np.inf))

    def against(self, motion: Array, unit_of_force: float) -> tuple[Array, Array, Ints, Array]:
        """Return the tractions that do most work on a motion of shape (k,).

        Returns:
            Resultants of unlimited tractions: edges of the cone and directions within it, one per
                row,
            without round-off; their lengths, shape (m,); the node that each of them presses, shape
            (m,), -1 for friction without pressure; and the resultant of limited tractions that does
            the most work, shape (k,), in units of ``unit_of_force``.
        """
        away = self.normal @ motion
        slip = self.tangential @ motion
        along = unit(slip)
        pull = np.einsum("it,itk->ik", along, self.tangential)
        stick = np.isinf(self.given)
        capped = np.isfinite(self.cap) & (self.coefficient > 0)
        share = np.where(stick | capped, 0.0, self.coefficient)
        side = np.where(self.bilateral & (away < 0), -1.0, 1.0)
        pressed = side * away
        size = length(slip)
        # Friction below its bound F lambda does more work where the motion presses more than it
        # slips.
        reduced = np.flatnonzero((pressed > 0) & (size < share * pressed))
        reduced_pull = (size[reduced] / pressed[reduced])[:, None] * pull[reduced]
        normal = side[:, None] * self.normal
        edges = np.concatenate(
            (normal + share[:, None] * pull, normal[reduced] + reduced_pull, pull[stick])
        )
        node = np.concatenate((np.arange(away.size), reduced, np.full(np.count_nonzero(stick), -1)))
        # Up to its cap, friction grows with the pressure.
        lift = np.zeros_like(away)
        lift[capped] = (self.cap[capped] - self.given[capped]) / self.coefficient[capped]
        lift[away + self.coefficient * size <= 0] = 0.0
        bound = np.where(stick, 0.0, np.where(lift > 0, self.cap, self.given)) / unit_of_force
        lengths = np.linalg.norm(edges, axis=1)
        real = lengths > NO_FORCE
        return (
            edges[real],
            lengths[real],
            node[real],
            bound @ pull + (lift / unit_of_force) @ self.normal,
        )


def reactions(
    motions: FreeMotions,
    law: PointFriction | None,
    bilateral: Flags,
    pressing: Flags | None = None,
) -> Reactions:
    """Return the reactions of contact to the free rigid motions; collective.

    Args:
        motions: the free rigid motions.
        law: the friction law, stresses; None: without friction.
        bilateral: nodes whose contact cannot open.
        pressing: nodes at which the foundation can press; None: at all; given friction acts at all
            nodes.
    """
    points = motions.points
    k = motions.count
    tangents = motions.points.dimension - 1
    law = as_given(np.zeros(points.size)) if law is None else law.forces(points.weight)
    able = np.ones(points.size) if pressing is None else pressing
    cap = np.full(points.size, np.inf) if law.cap is None else law.cap
    laws = (law.given, law.coefficient, cap, bilateral, able, motions.of_point)
    flat = motions.relative.reshape(points.size, (1 + tangents) * k)
    table = parallel.gather_rows(points.comm, np.column_stack((flat, *laws)))
    base_bound, share, cap, sides, able, assembly = table[:, (1 + tangents) * k :].T
    sideways = table[:, k : (1 + tangents) * k].reshape(len(table), tangents, k)
    # On a foundation that may pull as well as push, F |lambda| is not convex; friction is then
    # taken as unlimited except for the cap.
    unlimited = (share > 0) & ((sides > 0) | (share > LARGEST_BALANCING_FORCE))
    return Reactions(
        normal=np.where(able[:, None] > 0, table[:, :k], 0.0),
        tangential=sideways,
        given=np.where(unlimited & (able > 0), cap, np.minimum(base_bound, cap)),
        coefficient=np.where(unlimited | (able == 0), 0.0, share),
        cap=cap,
        bilateral=sides > 0,
        assembly=assembly.astype(np.int64),
    )


@dataclass(frozen=True)
class NearestTractions:
    """The admissible tractions of one assembly whose resultant is nearest to a load.

    Attributes:
        motion: the part of the load that is left, which is the motion that it drives, in units of
            the load, shape (k,).
        pressed: nodes that the tractions press with a force that no bound limits.
        balanced: whether nothing but round-off is left.
        unbalanced: whether it is proved that no tractions balance the load.
    """

    motion: Array
    pressed: Ints
    balanced: bool
    unbalanced: bool


def nearest(contact: Reactions, load: Array, *, unlimited: bool = False) -> NearestTractions:
    """Return the admissible tractions of one assembly nearest to a load, given by its work on the
    motions.

    The size of the load is the unit of force.  A limited resultant z is the column (z, 1), an
    unlimited edge e the column (e, 0), and the load (W, 1).  With ``unlimited`` the tractions with
    a given bound are left out, and the size of the load does not matter.
    """
    size = float(np.linalg.norm(load))
    target = np.append(load / size, 0.0 if unlimited else 1.0)
    columns = np.eye(target.size)[-1:]
    pressing = np.array([-1])
    passive: list[int] = []
    previous = np.inf
    stalled = 0
    proof: tuple[Array, list[int]] | None = None

    def proves(motion: Array) -> bool:
        """Return whether admissible tractions do less work on a motion than the load.

        The work of unlimited tractions is only limited by round-off of the motion; their sum is
        taken as at most ``LARGEST_BALANCING_FORCE`` times it.
        """
        edges, lengths, _, bounded = contact.against(motion, size)
        most_work = LARGEST_BALANCING_FORCE * float(np.max(edges @ motion / lengths, initial=0.0))
        most_work += 0.0 if unlimited else float(bounded @ motion)
        return bool(motion @ target[:-1] - most_work > NO_FORCE * np.linalg.norm(motion))

    for _ in range(_ROUNDS):
        passive, values, residual = combination(columns, target, passive)
        distance = float(np.linalg.norm(residual))
        stalled = stalled + 1 if distance > (1 - 1e-13) * previous else 0
        # There are no more independent columns than components; further ones differ by round-off.
        if distance <= NO_FORCE**1.5 or stalled > _PATIENCE or len(passive) > 4 * target.size:
            break
        previous = distance
        if proves(residual[:-1]):
            proof = residual[:-1], passive
        edges, lengths, node, bounded = contact.against(residual[:-1], size)
        rows = np.column_stack((edges / lengths[:, None], np.zeros(lengths.size)))
        if not unlimited:
            rows = np.vstack((rows, np.append(bounded, 1.0)))
            node = np.append(node, -1)
            rows[-1] /= np.linalg.norm(rows[-1])
        work = rows @ residual
        steepest = np.argsort(-work, kind="stable")[: _COLUMNS * target.size]
        steepest = steepest[work[steepest] > max(ZERO_COMPONENT, NOTHING_LEFT * distance)]
        if not steepest.size:
            break
        columns = np.concatenate((columns, rows[steepest]))
        pressing = np.concatenate((pressing, node[steepest]))
    motion = residual[:-1]
    balanced = bool(distance <= NO_FORCE and values.sum() <= LARGEST_BALANCING_FORCE)
    # An earlier motion may be a proof although a later one is not, if round-off resists the latter
    # with very large forces.
    unbalanced = not balanced and (proves(motion) or proof is not None)
    if unbalanced and not proves(motion) and proof is not None:
        motion, passive = proof
    pressed = np.unique(pressing[passive])
    return NearestTractions(motion, pressed[pressed >= 0], balanced, unbalanced)


def combination(
    columns: Array, target: Array, passive: list[int]
) -> tuple[list[int], Array, Array]:
    """Return the combination of columns with non-negative coefficients that is nearest to the
    target.

    Args:
        columns: one per row, of length 1.
        target: the vector to approximate.
        passive: rows that had positive coefficients with fewer columns.

    Returns:
        The rows with positive coefficients, these coefficients, and what is left of the target.
    """
    passive = list(passive)
    values = _solve(columns[passive], target)
    banned: list[int] = []
    residual = target - values @ columns[passive]
    for _ in range(10 * target.size):
        gain = columns @ residual
        gain[passive + banned] = -np.inf
        best = int(np.argmax(gain)) if gain.size else -1
        if best < 0 or gain[best] <= max(
            ZERO_COMPONENT, NOTHING_LEFT * float(np.linalg.norm(residual))
        ):
            break
        passive = [*passive, best]
        values = np.append(values, 0.0)
        while True:
            wanted = _solve(columns[passive], target)
            low = wanted <= 0
            if not low.any():
                values = wanted
                break
            if low[-1] and values[-1] == 0.0:
                banned.append(passive.pop())
                values = values[:-1]
                break
            steps = quotient(values, values - wanted, low, otherwise=np.inf)
            first = int(np.argmin(steps))
            values = values + steps[first] * (wanted - values)
            values[first] = 0.0  # set exactly, so that the set shrinks in spite of round-off
            positive = ~low | (values > 0)
            passive = [row for row, keep in zip(passive, positive, strict=True) if keep]
            values = values[positive]
        residual = target - values @ columns[passive]
    return passive, values, residual


def _solve(columns: Array, target: Array) -> Array:
    """Return the least-squares coefficients of the columns, one per row, for the target."""
    return (
        np.asarray(np.linalg.lstsq(columns.T, target, rcond=None)[0])
        if len(columns)
        else np.zeros(0)
    )


def escape(contact: Reactions, load: Array) -> tuple[Status, Array] | None:
    """Return how a load moves one assembly away, and the motion that it drives, shape (k,); None if
    this is not proved.

    The load, not zero, is given by its work on the motions.
    """
    near = nearest(contact, load)
    if not near.unbalanced:
        return None
    if contact.friction.any():
        rough = nearest(
            replace(contact.unlimited(contact.friction), coefficient=0.0 * contact.coefficient),
            load,
        )
        if not rough.unbalanced:
            return Status.SLIDES, along_contact(contact, near.motion, near.pressed)
        near = rough
    if not near.pressed.size:
        return Status.OPEN, near.motion
    motion = along_contact(contact, near.motion, near.pressed)
    at_nodes = np.concatenate((contact.normal[:, None], contact.tangential), axis=1) @ motion
    still = np.abs(at_nodes[near.pressed]).max() <= CERTIFICATE_TOLERANCE * np.abs(at_nodes).max()
    return (Status.TIPS if still else Status.OPEN), motion


def along_contact(contact: Reactions, motion: Array, pressed: Ints) -> Array:
    """Return the part of a motion that keeps pressed nodes in contact, shape (k,).

    Where friction depends on the pressure, the motion on which tractions can do no more work lifts
    slipping nodes off, but the body does not.  The motion is returned unchanged if nothing would be
    left of it.
    """
    rows = contact.normal[pressed]
    sliding = (
        motion - np.linalg.lstsq(rows, rows @ motion, rcond=NO_FORCE)[0] if len(rows) else motion
    )
    return sliding if np.linalg.norm(sliding) > NO_FORCE * np.linalg.norm(motion) else motion


def separable(contact: Reactions) -> bool:
    """Return whether one assembly can move off its foundation at all nodes at once, without slip
    where friction is given.

    Then no pressures balance each other: without a load there are none, and the position of the
    body is not determined.
    """
    if contact.bilateral.any():
        return False
    zero = np.zeros_like(contact.given)
    with_distance = replace(
        contact.unlimited(contact.given > 0),
        normal=np.column_stack((contact.normal, zero + 1.0)),
        tangential=np.concatenate(
            (contact.tangential, np.zeros_like(contact.tangential[:, :, :1])), axis=2
        ),
    )
    return nearest(
        with_distance, np.eye(contact.normal.shape[1] + 1)[-1], unlimited=True
    ).unbalanced


def squeezed(contact: Reactions, gap: Array) -> bool:
    """Return whether the foundation holds one assembly without a load, as in an interference fit.

    This is so if some pressures in balance do negative work on the gaps at its contact nodes: then
    nodes overlap with the foundation wherever the assembly is.
    """
    size = float(np.abs(gap).max(initial=0.0))
    if size == 0.0:
        return False
    rows = np.column_stack((contact.normal, gap / size + NO_FORCE))
    rows = np.concatenate(
        (rows, -np.column_stack((contact.normal, gap / size - NO_FORCE))[contact.bilateral])
    )
    rows /= np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), NO_FORCE)
    *_, residual = combination(rows, -np.eye(rows.shape[1])[-1], [])
    return bool(np.linalg.norm(residual) <= NO_FORCE)


def largest_multiple(contact: Reactions, load: Array) -> float:
    """Return the largest multiple of a load that admissible tractions of one assembly balance;
    infinite above ``LARGEST_BALANCING_FORCE``.

    The load, not zero, is given by its work on the motions.  The motion that a larger multiple
    drives bounds what the tractions can do against it: this is Newton's method for the largest
    multiple.
    """
    multiple = LARGEST_BALANCING_FORCE
    size = float(np.linalg.norm(load))
    while True:
        near = nearest(contact, multiple * load)
        if not near.unbalanced:
            return np.inf if multiple == LARGEST_BALANCING_FORCE else multiple
        *_, limited = contact.against(near.motion, size)
        least = max(0.0, float(limited @ near.motion)) * size / float(load @ near.motion)
        if least == 0.0 or least >= multiple * (1 - NO_FORCE):
            return least
        multiple = least
