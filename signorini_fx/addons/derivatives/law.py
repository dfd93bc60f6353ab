"""The contact and friction law linearised at a solution, for derivatives of the solution by its data.

For fixed sets the law is affine: a change dx of the unknowns, dd of gap and origin, and c of the traction at a given
displacement (by another friction coefficient, say) change the traction by dt = D (B dx - dd) + c, with the blocks D of
the Newton tangent.  Without regularisation the tied components, the normal one in contact and the tangential ones of
stick, do not change at all, B dx = dd, and their tractions are unknown; a finite gamma in D is then that of an
iteration which finds them, see ``derivatives.adjoint``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.nodal_vectors import Nodal, inner, length, unit
from signorini_fx.algebra.contact.state import PointState
from signorini_fx.machine import parallel
from signorini_fx.tuned import CERTIFICATE_TOLERANCE


@dataclass(frozen=True)
class LinearisedLaw:
    """The law at the n points of this rank.

    Attributes:
        tied: components whose displacement the law prescribes, or would without regularisation, shape (n, d).
        spread: E, from their tractions to all components: the friction bound follows the pressure, shape (n, d, d).
        turning: the rest of the tangent, by which the shear follows the direction of slip, stress per length, shape
            (n, d, d).
        gamma: stiffness of each component, stress per length, shape (d,).
        exact: whether there is no regularisation.
        slip: e where the shear is at its bound, else zero, shape (n, d - 1).
        between: points of all ranks that stand between two sets, where derivatives are one-sided.
        slips: by how much more slips change with displacements than these along the contact do, as they turn it,
            without unit, shape (n, d - 1, d); None: by nothing.
    """

    tied: npt.NDArray[np.bool_]
    spread: Nodal
    turning: Nodal
    gamma: Nodal
    exact: bool
    slip: Nodal
    between: int
    slips: Nodal | None = None

    @property
    def tangent(self) -> Nodal:
        """D by displacements of the points, stress per length, shape (n, d, d)."""
        tied, slopes = self.spread * (self.gamma * self.tied)[:, None, :], self.turning
        if not self.exact:
            tied, slopes = np.zeros_like(tied), slopes + tied
        return (slopes if self.slips is None else slopes + slopes[:, :, 1:] @ self.slips) + tied

    def by_bound(self, change: Nodal) -> Nodal:
        """C of a change of the friction bound, stress, shape (n, d)."""
        moving = length(self.slip) > 0
        shear = np.where(moving, change, 0.0)[:, None] * self.slip
        return np.column_stack((np.zeros(len(shear)), shear))

    def by_slips(self, owed: Nodal) -> Nodal:
        """What is owed to gaps and slips that the law prescribes, from what is owed to displacements, shape (n, d)."""
        if self.slips is None or not self.exact:
            return owed
        normal, along = self.slips[:, :, 0], np.eye(self.slips.shape[1]) + self.slips[:, :, 1:]
        slips = np.asarray(np.linalg.solve(along.transpose(0, 2, 1), owed[:, 1:, None])[:, :, 0], dtype=np.float64)
        return np.column_stack((owed[:, 0] - inner(slips, normal), slips))

    def tied_tractions(self, tractions: Nodal) -> Nodal:
        """E^T of them in the tied components, shape (n, d)."""
        return np.where(self.tied, np.einsum("nji,nj->ni", self.spread, tractions), 0.0)


def linearised(
    state: PointState,
    law: PointFriction | None,
    gamma: tuple[float, float],
    *,
    exact: bool,
    before: Nodal | None = None,
) -> LinearisedLaw:
    """The law at a solution; collective.

    Args:
        state: the contact points.
        law: of friction; None: there is none.
        gamma: (gamma_1, gamma_2), stress per length; those of the regularisation unless ``exact``.
        exact: whether there is no regularisation.
        before: the shear at the beginning of the load step, stress, shape (n, d - 1); None: zero.
    """
    contact, (count, tangents) = state.in_contact, state.shear.shape
    law = law if state.has_friction else None
    coefficient = np.zeros(count) if law is None else law.derivative(state.pressure)
    moves = np.any(state.direction != 0, axis=1) | ~(state.bound > 0)
    slips = moves & (state.bound > 0)
    slip = np.where(slips[:, None], unit(state.shear), 0.0)
    coefficient = np.where(slips, coefficient, 0.0)  # it may be infinite where there is no pressure
    spread = np.broadcast_to(np.eye(1 + tangents), (count, 1 + tangents, 1 + tangents)).copy()
    spread[:, 1:, 0] = slip * coefficient[:, None]
    tied = np.repeat((~moves & (state.bound > 0))[:, None], 1 + tangents, axis=1)
    tied[:, 0] = contact
    bound = np.where(slips & np.isfinite(state.bound), state.bound, 0.0)
    along = gamma[1] * inner(slip, state.slip_length)
    if not exact:
        reach = np.maximum(along + (0.0 if before is None else inner(slip, before)), bound)
    else:  # where the slip is hardly any the shear turns as if it were regularised
        reach = np.maximum(along, bound * CERTIFICATE_TOLERANCE)
    share = gamma[1] * np.divide(bound, reach, out=np.zeros(count), where=reach > 0)
    turning = np.zeros_like(spread)
    turning[:, 1:, 1:] = share[:, None, None] * (np.eye(tangents) - slip[:, :, None] * slip[:, None, :])
    between = _between(state, gamma, slips, ~moves)
    return LinearisedLaw(tied, spread, turning, np.array([gamma[0], *[gamma[1]] * tangents]), exact, slip, between)


def _between(
    state: PointState, gamma: tuple[float, float], slips: npt.NDArray[np.bool_], sticks: npt.NDArray[np.bool_]
) -> int:
    """Points of all ranks that would change their set if hardly anything changed; collective."""
    comm = state.points.comm
    largest = parallel.largest(comm, np.abs(state.pressure))
    size = np.where(state.in_contact, state.pressure, gamma[0] * (state.u_n - state.gap))
    opening = ~state.bilateral & (np.abs(size) <= CERTIFICATE_TOLERANCE * largest)
    bound = np.where(np.isfinite(state.bound), state.bound, 0.0)
    tolerance = CERTIFICATE_TOLERANCE * bound
    stopping = slips & (gamma[1] * length(state.xi) <= tolerance)
    starting = sticks & np.isfinite(state.bound) & (bound - length(state.shear) <= tolerance)
    return int(parallel.global_sum(comm, np.array(np.count_nonzero(opening | stopping | starting))))
