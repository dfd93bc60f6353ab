"""Effects in time of a user's own, which tests give to scenes and forms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from mpi4py import MPI
from numpy.testing import assert_allclose

from signorini_fx import build_problem, solve
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.interfaces import Foundation
from signorini_fx.mechanics.statement.effect import ContactPart, Part
from signorini_fx.mechanics.statement.values import Positive
from signorini_fx.mechanics.step_effect import StepEffect


class Counted(StepEffect):
    """Counts load steps, and adds up pressures."""

    def after(self, state, new, ended):
        new = self.added(new, "impulse", "points", ended.contact.pressure * ended.dt)
        return self.added(new, "steps", "global", [1.0])


@dataclass(frozen=True)
class Wear(StepEffect):
    """The gap grows by ``rate``, length per stress, times the pressure of each load step."""

    rate: float

    def contact(self, contact, state, dt):
        worn = state.fields.get("worn")
        return contact if worn is None else contact.with_gap(worn.values)

    def after(self, state, new, ended):
        return self.added(new, "worn", "points", self.rate * ended.contact.pressure)


class Erosion(ContactPart):
    """``Wear`` as a table within a contact."""

    key: ClassVar[str] = "erosion"
    step_effect: ClassVar[str] = "erosion"
    rate: Positive


@dataclass(frozen=True)
class ErodedContacts(Wear):
    """It for the contacts that have such a table."""

    @classmethod
    def of(cls, entry):
        ((number, part),) = entry.items()
        return cls(part.rate * (number + 1))


class ErodedContact(Contact):
    """A contact with a key for it."""

    erosion: Part = None


@dataclass(frozen=True)
class ErodedFoundation(Foundation):
    """A foundation of forms with it."""

    erosion: Any = None


def solve_on(scene, done):
    """The solution of a scene, of which another goes on after so many load steps: the rest is that
    of one run, on one rank bit by bit, with what is remembered.

    On several ranks MUMPS adds what ranks send each other in the order in which it arrives: of 60
    equal solves of one matrix with one right side 2 to 6 solutions differ in their last digits.
    """
    digits = 0.0 if MPI.COMM_WORLD.size == 1 else 1e-13
    whole = solve(scene, effects=[Counted()])
    problem = build_problem(scene, effects=[Counted()])
    state = problem.initial()
    for step in whole.steps[:done]:
        state, result = problem.step(state, step.time)
        assert result.status.value == "converged"
    rest = solve(scene, state=state, effects=[Counted()])
    count = len(whole.steps)
    assert [step.step for step in rest.steps] == list(range(done + 1, count + 1))
    assert rest.state.number == whole.state.number == count
    for ours, theirs in zip(rest.steps, whole.steps[done:], strict=True):
        u, expected = (one.displacement.x.array for one in (ours, theirs))
        assert_allclose(u, expected, rtol=0, atol=digits * np.abs(expected).max())
        assert (ours.linear_solves, ours.time) == (theirs.linear_solves, theirs.time)
    for name, field in whole.state.fields.items():
        atol = 1e-13 * np.abs(field.values).max(initial=0.0)
        assert_allclose(rest.state.fields[name].values, field.values, rtol=0, atol=atol)
    assert whole.state.fields["steps"].values == [float(count)]
    return whole
