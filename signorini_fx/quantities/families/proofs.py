"""What is proved of a solution, and the functionals that bound it."""

from __future__ import annotations

from typing import Any

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.kinds import Number, Row, described
from signorini_fx.quantities.quantity import Quantity, Summary
from signorini_fx.quantities.text import row

# How the statement begins where there is no bound.
_NONE = "none: "


class ErrorBoundFigures(Row):
    """A guaranteed bound."""

    relative_error: Number = described(
        "Of the displacement, relative to the energy norm of the exact solution.", default=None
    )
    strain_energy: list[Number] = described(
        "Between which the strain energy of the exact solution is.", default_factory=list
    )
    error: Number = described("Square root of a(e, e): at most the sum of the three that follow.", default=None)
    duality: Number = described("Part of the gap between both functionals.", default=None)
    moved: Number = described("Part of the displacement without penetration instead of the computed one.", default=None)
    round_off: Number = described("Part of round-off.", default=None)
    guaranteed: bool = described("Whether it is a bound; else an estimate.", default=None)
    statement: str = described("All of it in a sentence, or why there is no bound.")


class ErrorBoundOfSolution(Quantity):
    """In the energy norm."""

    key, kind = "error_bound", ErrorBoundFigures
    title = "A guaranteed bound of the error in the energy norm, where the scene asks for it; null: none."
    terminal = "error bound"

    def asked(self, solution: Any) -> bool:
        goal = solution.statement.accuracy
        return bool(solution.statement.solver.error_bound or (goal is not None and goal.certified))

    def value(self, solution: Any) -> Any:
        bound = solution.error_bound
        if isinstance(bound, str):
            return {"statement": f"{_NONE}{bound}"}
        return None if bound is None else bound.as_dict()

    def missed(self, value: Any) -> str:
        """See ``Quantity``: that there is no bound."""
        none = value["statement"].startswith(_NONE)
        return f"there is no guaranteed bound: {value['statement'].removeprefix(_NONE)}" if none else ""

    def lines(self, summary: Summary) -> list[TerminalLine]:
        return _statement(self, summary)


class BothFunctionals(Row):
    """Energies."""

    primal: Number
    dual: Number
    relative_duality_gap: Number


class FunctionalsOfSolution(Quantity):
    """Without Coulomb friction."""

    key, kind, stage = "functionals", BothFunctionals, "results"
    title = "Primal and dual functional of the regularised problem, energies, without Coulomb friction."
    terminal = "duality gap"

    def value(self, solution: Any) -> Any:
        values = solution.functionals
        if values is None:
            return None
        return {"primal": values.primal, "dual": values.dual, "relative_duality_gap": values.relative_gap}

    def lines(self, summary: Summary) -> list[TerminalLine]:
        figures = summary.get(self.key)
        return [row(self.terminal, f"{figures['relative_duality_gap']:.1e}")] if figures else []


def _statement(quantity: Quantity, summary: Summary) -> list[TerminalLine]:
    return [row(quantity.terminal, summary[quantity.key]["statement"])] if quantity.key in summary else []


QUANTITIES = (ErrorBoundOfSolution(), FunctionalsOfSolution())
