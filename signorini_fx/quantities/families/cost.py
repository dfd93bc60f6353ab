"""What the accuracy took, and what a better one would take."""

from __future__ import annotations

from typing import Any

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.kinds import Count, Number, Row, described
from signorini_fx.quantities.quantity import Quantity, Summary
from signorini_fx.quantities.text import row
from signorini_fx.records import Status


class CostFigures(Row):
    """Of the estimated error and the seconds of this run."""

    of: str | None = described(
        "The error that it is about, a column of the convergence table: `energy` is that of stress and displacement.",
        default=None,
    )
    error: Number = described("Estimated error of the last mesh, relative.", default=None)
    seconds: Number = described("What it took, all meshes together, wall time.", default=None)
    dofs: Count | None = described("Unknowns of the last mesh.", default=None)
    next_error: Number = described("A smaller error: a tenth in 2D, half in 3D, relative.", default=None)
    next_seconds: list[Number] = described("What that would take on this machine, from and to.", default_factory=list)
    next_dofs: Number = described("About how many unknowns it would take.", default=None)
    command: str | None = described(
        "What asks for it, to be pasted behind the command or in `solve_to_accuracy`.", default=None
    )
    local: bool | None = described("Whether cells become smaller only where the error is.", default=None)
    statement: str = described("All of it in a sentence, or why there is no forecast.")


def cost_in_words(summary: Summary) -> str:
    """What the error took, and what a smaller one would take; or why that is not known; "": nobody has asked."""
    cost = summary.get("cost")
    if cost is None:
        return ""
    statement: str = cost["statement"]
    if cost.get("error") is not None and summary.get("status") == Status.OUT_OF_REACH.value:
        return f"{statement.partition(';')[0]}; no finer mesh helps"  # whatever the rate of the meshes so far promises
    return statement if cost.get("error") is not None else f"no forecast: {statement}"


class CostOfSolution(Quantity):
    """See ``accuracy.next_accuracy``."""

    key, kind = "cost", CostFigures
    title = "What the accuracy took, and what a better one would take; a forecast."
    terminal = "cost"

    def value(self, solution: Any) -> Any:
        cost = solution.cost
        return {"statement": cost} if isinstance(cost, str) else cost.as_dict()

    def lines(self, summary: Summary) -> list[TerminalLine]:
        return [row(self.terminal, cost_in_words(summary))] if self.key in summary else []


QUANTITIES = (CostOfSolution(),)
