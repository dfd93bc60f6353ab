"""The contact law of a result beside the one that was asked for."""

from __future__ import annotations

from typing import Any

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.kinds import Row, described
from signorini_fx.quantities.quantity import Quantity, Summary
from signorini_fx.quantities.text import row


class LawOfResult(Row):
    """The law that the certificate judges, and the one that the settings ask for."""

    asked: str = described("What the settings ask for; empty: nothing particular.")
    delivered: str = described("The law of the results.")
    differs: str = described("In what it is not what was asked for, and what to do; empty: in nothing.")


class ContactLaw(Quantity):
    """Of a solution."""

    key, kind, stage, first = "law", LawOfResult, "results", True
    title = "The contact law of the results, and whether it is the one that was asked for; absent without a solution."
    terminal = "law"

    def value(self, solution: Any) -> Any:
        law = solution.law
        return None if law is None else law.as_dict()

    def lines(self, summary: Summary) -> list[TerminalLine]:
        """See ``Quantity``: if it is not what was asked for."""
        law = summary.get(self.key)
        return (
            [row(self.terminal, f"{law['delivered']}, not what was asked for", "warning")]
            if law and law["differs"]
            else []
        )


QUANTITIES = (ContactLaw(),)
