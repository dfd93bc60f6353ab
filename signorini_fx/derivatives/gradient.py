"""The derivative of a quantity by one datum: the adjoint state, and the problem evaluated at two values of the datum.

What depends on the datum explicitly is evaluated for the displacement and the tractions of the solution, which stay:
the difference of two residuals is exact but for round-off where the problem is linear in the datum, as it is in loads,
in Young's modulus and in friction coefficients, and of second order elsewhere.  No solve takes part in it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from petsc4py import PETSc

from signorini_fx.algorithms.task import Outcome, Start, Task
from signorini_fx.body.assembly import action
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.contact_map import contact_map
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.elastic import ElasticBody
from signorini_fx.body.rigid_tools import Driven
from signorini_fx.contact.laws import FrictionLaw, Nodal
from signorini_fx.derivatives.adjoint import Adjoint, TransposedTangent
from signorini_fx.derivatives.law import LinearisedLaw, linearised
from signorini_fx.derivatives.quantities import Quantity

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Solved:
    """A solution with all that its derivatives need.

    Attributes:
        body: the elastic body.
        task: its contact problem.
        outcome: how that ended.
        start: where it started.
        state: the contact points.
        displacement: y, from the initial position.
        law: of friction; None: there is none.
    """

    body: ElasticBody
    task: Task
    outcome: Outcome
    start: Start
    state: ContactState
    displacement: fem.Function
    law: FrictionLaw | None

    @property
    def linearised(self) -> LinearisedLaw:
        """The law at the solution; collective."""
        promised = self.task.promised(self.outcome)
        exact = not all(np.isfinite(promised))
        data = self.start.data if exact else self.outcome.problem.data
        return linearised(
            self.state, self.law, (data.gamma_n, data.gamma_t), exact=exact, before=self.start.data.mu_hat
        )

    def adjoints_of(self, quantities: Sequence[Quantity], law: LinearisedLaw) -> list[Adjoint]:
        """The adjoint states of quantities; collective."""
        methods = [self.outcome.newton, vars(self.task.iterate).get("unsymmetric_newton")]  # if it was used
        tangent, state, found = TransposedTangent(self.task.system, law, methods), self.state, []
        for quantity in quantities:
            row = quantity.by_displacement(self.displacement)
            vector = self.body.vector(np.zeros(self.body.fixed.size) if row is None else row)
            vector.getArray()[self.body.prescribed] = 0.0
            kappa = quantity.by_traction(state.boundary, state.pressure, state.shear)
            found.append(tangent.adjoint(vector, kappa))
        return found


@dataclass(frozen=True)
class Data:
    """The problem at some value of a datum.

    Attributes:
        forms: terms of a(., .), with that value while it is evaluated.
        forces: L at the owned dofs.
        prescribed: the prescribed displacements at the owned dofs.
        boundary: the contact points.
        gap: d from the initial position, length, shape (n,).
        law: of friction; None: there is none.
        driven: what drives tools; None: there are none.
    """

    forms: Sequence[fem.Form]
    forces: Array
    prescribed: Array
    boundary: ContactBoundary
    gap: Nodal
    law: FrictionLaw | None
    driven: Driven | None = None


@dataclass(frozen=True)
class Explicit:
    """What of the problem depends on its data explicitly, for fixed displacement and tractions.

    Attributes:
        values: of the quantities.
        residual: R at the unknowns of the stiffness.
        relative: B x - d, length, shape (n, d).
        bound: the friction bound, stress, shape (n,).
    """

    values: list[float]
    residual: PETSc.Vec
    relative: Nodal
    bound: Nodal


def explicit(solved: Solved, data: Data, quantities: Sequence[Quantity]) -> Explicit:
    """The problem with some data at the displacement and the tractions of a solution; collective."""
    body, state = solved.body, solved.state
    x, fixed, given = body.unknowns(solved.displacement), body.prescribed, body.vector(data.prescribed)
    if data.driven is not None:
        body.begin_driven(x, body.driven(solved.outcome.displacement(), solved.task.rest), None)
        body.begin_driven(given, data.driven.motion, None)
    x.getArray()[fixed] = given.getArray(readonly=True)[fixed]
    y = body.function(x)
    nodes = np.arange(y.x.array.size // body.dimension, dtype=np.int32)
    residual = body.vector(action(tuple(data.forms), y, nodes) - data.forces)
    if data.driven is not None:
        body.begin_driven(residual, -data.driven.forces, None)
    same = data.boundary is body.boundary
    contact = body.contact if same else contact_map(data.boundary, fixed, body.stiffness, body.rotation, body.dimension)
    contact.add_forces(state.pressure, state.shear, residual)
    residual.getArray()[fixed] = 0.0
    u_n, u_t = contact.traces(x)
    bound = np.zeros_like(u_n) if data.law is None else data.law.bound(state.pressure)
    bound = np.where(np.isfinite(bound), bound, 0.0)
    values = [one.value(y, data.boundary, state.pressure, state.shear) for one in quantities]
    return Explicit(values, residual, np.column_stack((u_n - data.gap, u_t)), bound)


def derivatives(
    adjoints: Sequence[Adjoint],
    quantities: Sequence[Quantity],
    at: Callable[[float], Explicit],
    step: float,
) -> list[float]:
    """The derivative of each quantity by one datum; collective.

    Args:
        adjoints: the adjoint state of each quantity.
        quantities: these.
        at: ``explicit`` where the datum is larger by its argument.
        step: by how much the datum is changed.
    """
    more, less = at(step), at(-step)
    residual = more.residual - less.residual
    residual.scale(0.5 / step)
    twice = np.float64(2 * step)
    relative = np.asarray((more.relative - less.relative) / twice, dtype=np.float64)
    bound = np.asarray((more.bound - less.bound) / twice, dtype=np.float64)
    return [
        one.derivative((high - low) / (2 * step), residual, relative, bound)
        for one, high, low in zip(adjoints, more.values, less.values, strict=True)
    ]
