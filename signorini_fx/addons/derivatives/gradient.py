"""The derivatives of quantities by data, from adjoint states and from the problem at two values of
a datum.

The explicit dependence on the datum is evaluated for fixed displacement and tractions of the
solution: the difference of two residuals is exact except for round-off where the problem is linear
in the datum, as it is in loads, in Young's modulus and in friction coefficients, and of second
order elsewhere.  It needs no solve.

A load step with friction begins with the tangential displacement tau_T y of the step before it,
and, with regularisation, with its shear mu: its slip counts from the position o = tau_T y - mu /
gamma_2.  With z = D^T q in the tangential components of the adjoint state, the dependence of a
quantity on the earlier step is the sum of w z . o, a quantity of that step: one loop from the last
step to the first finds all adjoint states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.arrays import Array, inner, matvec, rmatvec
from signorini_fx.errors import FormError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import action
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, contact_map
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.quantities.differentiable import ContactForce, Functional
from signorini_fx.results.accuracy.adjoint import (
    Adjoint,
    Explicit,
    LinearisedLaw,
    TransposedTangent,
    law_at,
)
from signorini_fx.solving.frames import turned
from signorini_fx.tuned import ROOT_OF_EPS

# The derivatives by a datum of what of a load step depends on it explicitly, with those of some
# quantities.
By = Callable[[Any, Sequence[Functional]], Explicit]


@dataclass(frozen=True)
class SolvedStep:
    """A load step with its solution, and everything that its derivatives need."""

    body: Model
    system: ElasticSystem
    law: LinearisedLaw
    state: ContactState
    displacement: fem.Function  # y, from the initial position
    compliance: float  # 1 / gamma_2, length per stress; zero without regularisation
    # how contact forces turn with the displacements of their points, force per length, shape (n, d,
    # d); None: they do not
    curvature: Array | None = None
    # by which rotations shapes have turned in this load step, shape (n, d, d); None: by none that
    # counts
    spin: Array | None = None

    @classmethod
    def of(
        cls,
        body: Model,
        task: Task,
        outcome: Outcome,
        start: Start,
        state: ContactState,
        displacement: fem.Function,
        law: PointFriction | None,
        turning: tuple[Array, Array, Array | None] | None = None,
    ) -> SolvedStep:
        """Return a load step that has just been solved; collective.

        See the attributes for most arguments.  ``turning`` has, for points on shapes at finite
        displacements, ``curvature``, ``LinearisedLaw.slips`` and ``spin``.
        """
        if law is not None and law.follows_slip:
            reason = "derivatives are not possible yet where it follows the speed of slip"
            raise FormError.at("contact.friction", reason)
        linear_law = law_at(task, outcome, start, state, law)
        exact = linear_law.exact
        if turning is not None:
            linear_law = replace(linear_law, slips=turning[1])
            alone = (
                linear_law.tied[:, 1:].any(axis=1)
                & ~state.in_contact
                & (turning[1][:, :, 0] != 0.0).any(axis=1)
            )
            if parallel.any_rank(body.comm, exact and bool(alone.any())):
                reason = (
                    "derivatives are not possible yet where it holds points without pressure "
                    "while a shape turns"
                )
                raise FormError.at("contact.friction", reason)
            boundary = state.boundary
            turns = (turning[0] != 0.0).any() or (np.abs(turning[1]) > ROOT_OF_EPS).any()
            if parallel.any_rank(
                body.comm,
                bool(turns) and not np.array_equal(boundary.tangents, boundary.cotangents),
            ):
                reason = (
                    "derivatives are not possible yet where it depends on the direction of "
                    "slip and a shape turns it"
                )
                raise FormError.at("contact.friction", reason)
        return cls(
            body,
            task.system,
            linear_law,
            state,
            displacement,
            0.0 if exact else 1 / float(linear_law.gamma[1]),
            *((None, None) if turning is None else turning[::2]),
        )

    def quantity(self, of: Functional) -> tuple[PETSc.Vec, Array]:
        """Return J_x at the free unknowns of the stiffness, and J_t over the weight, shape (n, d);
        collective.

        Raises:
            FormError: the quantity is a moment at displaced points.
        """
        row = of.by_displacement(self.displacement)
        boundary = self.state.boundary
        row = np.zeros(self.body.fixed.size) if row is None else row
        if self.curvature is not None and isinstance(of, ContactForce):
            if of.moment:
                raise FormError.at("of", "a moment at displaced points has no derivative yet")
            forces = row.reshape(-1, self.body.dimension).copy()
            np.subtract.at(
                forces,
                boundary.nodes,
                rmatvec(self.curvature, of.directions(boundary)),
            )
            row = forces.ravel()
        vector = self.body.vector(row)
        vector.getArray()[self.body.prescribed] = 0.0
        return vector, of.by_traction(boundary, self.state.pressure, self.state.shear)

    def value(self, of: Functional) -> float:
        """Return the value of a quantity; collective."""
        return of.value(
            self.displacement, self.state.boundary, self.state.pressure, self.state.shear
        )

    def handed_back(
        self, adjoint: Adjoint | None, earlier: SolvedStep | None
    ) -> tuple[PETSc.Vec, Array] | None:
        """Return the derivatives of a quantity by the state of the previous load step, in the form
        of ``quantity``; None if they are zero; collective.

        Args:
            adjoint: the adjoint state of the quantity in this step, or None.
            earlier: the previous step, or None.
        """
        if adjoint is None or earlier is None:
            return None
        if not parallel.any_rank(self.body.comm, adjoint.tied[:, 1:]):
            return None
        body = earlier.body
        boundary = self.state.boundary
        slips = adjoint.tied[:, 1:]
        contact = _map_to(boundary, body)
        vector = body.vector(np.zeros(body.fixed.size))
        normal: Array = np.zeros(len(slips))
        along = slips
        if self.spin is not None:  # shapes take with them where points were
            back = np.einsum("nji,njk,nk->ni", self.spin, boundary.tangents, slips)
            normal = inner(boundary.normal, back)
            along = rmatvec(boundary.cotangents, back)
        contact.add_forces(normal, along, vector)
        carried = -self.compliance * rmatvec(
            turned(earlier.state.boundary, boundary, self.spin), slips
        )
        return vector, np.column_stack((np.zeros(len(slips)), carried))


def columns(
    count: int,
    step_at: Callable[[int], Any],
    quantities: Sequence[tuple[int, Functional]],
    data: Sequence[By],
) -> tuple[Array, Array, list[int]]:
    """Return derivatives of quantities by data, shape (quantities, data), the values of the
    quantities, and the number of contact points of each load step between two active sets;
    collective.

    Args:
        count: number of load steps.
        step_at: returns a load step by its number, with its ``SolvedStep`` as ``solved``, and that
            of the previous step as ``earlier``, or None.
        quantities: the quantities, each with the number of its load step.
        data: functions that return the explicit derivatives by each datum.
    """
    slopes = np.zeros((len(quantities), len(data)))
    values = np.zeros(len(quantities))
    between = [0] * count
    owed: list[tuple[PETSc.Vec, Array] | None] = [None] * len(quantities)
    for number in range(count - 1, -1, -1):
        asked = [(k, of) for k, (at, of) in enumerate(quantities) if at == number]
        if not asked and all(debt is None for debt in owed):
            continue
        step = step_at(number)
        solved: SolvedStep = step.solved
        for k, of in asked:
            values[k] = solved.value(of)
            owed[k] = solved.quantity(of)
        between[number] = solved.law.between
        if not data:
            continue
        tangent = TransposedTangent(solved.system, solved.law, symmetric=solved.body.symmetric)
        adjoints = [None if debt is None else tangent.adjoint(*debt) for debt in owed]
        for column, by in enumerate(data):
            change = by(step, [of for _, of in asked])
            direct = dict(zip([k for k, _ in asked], change.values, strict=True))
            for k, adjoint in enumerate(adjoints):
                if adjoint is not None:
                    slopes[k, column] += adjoint.derivative(change, direct.get(k, 0.0))
        owed = [solved.handed_back(adjoint, step.earlier) for adjoint in adjoints]
    return slopes, values, between


def _map_to(boundary: ContactBoundary, body: Model) -> ContactMap:
    """Return the map B from the unknowns of a body to contact points; collective."""
    body_boundary = body.boundary
    assert body_boundary is not None
    unchanged = boundary is body_boundary
    same = not boundary.paired or boundary.averages is body_boundary.averages
    if same and boundary.moving is body_boundary.moving:
        unchanged = unchanged or np.array_equal(boundary.frames, body_boundary.frames)
    if not parallel.any_rank(body.comm, not unchanged):
        return body.contact
    return contact_map(boundary, body.prescribed, body.stiffness, body.rotation)


@dataclass(frozen=True)
class ChangedStep:
    """A load step at some value of a datum."""

    # terms of a(., .), with that value while it is evaluated; none where what they give does not
    # change
    forms: Sequence[fem.Form]
    forces: Array  # L at the owned dofs
    prescribed: Array  # the prescribed displacements at the owned dofs
    boundary: ContactBoundary  # the contact points
    gap: Array  # d from the initial position, length, shape (n,)
    law: PointFriction | None  # of friction; None: there is none
    # how far foundations have moved in this load step, length, shape (n, d); None: they have not
    drift: Array | None = None
    spin: Array | None = None  # see ``SolvedStep``


def explicit(
    solved: SolvedStep,
    data: ChangedStep,
    quantities: Sequence[Functional],
    previous: tuple[SolvedStep, ChangedStep] | None = None,
) -> Explicit:
    """Return the explicit dependence of a load step on its data, at the displacement and the
    tractions of its solution; collective.

    Args:
        solved: the load step.
        data: its data.
        quantities: the quantities to evaluate.
        previous: the previous load step with its data; None for the first step.
    """
    state = solved.state
    y = solved.body.function(_displaced(solved, data, solved.body))
    values = [
        quantity.value(y, data.boundary, state.pressure, state.shear) for quantity in quantities
    ]
    bound = np.zeros_like(state.pressure)
    if data.law is not None:
        bound, _, _ = data.law.evaluate(state.pressure, 0.0)
    bound = np.where(np.isfinite(bound), bound, 0.0)
    return Explicit(values, _residual(solved, data), _relative(solved, data, previous), bound)


def _residual(solved: SolvedStep, data: ChangedStep) -> PETSc.Vec:
    """Return the residual R at the unknowns of the stiffness; collective."""
    body = solved.body
    state = solved.state
    residual = body.vector(-data.forces)
    if data.forms:
        residual.axpy(
            1.0, elastic_forces(body, data.forms, body.function(_displaced(solved, data, body)))
        )
    _map_to(data.boundary, body).add_forces(state.pressure, state.shear, residual)
    residual.getArray()[body.prescribed] = 0.0
    return residual


def elastic_forces(body: Model, forms: Sequence[fem.Form], y: fem.Function) -> PETSc.Vec:
    """Return a(y, .) of the forms at the unknowns of the stiffness; collective."""
    nodes = np.arange(y.x.array.size // body.dimension, dtype=np.int32)
    return body.vector(action(tuple(forms), y, nodes))


def _relative(
    solved: SolvedStep, data: ChangedStep, previous: tuple[SolvedStep, ChangedStep] | None
) -> Array:
    """Return B x - d, length, shape (n, d); collective."""
    body = solved.body
    contact = _map_to(data.boundary, solved.body)
    u_n, u_t = contact.traces(_displaced(solved, data, body))
    if data.drift is not None:
        u_t = u_t - rmatvec(data.boundary.tangents, data.drift)
    if previous is not None:
        earlier, earlier_data = previous
        u_t = u_t - contact.traces(_displaced(earlier, earlier_data, body))[1]
        if solved.compliance and data.boundary is not earlier_data.boundary:
            shear = matvec(
                turned(earlier_data.boundary, data.boundary, data.spin),
                earlier.state.shear,
            )
            u_t = u_t + solved.compliance * shear
    return np.column_stack((u_n - data.gap, u_t))


def _displaced(solved: SolvedStep, data: ChangedStep, body: Model) -> PETSc.Vec:
    """Return the displacement of a load step with the prescribed values of its data, in the
    unknowns of ``body``; collective.
    """
    x = solved.body.unknowns(solved.displacement)
    prescribed = solved.body.vector(data.prescribed)
    fixed = solved.body.prescribed
    x.getArray()[fixed] = prescribed.getArray(readonly=True)[fixed]
    if solved.body is body or solved.body.rotation is body.rotation:
        return x
    return body.unknowns(solved.body.function(x))


def difference(high: Explicit, low: Explicit, step: float) -> Explicit:
    """Return the derivatives of a load step by a datum, as central differences of its values for
    the datum plus and minus ``step``.
    """
    direct = [
        (upper - lower) / (2 * step) for upper, lower in zip(high.values, low.values, strict=True)
    ]
    residual = (high.residual - low.residual) * (0.5 / step)
    slopes = [
        np.asarray((upper - lower) / (2 * step), dtype=np.float64)
        for upper, lower in ((high.relative, low.relative), (high.bound, low.bound))
    ]
    return Explicit(direct, residual, *slopes)
