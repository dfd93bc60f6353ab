"""Foundations that forces move."""

from __future__ import annotations

from typing import Any

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.mechanics.statement.units import with_unit
from signorini_fx.quantities.digits import components, figure
from signorini_fx.quantities.kinds import Number, Row, Vector, described
from signorini_fx.quantities.quantity import Card, Quantity, Summary
from signorini_fx.quantities.text import labelled


class Tool(Row):
    """A rigid tool."""

    boundary: str = described("The boundary that it may touch.")
    reference: Vector = described("The point that it turns about, before it moves.")
    displacement: Vector = described("Of that point.")
    rotation: Number | Vector = described("Radians; in 3D a vector.")
    force: Vector = described("Of the body on the tool.")
    moment: Number | Vector = described("About that point; in 3D a vector.")
    gap_error: Number = described(
        "By how much the gap where the tool ends up differs at most from the linearised one, where it presses, length; "
        "null for bonded boundaries, and for nonlinear bodies, whose gap is that of the place where the tool is."
    )


class Tools(Quantity):
    """How they have moved."""

    key, kind, stage = "tools", list[Tool], "results"
    terminal, brief = "foundation", True
    title = "Foundations that forces move: how they have moved, and what the body does to them."

    def value(self, solution: Any) -> Any:
        contact, effects = solution.contact, solution.statement.contact
        if contact is None:
            return None
        kinematics = solution.model.kinematics
        return [motion.as_dict(contact, effects, kinematics) for motion in solution.last_step.tools] or None

    def cards(self, summary: Summary) -> list[Card]:
        """See ``Quantity``: its motion, force and moment."""
        return [card for tool in summary.get(self.key, ()) for card in _of_tool(tool)]

    def lines(self, summary: Summary) -> list[TerminalLine]:
        told = [tool_in_words(tool) for tool in summary.get(self.key, ())]
        return labelled(self.terminal, [text for texts in zip(*told, strict=True) for text in texts])


def _of_tool(tool: dict[str, Any]) -> list[Card]:
    """Its motion and what the body does to it, component by component."""
    units = {"displacement": "length", "rotation": "", "force": "force", "moment": "moment"}
    names = {"displacement": "moved", "rotation": "turned (radians)", "force": "force on it", "moment": "moment on it"}
    cards = []
    for key, name in names.items():
        value = tool[key] if isinstance(tool[key], list) else [tool[key]]
        axes = [f", {axis}" for axis in "xyz"] if len(value) > 1 else [""]
        texts = [with_unit(text, units[key]) for text in components(value)]
        cards += [Card(f"{tool['boundary']}: {name}{axis}", text) for axis, text in zip(axes, texts, strict=False)]
    return cards


def tool_in_words(tool: dict[str, Any]) -> tuple[str, str]:
    """How a foundation that forces move has moved, and what the body does to it, from a row of a summary."""
    names = ("displacement", "rotation", "force", "moment", "reference")
    moved, turned, force, moment, point = (figure(tool[name]) for name in names)
    off = "" if tool["gap_error"] is None else f"; gap linearised, off by {tool['gap_error']:.1e}"
    name = tool["boundary"]
    return f"{name}: moved by {moved}, turned by {turned}{off}", f"{name}: takes {force}, about {point} {moment}"


QUANTITIES = (Tools(),)
