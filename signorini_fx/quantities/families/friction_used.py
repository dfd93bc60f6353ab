"""How much of its friction a body uses that supports do not hold."""

from __future__ import annotations

from typing import Any

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.digits import percent
from signorini_fx.quantities.quantity import Card, Quantity, Summary
from signorini_fx.quantities.text import row


class FrictionUsed(Quantity):
    """Of the loads of the last load step that has a solution."""

    key, first = "friction_used", True
    title = "Share of its friction that the loads use, with the friction bounds of this solution."
    terminal, report = "friction used", "friction used"

    def asked(self, solution: Any) -> bool:
        return solution.contact is not None

    def value(self, solution: Any) -> Any:
        return solution.friction_used

    def lines(self, summary: Summary) -> list[TerminalLine]:
        return [row(self.terminal, percent(summary[self.key]))] if summary.get(self.key) else []

    def cards(self, summary: Summary) -> list[Card]:
        return [Card(self.report, percent(summary[self.key]))] if summary.get(self.key) else []


class HeldBySupports(Quantity):
    """Then no load moves the body away."""

    key, kind, scope, stage = "held_by_supports", bool, "all", "results"
    title = "Whether supports leave the body no rigid motion, so that no load can move it away."

    def value(self, solution: Any) -> Any:
        return solution.model.motions.free.shape[1] == 0


QUANTITIES = (FrictionUsed(), HeldBySupports())
