"""Where the contact boundary touches, sticks and slips."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.kinds import Number, Point, Row, described
from signorini_fx.quantities.quantity import Quantity, Summary
from signorini_fx.quantities.requests import contact_of, power_of
from signorini_fx.quantities.text import point_in_words, row

if TYPE_CHECKING:
    from signorini_fx.mechanics.model import Model
    from signorini_fx.quantities.functional import Functional

Runs = list[Annotated[list[Point], Field(min_length=2, max_length=2)]]
_RUNS = "Runs of neighbouring nodes, each from its first to its last point."


class ZoneRuns(Row):
    """Zones on the contact boundary of a body in 2D."""

    contact: Runs = described(_RUNS)
    stick: Runs = described(_RUNS)
    slip: Runs = described(_RUNS)


class Zones(Quantity):
    """In 2D: from node to node."""

    key, kind, stage = "zones", ZoneRuns, "results"
    terminal = "zone"
    title = "Zones on the contact boundary of a body in 2D."

    def value(self, solution: Any) -> Any:
        if solution.contact is None or "s" not in solution.table.columns:
            return None
        table, columns = solution.table, solution.table.columns
        touching = columns["state"] != "open"
        # Tresca friction acts on open nodes too, which are no zone of the contact.
        acting = (columns["bound"] > 0) & touching
        return {
            "contact": table.zones(touching),
            "stick": table.zones(acting & (columns["friction"] == "stick")),
            "slip": table.zones(acting & np.isin(columns["friction"], ["slip+", "slip-", "slip"])),
        }

    def lines(self, summary: Summary) -> list[TerminalLine]:
        zones = summary.get(self.key, {}).items()
        return [
            row(f"{name} {self.terminal}", ", ".join(f"{point_in_words(a)} to {point_in_words(b)}" for a, b in runs))
            for name, runs in zones
            if runs
        ]


class ZoneAreas(Row):
    """Areas on the contact boundary of a body in 3D."""

    contact: Number
    stick: Number
    slip: Number


class Areas(Quantity):
    """In 3D: sums of the weights of nodes."""

    key, unit, kind, stage = "areas", "area", ZoneAreas, "results"
    terminal = "area"
    title = "Areas on the contact boundary of a body in 3D."
    request = "area BOUNDARY [POWER]"

    def value(self, solution: Any) -> Any:
        contact = solution.contact
        return None if contact is None or contact.boundary.x.shape[1] != 3 else contact.areas

    def lines(self, summary: Summary) -> list[TerminalLine]:
        """See ``Quantity``; with it that friction acts beside the contact too."""
        lines = [
            row(f"{name} {self.terminal}", f"{area:.6g}") for name, area in summary.get(self.key, {}).items() if area
        ]
        laws = {effect["friction"]["law"] for effect in summary.get("scene", {}).get("contact", ())}
        if "tresca" in laws and summary.get("touching_nodes") != summary.get("contact_nodes"):
            lines.append(row("note", "Tresca friction also acts where there is no contact"))
        return lines

    def functional(self, model: Model, *words: str) -> Functional | None:
        """See ``Quantity``: that of the contact, smoothed, in 2D a length."""
        from signorini_fx.quantities.differentiable import ContactArea

        boundary, *power = words
        return ContactArea(contact_of(model.statement, boundary), power_of(f"area {boundary}", 2.0, power))


QUANTITIES = (Zones(), Areas())
