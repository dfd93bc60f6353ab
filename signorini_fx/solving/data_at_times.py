"""The load steps of a stated problem: foundations, friction and loads are what its statement says of their time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dolfinx import fem

from signorini_fx.algebra.algorithms.task import Start, Task
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.body.discretisation import moved_since, placed
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.model import Model
from signorini_fx.results.certificate.law_of_method import PreviousStep
from signorini_fx.results.step_frames import StepEnd, from_rest, turned
from signorini_fx.solving.stepped_body import BegunStep, SteppedBody


@dataclass(frozen=True)
class StatedSteps(SteppedBody):
    """A body that a statement says all of; ``renew``: makes the contact problem of a model whose foundations have
    moved.
    """

    renew: Callable[[Model], Task]

    def begun(self, path_step: float, task: Task, first: Start, end: StepEnd | None) -> BegunStep:
        earlier, start, last = self.model, first, None
        if end is not None:
            start, last = end.start, end.before
        moved = placed(earlier, path_step)
        if moved is earlier:
            return BegunStep(self, task, start, last)
        stepped = replace(self, model=moved)
        if moved.boundary is earlier.boundary:
            assert moved.law is not None
            bound = moved.law.given if start.multipliers is None else moved.law.bound(start.multipliers[0])
            return BegunStep(stepped, task, replace(start, law=moved.law, data=replace(start.data, bound=bound)), last)
        task = self.renew(moved)
        return BegunStep(stepped, task, *on_moved_foundations(earlier, moved, task, start, end))

    def load(self, system: ElasticSystem, path_step: float) -> Nodal:
        return self.model.load(system, path_step)


def on_moved_foundations(
    earlier: Model, moved: Model, task: Task, start: Start, end: StepEnd | None
) -> tuple[Start, PreviousStep]:
    """A load step on foundations that have moved: where it starts, and the end of the last one as it begins from it;
    supports hold the body, see ``check.findings``; collective.
    """
    assert earlier.boundary is not None
    assert moved.boundary is not None
    if end is None:
        drift, begun = moved_since(moved, moved.statement.placed(-1)), task.start
        if start.sets is not None and start.multipliers is not None:  # of a coarser mesh
            pressure, shear = start.multipliers
            shear = np.einsum("njk,nk->nj", turned(earlier.boundary, moved.boundary), shear)
            begun = begun.begin_from(start.sets, (pressure, shear))
        return from_rest(moved.space, moved.boundary, begun, drift)
    end.taken_up(task, moved, moved.rigid)
    begun, _ = end.projected_onto(moved.boundary, held=True)
    if task.rest is not None:  # contact alone holds the body, which comes to rest elsewhere with another gap
        begun = replace(begun, data=replace(begun.data, slip_origin=begun.data.slip_origin - task.rest.u_t))
    drift = moved_since(moved, earlier.statement)
    begun, before = end.begins_on(moved.boundary, task.start.data, moved.law, drift, start=begun)
    change = _seen_otherwise(earlier.boundary, moved.boundary, before.displacement)
    if change is None or begun.multipliers is None:
        return begun, before
    tangents = moved.boundary.tangents
    data = replace(begun.data, slip_origin=begun.data.slip_origin + np.einsum("nij,ni->nj", tangents, change))
    across = np.zeros((moved.boundary.size, tangents.shape[1], tangents.shape[1]))
    for number, pair in moved.pairs.items():
        across[moved.boundary.part == number] = pair.across
    if not parallel.any_rank(moved.boundary.comm, bool(across.any())):
        return replace(begun, data=data), before

    def without_across(vectors: Nodal | None) -> Any:  # of shears along the tangents, or in 3D
        if vectors is None:
            return None
        inner = across if vectors.shape[1] == across.shape[1] else tangents.swapaxes(1, 2) @ across @ tangents
        return vectors - np.einsum("nij,nj->ni", inner, vectors)

    pressure, shear = begun.multipliers
    begun = replace(
        begun,
        data=replace(data, mu_hat=without_across(data.mu_hat)),
        multipliers=(pressure, without_across(shear)),
        elastic_slip=without_across(begun.elastic_slip),
    )
    tractions = replace(before.tractions, shear=without_across(before.tractions.shear))
    return begun, replace(before, tractions=tractions, elastic_slip=without_across(before.elastic_slip))


def _seen_otherwise(earlier: ContactBoundary, now: ContactBoundary, displacement: fem.Function) -> Nodal | None:
    """What the relative displacement at the points of two bodies is now more than it was for the same displacement,
    shape (n, d): a support that holds from now on, or does no longer, changes across which planes of symmetry there is
    none; None: points see what they have seen; collective.
    """
    if earlier.averages is None or now.averages is None:
        return None
    space = displacement.function_space
    dim, owned = space.mesh.geometry.dim, space.dofmap.index_map.size_local
    y = displacement.x.array.reshape(-1, dim)[:owned]
    seen = [
        (averages.operator @ from_owners(y, averages.nodes, now.comm).ravel()).reshape(-1, dim)
        for averages in (earlier.averages, now.averages)
    ]
    return np.asarray(seen[1] - seen[0])
