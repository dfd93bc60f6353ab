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
        bound: F g, stress; None if there is no friction.
    """

    gap: Nodal
    gamma_n: float
    gamma_t: float
    sigma: float
    lambda_hat: Nodal
    mu_hat: Nodal
    bound: Nodal | None

    @property
    def has_friction(self) -> bool:
        """Whether a friction condition is part of the problem."""
        return self.bound is not None


def contact_pressure(sets: ActiveSets, u_n: Nodal, data: RegularisedData) -> Nodal:
    """lambda of step 4: lambda_hat + gamma_1 (tau_N y - d) on A_c, zero on I_c."""
    return np.where(sets.contact, data.lambda_hat + data.gamma_n * (u_n - data.gap), 0.0)


def tangential_traction(sets: ActiveSets, u_t: Nodal, data: RegularisedData) -> Nodal:
    """mu of step 4: mu_hat + gamma_2 tau_T y on I_f, -F g on A_f,-, F g on A_f,+; zero without friction."""
    if data.bound is None:
        return np.zeros_like(u_t)
    return np.where(sets.slip == 0, data.mu_hat + data.gamma_t * u_t, sets.slip * data.bound)


def slip_multiplier(sets: ActiveSets, u_t: Nodal, data: RegularisedData) -> Nodal:
    """xi of step 5: tau_T y + (mu_hat -+ F g) / gamma_2 on A_f,+-, zero on I_f."""
    if data.bound is None:
        return np.zeros_like(u_t)
    return np.where(sets.slip == 0, 0.0, u_t + (data.mu_hat - sets.slip * data.bound) / data.gamma_t)


def classify(sets: ActiveSets, u_n: Nodal, u_t: Nodal, data: RegularisedData) -> ActiveSets:
    """The active sets k + 1 from iterate k, which was computed with ``sets`` (step 2 of Algorithm SSN)."""
    contact = data.lambda_hat + data.gamma_n * (u_n - data.gap) > 0
    if data.bound is None:
        return ActiveSets(contact, np.zeros_like(sets.slip))
    mu = tangential_traction(sets, u_t, data)
    xi = slip_multiplier(sets, u_t, data)
    if math.isinf(data.sigma):
        # The limit of the tests below: where mu is inside the bounds or at the other one, sigma decides alone.
        plus = (mu > data.bound) | ((mu == data.bound) & (xi > 0))
        minus = (mu < -data.bound) | ((mu == -data.bound) & (xi < 0))
    else:
        plus = xi + data.sigma * (mu - data.bound) > 0
        minus = xi + data.sigma * (mu + data.bound) < 0
    # Where nothing can be transmitted there is no stick and no side: one name for it, or the sets would never repeat.
    slip = np.where(data.bound == 0, 1, plus.astype(np.int8) - minus.astype(np.int8))
    return ActiveSets(contact, slip.astype(np.int8))


def tangent_coefficients(sets: ActiveSets, data: RegularisedData) -> tuple[Nodal, Nodal]:
    """d lambda / d tau_N y and d mu / d tau_T y for fixed sets: the generalised derivative (1.5)."""
    normal = np.where(sets.contact, data.gamma_n, 0.0)
    if data.bound is None:
        return normal, np.zeros_like(normal)
    return normal, np.where(sets.slip == 0, data.gamma_t, 0.0)


@dataclass(frozen=True)
class FrictionLaw:
    """The friction bound as a function of the contact pressure: given + coefficient * lambda.

    Attributes:
        given: Tresca's g, stress; zero at other nodes.
        coefficient: Coulomb's F; zero at other nodes.
    """

    given: Nodal
    coefficient: Nodal

    def bound(self, pressure: Nodal) -> Nodal:
        """F g with g = lambda at Coulomb nodes (6.1), stress."""
        return self.given + self.coefficient * pressure
