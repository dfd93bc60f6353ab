"""Soft contact: tangents of how it gives way under its pressure, until the pressures are those of the law.

The overclosure h(p) is replaced by its tangent at the last pressure, so that each point has a stiffness and an offset
of its own, and the contact problem is that of a penalty.  Newton's method in p: a law that is proportional needs one
problem, and where h is concave, as for exponential laws, pressures that are too small lead there without damping.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from signorini_fx.algebra.contact.complementarity import Yielding
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.machine import parallel
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.overclosure import Overclosure
from signorini_fx.records import Status
from signorini_fx.results.certificate.promised_law import overclosures_of
from signorini_fx.solving.iterated_interfaces.protocol import Interface, LoadStepEnd, LoadStepStart
from signorini_fx.tuned import OVERCLOSURE_MISSED, OVERCLOSURE_PROBLEMS, PRESSURE_FALLS


class Overclosures(Interface):
    """Those of a scene, see ``Interface``."""

    def solve(self, step: LoadStepStart) -> LoadStepEnd:
        """See ``Interface``."""
        model, start, newton = step.model, step.start, step.task.iterate.newton
        assert model.boundary is not None
        pressure = self._first(model, start.multipliers)
        for _ in range(OVERCLOSURE_PROBLEMS):
            begun = newton.checkpoint()
            overclosure, slope = self._tangent(model, pressure, start.data.gamma_n)
            share: Nodal = np.asarray(1.0 / (slope * start.data.gamma_n), dtype=np.float64)
            soft = Yielding(share, overclosure - slope * pressure)
            start = replace(start, data=replace(start.data, yielding=soft))
            end = step.solved(model, start)
            if end.outcome.status is not Status.CONVERGED:
                newton.restore(begun)
                return end
            reached = np.maximum(end.outcome.newton.multipliers()[0], 0.0)
            meant = overclosure + slope * (reached - pressure)
            by_law = self._tangent(model, reached, start.data.gamma_n)[0]
            overlap = end.outcome.problem.system.contact.traces(end.outcome.newton.x)[0] - start.data.gap
            # A point that its tangent leaves open may be closed by the law.
            closed = np.where(start.data.immovable, 0.0, np.maximum(overlap - by_law, 0.0))
            away = np.where(reached > 0, np.abs(by_law - meant), closed)
            scale = parallel.largest(model.comm, np.abs(meant))
            missed = float(parallel.largest(model.comm, away) / scale) if scale > 0 else 0.0
            if missed <= OVERCLOSURE_MISSED:
                return end
            step.task.history.add(f"soft contact: overclosures miss the law by {missed:.1e}: solved again")
            pressure = np.maximum(reached, PRESSURE_FALLS * pressure)
            start = start.begin_from(end.outcome.problem.sets, end.outcome.newton.multipliers())
        return replace(end, outcome=replace(end.outcome, status=Status.OUTER_MAX_ITERATIONS))

    @cached_property
    def _laws(self) -> dict[int, Overclosure]:
        return overclosures_of(self.statement)

    def _first(self, model: Model, multipliers: tuple[Nodal, Nodal] | None) -> Nodal:
        """Pressures to begin with: those of the last load step, and where that has none those that laws propose."""
        assert model.boundary is not None
        pressure = np.zeros(model.boundary.size) if multipliers is None else np.maximum(multipliers[0], 0.0)
        for number, law in self._laws.items():
            pressure = np.where((model.boundary.part == number) & (pressure == 0), law.start, pressure)
        return np.asarray(pressure)

    def _tangent(self, model: Model, pressure: Nodal, gamma: float) -> tuple[Nodal, Nodal]:
        """The overclosure at each point and its derivative; elsewhere those of the penalty."""
        assert model.boundary is not None
        overclosure: Nodal = np.asarray(pressure / gamma, dtype=np.float64)
        slope = np.full_like(pressure, 1.0 / gamma)
        for number, law in self._laws.items():
            on = model.boundary.part == number
            overclosure[on], slope[on] = law.tangent(pressure[on])
        return overclosure, slope


Kind = Overclosures
