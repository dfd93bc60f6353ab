"""Wear of contact points, from load step to load step.

Archard's law with the pressure at the end of the step, h' = h + k lambda' ds in the gap d + h',
makes contact soft with the stiffness 1 / (1 / gamma_1 + k ds).  The contact problem stays symmetric
and is stable for any slip ds.  With the pressure at the beginning of the step it would be stable
only for k ds below about 2.2 h / E*, with h here the length of cells; beyond, the pressure
alternates between zero and many times its value.  Where the slip is that of the contact itself, the
step is solved again with the slip found.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np

from signorini_fx.arrays import Array, length
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.machine.display import clean
from signorini_fx.mechanics.assembly.mesh_entities import heights_at_nodes
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.effects.wear import Archard
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.state import Field, State
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.step_effect import StepContact, StepEffect, StepEnd
from signorini_fx.records import Finding, Status

_EXPLICIT = 2.2  # k ds E / h below which an explicit rule is stable
_SETTLED = 1e-9  # change of wear by the slip found, relative to the deepest wear of the step
_MOST_DEPTH = 0.5  # wear over height of the cell; beyond it the geometry of the mesh is wrong


@dataclass(frozen=True)
class Wear(StepEffect):
    """The wear of contacts, by the numbers of the contacts.

    Fields of the state at contact points: ``wear``, its depth, length; ``dissipated``, the friction
    energy so far, per area; ``sliding``, the slip of the last step where that determines the wear,
    length.
    """

    parts: Mapping[int, Archard]

    @classmethod
    def of(cls, entry: Mapping[int, Archard]) -> Self:
        return cls(entry)

    # --- a step ---

    def contact(self, contact: StepContact, state: State, dt: float) -> StepContact:
        softness = self._softness(contact.model, contact.boundary, state, state.time + dt)
        worn = state.fields.get("wear")
        contact = contact if worn is None else contact.with_gap(worn.values)
        return replace(contact, softness=softness)

    def _softness(
        self, model: Model, boundary: ContactBoundary, state: State, time: float
    ) -> Array:
        """Return the depth that a unit of pressure wears at each point in a step, k ds, length per
        stress, shape (n,).
        """
        sliding = state.fields.get("sliding")
        softness = np.zeros(boundary.size)
        for number, part in self.parts.items():
            on = boundary.part == number
            x = in_space(boundary.x[on])
            slip: Array | None = None
            if part.distance is not None:
                begin, end = (sample(part.distance.at_time(t), x) for t in (state.time, time))
                slip = end - begin
                _check(boundary, slip, f"contact[{number}].wear.distance", "falls with the time")
            elif sliding is not None:
                slip = sliding.values[on]
            coefficient = sample(part.coefficient, x)
            _check(boundary, coefficient, f"contact[{number}].wear.coefficient", "is negative")
            if slip is not None:
                softness[on] = coefficient * np.maximum(slip, 0.0)
        return model.path.jump_at(state.number) * softness

    def repeat(self, state: State, new: State, ended: StepEnd) -> State | None:
        again, unsettled = self._again(state, new, ended)
        return again if unsettled > _SETTLED else None

    def _again(self, state: State, new: State, ended: StepEnd) -> tuple[State, float]:
        """Return the state with the slip found in a step, and the change of wear that it causes,
        relative to the deepest wear of the step; collective.

        Only contacts whose wear depends on their own slip count; without any the change is zero.
        """
        own = [number for number, part in self.parts.items() if part.distance is None]
        contact = ended.contact
        if contact is None or not own:
            return state, 0.0
        boundary = contact.boundary
        again = _with_slip(state, np.where(np.isin(boundary.part, own), length(contact.xi), 0.0))
        used, found = (
            contact.pressure * self._softness(ended.model, boundary, each, new.time)
            for each in (state, again)
        )
        most = parallel.largest(boundary.comm, np.maximum(used, found))
        change = parallel.largest(boundary.comm, np.abs(found - used))
        return again, change / most if most > 0 else 0.0

    def last_begun(self, state: State, new: State) -> State:
        found = new.fields.get("sliding")
        return state if found is None else _with_slip(state, found.values)

    def after(self, state: State, new: State, ended: StepEnd) -> State:
        contact = ended.contact
        if contact is None:
            return new
        softness = self._softness(ended.model, contact.boundary, state, new.time)
        new = self.added(new, "wear", "points", softness * np.maximum(contact.pressure, 0.0))
        jump = ended.model.path.jump_at(state.number)
        return self.added(new, "dissipated", "points", jump * contact.friction_energy)

    def outcome(self, state: State, new: State, ended: StepEnd) -> tuple[Status, Finding] | None:
        contact = ended.contact
        if contact is None:
            return None
        boundary = contact.boundary
        _, unsettled = self._again(state, new, ended)
        if unsettled > _SETTLED:
            number = next(number for number, part in self.parts.items() if part.distance is None)
            reason = f"its slip still changes the depth by {unsettled:.1g}: take shorter load steps"
            finding = Finding("warning", f"contact[{number}].wear", reason)
            return Status.OUTER_MAX_ITERATIONS, finding
        depth = new.fields["wear"].values
        for number in self.parts:
            worn = depth[boundary.part == number] / _heights(boundary, number)
            deepest = parallel.largest(boundary.comm, worn)
            if deepest > _MOST_DEPTH:
                reason = f"is {deepest:.2g} cells deep: take larger cells, or remesh the worn body"
                return Status.WORN, Finding("warning", f"contact[{number}].wear", reason)
        return None

    # --- what is told ---

    def findings(self, model: Model) -> Iterator[Finding]:
        boundary = model.boundary
        if boundary is None:
            return
        path = model.path
        divided = path.steps or 1
        places = (-1.0 + k / divided for k in range(len(path.times) * divided + 1))
        largest: Array = np.zeros(boundary.size)
        total: Array = np.zeros(boundary.size)
        for number, (begin, end) in enumerate(pairwise(map(path.time_at, places))):
            state = State(number, begin, np.zeros(0), np.zeros(0), ())
            softness = self._softness(model, boundary, state, end)
            largest = np.maximum(largest, softness)
            total = total + softness
        comm = boundary.comm
        for number in self.parts:
            on = boundary.part == number
            height = _heights(boundary, number)
            most = parallel.largest(comm, largest[on] / height)
            ratio = most * model.scales.modulus / _EXPLICIT
            where = f"contact[{number}].wear"
            if ratio > 0:
                text = f"a step wears {ratio:.3g} times what an explicit rule could: it is implicit"
                yield Finding("note", where, text)
            if len(model.contacts) > 1:
                continue  # the share of the loads that it bears is unknown
            loads = model.loads_at(len(path.times) - 1.0).forces.reshape(-1, model.dimension)
            force = parallel.global_sum(comm, loads.sum(axis=0))
            if model.kinematics.zero_on_axis:
                force = force[1:2]  # radial forces cancel each other
            area = float(parallel.global_sum(comm, boundary.weight.sum()))
            deep = parallel.largest(comm, total[on] / height) * np.linalg.norm(force) / area
            if deep > _MOST_DEPTH:
                text = f"would be {deep:.2g} cells deep, if all of it touched: take larger cells"
                yield Finding("warning", where, text)

    def columns(self, new: State) -> Mapping[str, Array]:
        return {name: new.fields[name].values for name in ("wear", "dissipated")}

    def told(self, new: State, ended: StepEnd, figures: Mapping[str, float]) -> Iterator[Finding]:
        contact = ended.contact
        if contact is None:
            return
        boundary = contact.boundary
        slip = length(contact.xi) * contact.in_contact
        x = boundary.x[:, : ended.model.dimension]
        rows = np.column_stack(
            (boundary.part, *self.columns(new).values(), slip, boundary.weight, x)
        )
        gathered = parallel.gather_rows(boundary.comm, rows)
        for number, entry in self.parts.items():
            _, depth, work, slips, weight, *place = gathered[gathered[:, 0] == number].T
            deepest = np.lexsort((*np.round(place[::-1], 9), -np.round(depth, 12)))[0]
            extent = max(np.ptp(along) for along in place)
            at = ", ".join(f"{x:.4g}" for x in clean([along[deepest] for along in place], extent))
            name = ended.model.contacts[number].boundary
            text = f"{name}: worn {depth[deepest]:.4g} deep at ({at}), volume {weight @ depth:.4g}"
            if entry.distance is None:
                text += f"; in the last step it slips by up to {slips.max():.4g}"
            if contact.has_friction:
                text += f"; energy of friction {weight @ work:.4g}"
            yield Finding("note", f"contact[{number}].wear", text)

    def figures(self, state: State, new: State, ended: StepEnd) -> Mapping[str, float]:
        """Return the largest depth, worn volume, friction energy and largest slip, and the relative
        error of the wear of the step: the gap that has closed compared with k times force times
        slip.
        """
        contact = ended.contact
        if contact is None:
            return {}
        boundary = contact.boundary
        softness = self._softness(ended.model, boundary, state, new.time)
        depth = new.fields["wear"].values
        pressed = contact.pressure > 0
        assert new.gammas is not None
        stiffness = np.full(boundary.size, new.gammas[0])
        for number, entry in enumerate(ended.model.contacts):
            if entry.overclosure is not None:
                stiffness[boundary.part == number] = entry.overclosure.stiffness
        expected = softness * np.where(pressed, contact.pressure, 0.0)
        entered = contact.u_n - contact.gap - contact.pressure / stiffness
        closed = expected + np.where(pressed & (softness > 0), entered, 0.0)
        rows = [depth, new.fields["dissipated"].values, closed, expected]
        sums = boundary.weight @ np.column_stack(rows)
        volume, dissipated, grown, wanted = parallel.global_sum(boundary.comm, sums)
        return {
            "wear": parallel.largest(boundary.comm, depth),
            "worn_volume": float(volume),
            "dissipated": float(dissipated),
            "slip_range": parallel.largest(boundary.comm, length(contact.xi) * pressed),
            "wear_error": float(grown / wanted - 1.0) if wanted else 0.0,
        }


def _check(boundary: ContactBoundary, values: Array, path: str, wrong: str) -> None:
    """Raise an error on all ranks if values at contact points are negative or not finite;
    collective.

    Raises:
        SceneError: there are such values on some rank.
    """
    reason = "" if np.isfinite(values).all() else "is not finite"
    if (values < 0).any():
        reason = wrong
    error = SceneError.at(path, f"{reason} at some contact points") if reason else None
    parallel.raise_together(boundary.comm, error)


def _with_slip(state: State, slip: Array) -> State:
    """Return a state whose field ``sliding`` is this slip of the contact points."""
    return replace(state, fields={**state.fields, "sliding": Field("points", slip)})


def _heights(boundary: ContactBoundary, number: int) -> Array:
    """Return the heights of the cells at the points of one contact, length, shape (its points,);
    collective.
    """
    space, facets = next(each[:2] for each in boundary.surface if each[2] == number)
    at_nodes = heights_at_nodes(space, facets)
    return at_nodes[boundary.nodes[boundary.part == number]]
