"""Energies, in 2D per unit thickness."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from signorini_fx.quantities.digits import solved_prices
from signorini_fx.quantities.quantity import Quantity, Summary

if TYPE_CHECKING:
    from signorini_fx.quantities.proved_statements import Interval


class FrictionWork(Quantity):
    """Of a load step."""

    key, unit, stage, steps = "friction_work", "energy", "never", "number"
    title = "Energy dissipated by slip in this step."

    def value(self, solution: Any) -> Any:
        return None if solution.contact is None else solution.contact.friction_work


class StrainEnergy(Quantity):
    """Of the body."""

    key, unit, stage, steps = "strain_energy", "energy", "results", "number"
    title = "a(y, y) / 2, an energy, in 2D per unit thickness; of a body whose forces are linear in y."
    terminal, report = "strain energy", "strain energy"

    def value(self, solution: Any) -> Any:
        return solution.last_step.strain_energy

    def error(self, summary: Summary) -> float | None:
        """See ``Quantity``: the square of that in the energy norm."""
        energy = solved_prices(summary).get("energy")
        return None if energy is None else float(energy**2)

    def bounds(self, solution: Any, *words: str) -> Interval | str | None:
        from signorini_fx.quantities.proved_statements import Interval

        if words:
            raise ValueError(words)
        bound = solution.error_bound
        if bound is None or isinstance(bound, str):
            return bound
        low, high = bound.strain_energy
        return Interval(low, high, bound.assumed)


QUANTITIES = (FrictionWork(), StrainEnergy())
