"""The pointwise contact and friction conditions in d dimensions, (3.2) to (3.4).

Every array has one entry per contact point of this rank.  A tangential vector has d - 1 components
in the tangent plane of its point, shape (n, d - 1): one in 2D, two in 3D.  Pressures and shears are
stresses, lambda and mu of the paper: lambda >= 0 pushes the body off the foundation, mu = -sigma_T
acts against tau_T y.

The friction law is the projection onto the disc |mu| <= F g of R^(d - 1).  In R^1 the disc is an
interval, a direction is a sign, and what follows is the paper's Algorithm (SSN).  In R^2 a slipping
point carries the direction e of its shear, and its shear for fixed sets is

    mu = F g e + k (I - e e^T) s,    s = tau_T y + mu_hat / gamma_2,
    k = F g / max(e . s, F g / gamma_2),

with e and k of the previous iterate: the projection (3.4) with its derivative taken at mu, not at
gamma_2 s (the dual form of (3.3c); Stadler, SIAM J. Optim. 15 (2004) 39-62, and Hueber, Stadler,
Wohlmuth, SIAM J. Sci. Comput. 30 (2008) 572-596, for the disc).  In R^1 the second term vanishes.

This module has the data (3.2), the contact condition (3.3b), the friction condition (3.3c) and the
projection (3.4); the sets that follow from them, and the derivatives for fixed sets, are in
``active_sets``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from signorini_fx.algebra import Settings
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.arrays import Array, Flags, inner, length, unit
from signorini_fx.tuned import AUTOMATIC_GAMMA, SAME_NUMBER

if TYPE_CHECKING:
    from signorini_fx.algebra.contact.bond import Bond


@dataclass(frozen=True)
class RegularisedData:
    """The data of the regularised problem (P_gamma) at the contact points; outer algorithms change
    nothing else.

    Attributes:
        gap: d, length, shape (n,).
        gamma_n: gamma_1, stress per length.
        gamma_t: gamma_2, stress per length.
        sigma: sigma of (3.3c), length per stress; inf: a point that slips one way sticks for one
            iterate before it slips the other way.
        lambda_hat: shift of the contact pressure, stress, shape (n,).
        mu_hat: shift of the shear, stress, shape (n, d - 1).
        bound: given friction bound F g, stress, shape (n,); None without friction.
        bilateral: points whose contact cannot open, shape (n,).
        immovable: points that cannot move along their normal, see ``ContactPoints``, shape (n,); no
            pressure acts there, as supports would take it.
        slip_origin: tau_T y from which slip counts, length, shape (n, d - 1).  The law of the paper
            is total, with origin zero; with load steps it acts on the increment, and mu_hat is the
            shear of the previous step.
        follows: the friction law whose bound at the pressure lambda(y) of the iterate is used
            (monolithic Coulomb friction); ``bound`` is then its part without pressure.  None: the
            bound is given.
        share: stiffness of soft contact as a share of gamma_1, shape (n,); None: gamma_1
            everywhere.
        bond: the bonds that hold points together; None: there are none.
        broken: share of the friction bound that acts, equal to the damage of the bond, shape (n,);
            None: all of it.
    """

    gap: Array
    gamma_n: float
    gamma_t: float
    sigma: float
    lambda_hat: Array
    mu_hat: Array
    bound: Array | None
    bilateral: Flags
    immovable: Flags
    slip_origin: Array
    follows: PointFriction | None = None
    share: Array | None = None
    bond: Bond | None = None
    broken: Array | None = None

    @classmethod
    def unshifted(
        cls,
        gap: Array,
        tangents: int,
        settings: Settings,
        natural_gamma: float,
        law: PointFriction | None,
        bilateral: Flags,
        immovable: Flags,
    ) -> RegularisedData:
        """Return the problem without shifts, with the given part of the friction bound.

        Args:
            gap: d, length, shape (n,).
            tangents: number of tangents at a point, d - 1.
            settings: gives the gammas and sigma.
            natural_gamma: the unit of gamma where it is automatic, stress per length.
            law: the friction law; None: without friction.
            bilateral: points whose contact cannot open, shape (n,).
            immovable: points that cannot move along their normal, shape (n,).
        """
        automatic = AUTOMATIC_GAMMA * natural_gamma
        return cls(
            gap,
            automatic if settings.gamma_n == "auto" else settings.gamma_n,
            automatic if settings.gamma_t == "auto" else settings.gamma_t,
            np.inf if settings.sigma == "auto" else settings.sigma,
            np.zeros(gap.size),
            np.zeros((gap.size, tangents)),
            None if law is None else law.given,
            bilateral,
            immovable,
            np.zeros((gap.size, tangents)),
        )

    @property
    def stiffness(self) -> Array | float:
        """The stiffness of contact, gamma_1 or that of soft contact, stress per length; shape (n,)
        if it varies.
        """
        return self.gamma_n if self.share is None else self.gamma_n * self.share

    def softer(self, stiffness: float) -> RegularisedData:
        """Return the data with both gammas limited to a stiffness, stress per length."""
        gamma_n = min(self.gamma_n, stiffness)
        share = None if self.share is None else np.minimum(self.stiffness, stiffness) / gamma_n
        return replace(self, gamma_n=gamma_n, gamma_t=min(self.gamma_t, stiffness), share=share)

    def friction_bound(self, pressure: Array, u_t: Array) -> Array:
        """Return the bound of |mu| for a contact pressure lambda and a displacement tau_T y,
        stress, shape (n,); zero without friction.
        """
        if self.bound is None:
            return np.zeros_like(pressure)
        if self.follows is None:
            return self.acting(self.bound)
        pushing = np.where(self.bilateral, pressure, np.maximum(pressure, 0.0))
        return self.acting(self.follows.evaluate(pushing, length(slip_of(u_t, self)))[0])

    def at(self, traces: tuple[Array, Array]) -> RegularisedData:
        """Return the data with the damage of bonds at displacements (tau_N y, tau_T y)."""
        return self if self.bond is None else replace(self, broken=self.bond.damaged(traces))

    def acting(self, bound: Array) -> Array:
        """Return the part of a friction bound, or of its derivative, that acts beside the bonds,
        shape (n,).
        """
        return bound if self.broken is None else self.broken * bound


def slip_of(u_t: Array, data: RegularisedData) -> Array:
    """Return the tangential displacement that friction opposes, length, shape (n, d - 1)."""
    return u_t - data.slip_origin


def trial_pressure(u_n: Array, data: RegularisedData) -> Array:
    """Return lambda_hat + gamma_1 (tau_N y - d), whose positive part is lambda (3.3b); zero at
    immovable points.
    """
    trial = data.lambda_hat + data.stiffness * (u_n - data.gap)
    return np.where(data.immovable, 0.0, trial)


def trial_shear(u_t: Array, data: RegularisedData) -> Array:
    """Return mu_hat + gamma_2 tau_T y, whose projection onto the disc |mu| <= F g is mu (3.4)."""
    return data.mu_hat + data.gamma_t * slip_of(u_t, data)


def slips(xi: Array, mu: Array, bound: Array, data: RegularisedData) -> Flags:
    """Return the points that slip by the friction condition (3.3c), |mu + xi / sigma| > F g, shape
    (n,).

    The slip multiplier xi, length, is zero at the others.  With infinite sigma the sign of |mu| - F
    g decides, and mu . xi where mu is at its bound.
    """
    size = length(mu)
    over = size - bound
    # sigma (|mu + xi / sigma|^2 - F^2 g^2) = sigma (|mu|^2 - F^2 g^2) + this.
    leaning = 2.0 * inner(mu, xi) + inner(xi, xi) / data.sigma
    if np.isinf(data.sigma):
        return np.where(
            np.abs(over) <= SAME_NUMBER * np.where(np.isfinite(bound), bound, 0.0),
            leaning > 0,
            over > 0,
        )
    return data.sigma * over * (size + bound) + leaning > 0


def onto_disc(shear: Array, bound: Array) -> Array:
    """Return the projection of (3.4): the shear where |mu| <= F g, otherwise F g mu / |mu|; the
    bound may be infinite.
    """
    beyond = length(shear) > bound
    return np.where(beyond[:, None], np.where(beyond, bound, 0.0)[:, None] * unit(shear), shear)


def project(
    pressure: Array, shear: Array, u_t: Array, data: RegularisedData
) -> tuple[Array, Array]:
    """Return (lambda, mu) made feasible, lambda >= 0 and |mu| <= F g, as section 7 does before the
    update of inexact ALM.
    """
    pressure = np.where(data.bilateral, pressure, np.maximum(pressure, 0.0))
    return pressure, onto_disc(shear, data.friction_bound(pressure, u_t))
