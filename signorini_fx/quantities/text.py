"""What is said of the figures of a summary, on a terminal and in the report: of which solution they are, in numbers
with the digits that their error estimates allow, and in words.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any

import numpy as np

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.mechanics.kinematics import of_data
from signorini_fx.mechanics.kinematics.protocol import Kinematics
from signorini_fx.records import SHORT_OF_ACCURACY, Status
from signorini_fx.tuned import FAR_GAP, NEGLIGIBLE


class Validity(Enum):
    """Of what the figures of a summary are."""

    SOLUTION = "the solution of the scene"
    LESS_ACCURATE = "a certified solution that is less accurate than required"
    EARLIER_STEP = "the last load step with a solution, before the one that failed"
    NO_SOLUTION = "the last iterate, which is no result"

    @property
    def solved(self) -> bool:
        """Whether the figures are those of a solution, be it of an earlier load step."""
        return self is not Validity.NO_SOLUTION


def validity_of(summary: dict[str, Any]) -> Validity:
    """What the figures of a summary are of."""
    status = Status(summary["status"])
    if status is Status.CONVERGED:
        return Validity.SOLUTION
    if status in SHORT_OF_ACCURACY:
        return Validity.LESS_ACCURATE
    if summary.get("results_of", {}).get("status") == Status.CONVERGED.value:
        return Validity.EARLIER_STEP
    return Validity.NO_SOLUTION


def was_solved(summary: dict[str, Any]) -> bool:
    """Whether there are figures, be they of an iterate: what statics excludes is not solved."""
    return validity_of(summary).solved or summary["linear_solves"] > 0


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


# Rows of a list that the terminal shows.
MOST_ROWS = 8
# The errors of a convergence table that say something to somebody who has asked for none of them, as they are called
# there.
_ESTIMATED = ("pressure", "force", "energy")


def row(label: str, text: str, kind: str = "") -> TerminalLine:
    """A figure with its label."""
    return TerminalLine(f"  {label:16s} ", text, kind)


def labelled(label: str, texts: list[str]) -> list[TerminalLine]:
    """Lines of the table of which only the first has its label."""
    return [row(label if k == 0 else "", text) for k, text in enumerate(texts)]


def digits(value: Any, error: float | None = None) -> str:
    """A figure rounded to its estimated error; one without an estimate with six digits."""
    if not isinstance(value, float):
        return in_brackets(value) if isinstance(value, list) else str(value)
    return f"{value:.6g}" if error is None else figure(value, error)


def in_brackets(components: Sequence[float]) -> str:
    """A vector."""
    return "(" + ", ".join(f"{component:.6g}" for component in components) + ")"


def kinematics_of(summary: dict[str, Any]) -> Kinematics:
    """That of the body of a summary."""
    return of_data(summary.get("scene") or {}, 3 if summary.get("dimension") == 3 else 2)


def has_friction(summary: dict[str, Any]) -> bool:
    """Whether a contact of the scene has a friction law."""
    laws = [(entry.get("friction") or {}).get("law") for entry in (summary.get("scene") or {}).get("contact", ())]
    return any(law not in (None, "none") for law in laws)


def named_components(kinematics: Kinematics, count: int) -> dict[int, str]:
    """The components of a force on a body by their names; over a revolution radial ones cancel each other."""
    if kinematics.uniform:
        return dict(enumerate("xyz"[:count]))
    return {1: "along the axis"}


def point_in_words(point: Sequence[float]) -> str:
    """The coordinates of a point, without round-off."""
    return "(" + ", ".join(f"{round(x, 9) + 0.0:.6g}" for x in point) + ")"


def friction_in_words(row: dict[str, Any]) -> str:
    """The friction of a row of ``contact_boundaries``: the force, or the moment where it is that which is transmitted,
    and the largest possible value.
    """
    force, limit = f"{row['tangential_force']:.6g}", row["friction_limit"]
    if row["friction_moment"] is not None and row["tangential_force"] < NEGLIGIBLE * row["pressure_integral"]:
        force = f"a moment of {np.linalg.norm(row['friction_moment']):.6g} about its middle"
        limit = row["moment_limit"]
    return f"{force} in a bond" if limit is None or np.isinf(limit) else f"{force} of at most {limit:.6g}"


def cost_in_words(summary: dict[str, Any]) -> str:
    """What the error took, and what a smaller one would take; or why that is not known; "": nobody has asked."""
    cost = summary.get("cost")
    if cost is None:
        return ""
    statement: str = cost["statement"]
    if cost.get("error") is not None and summary.get("status") == Status.OUT_OF_REACH.value:
        return f"{statement.partition(';')[0]}; no finer mesh helps"  # whatever the rate of the meshes so far promises
    return statement if cost.get("error") is not None else f"no forecast: {statement}"


def error_in_words(summary: dict[str, Any]) -> str:
    """How wrong the results are: proved, estimated, or how to know it."""
    relative = (summary.get("error_bound") or {}).get("relative_error")
    if relative is not None:
        return f"at most {percent(relative)} of the energy norm, guaranteed"
    prices = solved_prices(summary)
    errors = [f"{name} {percent(prices[name])}" for name in _ESTIMATED if prices.get(name) is not None]
    if errors:
        return f"{', '.join(errors)}, estimated"
    of_stress, cost = (summary.get("stress") or {}).get("error"), summary.get("cost") or {}
    if of_stress is None and cost.get("of") == "energy":  # without fields the stress itself is not told
        of_stress = cost.get("error")
    if of_stress is not None:
        return f"of the stress {percent(of_stress)} in the mean, estimated"
    scene = summary.get("scene") or {}
    if scene.get("contact") and "forms" not in scene and "strain_energy" in summary:
        return "not estimated: --accuracy 5% asks for an estimate"
    return "not estimated: solve on a finer mesh as well, and compare"


def largest_von_mises(summary: dict[str, Any]) -> dict[str, Any] | None:
    """The larger one of the raw and the recovered von Mises stress, and which it is ``of``; None: there is none."""
    stress = summary.get("stress") or {}
    extremes = {"raw": stress.get("von_mises"), "recovered": (stress.get("recovered") or {}).get("von_mises")}
    known = [entry | {"of": name} for name, entry in extremes.items() if entry and entry["value"] is not None]
    return max(known, key=lambda entry: float(entry["value"])) if known else None


def marked_stress(summary: dict[str, Any]) -> tuple[list[float], str] | None:
    """The place of the largest von Mises stress and its value, as the answers have them; None: it may not be used."""
    largest = largest_von_mises(summary) if validity_of(summary).solved else None
    if largest is None or not largest["value"] > 0:
        return None
    return largest["place"], figure(largest["value"], between(summary["stress"]))


def share_in_words(summary: dict[str, Any], of: str = "") -> str:
    """How much of the yield stress is used, with the digits that the stress has: a share of it, such as 41 %, far above
    it how many times, and above it at a place where the stress has no limit no figure, which each mesh would change.

    Args:
        summary: with the share.
        of: the yield stress by its name; "": who reads it knows what is meant.
    """
    largest, apart = summary["utilisation"], between(summary["stress"])
    share = largest["value"]
    if share is not None and share > 1 and largest.get("no_limit"):
        return f"{'far ' * (share > FAR_GAP)}above {of or '100 %'}"
    if share is not None and share > FAR_GAP:
        return f"{figure(share, apart)} times{' ' * bool(of)}{of}"
    return f"{figure(None if share is None else 100 * share, apart)} %{' of ' * bool(of)}{of}"


def resultant_in_words(row: dict[str, Any], scene: dict[str, Any]) -> str:
    """What acts through a boundary and where, from a row of a summary with its scene, and the torque of a section."""
    kinematics = of_data(scene)
    moment = row["moment"] if isinstance(row["moment"], list) else [row["moment"]]
    couple = in_brackets(moment) if len(moment) > 1 else f"{moment[0]:.6g}"
    nowhere = "" if not kinematics.uniform else f", a couple of {couple}" if any(moment) else ", no couple"
    where = nowhere if row["acts_at"] is None else f", acts at {point_in_words(row['acts_at'])}"
    torque = f", torque {row['moment'][1]:.6g}," if kinematics.out_of_section else ""
    name = "" if row["boundary"] is None else f"{row['boundary']}: "
    return f"{name}{in_brackets(row['force'])}{torque} by {' and '.join(row['acts'])}{where}"


def tool_in_words(tool: dict[str, Any]) -> tuple[str, str]:
    """How a foundation that forces move has moved, and what the body does to it, from a row of a summary."""
    names = ("displacement", "rotation", "force", "moment", "reference")
    moved, turned, force, moment, point = (figure(tool[name]) for name in names)
    name = tool["boundary"]
    return f"{name}: moved by {moved}, turned by {turned}", f"{name}: takes {force}, about {point} {moment}"
