"""Wear of contact points, from load step to load step.

Archard's law with the pressure of the end of the step, h' = h + k lambda' ds in the gap d + h',
makes it a soft contact of stiffness 1 / (1 / gamma_1 + k ds): one contact problem, symmetric, and
stable for any slip ds.  With the pressure of its beginning it is stable only for k ds below about
2.2 h / E*, h the length of cells, and alternates between nothing and many times the pressure
beyond.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np

from signorini_fx.arrays import Array
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import heights_at_nodes
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.effects.wear import Archard
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.step_effect import StepContact, StepEffect, StepEnd
from signorini_fx.records import Finding, Status

_EXPLICIT = 2.2  # k ds E / h below which an explicit rule is stable
_MOST_DEPTH = 0.5  # of a cell: deeper its geometry is another one


@dataclass(frozen=True)
class Wear(StepEffect):
    """The wear of contacts, by their numbers; the field ``wear`` of the state is its depth at the
    contact points, length.
    """

    parts: Mapping[int, Archard]

    @classmethod
    def of(cls, entry: Mapping[int, Archard]) -> Self:
        return cls(entry)

    def findings(self, model: Model) -> Iterator[Finding]:
        boundary = model.boundary
        if boundary is None:
            return
        path = model.path
        ends = (
            -1.0 + k / (path.steps or 1) for k in range(len(path.times) * (path.steps or 1) + 1)
        )
        times = [path.time_at(place) for place in ends]
        softness: Array = np.zeros(boundary.size)
        for begin, end in pairwise(times):
            state = State(0, begin, np.zeros(0), np.zeros(0), ())
            softness = np.maximum(softness, self._softness(boundary, state, end))
        for number in self.parts:
            height = self._heights(boundary, number)
            most = softness[boundary.part == number] / height
            ratio = parallel.largest(boundary.comm, most) * model.scales.modulus / _EXPLICIT
            if ratio > 0:
                text = f"a step wears {ratio:.3g} times what an explicit rule could: it is implicit"
                yield Finding("note", f"contact[{number}].wear", text)

    @staticmethod
    def _heights(boundary: ContactBoundary, number: int) -> Array:
        """The heights of the cells at the points of a contact, length, shape (its points,);
        collective.
        """
        space, facets = next(each[:2] for each in boundary.surface if each[2] == number)
        at_nodes = heights_at_nodes(space, facets)
        return at_nodes[boundary.nodes[boundary.part == number]]

    def contact(self, contact: StepContact, state: State, dt: float) -> StepContact:
        boundary = contact.boundary
        softness = self._softness(boundary, state, state.time + dt)
        worn = state.fields.get("wear")
        contact = contact if worn is None else contact.with_gap(worn.values)
        return replace(contact, softness=softness)

    def _softness(self, boundary: ContactBoundary, state: State, time: float) -> Array:
        """By how much the pressure of a step wears each point, k ds, length per stress, shape
        (n,).
        """
        softness = np.zeros(boundary.size)
        for number, part in self.parts.items():
            on = boundary.part == number
            x = in_space(boundary.x[on])
            begin, end = (sample(part.distance.at_time(t), x) for t in (state.time, time))
            softness[on] = sample(part.coefficient, x) * np.maximum(end - begin, 0.0)
        return softness

    def after(self, state: State, new: State, ended: StepEnd) -> State:
        contact = ended.contact
        if contact is None:
            return new
        softness = self._softness(contact.boundary, state, new.time)
        return self.added(new, "wear", "points", softness * np.maximum(contact.pressure, 0.0))

    def outcome(self, state: State, new: State, ended: StepEnd) -> tuple[Status, Finding] | None:
        contact = ended.contact
        if contact is None:
            return None
        boundary = contact.boundary
        depth = new.fields["wear"].values
        for number in self.parts:
            worn = depth[boundary.part == number] / self._heights(boundary, number)
            deepest = parallel.largest(boundary.comm, worn)
            if deepest > _MOST_DEPTH:
                reason = f"is {deepest:.2g} cells deep: take larger cells, or remesh the worn body"
                return Status.WORN, Finding("warning", f"contact[{number}].wear", reason)
        return None

    def figures(self, state: State, new: State, ended: StepEnd) -> Mapping[str, float]:
        """Return the largest depth, the volume, and by how much of its growth the gaps that closed
        differ from k times force times slip.
        """
        contact = ended.contact
        if contact is None:
            return {}
        boundary = contact.boundary
        softness = self._softness(boundary, state, new.time)
        depth = new.fields["wear"].values
        pressed = contact.pressure > 0
        assert new.gammas is not None
        closed = contact.u_n - ended.gap - contact.pressure / new.gammas[0]
        closed = np.where(pressed & (softness > 0), closed, 0.0)
        rows = [depth, closed, softness * np.where(pressed, contact.pressure, 0.0)]
        sums = boundary.weight @ np.column_stack(rows)
        volume, grown, expected = parallel.global_sum(boundary.comm, sums)
        return {
            "wear": parallel.largest(boundary.comm, depth),
            "worn_volume": float(volume),
            "wear_error": float(grown / expected - 1.0) if expected else 0.0,
        }
