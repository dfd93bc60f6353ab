"""Results at the contact points, the same for every algorithm, and the functionals of section 3."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.contact.laws import ActiveSets, Nodal, RegularisedData, inner, project, trial_pressure
from signorini_fx.contact.laws import length as length_of
from signorini_fx.contact.points import STILL, ContactPoints


@dataclass(frozen=True, repr=False)
class PointState:
    """The contact points of this rank after a solve, arrays of shape (n,).

    Attributes:
        points: weights, and what supports let move.
        gap: d, length.
        u_n: tau_N y, length; u_n - gap > 0 is penetration.
        u_t: tau_T y, length, shape (n, d - 1).
        pressure: lambda = -sigma_N, stress.
        shear: mu = -sigma_T, stress, shape (n, d - 1).
        bound: friction bound F g, stress; zero without friction.
        in_contact: True on A_c.
        direction: unit vector of the shear on A_f, zero on I_f, shape (n, d - 1); in the plane +1 on A_f,+ and
            -1 on A_f,-.
        has_friction: whether a friction law acts.
        bilateral: points whose contact cannot open.
        slip_length: the slip that friction opposes, length: tau_T y, or its increment in a later load step, shape
            (n, d - 1).
        xi: its part beyond the elastic slip of the regularisation, length; zero at stick nodes, shape (n, d - 1).
    """

    points: ContactPoints
    gap: Nodal
    u_n: Nodal
    u_t: Nodal
    pressure: Nodal
    shear: Nodal
    bound: Nodal
    in_contact: npt.NDArray[np.bool_]
    direction: Nodal
    has_friction: bool
    bilateral: npt.NDArray[np.bool_]
    slip_length: Nodal
    xi: Nodal

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.points.size} points of this rank, {self.in_contact.sum()} in contact>"

    @cached_property
    def friction_work(self) -> float:
        """Energy dissipated by slip in this load step, (mu, xi) with xi of (3.3c), never negative;
        collective.

        xi is the slip without the elastic part that the regularisation adds, zero at stick nodes.
        """
        work = np.dot(self.points.weight, inner(self.shear, self.xi))
        return float(parallel.global_sum(self.points.comm, work))

    def sliding_side(self) -> npt.NDArray[np.int8]:
        """``ActiveSets.side``; a node that transmits no shear moves freely, forward but for round-off."""
        side = ActiveSets.of(self.in_contact, self.direction).side
        back = self.slip_length[:, 0] < -STILL * np.linalg.norm(np.column_stack((self.u_n, self.u_t)), axis=1)
        moving = np.where(back, -1, 1) if self.direction.shape[1] == 1 else np.ones(side.size)
        return np.where(self.bound > 0, side, moving).astype(np.int8)

    @cached_property
    def areas(self) -> dict[str, float]:
        """Areas (in the plane lengths) in contact, and of the nodes with a friction bound those that stick and slip;
        collective.
        """
        weight, slip = self.points.weight, self.sliding_side() != 0
        acting = self.bound > 0
        sums = [np.dot(weight, where) for where in (self.in_contact, acting & ~slip, acting & slip)]
        total = parallel.global_sum(self.points.comm, np.array(sums))
        return dict(zip(("contact", "stick", "slip"), map(float, total), strict=True))


@dataclass(frozen=True)
class Functionals:
    """Primal and dual functional of the regularised problem with a given friction bound, energies per thickness.

    Their difference is never negative for feasible lambda and mu, and zero where (3.3b) and (3.3c) hold; together with
    equilibrium (3.3a) it is a certificate of optimality.

    Attributes:
        primal: J_gamma(y) of section 3.
        dual: -J*_gamma(lambda, mu) of section 3, written for prescribed displacements that need not vanish.
    """

    primal: float
    dual: float

    @property
    def relative_gap(self) -> float:
        """(primal - dual) / |primal|."""
        return (self.primal - self.dual) / abs(self.primal) if self.primal != 0 else self.primal - self.dual


def functionals(elastic: float, contact: PointState, data: RegularisedData) -> Functionals:
    """Evaluate J_gamma (section 3) and its dual at a solution; collective.

    Args:
        elastic: a(y, y) / 2 - L(y), an energy per thickness.
        contact: the contact points.
        data: the regularised problem.

    The elastic part of the dual, min over y of a(y, y) / 2 - L(y) + (lambda, tau_N y) + (mu, tau_T y), is taken at the
    current displacement, which is its minimiser as far as (3.3a) holds.
    """
    c, w = contact, contact.points.weight
    pressure, shear = project(c.pressure, c.shear, data)
    bound = data.friction_bound(pressure)
    overlap, slip = c.u_n - c.gap, c.slip_length
    if np.isinf(data.gamma_n):  # the unregularised J of (P) and its dual (2.7)
        primal, dual = bound * length_of(slip), pressure * overlap + inner(shear, slip)
    else:
        trial = trial_pressure(c.u_n, data)
        pushing = np.where(c.bilateral, trial, np.maximum(0.0, trial))
        primal = pushing**2 / (2 * data.gamma_n) + _smoothed_friction(slip, data, bound)
        dual = (
            pressure * overlap
            + (data.lambda_hat**2 - (pressure - data.lambda_hat) ** 2) / (2 * data.gamma_n)
            + inner(shear, slip)
            + (inner(data.mu_hat, data.mu_hat) - inner(shear - data.mu_hat, shear - data.mu_hat)) / (2 * data.gamma_t)
        )
    sums = parallel.global_sum(
        contact.points.comm,
        np.array([np.dot(w, primal), np.dot(w, dual)]),
    )
    return Functionals(elastic + float(sums[0]), elastic + float(sums[1]))


def _smoothed_friction(slip: Nodal, data: RegularisedData, bound: Nodal) -> Nodal:
    """F g h(tau_T y, mu_hat) / gamma_2 of (3.2)."""
    trial = length_of(data.gamma_t * slip + data.mu_hat)
    sliding = bound * (trial - bound / 2)
    return np.where(trial >= bound, sliding, trial**2 / 2) / data.gamma_t
