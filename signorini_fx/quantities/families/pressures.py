"""Pressure and shear on the contact boundary."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from signorini_fx.quantities.digits import solved_prices
from signorini_fx.quantities.quantity import Card, Quantity, Summary
from signorini_fx.quantities.requests import contact_of, power_of
from signorini_fx.quantities.step_columns import by_axis, closed_boundaries
from signorini_fx.quantities.text import has_friction

if TYPE_CHECKING:
    from signorini_fx.mechanics.model import Model
    from signorini_fx.quantities.functional import Functional


class PressureIntegral(Quantity):
    """The normal force of boundaries that are not flat."""

    key, unit, scope, stage, steps = "pressure_integral", "force", "contact", "results", "components"
    title = "Integral of the pressure, a force."

    def value(self, solution: Any) -> Any:
        if solution.contact is None:
            return None
        columns = solution.table.columns
        return float(np.dot(columns["weight"], columns["pressure"]))

    def columns(self, solution: Any) -> dict[str, Any]:
        """See ``Quantity``; of boundaries that close around a body, where the force is zero."""
        return {
            name: value
            for boundary, figures in closed_boundaries(solution)
            for name, value in by_axis(self.key, [figures.pressure_integral], [boundary]).items()
        }


class PeakPressure(Quantity):
    """Of all boundaries."""

    key, unit, scope, stage, steps = "max_pressure", "stress", "contact", "results", "number"
    title = "Largest nodal pressure, a stress."
    terminal, report = "largest pressure", "largest contact pressure"
    request = "pressure BOUNDARY [POWER]"

    def value(self, solution: Any) -> Any:
        return None if solution.contact is None else float(solution.table.columns["pressure"].max())

    def columns(self, solution: Any) -> dict[str, Any]:
        from signorini_fx.machine import parallel

        contact = solution.contact
        return {} if contact is None else {self.key: parallel.largest(contact.boundary.comm, contact.pressure)}

    def error(self, summary: Summary) -> float | None:
        return solved_prices(summary).get("peak")

    def functional(self, model: Model, *words: str) -> Functional | None:
        """See ``Quantity``: a smooth approximation, see ``differentiable.LargestPressure``."""
        from signorini_fx.quantities.differentiable import LargestPressure

        boundary, *power = words
        return LargestPressure(contact_of(model.statement, boundary), power_of(f"pressure {boundary}", 8.0, power))


class PeakShear(Quantity):
    """Of all boundaries."""

    key, unit, scope, stage = "max_shear", "stress", "contact", "results"
    title = "Largest nodal shear, a stress."
    report = "largest shear"

    def value(self, solution: Any) -> Any:
        return None if solution.contact is None else float(np.abs(solution.table.columns["shear"]).max())

    def error(self, summary: Summary) -> float | None:
        return solved_prices(summary).get("pressure")

    def cards(self, summary: Summary) -> list[Card]:
        """See ``Quantity``; none without friction."""
        return super().cards(summary) if has_friction(summary) else []


QUANTITIES = (PressureIntegral(), PeakPressure(), PeakShear())
