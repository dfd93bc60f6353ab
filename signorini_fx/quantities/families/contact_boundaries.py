"""Each contact boundary in figures."""

from __future__ import annotations

from typing import Any

import numpy as np

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.kinds import Count, Number, Row, Vector, described
from signorini_fx.quantities.quantity import Quantity, Summary
from signorini_fx.quantities.text import MOST_ROWS, labelled
from signorini_fx.tuned import RESULTANT_OF_MESH


class ContactBoundaryRow(Row):
    """A contact boundary."""

    boundary: str
    area: Number
    contact_area: Number = described("Area of the nodes in contact.")
    touching_nodes: Count = described("How many these are.")
    pressure_integral: Number = described("Normal force N.")
    mean_pressure: Number = described("N over the area in contact; null where nothing is in contact.")
    max_pressure: Number
    contact_force: Vector = described("Resultant of the pressure on the body of this boundary.")
    friction_force: Vector = described("Resultant of the shear on the body of this boundary.")
    tangential_force: Number = described("Magnitude of the resultant T of the shear.")
    friction_limit: Number = described("Integral of the friction bound, F N for Coulomb friction.")
    friction_moment: Number | Vector = described(
        "Of a boundary that closes around a body: moment of friction about its middle; null of others."
    )
    moment_limit: Number = described("The largest possible size of the friction moment.")


class ContactBoundaries(Quantity):
    """Area, pressure and friction of each."""

    key, kind, scope, stage = "contact_boundaries", list[ContactBoundaryRow], "contact", "results"
    terminal = "in contact"
    title = "Each contact boundary; areas are lengths in 2D."

    def value(self, solution: Any) -> Any:
        return [figures.as_dict() for figures in solution.contact_figures] or None

    def lines(self, summary: Summary) -> list[TerminalLine]:
        areas, friction = [], []
        for row in summary.get(self.key, ())[:MOST_ROWS]:
            mean = "" if row["mean_pressure"] is None else f", mean pressure there {row['mean_pressure']:.6g}"
            areas.append(f"{row['boundary']}: {row['contact_area']:.6g} of {row['area']:.6g}{mean}")
            if row["friction_limit"] > 0:
                friction.append(f"{row['boundary']}: {friction_in_words(row)}")
        return [*labelled(self.terminal, areas), *labelled("friction", friction)]


def friction_in_words(row: dict[str, Any]) -> str:
    """The friction of a row of ``contact_boundaries``: the force, or the moment where it is that which is transmitted,
    and the largest possible value.
    """
    force, limit = f"{row['tangential_force']:.6g}", row["friction_limit"]
    if row["friction_moment"] is not None and row["tangential_force"] < RESULTANT_OF_MESH * row["pressure_integral"]:
        force = f"a moment of {np.linalg.norm(row['friction_moment']):.6g} about its middle"
        limit = row["moment_limit"]
    return f"{force} of at most {limit:.6g}" if np.isfinite(limit) else f"{force} in a bond"


QUANTITIES = (ContactBoundaries(),)
