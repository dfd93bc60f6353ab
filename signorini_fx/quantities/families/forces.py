"""The forces on the body at the contact boundary."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from signorini_fx.machine.display import clean, on_several_bodies, touch_each_other
from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.mechanics.statement.units import with_unit
from signorini_fx.quantities.digits import components, solved_prices
from signorini_fx.quantities.kinds import Vector
from signorini_fx.quantities.quantity import Card, Quantity, Summary
from signorini_fx.quantities.requests import axis_of, contact_of, direction_of
from signorini_fx.quantities.step_columns import by_axis, of_boundaries
from signorini_fx.quantities.text import force_lines, has_friction, kinematics_of, named_components

if TYPE_CHECKING:
    from signorini_fx.mechanics.model import Model
    from signorini_fx.quantities.functional import Functional
    from signorini_fx.quantities.proved_statements import Interval


class _Force(Quantity):
    """A resultant of the tractions.

    Attributes:
        number: 0: of the pressure, 1: of the shear.
    """

    kind, unit, scope, stage, steps = Vector, "force", "contact", "results", "components"
    number: int

    def value(self, solution: Any) -> Any:
        return None if solution.contact is None else [float(f) + 0.0 for f in solution.contact.forces[self.number]]

    def columns(self, solution: Any) -> dict[str, Any]:
        """See ``Quantity``; between several bodies of each boundary, as their sum acts on none."""
        contact, names = solution.contact, of_boundaries(solution.statement)
        if contact is None:
            return {}
        forces = [contact.forces_of_each[k, self.number] for k in range(len(names))] or [contact.forces[self.number]]
        return by_axis(self.key, forces, names)

    def lines(self, summary: Summary) -> list[TerminalLine]:
        return force_lines(summary, self.key) if self.key in summary else []

    def cards(self, summary: Summary) -> list[Card]:
        """See ``Quantity``; between bodies with the boundary on which it acts, and of several boundaries none."""
        if self.key not in summary or on_several_bodies(summary):
            return []
        label, boundaries = self.report, summary.get("contact_boundaries")
        if touch_each_other(summary) and boundaries:
            label = label.replace("the body", boundaries[0]["boundary"])
        size = max(abs(f) for key in ("contact_force", "friction_force") for f in summary[key])
        error = self.error(summary)
        force = clean(summary[self.key], size)
        names = named_components(kinematics_of(summary), len(force))
        texts = components([force[k] for k in names], error)
        pairs = zip(names.values(), texts, strict=True)
        return [Card(f"{label}, {name}", with_unit(text, self.unit), error) for name, text in pairs]


class TotalContactForce(_Force):
    """Of the pressure."""

    key, number = "contact_force", 0
    title = (
        "Resultant of the normal tractions on the body; of several contacts between bodies a sum that acts on none of "
        "them: see contact_boundaries."
    )
    terminal, report = "contact force", "contact force on the body"
    request = "force BOUNDARY AXIS"

    def error(self, summary: Summary) -> float | None:
        """See ``Quantity``; of several boundaries whose forces nearly cancel it is large, as the estimate is relative
        to all of them.
        """
        error: float | None = solved_prices(summary).get("force")
        contact, friction = (math.hypot(*summary.get(name, [0.0])) for name in ("contact_force", "friction_force"))
        rows = summary.get("contact_boundaries", ())
        components = [f for row in rows for name in ("contact_force", "friction_force") for f in row.get(name, ())]
        if error is not None and len(rows) > 1 and contact + friction > 0:
            error *= max(1.0, math.hypot(*components) / math.hypot(contact, friction))
        return error

    def functional(self, model: Model, *words: str) -> Functional | None:
        """See ``Quantity``: with friction, at one boundary."""
        from signorini_fx.quantities.differentiable import ContactForce

        boundary, axis = words
        return ContactForce(contact_of(model.statement, boundary), axis_of(model.dimension, axis))

    def bounds(self, solution: Any, *words: str) -> Interval | str | None:
        """See ``Quantity``: of a contact or of a support."""
        boundary, axis = words
        direction = direction_of(solution.model.dimension, axis)
        bounds: Interval | str = solution.force_bounds(boundary, direction)
        return bounds


class TotalFrictionForce(_Force):
    """Of the shear."""

    key, number = "friction_force", 1
    title = "The same of the tangential tractions."
    terminal, report = "friction force", "friction force on the body"

    def error(self, summary: Summary) -> float | None:
        """See ``Quantity``; of one that nearly vanishes it is large, as it is as uncertain as the contact force is."""
        error = TotalContactForce().error(summary)
        contact, friction = (math.hypot(*summary.get(name, [0.0])) for name in ("contact_force", "friction_force"))
        return error * contact / friction if error is not None and 0 < friction < contact else error

    def cards(self, summary: Summary) -> list[Card]:
        """See ``Quantity``; none without friction."""
        return super().cards(summary) if has_friction(summary) else []


QUANTITIES = (TotalContactForce(), TotalFrictionForce())
