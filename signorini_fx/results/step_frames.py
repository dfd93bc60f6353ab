"""The end of a step in the frames of the next one, whose foundations may have turned and moved."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.motions import ReferenceMotion
from signorini_fx.algebra.contact.nodal_vectors import length, unit
from signorini_fx.errors import FormError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import ElasticBody
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodies, RigidBodyMotion
from signorini_fx.results.certificate.law_of_method import Law, PreviousStep, Tractions
from signorini_fx.tuned import ROOT_OF_EPS

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class StepEnd:
    """The end of a step of a loop, in the frames that its foundations had then.

    Every solve of the next step starts from this end, wherever the foundations of the solves before
    it were.
    """

    start: Start  # of the next step
    rest: (
        ReferenceMotion | None
    )  # from which displacements are counted; None: from the initial position
    normal: Array  # displacement along the normals, length, shape (n,)
    boundary: ContactBoundary  # the contact points
    before: PreviousStep  # the same as the certificate sees it

    @classmethod
    def of(
        cls,
        task: Task,
        outcome: Outcome,
        start: Start,
        contact: ContactState,
        displacement: fem.Function,
        before: PreviousStep | None,
        rigid: tuple[RigidBodyMotion, ...] = (),
    ) -> StepEnd:
        """That of a step with a solution, a displacement that nothing may change any more;
        ``before``: the end of the step before it; collective.
        """
        normal = outcome.problem.system.contact.traces(outcome.newton.x)[0]
        law = Law(*task.promised(outcome))
        previous = PreviousStep.of(displacement, Tractions.of(contact), law, before, rigid)
        # Not from the iterate: a point that slips is at its bound, and round-off would decide
        # whether it still does.
        following = replace(outcome.next_step(start), sets=task.newton.problem.sets)
        return cls(following, task.rest, normal, contact.boundary, previous)

    def taken_up(self, task: Task, body: ElasticBody, rigid: RigidBodies) -> None:
        """Begin the iterate of a contact problem that was made anew, with the same points, with the
        displacement with which this step has ended; collective.
        """
        unknowns = body.unknowns(self.before.displacement)
        if task.rest is not None:
            unknowns.axpy(-1.0, body.vector(body.motions.displacement(task.rest.motion)))
        if rigid.bodies:
            body.begin_driven(unknowns, rigid.unknowns(self.before.rigid), task.rest)
        task.newton.begin_at(task.system.unknowns(unknowns))

    def begins_on(
        self,
        boundary: ContactBoundary,
        first: RegularisedData,
        law: PointFriction | None,
        moved: Array | None,
        resting: ReferenceMotion | None,
        spin: Array | None = None,
    ) -> tuple[Start, PreviousStep]:
        """Where the next step starts, and this end as it begins from it, in the frames that these
        points have now;
        ``moved``: by which foundations have moved at them, length, shape (n, d); ``resting``: the
        reference motion from which slips count by now; ``spin``: see ``rotations``; collective.

        Slip is relative to foundations, and friction is that of the pressure with which this step
        has ended.

        Raises:
            FormError: the points are others.
        """
        start = (
            self.start
            if boundary is self.boundary
            else self._projected_onto(boundary, resting, spin)
        )
        assert start.multipliers is not None
        data = replace(
            start.data,
            gap=first.gap,
            bound=None if law is None else law.bound(start.multipliers[0]),
            slip_origin=start.data.slip_origin + _along(boundary, moved),
            immovable=first.immovable,
            bilateral=first.bilateral,
        )
        rotation = rotations(self.boundary.normal, boundary.normal, spin)
        before = self.before
        shear = before.tractions.shear
        elastic = before.elastic_slip
        before = replace(
            before,
            tractions=replace(before.tractions, shear=np.einsum("nij,nj->ni", rotation, shear)),
            elastic_slip=None if elastic is None else np.einsum("nij,nj->ni", rotation, elastic),
            moved=moved,
        )
        return replace(start, data=data, law=law), before

    def _projected_onto(
        self, boundary: ContactBoundary, resting: ReferenceMotion | None, spin: Array | None
    ) -> Start:
        """The start of the step in the frames that the same points have now, with which shears
        turn; collective.
        """
        start = self.start
        earlier = self.boundary
        normal = self.normal
        slips = self.start.data.slip_origin
        if self.rest is not None:
            normal = normal + self.rest.u_n
            slips = slips + self.rest.u_t
        if parallel.any_rank(boundary.comm, not np.array_equal(earlier.nodes, boundary.nodes)):
            raise FormError([("contact", "its points cannot change between the steps of a loop")])
        rotation = turned(earlier, boundary, spin)

        def along(shear: Array) -> Any:
            return np.einsum("njk,nk->nj", rotation, shear)

        data = start.data
        multipliers = start.multipliers
        relative = np.column_stack((normal, slips))
        origin = np.einsum("nki,nkj,nj->ni", boundary.frames, earlier.coframes, relative)[:, 1:]
        if resting is not None:
            origin = origin - resting.u_t
        return replace(
            start,
            data=replace(data, mu_hat=along(data.mu_hat), slip_origin=origin),
            sets=None if start.sets is None else _turned_sets(start.sets, rotation),
            multipliers=None if multipliers is None else (multipliers[0], along(multipliers[1])),
            elastic_slip=along(start.elastic_slip),
        )


@dataclass(frozen=True)
class LastSolution:
    """What the next solve of a loop may begin from: sets and multipliers of the last solution, in
    its frames.
    """

    sets: ActiveSets
    multipliers: tuple[Array, Array]
    step: int
    boundary: ContactBoundary

    @classmethod
    def of(cls, outcome: Outcome, step: int, boundary: ContactBoundary) -> LastSolution:
        """Those of the solution that a solve has reached."""
        return cls(outcome.problem.sets, outcome.newton.multipliers(), step, boundary)

    def begins(self, start: Start, boundary: ContactBoundary) -> Start:
        """The start of a solve, from this solution in the frames that its points have now;
        collective.

        Unchanged where the points are others, and in a step without a solution so far.
        """
        if start.step != self.step:
            return start
        if boundary is self.boundary:
            return start.begin_from(self.sets, self.multipliers)
        if parallel.any_rank(
            boundary.comm, not np.array_equal(boundary.nodes, self.boundary.nodes)
        ):
            return start
        rotation = turned(self.boundary, boundary)
        pressure, shear = self.multipliers
        shear = np.einsum("njk,nk->nj", rotation, shear)
        return start.begin_from(_turned_sets(self.sets, rotation), (pressure, shear))


def _turned_sets(sets: ActiveSets, rotation: Array) -> ActiveSets:
    """The sets of points in the frames that these have now; ``rotation``: see ``turned``."""
    direction = np.einsum("njk,nk->nj", rotation, sets.direction)
    slips = sets.slip & (length(direction) > 0)
    return ActiveSets.of(sets.contact, np.where(slips[:, None], unit(direction), 0.0), sets.turning)


def from_rest(
    space: fem.FunctionSpace, boundary: ContactBoundary, start: Start, moved: Array
) -> tuple[Start, PreviousStep]:
    """The first step on foundations that move, which counts slip from the body without loads at
    time 0: where it starts, and that body as the end of the step before it; ``moved``: by which
    they have moved at the points since, length, shape (n, d).
    """
    before = PreviousStep(fem.Function(space), Tractions.none(boundary), moved=moved)
    # That of a body that contact alone holds is not zero where it has come to rest.
    origin = _along(boundary, moved) + start.data.slip_origin
    return replace(start, data=replace(start.data, slip_origin=origin)), before


def _along(boundary: ContactBoundary, moved: Array | None) -> Any:
    """The components of motions along the boundary, shape (n, d - 1)."""
    return 0.0 if moved is None else np.einsum("nij,ni->nj", boundary.tangents, moved)


def rotations(earlier: Array, later: Array, spin: Array | None = None) -> Array:
    """The least rotation that takes each normal to a later one, unit vectors of shape (n, d), shape
    (n, d, d).

    It has no part about the normal; where the foundation has one, the shear turns with it, so that
    the motion of body and foundation as one changes nothing: ``spin`` is the rotation of the
    foundation of each point, shape (n, d, d), less directions in which there is no shear any more;
    None: it counts for nothing.
    """
    if spin is not None:
        earlier = np.einsum("nij,nj->ni", spin, earlier)
    identity = np.eye(later.shape[1])
    cosine = np.einsum("ni,ni->n", earlier, later)
    both = earlier + later
    # A plane that has turned over has no least rotation: then directions stay as they are.
    turns = (earlier != later).any(axis=1) & (1 + cosine > ROOT_OF_EPS)
    across = np.einsum("ni,nj->nij", both, both) / np.where(turns, 1 + cosine, 1.0)[:, None, None]
    rotation = identity + np.where(
        turns[:, None, None], 2 * np.einsum("ni,nj->nij", later, earlier) - across, 0.0
    )
    return np.asarray(rotation if spin is None else rotation @ spin)


def turned(earlier: ContactBoundary, later: ContactBoundary, spin: Array | None = None) -> Array:
    """From the components of a shear in earlier frames to those in later ones, shape (n, d - 1, d -
    1).
    """
    rotation = rotations(earlier.normal, later.normal, spin)
    return np.asarray(np.einsum("nij,nil,nlk->njk", later.cotangents, rotation, earlier.tangents))
