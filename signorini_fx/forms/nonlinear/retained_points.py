"""Which contact points of a nonlinear body its tangents are condensed onto: those that may touch in an iteration.

In 3D the contact boundary has far more nodes than the contact.  A point that is farther from its shape than an
increment may bring it is left out of the dense matrix, as the inside of the body is, and no force acts there.  Where it
is in the solution of the linearised problem is known afterwards: if it has come into contact, or if friction has a
bound there without contact, or if there is no solution, it is solved once more with all points.  So solutions do not
depend on the choice.  A body that nothing holds but contact is condensed onto all of its points.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.algebra.algorithms.task import Outcome, Start
from signorini_fx.algebra.contact.active_sets import classify
from signorini_fx.algebra.linalg.condensed import CondensedSystem
from signorini_fx.forms.nonlinear.moving_shapes import MovingShape
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.records import Status
from signorini_fx.tuned import RETAINED_REACH

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class RetainedPoints:
    """The choice for the tangents of one load, on one rank in 3D; elsewhere dense matrices are small, or none.

    Attributes:
        all: whether all points are retained: while no tangent is solved for, or where a choice was too small.
    """

    def __init__(self, at: fem.Function) -> None:
        self._at = at
        space = at.function_space
        self._possible = space.mesh.geometry.dim == 3 and space.mesh.comm.size == 1
        self.all = True
        self._moved = 0.0  # the largest increment of this load so far, length
        self.begin_anew()

    def begin_anew(self) -> None:
        """A new load."""
        self._expected, self._moved = self._moved, 0.0
        self._near: Flags | None = None
        self._last_values: Array | None = None  # values of the displacement in the last iteration

    def far_points(
        self,
        boundary: ContactBoundary,
        state: ContactState | None,
        shapes: Mapping[int, MovingShape],
        prescribed: tuple[Flags, Array],
    ) -> tuple[Flags, fem.Function] | None:
        """Which points are left out, shape (n,), and the displacement of now; None: none is; ``prescribed``: which
        unknowns are prescribed, and to what, shapes (dofs,).
        """
        plain = boundary.averages.shares.nnz == boundary.size > 0 and boundary.moving is None and not boundary.paired
        if not self._possible or self.all or not plain or state is None or state.boundary.size != boundary.size:
            return None
        values, (fixed, to) = self._at.x.array, prescribed
        distance = distances(boundary, shapes, values.reshape(-1, boundary.x.shape[1]))
        # As far as shapes are inside, supports move now, or the last increment, or the last load, has moved anything.
        increments = [np.abs(to - values)[fixed], -distance[np.isfinite(distance)]]
        if self._last_values is None:
            increments.append(np.array([self._expected]))
        else:
            increments.append(np.abs(values - self._last_values))
            self._moved = max(self._moved, float(increments[-1].max(initial=0.0)))
        near = state.in_contact | (state.shear != 0.0).any(axis=1)  # a shear may act without contact
        reach = RETAINED_REACH * max(moved.max(initial=0.0) for moved in increments)
        near |= distance <= reach
        if self._near is not None and self._near.size == near.size:
            near |= self._near
        near[distance.argmin()] = True  # a dense matrix of nothing is none
        self._near, self._last_values = near, values.copy()
        return None if near.all() else (~near, self._at)

    def suffice(self, far: tuple[Flags, fem.Function] | None, begun: Start, outcome: Outcome) -> bool:
        """Whether an outcome is that of the problem with all points; else all of them will be retained; ``far``: what
        ``far_points`` said.
        """
        system = outcome.problem.system
        # Other systems reach all points, and so does a condensed one of a body that only contact holds.
        if far is None or not isinstance(system, CondensedSystem) or system.elasticity.far is None:
            return True
        points, problem = far[0], outcome.problem
        began_far = begun.sets is not None and bool((begun.sets.contact & points).any())
        suffices = outcome.status is Status.CONVERGED and not began_far
        if suffices:
            system.find_far_points(outcome.newton.x)
            touching = classify(problem.sets, *system.contact.traces(outcome.newton.x), problem.data).contact
            touching |= problem.sets.contact  # from where they were before
            if problem.data.bound is not None:
                touching |= problem.data.bound > 0.0  # such as that of Tresca, which acts without contact
            suffices = not (touching & points).any()
        self.all = not suffices
        return suffices


def distances(boundary: ContactBoundary, shapes: Mapping[int, MovingShape], places: Array) -> Array:
    """How far contact points are from their shapes, length, shape (n,); minus infinity for those of no shape."""
    distance = np.full(boundary.size, -np.inf)
    for number, moving in shapes.items():
        points = np.flatnonzero(boundary.part == number)
        nodes, added = boundary.nodes[points], np.zeros(len(places))
        added[moving.nodes] = moving.added
        distance[points] = moving.shape.distance(boundary.x[points] + places[nodes])[0] + added[nodes]
    return distance
