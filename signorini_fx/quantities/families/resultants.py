"""The forces on the body through all its boundaries."""

from __future__ import annotations

from typing import Any

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.mechanics.kinematics import of_data
from signorini_fx.quantities.kinds import Number, Point, Row, Vector, described
from signorini_fx.quantities.quantity import Quantity, Summary
from signorini_fx.quantities.text import MOST_ROWS, in_brackets, labelled, point_in_words


class BoundaryResultant(Row):
    """A resultant."""

    boundary: str | None = described("Name of the boundary; null: the body force.")
    acts: list[str] = described("What acts there: support, contact, and kinds of loads and resistances.")
    force: Vector
    moment: Number | Vector = described("Moment about `about`; in 2D a number, counterclockwise.")
    about: Point
    acts_at: Point | None = described("A point of the line of action; null where the forces have no resultant.")


class AllResultants(Quantity):
    """Through each boundary."""

    key, kind, scope, stage = "resultants", list[BoundaryResultant], "all", "results"
    terminal = "forces"
    title = (
        "Forces on the body through each boundary with a support, a load or contact, and the body force; in 2D "
        "per unit thickness."
    )

    def value(self, solution: Any) -> Any:
        return solution.resultants.as_rows()

    def lines(self, summary: Summary) -> list[TerminalLine]:
        """See ``Quantity``: what acts through the other boundaries, and where; contact too if it has several."""
        several = len(summary.get("contact_boundaries", ())) > 1
        rows = [row for row in summary[self.key] if row["acts"] != ["contact"] or several]
        lines = [resultant_in_words(row, summary.get("scene") or {}) for row in rows[:MOST_ROWS]]
        if len(rows) > MOST_ROWS:
            lines.append(f"and {len(rows) - MOST_ROWS} more in summary.json")
        return labelled(self.terminal, lines)


def resultant_in_words(row: dict[str, Any], scene: dict[str, Any]) -> str:
    """What acts through a boundary and where, from a row of a summary with its scene, and the torque of a section."""
    kinematics = of_data(scene)
    moment = row["moment"] if isinstance(row["moment"], list) else [row["moment"]]
    couple = in_brackets(moment) if len(moment) > 1 else f"{moment[0]:.6g}"
    nowhere = "" if not kinematics.uniform else f", a couple of {couple}" if any(moment) else ", no couple"
    where = nowhere if row["acts_at"] is None else f", acts at {point_in_words(row['acts_at'])}"
    torque = f", torque {row['moment'][1]:.6g}," if kinematics.out_of_section else ""
    name = "" if row["boundary"] is None else f"{row['boundary']}: "
    return f"{name}{in_brackets(row['force'])}{torque} by {' and '.join(row['acts'])}{where}"


QUANTITIES = (AllResultants(),)
