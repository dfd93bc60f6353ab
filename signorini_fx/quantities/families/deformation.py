"""How small the deformation is."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.kinds import Number, Row, described
from signorini_fx.quantities.quantity import Quantity, Summary
from signorini_fx.quantities.text import row


class LargestDeformation(Row):
    """Of the load step with the largest one."""

    gradient: Number = described("Mean strain and rotation.")
    displacement: Number = described("Largest displacement, relative to the size of the body.")


class DeformationOfBody(Quantity):
    """Relative figures."""

    key, kind, scope, stage = "deformation", LargestDeformation, "all", "results"
    title = "Of the load step with the largest one."
    terminal = "deformation"

    def value(self, solution: Any) -> Any:
        return asdict(max((step.deformation for step in solution.shown_steps), key=lambda step: step.largest))

    def lines(self, summary: Summary) -> list[TerminalLine]:
        figures = summary[self.key]
        text = (
            f"strains and rotations of {figures['gradient']:.1e} on average, displacements of at most "
            f"{figures['displacement']:.1e} times the size of the body"
        )
        return [row(self.terminal, text)]


QUANTITIES = (DeformationOfBody(),)
