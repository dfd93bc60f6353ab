"""The pointwise contact and friction maps and their generalised derivatives.  Nodal arrays only, no finite elements.

Every array has one entry per contact node of this rank.  Pressures and shears are stresses, lambda and mu of the paper:
lambda >= 0 pushes the body off the foundation, mu = -sigma_T acts against tau_T y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Nodal = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ActiveSets:
    """The sets of Algorithm (SSN), step 2.

    Attributes:
        contact: True on A_c, False on I_c.
        slip: +1 on A_f,+; -1 on A_f,-; 0 on I_f (stick).
    """

    contact: npt.NDArray[np.bool_]
    slip: npt.NDArray[np.int8]

    @classmethod
    def all_in_contact(cls, nodes: int) -> ActiveSets:
        """Contact and stick everywhere: the unconstrained dual problem with which section 7 starts."""
        return cls(np.ones(nodes, dtype=bool), np.zeros(nodes, dtype=np.int8))

    def changed(self, other: ActiveSets) -> npt.NDArray[np.bool_]:
        """The nodes that are in another set in ``other``."""
        return (self.contact != other.contact) | (self.slip != other.slip)


@dataclass(frozen=True)
class RegularisedData:
    """The data of the regularised problem (P_gamma) on the contact nodes: all that outer algorithms ever change.

    Attributes:
        gap: d, length.
        gamma_n: gamma_1, stress per length.
        gamma_t: gamma_2, stress per length.
        sigma: sigma of (3.3c), length per stress; infinite: a node passes through stick between the slip sets.
        lambda_hat: shift of the contact pressure, stress.
        mu_hat: shift of the shear, stress.
        bound: given friction bound F g, stress; None if there is no friction.
        coupling: F where the bound is F lambda(y) of the iterate itself (monolithic Coulomb friction), added to
            ``bound``; None where the bound is given.
        bilateral: nodes whose contact cannot open; None: there are none.
        slip_origin: tau_T y from which slip counts, length: the law of the paper is total, with origin zero; with load
            steps it acts on the increment, with mu_hat the shear of the step before.
    """

    gap: Nodal
    gamma_n: float
    gamma_t: float
    sigma: float
    lambda_hat: Nodal
    mu_hat: Nodal
    bound: Nodal | None
    coupling: Nodal | None = None
    bilateral: npt.NDArray[np.bool_] | None = None
    slip_origin: Nodal | None = None

    @property
    def has_friction(self) -> bool:
        """Whether a friction condition is part of the problem."""
        return self.bound is not None

    def friction_bound(self, pressure: Nodal) -> Nodal:
        """The bound of |mu| at the contact pressure lambda, stress; zero without friction."""
        if self.bound is None:
            return np.zeros_like(pressure)
        return self.bound if self.coupling is None else self.bound + self.coupling * np.maximum(pressure, 0.0)


def slip_of(u_t: Nodal, data: RegularisedData) -> Nodal:
    """The tangential displacement that friction acts against."""
    return u_t if data.slip_origin is None else u_t - data.slip_origin


def keep_closed(contact: npt.NDArray[np.bool_], data: RegularisedData) -> npt.NDArray[np.bool_]:
    """The contact set with the bilateral nodes, which belong to it always."""
    return contact if data.bilateral is None else contact | data.bilateral


def trial_pressure(u_n: Nodal, data: RegularisedData) -> Nodal:
    """lambda_hat + gamma_1 (tau_N y - d), whose positive part is lambda (3.3b)."""
    return data.lambda_hat + data.gamma_n * (u_n - data.gap)


def multipliers(sets: ActiveSets, u_n: Nodal, u_t: Nodal, data: RegularisedData) -> tuple[Nodal, Nodal]:
    """(lambda, mu) of step 4.

    lambda is lambda_hat + gamma_1 (tau_N y - d) on A_c and zero on I_c; mu is mu_hat + gamma_2 tau_T y on I_f, -F g on
    A_f,- and F g on A_f,+, and zero without friction.
    """
    pressure = np.where(sets.contact, trial_pressure(u_n, data), 0.0)
    if data.bound is None:
        return pressure, np.zeros_like(u_t)
    # A node about to leave has a negative pressure for one step, and its bound follows: the map stays affine.
    bound = data.bound if data.coupling is None else data.bound + data.coupling * pressure
    stick = data.mu_hat + data.gamma_t * slip_of(u_t, data)
    return pressure, np.where(sets.slip == 0, stick, at_bound(sets, bound))


def at_bound(sets: ActiveSets, bound: Nodal) -> Nodal:
    """-F g on A_f,-, F g on A_f,+ and zero on I_f, where the bound may be infinite."""
    return sets.slip * np.where(sets.slip == 0, 0.0, bound)


def slip_multiplier(sets: ActiveSets, mu: Nodal, u_t: Nodal, data: RegularisedData) -> Nodal:
    """Xi of step 5: tau_T y + (mu_hat - mu) / gamma_2, which is zero on I_f."""
    return np.where(sets.slip == 0, 0.0, slip_of(u_t, data) + (data.mu_hat - mu) / data.gamma_t)


def next_sets(u_n: Nodal, u_t: Nodal, xi: Nodal, mu: Nodal, data: RegularisedData) -> ActiveSets:
    """The active sets from an iterate (y, xi, mu), step 2 of Algorithm (SSN).

    A node whose bound is zero transmits nothing and belongs to the side to which it moves; ``transmitting`` leaves it
    out.
    """
    trial = trial_pressure(u_n, data)
    contact = keep_closed(trial > 0, data)
    if data.bound is None:
        return ActiveSets(contact, np.zeros(contact.shape, dtype=np.int8))
    bound = data.friction_bound(trial)
    if math.isinf(data.sigma):
        # The limit of the tests below: unless mu is at this bound, sigma decides alone.
        plus = (mu > bound) | ((mu == bound) & (xi > 0))
        minus = (mu < -bound) | ((mu == -bound) & (xi < 0))
    else:
        plus = xi + data.sigma * (mu - bound) > 0
        minus = xi + data.sigma * (mu + bound) < 0
    free = np.where(slip_of(u_t, data) < 0, -1, 1)
    slip = np.where(bound == 0, free, plus.astype(np.int8) - minus.astype(np.int8))
    return ActiveSets(contact, slip.astype(np.int8))


def classify(sets: ActiveSets, u_n: Nodal, u_t: Nodal, data: RegularisedData) -> ActiveSets:
    """The active sets k + 1 from the iterate y^k, which was computed with ``sets``."""
    _, mu = multipliers(sets, u_n, u_t, data)
    if data.coupling is not None:
        # At slip nodes mu is at its bound by construction, also where the pressure changes sign.
        mu = np.where(sets.slip == 0, mu, at_bound(sets, data.friction_bound(trial_pressure(u_n, data))))
    return next_sets(u_n, u_t, slip_multiplier(sets, mu, u_t, data), mu, data)


def release(sets: ActiveSets, data: RegularisedData) -> ActiveSets:
    """The sets without stick where nothing can be transmitted: the bound is zero, or follows a pressure that is."""
    if data.bound is None:
        return sets
    free = data.bound == 0
    if data.coupling is not None:
        free &= (data.coupling == 0) | ~sets.contact
    return ActiveSets(sets.contact, np.where(free & (sets.slip == 0), 1, sets.slip).astype(np.int8))


def transmitting(sets: ActiveSets, bound: Nodal) -> ActiveSets:
    """The sets with the nodes that can transmit no shear put into I_f, for counting and comparing."""
    return ActiveSets(sets.contact, np.where(bound > 0, sets.slip, 0).astype(np.int8))


def tangent_coefficients(sets: ActiveSets, data: RegularisedData) -> tuple[Nodal, Nodal, Nodal | None]:
    """Derivatives (1.5) for fixed sets: d lambda / d tau_N y, d mu / d tau_T y, d mu / d tau_N y (None if zero)."""
    normal = np.where(sets.contact, data.gamma_n, 0.0)
    if data.bound is None:
        return normal, np.zeros_like(normal), None
    tangential = np.where(sets.slip == 0, data.gamma_t, 0.0)
    return normal, tangential, None if data.coupling is None else sets.slip * data.coupling * normal


def project(pressure: Nodal, shear: Nodal, data: RegularisedData) -> tuple[Nodal, Nodal]:
    """(lambda, mu) made feasible, lambda >= 0 and |mu| <= F g, as section 7 does before the update of inexact ALM."""
    pushing = np.maximum(pressure, 0.0)
    pressure = pushing if data.bilateral is None else np.where(data.bilateral, pressure, pushing)
    bound = data.friction_bound(pressure)
    return pressure, np.clip(shear, -bound, bound)


@dataclass(frozen=True)
class FrictionLaw:
    """The friction bound as a function of the contact pressure: given + coefficient * lambda.

    Attributes:
        given: Tresca's g, stress; zero at other nodes.
        coefficient: Coulomb's F; zero at other nodes.
        cap: largest bound, stress; None: unlimited.
    """

    given: Nodal
    coefficient: Nodal
    cap: Nodal | None = None

    def bound(self, pressure: Nodal) -> Nodal:
        """F g with g = lambda at Coulomb nodes (6.1), stress; |lambda| where contact is bilateral."""
        bound = self.given + self.coefficient * np.abs(pressure)
        return bound if self.cap is None else np.minimum(bound, self.cap)
