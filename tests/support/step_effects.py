"""Effects in time of a user's own, which tests give to scenes and forms."""

from __future__ import annotations

from dataclasses import dataclass

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
