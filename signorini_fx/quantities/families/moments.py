"""The moments on the body at the contact boundary."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from signorini_fx.errors import SceneError
from signorini_fx.machine.display import on_several_bodies
from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.kinds import Point, Vector
from signorini_fx.quantities.quantity import Quantity, Summary
from signorini_fx.quantities.requests import axis_of, contact_of
from signorini_fx.quantities.step_columns import by_axis, closed_boundaries
from signorini_fx.quantities.text import resultant, row

if TYPE_CHECKING:
    from signorini_fx.mechanics.model import Model
    from signorini_fx.quantities.functional import Functional


class _Moment(Quantity):
    """About the origin, in 3D.

    Attributes:
        number: 0: of the contact force, 1: of the friction force.
    """

    unit, kind, stage = "moment", Vector, "results"
    number: int

    def value(self, solution: Any) -> Any:
        contact = solution.contact
        if contact is None or contact.boundary.x.shape[1] != 3:
            return None
        return [float(m) + 0.0 for m in contact.moments[self.number]]

    def lines(self, summary: Summary) -> list[TerminalLine]:
        if self.key not in summary or on_several_bodies(summary):
            return []
        return [row(self.terminal, f"{resultant(summary, self.key)}, about the origin")]


class ContactMoment(_Moment):
    """Of the contact force."""

    key, number = "contact_moment", 0
    title = "Moment of `contact_force` about the origin, in 3D; with torsion about the axis x[1]."
    terminal, request = "contact moment", "moment BOUNDARY [AXIS]"

    def functional(self, model: Model, *words: str) -> Functional | None:
        """See ``Quantity``: with friction, at one boundary; in 2D too."""
        from signorini_fx.quantities.differentiable import ContactForce

        boundary, axis = words if len(words) > 1 else (*words, "z")
        if model.dimension == 2 and axis != "z":
            raise ValueError(axis)
        if reason := model.kinematics.refuses.get("moment"):
            raise SceneError([(f"of moment {boundary}", reason)])
        component = 0 if model.dimension == 2 else axis_of(model.dimension, axis)
        return ContactForce(contact_of(model.statement, boundary), component, moment=True)


class FrictionMoment(_Moment):
    """Of the friction force."""

    key, number, steps = "friction_moment", 1, "components"
    title = "Moment of `friction_force` about the origin, in 3D; with torsion about the axis x[1]."
    terminal = "friction moment"

    def columns(self, solution: Any) -> dict[str, Any]:
        """See ``Quantity``; of boundaries that close around a body about their middle."""
        return {
            name: value
            for boundary, figures in closed_boundaries(solution)
            for name, value in by_axis(self.key, [figures.friction_moment], [boundary]).items()
        }


class ForceThrough(Quantity):
    """The line of action, which over a revolution there is none of."""

    key, unit, kind, stage = "contact_force_through", "length", Point | None, "results"
    title = "Point of the central axis of the contact force that is nearest to the origin, in 3D."

    def value(self, solution: Any) -> Any:
        contact = solution.contact
        force = contact.forces[0]
        size = float(force @ force)
        if not (size > 0 and contact.boundary.kinematics.uniform):
            return None
        return [float(x) + 0.0 for x in np.cross(force, contact.moments[0]) / size]

    def entries(self, solution: Any) -> dict[str, Any]:
        """See ``Quantity``; null where there is no such line."""
        contact = solution.contact
        if contact is None or contact.boundary.x.shape[1] != 3:
            return {}
        return {self.key: self.value(solution)}


class Torque(Quantity):
    """Of friction on a section that is twisted."""

    key, unit, stage, steps = "torque", "moment", "never", "number"
    title = "Of friction about the axis x[1], with torsion."

    def value(self, solution: Any) -> Any:
        contact = solution.contact
        if contact is None or not contact.boundary.kinematics.out_of_section:
            return None
        return float(contact.moments[1][1])


QUANTITIES = (ContactMoment(), FrictionMoment(), ForceThrough(), Torque())
