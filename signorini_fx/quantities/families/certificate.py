"""The check of the conditions of the problem."""

from __future__ import annotations

from typing import Any

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.kinds import Number, Row, described
from signorini_fx.quantities.quantity import Quantity, Summary
from signorini_fx.quantities.text import row
from signorini_fx.records import JUDGED
from signorini_fx.tuned import CERTIFICATE_TOLERANCE


class CertificateFigures(Row):
    """Its figures, each relative."""

    equilibrium: Number
    supports: Number
    negative_pressure: Number
    friction_cone: Number
    wrong_way_slip: Number
    entered: Number
    pressure_at_distance: Number
    slip_below_bound: Number
    coupling: Number
    moduli: Number
    displacement: Number = described("Largest displacement, relative to the size of the body.")
    penetration: Number
    complementarity: Number
    stick_slip: Number
    law: str = described("The contact law of the check.")
    holds: bool


class CertificateOfSolution(Quantity):
    """With its verdict."""

    key, kind, scope, stage, steps = "certificate", CertificateFigures, "all", "results", "number"
    title = "The check of the conditions of the problem; every figure is relative."
    terminal = "certificate"

    def value(self, solution: Any) -> Any:
        return solution.certificate.as_dict()

    def columns(self, solution: Any) -> dict[str, Any]:
        """See ``Quantity``: the verdict."""
        return {"certificate_holds": solution.certificate.holds}

    def lines(self, summary: Summary) -> list[TerminalLine]:
        """See ``Quantity``: the verdict with the figure that decides it, and what regularisation leaves."""
        figures = summary[self.key]
        judged = sorted(((figures[name], name.replace("_", " ")) for name in JUDGED), reverse=True)
        if figures["holds"]:
            value, name = judged[0]
            allowed = f"{CERTIFICATE_TOLERANCE:.0e} is allowed"
            text = f"holds for {figures['law']}: no figure above {value:.1e} ({name}), {allowed}"
        else:
            wrong = [f"{name} {value:.1e}" for value, name in judged if not value <= CERTIFICATE_TOLERANCE]
            text = f"DOES NOT HOLD for {figures['law']}: {', '.join(wrong)}"
        lines = [row(self.terminal, text, "" if figures["holds"] else "error")]
        if "contact_force" in summary:
            penetration, slip = f"{figures['penetration']:.1e}", f"{figures['stick_slip']:.1e}"
            lines.append(
                row(
                    "left by gamma",
                    f"penetration {penetration}, elastic slip {slip} times the largest displacement",
                )
            )
        return lines


QUANTITIES = (CertificateOfSolution(),)
