"""Bonds of contacts that soften and tear, from load step to load step.

The state holds, at contact points, the damage, the opening and slip since the bond was made, and
the energy spent on tearing it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, Self

import numpy as np

from signorini_fx.algebra.contact.bond import Bond
from signorini_fx.arrays import Array, inner, length, matvec, rmatvec
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.effects.cohesion import PARAMETERS, Cohesion
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.step_effect import StepContact, StepEffect, StepEnd
from signorini_fx.records import Finding
from signorini_fx.tuned import NOTABLE, ROOT_OF_EPS

# The largest ratio of the opening at which bonds begin to soften to that at which they have torn,
# and the least stiffness of bonds over modulus / size of the body.
_FIRST_OF_LAST = 1e-3
_TIMES_BODY = 100.0
# Ratio of released energy to tearing energy above which it is reported.  Long load steps alone
# release some percent.
_RELEASED = 0.01


@dataclass(frozen=True)
class TearingBonds(StepEffect):
    """The bonds of contacts, by the numbers of the contacts."""

    parts: Mapping[int, Cohesion] = field(default_factory=dict)

    @classmethod
    def of(cls, entry: Mapping[int, Cohesion]) -> Self:
        return cls(entry)

    def contact(self, contact: StepContact, state: State, dt: float) -> StepContact:
        bond = self._bond(contact)
        if "damage" in state.fields:
            separation = state.fields["separation"].values
            bond = replace(
                bond,
                damage=state.fields["damage"].values,
                separation=rmatvec(contact.boundary.tangents, separation),
            )
        return replace(contact, data=replace(contact.data, bond=bond))

    def after(self, state: State, new: State, ended: StepEnd) -> State:
        now = ended.contact
        if now is None:
            return new
        boundary = now.boundary
        bond, traces = _begun(now, ended)
        earlier = state.fields.get("separation")
        last = np.zeros_like(boundary.x) if earlier is None else earlier.values
        first = bond.at(inner(last, boundary.normal), bond.separation)
        slip = matvec(boundary.tangents, traces[1] - bond.position[:, 1:])
        opened = np.maximum(now.gap - now.u_n, 0.0)
        taken = bond.torn(traces)
        taken = taken[:, 0] - taken[:, 1]
        # Released in a jump is the work of the tractions in the step, by the trapezoidal rule as
        # only both ends are known, minus what the bonds have dissipated and stored.
        way = np.column_stack(traces) - np.column_stack(first)
        work = inner(0.5 * (bond.tractions(traces) + bond.tractions(first)), way)
        jumped = work - taken - bond.stored(traces) + bond.stored(first)
        released = parallel.global_sum(boundary.comm, np.array(now.points.weight @ jumped))
        new = new.with_field("damage", "points", bond.damaged(traces))
        new = new.with_field("separation", "points", slip - opened[:, None] * boundary.normal)
        new = self.added(new, "torn", "points", taken)
        return self.added(new, "released", "global", np.array([released]))

    def figures(self, state: State, new: State, ended: StepEnd) -> Mapping[str, float]:
        now = ended.contact
        if now is None or "damage" not in new.fields:
            return {}
        bond, _ = _begun(now, ended)
        damage = new.fields["damage"].values
        softens = (damage > bond.damage) & (damage < 1.0)
        taken = new.fields["torn"].values
        rows = [(damage >= 1.0) & (taken > 0), softens, taken]
        sums = [np.dot(now.points.weight, row) for row in rows]
        names = ("broken", "process_zone", "torn")
        values = parallel.global_sum(now.boundary.comm, np.array(sums))
        # By this rule a step in which a bond begins to soften may release a negative amount.
        released = max(float(new.fields["released"].values[0]), 0.0)
        return {**dict(zip(names, map(float, values), strict=True)), "released": released}

    def columns(self, new: State) -> Mapping[str, Array]:
        separation = new.fields["separation"].values
        return {"damage": new.fields["damage"].values, "opening": length(separation)}

    def told(self, new: State, ended: StepEnd, figures: Mapping[str, float]) -> Iterator[Finding]:
        now = ended.contact
        if now is None:
            return
        bonded = (new.fields["damage"].values < 1.0) | (new.fields["torn"].values > 0)
        whole = float(parallel.global_sum(now.boundary.comm, np.array(now.points.weight @ bonded)))
        path = f"contact[{min(self.parts)}].cohesion"
        text = (
            f"broken {figures['broken']:.4g} of {whole:.4g}, process zone "
            f"{figures['process_zone']:.4g}; torn by an energy of {figures['torn']:.4g}, "
            f"{figures['released']:.2g} released"
        )
        yield Finding("note", path, text)
        if figures["released"] > _RELEASED * figures["torn"] > 0:
            text = (
                "the bond breaks in jumps, unless shorter load steps release less: take smaller "
                "facets (two of degree 2 in the process zone), or inertia if the jumps are real"
            )
            jumps = figures["released"] > NOTABLE * figures["torn"]
            yield Finding("warning" if jumps else "note", path, text)

    def findings(self, model: Model) -> Iterator[Finding]:
        boundary = model.boundary
        if boundary is None or not model.modulus:
            return
        mesh = model.tagged.mesh
        thinnest = float(np.ptp(model.pieces.bounds, axis=1).min())
        wanted = 4 // int(model.space.element.basix_element.degree)
        for number, part in self.parts.items():
            x = in_space(boundary.x[boundary.part == number])
            strength, shear, energy, second, _ = (
                sample(1.0 if value is None else value, x) for value in part.parameters
            )
            on = strength > 0
            lengths = energy[on] / strength[on] ** 2, second[on] / shear[on] ** 2
            shortest = -parallel.largest(mesh.comm, -np.concatenate(lengths))
            own = model.modulus * shortest
            # Fits to computed process zones, the first for thick sides, the second for thin ones.
            zone = min(0.2 * own, 0.5 * own**0.25 * thinnest**0.75)
            facets = [each for _, each, k in boundary.surface if k == number]
            sizes = [mesh.h(mesh.topology.dim - 1, each) for each in facets]
            size = parallel.largest(mesh.comm, np.concatenate(sizes), 0.0)
            level: Literal["warning", "note"] = "note" if size * wanted <= zone else "warning"
            text = f"facets of up to {size:.3g}, process zone of about {zone:.3g}"
            if level == "warning":
                text += f": take {wanted} or more in it, or the bond breaks in jumps"
            yield Finding(level, f"contact[{number}].cohesion", text)

    def _bond(self, contact: StepContact) -> Bond:
        """Return the intact bonds, of points where both sides touch and the strength is not zero.

        Raises:
            SceneError: a parameter is not positive somewhere, or a contact has no bonded point.
        """
        boundary = contact.boundary
        comm = boundary.comm
        x = in_space(boundary.x)
        rows = np.ones((6, boundary.size))
        near = contact.gap <= ROOT_OF_EPS * contact.model.tagged.size
        damage = np.ones(boundary.size)
        for number, part in self.parts.items():
            at = np.flatnonzero(boundary.part == number)
            values = [sample(1.0 if v is None else v, x[:, at]) for v in part.parameters]
            where = f"contact[{number}].cohesion"
            bonded = near[at] & (values[0] > 0)
            for key, row in zip(PARAMETERS, values, strict=True):
                wrong = ~(row >= 0) | (bonded & (row == 0))
                if parallel.any_rank(comm, wrong):
                    raise SceneError.at(f"{where}.{key}", "must be above 0 at all points")
            if not parallel.any_rank(comm, bonded):
                closest = -parallel.largest(comm, -contact.gap[at])
                reason = f"bonds no point: the sides are {closest:.3g} apart, or its strength is 0"
                raise SceneError.at(where, reason)
            damage[at[bonded]] = 0.0
            rows[1:, at[bonded]] = [row[bonded] for row in values]
        none = np.zeros((boundary.size, boundary.x.shape[1] - 1))
        laws = dict(zip(("stiffness", *PARAMETERS), rows, strict=True))
        bond = Bond(**laws, damage=damage, separation=none, position=boundary.x)
        least = bond.least_stiffness()
        floor = _TIMES_BODY * contact.model.modulus / contact.model.tagged.size
        stiff = np.minimum(np.maximum(least / _FIRST_OF_LAST, floor), contact.data.gamma_n)
        for number, part in self.parts.items():
            at = boundary.part == number
            stiff[at] = stiff[at] if part.stiffness is None else part.stiffness
            weak = at & (damage < 1.0) & (stiff <= least)
            if parallel.any_rank(comm, weak):
                needed = parallel.largest(comm, least[at & (damage < 1.0)], 0.0)
                reason = f"must be above {needed:.4g}, or the bond has torn before it softens"
                raise SceneError.at(f"contact[{number}].cohesion.stiffness", reason)
        return replace(bond, stiffness=stiff)


def _begun(now: ContactState, ended: StepEnd) -> tuple[Bond, tuple[Array, Array]]:
    """Return the bonds at the beginning of the step, and the displacements tau_N y and slip of the
    step at its end.
    """
    data = ended.model.data
    assert data is not None
    assert data.bond is not None
    bond = data.bond.begun(now.gap, np.zeros_like(now.slip_length))
    return bond, (now.u_n, now.slip_length)
