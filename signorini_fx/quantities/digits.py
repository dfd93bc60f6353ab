"""Numbers with the digits that their error estimates allow."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from signorini_fx.tuned import NEGLIGIBLE

# Digits of a figure without an estimate, and the most that are shown of one with an estimate.
_UNKNOWN, _MOST_DIGITS = 4, 6


def solved_prices(summary: Mapping[str, Any]) -> Mapping[str, Any]:
    """The estimates of the finest mesh that was solved, the last solved row of the convergence table; empty: there is
    none.
    """
    solved = [row for row in summary.get("convergence_table", []) if not row["predicted"]]
    return solved[-1] if solved else {}


def between(stress: Mapping[str, Any]) -> float | None:
    """By how much the largest von Mises stress of ``stress`` and the recovered one differ, relative to the larger one.

    Digits beyond that mean nothing; it says nothing about the error, least of all where the stress has no limit: so it
    is None, not known, where they differ in the fourth digit only.
    """
    values = [(entry or {}).get("von_mises", {}).get("value") for entry in (stress, stress.get("recovered"))]
    if None in values or not max(values) > 0:
        return None
    apart = float((max(values) - min(values)) / max(values))
    return apart if apart > NEGLIGIBLE else None


def figure(value: Any, error: float | None = None) -> str:
    """A number or a vector, rounded at the first digit that is uncertain.

    Args:
        value: a number, or components, which are as uncertain as the vector is.
        error: estimated error relative to its size; None: not known, four digits are shown.
    """
    if isinstance(value, list | tuple):
        return f"({', '.join(components(list(value), error))})"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "" if value is None else str(value)
    if isinstance(value, int):
        return str(value)
    return _rounded(value, abs(value), error)


def components(vector: list[float], error: float | None = None) -> list[str]:
    """The components of a vector one by one, see ``figure``; with an estimated error they are rounded alike."""
    size = math.hypot(*vector)
    return [_rounded(component, size, error) for component in vector]


def _rounded(value: float, size: float, error: float | None) -> str:
    if not (math.isfinite(value) and math.isfinite(size)):
        return f"{value}"
    if value == 0 or size == 0:
        return "0"
    largest = math.floor(math.log10(size))
    uncertain = largest - _MOST_DIGITS + 1
    if error is None and value:  # a small component beside a large one has digits of its own
        uncertain = max(math.floor(math.log10(abs(value))) - _UNKNOWN + 1, uncertain)
    elif error:
        # An error of more than the size leaves the first digit: 0 would be a claim.
        uncertain = min(math.floor(math.log10(error * size) + 1e-9), largest)
        uncertain = max(uncertain, largest - _MOST_DIGITS + 1)
    rounded = round(value, -uncertain)
    if rounded == 0:
        return "0"
    if error is None or error <= 10.0 ** (1 - _MOST_DIGITS):  # zeros at the end say nothing about an error
        return f"{rounded:.{_MOST_DIGITS}g}"
    if not -4 <= largest < _MOST_DIGITS:
        return f"{rounded:.{max(math.floor(math.log10(abs(rounded))) - uncertain, 0)}e}"
    return f"{rounded:.{max(-uncertain, 0)}f}"


def figure_or_error(value: Any, error: float | None) -> str:
    """The same as ``figure``, with the error where it leaves no digit."""
    return figure(value, error) + (f" (error {percent(error)})" if error is not None and error >= 1 else "")


def percent(error: float) -> str:
    """A relative error, or another share, with two digits."""
    return f"{float(f'{100 * error:.2g}'):g} %" if error > 1e-5 else "below 0.001 %" if error else "0 %"
