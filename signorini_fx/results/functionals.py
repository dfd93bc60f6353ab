"""The primal and the dual functional of section 3 at a solution, whose difference certifies that it is optimal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signorini_fx.algebra.contact.complementarity import RegularisedData, project, trial_pressure
from signorini_fx.algebra.contact.nodal_vectors import Nodal, inner, length
from signorini_fx.algebra.contact.state import PointState
from signorini_fx.machine import parallel


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
    """Evaluate J_gamma (section 3) and its dual at a solution; ``elastic``: a(y, y) / 2 - L(y), an energy per
    thickness; collective.

    The elastic part of the dual, min over y of a(y, y) / 2 - L(y) + (lambda, tau_N y) + (mu, tau_T y), is taken at the
    current displacement, which is its minimiser as far as (3.3a) holds.
    """
    c, w = contact, contact.points.weight
    pressure, shear = project(c.pressure, c.shear, data)
    bound = data.friction_bound(pressure)
    overlap, slip = c.u_n - c.gap, c.slip_length
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
    trial = length(data.gamma_t * slip + data.mu_hat)
    sliding = bound * (trial - bound / 2)
    return np.where(trial >= bound, sliding, trial**2 / 2) / data.gamma_t
