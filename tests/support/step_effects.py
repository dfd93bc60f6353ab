"""Effects in time of a user's own, which tests give to scenes and forms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

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
