"""How many nodes touch the foundation or the other body."""

from __future__ import annotations

from typing import Any

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.kinds import Count
from signorini_fx.quantities.quantity import Quantity, Summary
from signorini_fx.quantities.text import row
from signorini_fx.tuned import FEW_NODES


def boundaries_touched_by(counts: range, summary: Summary) -> list[str]:
    """The contact boundaries of which so many nodes are in contact, by name."""
    return [row["boundary"] for row in summary.get("contact_boundaries") or () if row.get("touching_nodes") in counts]


class CountOfNodes(Quantity):
    """All nodes, which the terminal shows with those that touch."""

    key, kind, scope, stage = "contact_nodes", Count, "contact", "results"
    title = "Nodes of the contact boundary."
    terminal = "contact nodes"

    def value(self, solution: Any) -> Any:
        return None if solution.contact is None else int(solution.table.columns["x"].size)

    def lines(self, summary: Summary) -> list[TerminalLine]:
        if self.key not in summary:
            return []
        nodes = summary["touching_nodes"]
        coarse = boundaries_touched_by(range(1, FEW_NODES), summary)
        few = f": too few on {', '.join(coarse)}" if coarse else ""
        few += " for the ends of the zone or the largest pressure, refine there" if coarse else ""
        return [row(self.terminal, f"{summary[self.key]}, {nodes or 'none'} in contact{few}")]


class TouchingNodes(Quantity):
    """Those that touch."""

    key, kind, scope, stage = "touching_nodes", Count, "contact", "results"
    title = "Those in contact."

    def value(self, solution: Any) -> Any:
        return None if solution.contact is None else solution.table.touching


QUANTITIES = (CountOfNodes(), TouchingNodes())
