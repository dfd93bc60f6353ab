"""Algorithm (ALM), section 5: the first-order augmented Lagrangian method, for any friction law.

``Augmentation`` updates the shifts lambda_hat and mu_hat, decides whether they have converged, and
chooses the next gamma.

For fixed sets an update reduces an error e of the multipliers to r e, with r = k / (k + gamma) and
k the stiffness at the contact nodes.  The limit is the same for every gamma, but with a small gamma
an iterate changes little although it is far from the limit, and the two multipliers have different
gammas.  So a small change alone does not mean convergence.  Two criteria are used.  First, the
remaining error is estimated as the change times r / (1 - r), with the observed r or that of the
largest k, whichever is smaller.  Second, the displacement itself must satisfy the contact
conditions of the limit: a fixed point may contract more slowly than r, and the shear at one node
may still turn towards its slip without effect on any norm.

If a multiplier converges slowly its gamma is increased, up to ten times k.  A given gamma so large
that its round-off would hide the limit is reduced.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData, slip_of
from signorini_fx.arrays import Array, inner, quotient, unit
from signorini_fx.arrays import length as length_of
from signorini_fx.records import Status
from signorini_fx.tuned import GAMMA_GROWTH, NEGLIGIBLE


@dataclass
class Augmentation:
    """An augmented Lagrangian iteration on the problems that an inner method solves.

    Attributes:
        newton: the inner method.
        natural: a gamma with which few updates suffice on cells that are not refined many times,
            stress per length.
        tolerance: for the errors of lambda and mu in the norm of L2(Gamma_c), relative to their own
            norms, and for penetration and elastic slip, relative to the displacements; applied to
            each group of points.
        changes: the last changes of pressure and of shear, without what supports take, in the L2
            norm, shape (groups,) each; nan before the first update.
        slow: whether pressure and shear converged slowly at the last update.
        left: remaining relative error of the multipliers.
        violation: largest violation of the contact conditions, dimensionless: penetration and
            elastic slip relative to the displacements of the contact nodes, and misalignment of
            slip and shear. The misalignment is the smaller of the slip, relative to the
            displacements, and of the part of the shear that does not point along the slip, relative
            to the largest stress.
    """

    newton: SemismoothNewton
    natural: float
    tolerance: float
    changes: tuple[Array, Array] = (np.array([np.nan]), np.array([np.nan]))
    slow: tuple[bool, bool] = (False, False)
    left: float = np.inf
    violation: float = np.inf
    _stiffness: Array = field(init=False)

    def __post_init__(self) -> None:
        system = self.newton.problem.system
        self._stiffness = self.newton.problem.groups.largest(
            system.contact.stiffness(system.matrix.getDiagonal())
        )

    @property
    def settled(self) -> bool:
        """Whether both multipliers have converged to the tolerance."""
        return max(self.left, self.violation) <= self.tolerance

    def measure(self, data: RegularisedData) -> float:
        """Evaluate the solved problem: update ``changes``, ``slow``, ``left`` and ``violation``.
        Collective.

        Args:
            data: the problem just solved, with the shifts that it started from.

        Returns:
            Relative change of the multipliers, the largest of all groups of points.
        """
        newton = self.newton
        old_shifts = (data.lambda_hat, data.mu_hat)
        points = newton.problem.points
        groups = newton.problem.groups
        new_shifts = newton.shifts(data)
        differences = new_shifts[0] - old_shifts[0], new_shifts[1] - old_shifts[1]
        felt, felt_before, moved = (
            (points.felt(normal, shear), points.felt(shear, normal))
            for normal, shear in (new_shifts, old_shifts, differences)
        )
        now, last_size = (
            groups.norms(movement) + groups.norms(floor) for movement, floor in (felt, felt_before)
        )
        changes = groups.norms(moved[0]), groups.norms(moved[1])
        round_off = (
            newton.problem.round_off(newton.x)
            if newton.problem.bonds_alone
            else np.zeros(len(moved[0]))
        )
        size = np.maximum(groups.scales(np.where(now > 0, now, last_size)), groups.norms(round_off))
        gammas = (data.gamma_n, data.gamma_t)
        u_n, u_t = newton.problem.system.contact.traces(newton.x)
        length = groups.scales(
            groups.largest(np.maximum(np.abs(u_n), length_of(u_t))), lengths=True
        )
        # If all motion is round-off, the scale is the displacement that the tractions could cause.
        stress = np.maximum(
            groups.scales(groups.largest(np.maximum(*felt))), groups.largest(round_off)
        )
        length = np.maximum(length, quotient(NEGLIGIBLE * stress, self._stiffness))
        lengths, stresses = (
            np.where(movement > 0, movement, 1.0)[groups.number] for movement in (length, stress)
        )
        # At its bound, that of the problem just solved, the shear gives no information about slip.
        sticks = length_of(new_shifts[1]) < data.friction_bound(newton.multipliers()[0], u_t)
        open_at = np.abs(differences[0]), length_of(differences[1]) * sticks
        slip = slip_of(u_t, data)
        shear = new_shifts[1]
        way = unit(slip)
        astray = shear - np.maximum(inner(shear, way), 0.0)[:, None] * way
        with np.errstate(over="ignore"):  # overflow: the other quotient counts
            wrong = np.minimum(length_of(slip) / lengths, length_of(astray) / stresses)
        least = (np.zeros(groups.count), groups.largest(wrong))
        lefts = []
        violations = []
        slow = []
        for change, last, gamma, movement, floor in zip(
            changes, self.changes, gammas, open_at, least, strict=True
        ):
            share = quotient(change, last, otherwise=np.nan)
            beyond = quotient(share, 1 - share, otherwise=np.inf)
            times = np.maximum(1.0, np.fmin(beyond, self._stiffness / gamma))
            ahead = change * times
            remaining = quotient(ahead, size, otherwise=ahead)
            missed = groups.largest(movement) / gamma
            violation = np.maximum(floor, quotient(missed, length, otherwise=missed))
            far = np.maximum(remaining, violation) > self.tolerance
            slow.append(bool(np.any((share > 1 / GAMMA_GROWTH) & far)))
            lefts.append(remaining)
            violations.append(violation)
        self.changes = changes
        self.slow = (slow[0], slow[1])
        self.left = float(np.max(sum(lefts)))
        self.violation = float(np.max(violations))
        total = changes[0] + changes[1]
        return float(quotient(total, size, otherwise=total).max())

    def next(self, data: RegularisedData, factor: float = 1.0) -> RegularisedData:
        """Return the next problem, with the multipliers as shifts.

        Each gamma is increased if its multiplier converges slowly, and multiplied by ``factor`` as
        long as it stays below ``GAMMA_GROWTH`` times the natural one; it never decreases.
        """
        pressure, shear = self.newton.shifts(data)
        enough = GAMMA_GROWTH * float(self._stiffness.max())
        largest = GAMMA_GROWTH * self.natural

        def grown(gamma: float, slow: bool) -> float:
            raised = min(GAMMA_GROWTH * gamma, enough) if slow else gamma
            return max(gamma, raised, min(factor * gamma, largest))

        return replace(
            data,
            lambda_hat=pressure,
            mu_hat=shear,
            gamma_n=grown(data.gamma_n, self.slow[0]),
            gamma_t=grown(data.gamma_t, self.slow[1]),
        )


def augmented_lagrangian(
    augmentation: Augmentation,
    data: RegularisedData,
    first_sets: ActiveSets | None,
    *,
    max_outer: int,
    first_iteration: int = 1,
    inner_iterations: int | None = None,
    gamma_factor: float = 1.0,
) -> Status:
    """Iterate lambda_hat <- lambda, mu_hat <- mu until both have converged.

    Each problem starts from the variables of the previous one (section 7.1).

    Args:
        augmentation: the update, which also holds the inner method.
        data: the first problem.
        first_sets: active sets of the first linear solve; None: from the iterate.
        max_outer: problems allowed.
        first_iteration: number of the first linear solve.
        inner_iterations: linear solves allowed for one problem (inexact ALM); None: until its sets
            repeat.
        gamma_factor: growth of both gammas from one problem to the next.
    """
    newton = augmentation.newton
    for step in range(max_outer):
        status = newton.solve(
            data,
            first_sets,
            first_iteration=first_iteration,
            max_iterations=inner_iterations,
            measure=partial(_change, augmentation, data, first=step == 0),
        )
        inexact = inner_iterations is not None and status is Status.MAX_ITERATIONS
        if status is not Status.CONVERGED and not inexact:
            return status
        if step > 0 and augmentation.settled and not inexact:
            return Status.CONVERGED
        # A problem that was cut off continues with its last sets, a solved one with those of the
        # new data.
        cut_off = newton.continued_sets(data) if inexact else None
        data = augmentation.next(data, gamma_factor)
        # At the old iterate the new shift would count every pressure twice, and so would a friction
        # bound that depends on the pressure; so the present sets are kept there.
        following = newton.problem.sets if data.follows is not None else newton.continued_sets(data)
        first_sets = cut_off or following
        first_iteration = 1
    return Status.OUTER_MAX_ITERATIONS


def _change(augmentation: Augmentation, data: RegularisedData, *, first: bool) -> float | None:
    """Update the augmentation and return the relative change of lambda and mu; None for the first
    problem, which has no predecessor.
    """
    change = augmentation.measure(data)
    return None if first else change
