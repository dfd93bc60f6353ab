"""Fluids that enter contact as it opens, from load step to load step.

Their pressure acts on both sides at contact points that are open and connected, over facets between
open points, with the boundary that the fluid comes from.  A step starts with the wet points of the
previous one.  Its first repetition drops those that have closed; later ones only add points that
open, so that a step ends after finitely many repetitions.  If there are several equilibria the one
with the least fluid is found.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from signorini_fx.algebra.linalg import LoadCase
from signorini_fx.arrays import Array, Flags
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import to_owners
from signorini_fx.mechanics.assembly.mesh_entities import facet_nodes, marked_nodes
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.effects.seeping import Seeping
from signorini_fx.mechanics.model import Loads, Model
from signorini_fx.mechanics.state import Field, State
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.step_effect import AddedForces, StepEffect, StepEnd
from signorini_fx.records import Finding, Status


@dataclass(frozen=True)
class SeepingFluids(StepEffect):
    """The fluids in contacts, by the numbers of the contacts.

    Fields of the state: ``wet``, 1 at points that a fluid reaches, else 0; ``wetted``, the number
    of the step in which they were last determined.
    """

    parts: Mapping[int, Seeping]

    @classmethod
    def of(cls, entry: Mapping[int, Seeping]) -> Self:
        return cls(entry)

    # --- a step ---

    def load(self, model: Model, loads: Loads, state: State, dt: float) -> LoadCase | None:
        pressed = sum(self._forces(model, state, dt).values(), np.zeros(1))
        return model.case(loads.forces + pressed, loads.prescribed)

    def forces(
        self, model: Model, loads: Loads, state: State, dt: float, y: Array
    ) -> AddedForces | None:
        dim = model.dimension
        owned = model.fixed.size // dim
        prescribed = loads.prescribed[: owned * dim].reshape(-1, dim)
        total = np.zeros_like(prescribed)
        named = []
        for number, forces in self._forces(model, state, dt).items():
            contact = model.contacts[number]
            pressed = forces.reshape(-1, dim)
            total += pressed
            nodes = facet_nodes(model.space, model.tagged.facets(contact.boundary)).ravel()
            own = marked_nodes(model.space, nodes)[:owned, None]
            named.append((contact.boundary, "fluid", pressed * own))
            if contact.against is not None:
                named.append((contact.against, "fluid", pressed * ~own))
        none = np.zeros_like(total)
        return AddedForces(none, total, prescribed, none, none[:, 0], named=named)

    def _forces(self, model: Model, state: State, dt: float) -> dict[int, Array]:
        """Return the forces of each fluid on the owned nodes, shape (owned dofs,); collective."""
        boundary = model.boundary
        assert boundary is not None
        averages = boundary.averages
        pressure = self._pressure(boundary, state.time + dt) * _wet(boundary, state)
        no_shear = np.zeros((boundary.size, model.dimension - 1))
        forces = dict[int, Array]()
        for number in self.parts:
            at_points = -boundary.nodal_forces(pressure * (boundary.part == number), no_shear)
            at_nodes = (averages.operator.T @ at_points.ravel()).reshape(averages.x.shape)
            owned = model.fixed.size // model.dimension
            forces[number] = to_owners(at_nodes, averages.nodes, model.comm, owned).ravel()
        return forces

    def _pressure(self, boundary: ContactBoundary, time: float) -> Array:
        """Return the pressure of the fluid at each point, whether it reaches the point or not,
        stress, shape (n,).
        """
        pressure = np.zeros(boundary.size)
        for number, part in self.parts.items():
            on = boundary.part == number
            pressure[on] = sample(part.at_time(time).pressure, in_space(boundary.x[on]))
        return pressure

    def initial(self, model: Model | None, state: State) -> State:
        if model is not None and model.boundary is not None:
            self._at_side(model, model.boundary)
        return state

    def findings(self, model: Model) -> Iterator[Finding]:
        if model.boundary is not None:
            self._at_side(model, model.boundary)
        return iter(())

    def _at_side(self, model: Model, boundary: ContactBoundary) -> Flags:
        """Return which points are on the boundary that their fluid comes from, shape (n,);
        collective.

        Raises:
            SceneError: a contact has no such point.
        """
        tagged = model.tagged
        at_side = np.zeros(boundary.size, dtype=bool)
        for number, part in self.parts.items():
            facets = tagged.facets(part.side) if part.side in tagged.boundaries else np.arange(0)
            nodes = facet_nodes(model.space, facets.astype(np.int32)).ravel()
            own = marked_nodes(model.space, nodes)[boundary.nodes] & (boundary.part == number)
            if not parallel.any_rank(boundary.comm, own):
                name = model.contacts[number].boundary
                reason = f"{part.side!r} has no node of {name!r}: name a boundary that it ends at"
                raise SceneError.at(f"contact[{number}].seeping.side", reason)
            at_side |= own
        return at_side

    def _reached(self, ended: StepEnd) -> Flags:
        """Return which points are open and connected, over open points, with the boundary that
        their fluid comes from, shape (n,); collective.
        """
        contact = ended.contact
        assert contact is not None
        boundary = contact.boundary
        open_points = ~contact.in_contact & boundary.at_nodes
        at_side = self._at_side(ended.model, boundary)
        comm = boundary.comm
        nodes = int(ended.model.space.dofmap.index_map.size_global)
        key = boundary.part.astype(np.int64) * nodes + boundary.global_nodes
        rows = parallel.gather_rows(comm, np.column_stack((key, open_points, at_side)))
        order = np.argsort(rows[:, 0])
        facets = parallel.gather_rows(comm, boundary.segments)
        wanted = facets[:, :1] * nodes + facets[:, 1:]
        place = np.searchsorted(rows[order, 0], wanted).clip(max=max(len(rows) - 1, 0))
        ends = np.triu_indices(wanted.shape[1], 1)
        if ended.model.dimension == 2:  # in order along the facet
            ends = np.arange(wanted.shape[1] - 1), np.arange(1, wanted.shape[1])
        point = order[place]
        passes = (rows[point, 0] == wanted) & (rows[point, 1] > 0)
        links = np.stack([point[:, each] for each in ends])[
            :, passes[:, ends[0]] & passes[:, ends[1]]
        ]
        graph = sp.coo_array((np.ones(links.shape[1]), tuple(links)), shape=2 * (len(rows),))
        _, piece = connected_components(graph, directed=False)
        reached = np.isin(piece, piece[(rows[:, 1] * rows[:, 2]) > 0])
        first = parallel.rows_before(comm, boundary.size)
        return np.asarray(reached[first : first + boundary.size])

    def repeat(self, state: State, new: State, ended: StepEnd) -> State | None:
        if ended.contact is None:
            return None
        used = _wet(ended.contact.boundary, state)
        found = self._reached(ended)
        begun = state.fields.get("wetted")
        if begun is not None and begun.values[0] == new.number:
            found = found | used
        if not parallel.any_rank(ended.model.comm, found != used):
            return None
        wet = Field("points", found.astype(float))
        fields = {**state.fields, "wet": wet, "wetted": Field("global", np.array([new.number]))}
        return replace(state, fields=fields)

    def last_begun(self, state: State, new: State) -> State:
        fields = {name: new.fields[name] for name in ("wet", "wetted") if name in new.fields}
        return replace(state, fields={**state.fields, **fields})

    def after(self, state: State, new: State, ended: StepEnd) -> State:
        if ended.contact is None:
            return new
        return new.with_field("wet", "points", _wet(ended.contact.boundary, state))

    def outcome(self, state: State, new: State, ended: StepEnd) -> tuple[Status, Finding] | None:
        if self.repeat(state, new, ended) is None:
            return None
        reason = "still goes further: take shorter load steps"
        finding = Finding("warning", f"contact[{min(self.parts)}].seeping", reason)
        return Status.OUTER_MAX_ITERATIONS, finding

    # --- what is told ---

    def columns(self, new: State) -> Mapping[str, Array]:
        return {"wet": new.fields["wet"].values}

    def figures(self, state: State, new: State, ended: StepEnd) -> Mapping[str, float]:
        """Return the area that fluids reach, and the integral of their pressure over it."""
        if ended.contact is None:
            return {}
        boundary = ended.contact.boundary
        wet = boundary.weight * _wet(boundary, state)
        rows = np.array([wet.sum(), wet @ self._pressure(boundary, new.time)])
        area, force = parallel.global_sum(boundary.comm, rows)
        return {"fluid_area": float(area), "fluid_force": float(force)}

    def told(self, new: State, ended: StepEnd, figures: Mapping[str, float]) -> Iterator[Finding]:
        text = f"fluid on {figures['fluid_area']:.4g}, pushes with {figures['fluid_force']:.4g}"
        yield Finding("note", f"contact[{min(self.parts)}].seeping", text)


def _wet(boundary: ContactBoundary, state: State) -> Flags:
    """Return which points a fluid reaches in a step that starts from this state, shape (n,)."""
    wet = state.fields.get("wet")
    return np.zeros(boundary.size, dtype=bool) if wet is None else wet.values.ravel() > 0
