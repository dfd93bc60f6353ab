"""Active sets at contact points: contact, stick and slip, and the multipliers and tangent for fixed
sets.

The set of a point follows from the iterate by (3.3b) and (3.3c), see ``complementarity``, which
also describes the arrays.

A linear step with sets that leave a rigid motion free has no solution although the problem may have
one, as the sets of an iterate are only a guess.  Statics decides first: if no admissible contact
tractions could balance the load, nothing holds the body, and a status reports it.  Otherwise some
of the nodes that are about to be released are kept, half of them if that is enough: those that are
closest to staying.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.complementarity import (
    RegularisedData,
    onto_disc,
    slip_of,
    slips,
    trial_pressure,
    trial_shear,
)
from signorini_fx.algebra.contact.friction import Evaluated
from signorini_fx.algebra.contact.motions import FreeMotions
from signorini_fx.algebra.contact.points import ContactPoints
from signorini_fx.arrays import Array, Flags, Ints, inner, length, quotient, unit
from signorini_fx.machine import parallel
from signorini_fx.records import Status


@dataclass(frozen=True)
class ActiveSets:
    """The sets of Algorithm (SSN), step 2.

    Attributes:
        contact: True on A_c, False on I_c, shape (n,).
        slip: True on A_f, False on I_f (stick), shape (n,).
        direction: unit vector e of the shear on A_f, zero on I_f, shape (n, d - 1); in 2D +1 on
            A_f,+ and -1 on A_f,-.
        turning: k, stress per length: stiffness of the shear against slip perpendicular to its
            direction, shape (n,); without effect in 2D.
        line: tangent of a friction bound that depends on pressure and slip, at the iterate, see
            ``PointFriction.line``; None: the tangent at zero pressure and slip.
    """

    contact: Flags
    slip: Flags
    direction: Array
    turning: Array
    line: Evaluated | None = None

    @classmethod
    def of(cls, contact: Flags, direction: Array, turning: Array | None = None) -> ActiveSets:
        """Return sets from the contact set and the directions, which are zero where points
        stick.
        """
        slip = length(direction) > 0.5
        return cls(contact, slip, direction, np.zeros(slip.size) if turning is None else turning)

    @classmethod
    def all_in_contact(cls, points: int, tangents: int) -> ActiveSets:
        """Return contact and stick everywhere: the unconstrained dual problem with which section 7
        starts.
        """
        return cls.of(np.ones(points, dtype=bool), np.zeros((points, tangents)))

    @property
    def side(self) -> npt.NDArray[np.int8]:
        """+1 and -1 on A_f,+ and A_f,- in 2D, +1 on all of A_f in 3D; 0 on I_f, shape (n,).

        In 3D a sign would depend on the choice of tangents.
        """
        signs = np.sign(self.direction[:, 0]) if self.direction.shape[1] == 1 else self.slip
        return signs.astype(np.int8)

    @property
    def turned(self) -> Array:
        """Directions of slip at the points whose shear resists perpendicular slip, shape (n, d -
        1); zero at the others.
        """
        return np.where((self.slip & (self.turning > 0))[:, None], self.direction, 0.0)

    def changed(self, reference: ActiveSets) -> Flags:
        """Return the points in another set than in ``reference``, or whose direction has turned by
        more than a right angle.
        """
        turned = inner(self.direction, reference.direction) < 0
        return (self.contact != reference.contact) | (self.slip != reference.slip) | turned

    def sticking(self, where: Flags) -> ActiveSets:
        """Return the sets with the points ``where`` put into I_f."""
        slip = self.slip & ~where
        return ActiveSets(
            self.contact,
            slip,
            np.where(slip[:, None], self.direction, 0.0),
            self.turning,
            self.line,
        )

    def across(self, vectors: Array) -> Array:
        """Return (I - e e^T) v, the part of vectors perpendicular to the direction, shape (n, d -
        1); zero in 2D.
        """
        return vectors - inner(self.direction, vectors)[:, None] * self.direction


def line_of_bound(sets: ActiveSets, data: RegularisedData) -> Evaluated:
    """Return the friction bound for fixed sets, affine in pressure and slip, see
    ``PointFriction.line``.

    A point that is about to open has a negative pressure for one step, so its bound may be
    negative.
    """
    assert data.bound is not None
    if data.follows is None:
        none = np.zeros_like(data.bound)
        return data.acting(data.bound), none, none
    line = sets.line or data.follows.line(np.zeros_like(data.bound), data.bilateral)
    at_zero, by_pressure, by_slip = map(data.acting, line)
    return at_zero, by_pressure, by_slip


def multipliers(
    sets: ActiveSets, u_n: Array, u_t: Array, data: RegularisedData
) -> tuple[Array, Array]:
    """Return (lambda, mu) of step 4, affine in (tau_N y, tau_T y) for fixed sets.

    lambda is lambda_hat + gamma_1 (tau_N y - d) on A_c and zero on I_c; mu is mu_hat + gamma_2
    tau_T y on I_f, and F g e + k (I - e e^T)(tau_T y + mu_hat / gamma_2) on A_f; zero without
    friction.
    """
    pressure = np.where(sets.contact, trial_pressure(u_n, data), 0.0)
    if data.bound is None:
        return pressure, np.zeros_like(u_t)
    at_zero, by_pressure, by_slip = line_of_bound(sets, data)
    along = inner(sets.direction, slip_of(u_t, data))
    bound = at_zero + by_pressure * pressure + by_slip * along
    trial = trial_shear(u_t, data)
    return pressure, np.where(
        sets.slip[:, None], sliding_shear(sets, bound, trial, data.gamma_t), trial
    )


def sliding_shear(sets: ActiveSets, bound: Array, trial: Array, per: float = 1.0) -> Array:
    """Return F g e + k (I - e e^T) s on A_f with s = ``trial`` / ``per``, where the second term is
    zero in 2D.

    The result is zero on I_f, where the bound may be infinite.
    """
    at_bound = np.where(sets.slip, bound, 0.0)[:, None] * sets.direction
    return (
        at_bound
        if trial.shape[1] == 1
        else at_bound + (sets.turning / per)[:, None] * sets.across(trial)
    )


def slip_multiplier(sets: ActiveSets, mu: Array, u_t: Array, data: RegularisedData) -> Array:
    """Return xi of step 5, tau_T y + (mu_hat - mu) / gamma_2 on A_f and zero on I_f; length, shape
    (n, d - 1).
    """
    return np.where(sets.slip[:, None], slip_of(u_t, data) + (data.mu_hat - mu) / data.gamma_t, 0.0)


def next_sets(u_n: Array, u_t: Array, xi: Array, mu: Array, data: RegularisedData) -> ActiveSets:
    """Return the active sets from an iterate (y, xi, mu), step 2 of Algorithm (SSN).

    A point that ``slips`` by (3.3c) does so in the direction of mu + xi / sigma.  A point whose
    bound is zero transmits no shear and takes the direction of its motion.
    """
    trial = trial_pressure(u_n, data)
    contact = (trial > 0) | data.bilateral
    if data.bound is None:
        return ActiveSets.of(contact, np.zeros_like(u_t))
    bound = data.friction_bound(trial, u_t)
    motion = slip_of(u_t, data)
    along_shear = np.where(slips(xi, mu, bound, data)[:, None], unit(mu + xi / data.sigma), 0.0)
    direction = np.where((bound > 0)[:, None], along_shear, unit(motion))
    along = data.gamma_t * inner(direction, motion) + inner(direction, data.mu_hat)
    reach = np.maximum(along, bound)
    where = (reach > 0) & np.isfinite(bound)
    turning = data.gamma_t * quotient(bound, reach, where)
    return ActiveSets.of(contact, direction, turning)


def classify(sets: ActiveSets, u_n: Array, u_t: Array, data: RegularisedData) -> ActiveSets:
    """Return the active sets k + 1 from the iterate y^k, which was computed with ``sets``."""
    trial = trial_shear(u_t, data)
    if data.bound is None:
        return next_sets(u_n, u_t, trial, trial, data)
    bound = data.friction_bound(trial_pressure(u_n, data), u_t)
    # At slip points mu is at its bound by construction, even if the pressure has changed its sign
    # or mu its direction.
    shear = sliding_shear(sets, bound, trial, data.gamma_t)
    direction = np.where(inner(shear, shear)[:, None] > 0, unit(shear), sets.direction)
    mu = np.where(sets.slip[:, None], np.where(sets.slip, bound, 0.0)[:, None] * direction, trial)
    return next_sets(u_n, u_t, slip_multiplier(sets, mu, u_t, data), mu, data)


def release(sets: ActiveSets, data: RegularisedData) -> ActiveSets:
    """Return the sets with slip in place of stick where no shear can be transmitted, as the bound,
    or the pressure that it depends on, is zero.

    In 2D these points slip along the tangent, in 3D without a direction, as none is distinguished.
    Where the bound is infinite all points stick.
    """
    if data.bound is None:
        return sets
    sets = sets.sticking(np.isinf(data.bound))
    free = ~(data.bound > 0)
    if data.follows is not None:
        free &= ~data.follows.acts | ~sets.contact
    first = np.full_like(sets.direction, 1.0 if sets.direction.shape[1] == 1 else 0.0)
    direction = np.where((free & ~sets.slip)[:, None], first, sets.direction)
    return ActiveSets(sets.contact, sets.slip | free, direction, sets.turning, sets.line)


def tangent(sets: ActiveSets, data: RegularisedData) -> Array:
    """Return the derivative (1.5) of (lambda, mu) with respect to (tau_N y, tau_T y) for fixed
    sets, stress per length, shape (n, d, d).

    It is symmetric unless the bound depends on the pressure, and indefinite where the bound
    decreases with the slip.
    """
    count, tangents = sets.direction.shape
    blocks = np.zeros((count, 1 + tangents, 1 + tangents))
    pressing = sets.contact & ~data.immovable
    blocks[:, 0, 0] = np.where(pressing, data.stiffness, 0.0)
    if data.bound is None:
        return blocks
    identity = np.eye(tangents)
    across = identity - sets.direction[:, :, None] * sets.direction[:, None, :]
    blocks[:, 1:, 1:] = np.where(
        sets.slip[:, None, None], sets.turning[:, None, None] * across, data.gamma_t * identity
    )
    if data.follows is not None:
        _, by_pressure, by_slip = line_of_bound(sets, data)
        blocks[:, 1:, 0] = sets.direction * (by_pressure * blocks[:, 0, 0])[:, None]
        along = sets.direction[:, :, None] * sets.direction[:, None, :]
        blocks[:, 1:, 1:] += by_slip[:, None, None] * along
    return blocks


def law_residual(sets: ActiveSets, u_n: Array, u_t: Array, data: RegularisedData) -> Array:
    """Return the distance of mu of these sets from the projection (3.4) of the iterate, stress,
    shape (n,).

    It is zero in 2D once the sets repeat.  In 3D a direction may still change while the sets stay
    the same.
    """
    pressure, mu = multipliers(sets, u_n, u_t, data)
    return length(mu - onto_disc(trial_shear(u_t, data), data.friction_bound(pressure, u_t)))


def hold(
    following: ActiveSets,
    sets: ActiveSets,
    u_t: Array,
    multipliers: Callable[[], tuple[Array, Array]],
    data: RegularisedData,
    motions: FreeMotions,
    escaping: Callable[[], Status | None],
) -> tuple[ActiveSets, Status | None, bool]:
    """Return sets near ``following`` that hold the body, the status if it moves away, and whether
    the sets differ from ``following``; collective.

    Args:
        following: the sets that follow from the iterate.
        sets: the sets with which the iterate was computed.
        u_t: tau_T y of the iterate.
        multipliers: returns (lambda, mu) of the iterate.
        data: the regularised problem.
        motions: free rigid motions.
        escaping: returns how the body moves away whatever the sets are, see ``statics.no_balance``;
            None: it may stay.
    """
    unresisted = motions.unheld(following.contact, _stick(following, data))
    if not unresisted.any():
        return following, None, False
    pressure, shear = multipliers()
    # Without finite values no sets can be chosen; the convergence test ends the iteration.
    if parallel.any_rank(
        motions.points.comm, not (np.isfinite(pressure).all() and np.isfinite(shear).all())
    ):
        return following, None, False
    bound = data.friction_bound(pressure, u_t)
    points = motions.points
    everywhere = motions.points.everywhere
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
    unresisted_points = unresisted[motions.of_point]  # of assemblies not held
    slipping = _ranked(
        points, unresisted_points & ~sets.slip & following.slip & able, length(shear) - bound
    )
    opening = _ranked(points, unresisted_points & sets.contact & ~following.contact, -pressure)
    for candidates, opens in (slipping, False), (opening, True):
        for share in _shares(_count(points, candidates)):
            kept = _least(points, candidates, share)
            held = following.sticking(kept & able & ~sets.slip)
            held = replace(held, contact=held.contact | kept) if opens else held
            if holds(held, data, motions):
                return held, None, True
    # The iterate is still far from a solution: hold the body with all nodes that can, and let the
    # next iterates release them.
    contact = following.contact | (unresisted_points & sets.contact)
    everything = replace(following, contact=contact).sticking(unresisted_points & contact & able)
    # The present sets may be those of a problem with another friction bound, which need not hold
    # the body either.
    last = replace(following, contact=following.contact | unresisted_points).sticking(
        unresisted_points & able
    )
    return (
        next((held for held in (everything, sets) if holds(held, data, motions)), last),
        None,
        True,
    )


def holds(sets: ActiveSets, data: RegularisedData, motions: FreeMotions) -> bool:
    """Return whether sets resist every rigid motion, in 3D also by the resistance of slipping
    points to a change of direction; collective.
    """
    return motions.held_by(sets.contact, _stick(sets, data), sets.turned)


def _stick(sets: ActiveSets, data: RegularisedData) -> Flags:
    """Return the points that resist tangential motion: those that stick, and those whose friction
    increases with the slip.
    """
    if data.bound is None:
        return np.zeros_like(sets.contact)
    return ~sets.slip if sets.line is None else ~sets.slip | (sets.line[2] > 0)


def _ranked(points: ContactPoints, candidates: Flags, violation: Array) -> Ints:
    """Return the rank of each candidate by its violation over all ranks of MPI, from 0; -1 for the
    other nodes.
    """
    # Positions break ties: in a uniform state all nodes or none would be kept otherwise.
    ranking = np.column_stack((violation, points.x))
    ordered = sorted(map(tuple, parallel.gather_rows(points.comm, ranking[candidates])))
    places = {row: position for position, row in enumerate(ordered)}
    result = np.full(candidates.size, -1, dtype=np.int64)
    result[candidates] = [places[tuple(row)] for row in ranking[candidates]]
    return result


def _count(points: ContactPoints, places: Ints) -> int:
    return int(parallel.total(points.comm, places >= 0))


def _shares(count: int) -> list[float]:
    """Return the shares of candidates to try: half, three quarters, ..., finally all but one; none
    if there is only one candidate.
    """
    shares = [1 - 0.5**power for power in range(1, 64) if 0.5**power * count > 1]
    return [*shares, 1 - 1 / count] if count > 1 else []


def _least(points: ContactPoints, places: Ints, share: float) -> Flags:
    """Return the given share of the candidates, those with the least violation, never all
    of them.
    """
    count = _count(points, places)
    return (places >= 0) & (places < min(round(share * count), count - 1))
