"""The end of a step in the frames of the next one, whose foundations may have turned and moved."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from signorini_fx import parallel
from signorini_fx.algorithms.task import Outcome, Start
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.contact.laws import ActiveSets, length, unit
from signorini_fx.contact.laws import Nodal as Array
from signorini_fx.contact.resting_place import RestingMotion
from signorini_fx.errors import FormError
from signorini_fx.results.promised_law import PreviousStep


@dataclass(frozen=True)
class StepEnd:
    """The end of a step of a loop, in the frames that its foundations had then.

    Every solve of the next step starts from this end, wherever the foundations of the solves before it were.

    Attributes:
        start: of the next step.
        rest: the resting place from which displacements are counted; None: from the initial position.
        normal: displacement along the normals, length, shape (n,).
        boundary: the contact points.
        before: the same as the certificate sees it.
    """

    start: Start
    rest: RestingMotion | None
    normal: Array
    boundary: ContactBoundary
    before: PreviousStep

    def seen_from(self, boundary: ContactBoundary, *, held: bool) -> tuple[Start, RestingMotion | None]:
        """The start of the step and the resting place, in the frames that the same points have now; collective.

        Args:
            boundary: the points as they are now.
            held: whether what has fallen to the resting place is held by now, so that slips count from the initial one.

        Raises:
            FormError: see ``carried``.
        """
        start, resting = self.start, self.rest
        if held and resting is not None:
            assert start.data.slip_origin is not None
            start = replace(start, data=replace(start.data, slip_origin=start.data.slip_origin + resting.u_t))
            resting = None
        begun, carried_rest, _ = carried(start, resting, self.normal, self.boundary, boundary)
        return begun, carried_rest


@dataclass(frozen=True)
class LastSolution:
    """What the next solve of a loop may begin from: sets and multipliers of the last solution, in its frames.

    Attributes:
        sets: active sets.
        multipliers: (lambda, mu).
        step: number of its step.
        boundary: the contact points.
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
        """The start of a solve, from this solution in the frames that its points have now; collective.

        Unchanged where the points are others, and in a step that begins with the iterate of the last one.
        """
        if boundary is self.boundary:
            return start if start.step != self.step else start.begin_from(self.sets, self.multipliers)
        if parallel.any_rank(boundary.comm, not np.array_equal(boundary.nodes, self.boundary.nodes)):
            return start
        rotation = np.einsum("nij,nik->njk", boundary.cotangents, self.boundary.tangents)
        pressure, shear = self.multipliers
        direction, shear = (np.einsum("njk,nk->nj", rotation, vectors) for vectors in (self.sets.direction, shear))
        slips = self.sets.slip & (length(direction) > 0)
        sets = ActiveSets.of(self.sets.contact, np.where(slips[:, None], unit(direction), 0.0), self.sets.turning)
        return start.begin_from(sets, (pressure, shear))


def carried(
    start: Start,
    resting: RestingMotion | None,
    normal: Array,
    old_boundary: ContactBoundary,
    new_boundary: ContactBoundary,
) -> tuple[Start, RestingMotion | None, Array]:
    """The start of a step, the place from which its slips are counted, and the normal displacement at that start, in
    the frames that the same points have now; collective.

    A shear that is not along a foundation that has turned loses its part across it.

    Raises:
        FormError: the points are others, or their normals where contact alone holds the body.
    """
    comm = old_boundary.comm
    if parallel.any_rank(comm, not np.array_equal(old_boundary.nodes, new_boundary.nodes)):
        raise FormError([("contact", "its points cannot change between the steps of a loop")])
    turns = parallel.any_rank(comm, not np.allclose(old_boundary.normal, new_boundary.normal))
    if turns and resting is not None:
        wrong = "its directions cannot change between the steps of a loop where contact alone holds the body"
        raise FormError([("contact", wrong)])
    rotation = np.einsum("nij,nik->njk", new_boundary.cotangents, old_boundary.tangents)

    def turned(shear: Array) -> Any:
        return np.einsum("njk,nk->nj", rotation, shear)

    def moved(slip: Array | None) -> Any:
        return (
            None if slip is None else np.einsum("nij,nik,nk->nj", new_boundary.tangents, old_boundary.cotangents, slip)
        )

    data, multipliers, origin = start.data, start.multipliers, moved(start.data.slip_origin)
    if turns and origin is not None:
        relative = np.column_stack((normal, np.asarray(start.data.slip_origin)))
        coframes = np.concatenate((old_boundary.normal[:, :, None], old_boundary.cotangents), axis=2)
        relative = np.einsum("nki,nkj,nj->ni", new_boundary.frames, coframes, relative)
        normal, origin = relative[:, 0], relative[:, 1:]
    begun = replace(
        start,
        data=replace(data, mu_hat=turned(data.mu_hat), slip_origin=origin),
        multipliers=None if multipliers is None else (multipliers[0], turned(multipliers[1])),
        elastic_slip=moved(start.elastic_slip),
    )
    return begun, None if resting is None else replace(resting, u_t=moved(resting.u_t)), normal


def relative_to(previous: PreviousStep, boundary: ContactBoundary, moved: Array | None) -> PreviousStep:
    """The end of the last step as one begins from it whose foundations may have turned and moved, with shears along
    them.

    Args:
        previous: as it was.
        boundary: the points as they are now.
        moved: by which the foundations have moved at them, shape (n, d); None: they have not.
    """

    def along(vectors: Array) -> Array:
        return vectors - np.einsum("ni,ni->n", vectors, boundary.normal)[:, None] * boundary.normal

    tractions, elastic = previous.tractions, previous.elastic_slip
    tractions = replace(tractions, shear=along(tractions.shear))
    return replace(previous, tractions=tractions, elastic_slip=None if elastic is None else along(elastic), moved=moved)
