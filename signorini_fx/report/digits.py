"""Numbers with the digits that their error estimates allow."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

# Digits of a figure without an estimate, and the most that are shown of one with an estimate.
_UNKNOWN, _MOST_DIGITS = 4, 6
# Figure of the summary -> the estimate of the price list that is its own.
_ESTIMATES = {"contact_force": "force", "friction_force": "force", "max_pressure": "peak", "max_shear": "pressure"}


def estimated_errors(summary: Mapping[str, Any]) -> dict[str, float]:
    """Estimated relative errors of figures of the summary, of those that have an estimate.

    That of the strain energy is the square of the error in the energy norm; that of a friction force that nearly
    vanishes is large, as it is as uncertain as the contact force is.  So is that of a resultant of several contact
    boundaries whose forces nearly cancel: the estimate is relative to all of them.  The stress at a point has none: its
    difference from the recovered one is no error, see ``between``.
    """
    solved = [row for row in summary.get("price_list", []) if not row["predicted"]]
    if not solved:
        return {}
    errors: dict[str, float | None] = {name: solved[-1].get(key) for name, key in _ESTIMATES.items()}
    contact, friction = (math.hypot(*summary.get(name, [0.0])) for name in ("contact_force", "friction_force"))
    rows = summary.get("contact_boundaries", ())
    components = [f for row in rows for name in ("contact_force", "friction_force") for f in row.get(name, ())]
    error = errors["contact_force"]
    if error is not None and len(rows) > 1 and contact + friction > 0:
        error *= max(1.0, math.hypot(*components) / math.hypot(contact, friction))
    errors["contact_force"] = errors["friction_force"] = error
    if error is not None and 0 < friction < contact:
        errors["friction_force"] = error * contact / friction
    energy = solved[-1].get("energy")
    errors["strain_energy"] = None if energy is None else energy**2
    return {name: float(error) for name, error in errors.items() if error is not None}


def between(stress: Mapping[str, Any]) -> float | None:
    """By how much the largest von Mises stress of ``stress`` and the recovered one differ, relative to the larger one.

    Digits beyond that mean nothing; it says nothing about the error, least of all where the stress has no limit.
    """
    values = [(entry or {}).get("von_mises", {}).get("value") for entry in (stress, stress.get("recovered"))]
    if None in values or not max(values) > 0:
        return None
    return float((max(values) - min(values)) / max(values))


def figure(value: Any, error: float | None = None) -> str:
    """A number or a vector, rounded at the first digit that is uncertain.

    Args:
        value: a number, or components, which are rounded alike.
        error: estimated error relative to its size; None: not known, four digits are shown.
    """
    if isinstance(value, list | tuple):
        size = math.hypot(*value)
        return f"({', '.join(_rounded(component, size, error) for component in value)})"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "" if value is None else str(value)
    if isinstance(value, int):
        return str(value)
    return _rounded(value, abs(value), error)


def _rounded(value: float, size: float, error: float | None) -> str:
    if not (math.isfinite(value) and math.isfinite(size)):
        return f"{value}"
    if value == 0 or size == 0:
        return "0"
    largest = math.floor(math.log10(size))
    uncertain = largest - _MOST_DIGITS + 1 if error == 0 else largest - _UNKNOWN + 1
    if error:
        uncertain = max(math.floor(math.log10(error * size) + 1e-9), largest - _MOST_DIGITS + 1)
    rounded = round(value, -uncertain)
    if rounded == 0:
        return "0"
    if error is None or error <= 10.0 ** (1 - _MOST_DIGITS):  # zeros at the end say nothing about an error
        return f"{rounded:.{_MOST_DIGITS}g}"
    if not -4 <= largest < _MOST_DIGITS:
        return f"{rounded:.{max(math.floor(math.log10(abs(rounded))) - uncertain, 0)}e}"
    return f"{rounded:.{max(-uncertain, 0)}f}"


def percent(error: float) -> str:
    """A relative error with two digits."""
    return f"{100 * error:.2g} %" if error > 1e-5 else "below 0.001 %"
