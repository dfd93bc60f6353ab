"""What is said of the figures of a summary, on a terminal and in the report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.mechanics.kinematics import of_data
from signorini_fx.mechanics.kinematics.protocol import Kinematics
from signorini_fx.mechanics.statement.units import with_unit
from signorini_fx.quantities.digits import between, figure
from signorini_fx.quantities.validity import validity_of
from signorini_fx.records import Status
from signorini_fx.tuned import FAR_GAP, NEGLIGIBLE

# Rows of a list that the terminal shows.
MOST_ROWS = 8


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
    """The components of a force on a body by their names; over a revolution radial ones cancel each other.

    Args:
        kinematics: of the body.
        count: of components.
    """
    if kinematics.uniform:
        return dict(enumerate("xyz"[:count]))
    return {1: "along the axis"}


def point_in_words(point: Sequence[float]) -> str:
    """The coordinates of a point, without round-off."""
    return "(" + ", ".join(f"{round(x, 9) + 0.0:.6g}" for x in point) + ")"


def boundaries_touched_by(counts: range, summary: dict[str, Any]) -> list[str]:
    """The contact boundaries of which so many nodes are in contact, by name."""
    return [row["boundary"] for row in summary.get("contact_boundaries") or () if row.get("touching_nodes") in counts]


def friction_in_words(row: dict[str, Any]) -> str:
    """The friction of a row of ``contact_boundaries``: the force, or the moment where it is that which is transmitted,
    and the largest possible value.
    """
    force, limit = f"{row['tangential_force']:.6g}", row["friction_limit"]
    if row["friction_moment"] is not None and row["tangential_force"] < NEGLIGIBLE * row["pressure_integral"]:
        force = f"a moment of {np.linalg.norm(row['friction_moment']):.6g} about its middle"
        limit = row["moment_limit"]
    return f"{force} of at most {limit:.6g}" if np.isfinite(limit) else f"{force} in a bond"


def cost_in_words(summary: dict[str, Any]) -> str:
    """What the error took, and what a smaller one would take; or why that is not known; "": nobody has asked."""
    cost = summary.get("cost")
    if cost is None:
        return ""
    statement: str = cost["statement"]
    if cost.get("error") is not None and summary.get("status") == Status.OUT_OF_REACH.value:
        return f"{statement.partition(';')[0]}; no finer mesh helps"  # whatever the rate of the meshes so far promises
    return statement if cost.get("error") is not None else f"no forecast: {statement}"


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


def yielding_in_words(summary: dict[str, Any]) -> tuple[str, str]:
    """The largest plastic strain, and where it is; zero and that nothing yields.

    Args:
        summary: with a ``plastic_strain``.
    """
    largest = summary["plastic_strain"]
    if largest["value"] == 0:
        return "0", "nothing has yielded"
    region = f" in {largest['region']}" if largest.get("region") else ""
    return figure(largest["value"]), f"at {with_unit(point_in_words(largest['place']), 'length')}{region}"


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
    off = "" if tool["gap_error"] is None else f"; gap linearised, off by {tool['gap_error']:.1e}"
    name = tool["boundary"]
    return f"{name}: moved by {moved}, turned by {turned}{off}", f"{name}: takes {force}, about {point} {moment}"
