"""Lines of a terminal that several quantities have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from signorini_fx.machine.display import clean, touch_each_other
from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.mechanics.kinematics import of_data
from signorini_fx.mechanics.kinematics.protocol import Kinematics
from signorini_fx.quantities.digits import figure

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


def resultant(summary: dict[str, Any], key: str) -> str:
    """A resultant force or moment; components that are round-off of those at work count as zero."""
    kind = key.partition("_")[2]
    size = float(np.abs([summary[f"contact_{kind}"], summary[f"friction_{kind}"]]).max())
    return in_brackets(clean(summary[key], size))


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


def force_lines(summary: dict[str, Any], key: str) -> list[TerminalLine]:
    """Contact or friction force; between bodies that of each boundary on its body, as their sum acts on none."""
    label = key.replace("_", " ")
    if not touch_each_other(summary):
        return [row(label, resultant(summary, key))]
    rows = summary["contact_boundaries"][:MOST_ROWS]
    size = float(np.abs([entry[name] for entry in rows for name in ("contact_force", "friction_force")]).max())
    return labelled(label, [f"{in_brackets(clean(entry[key], size))} on {entry['boundary']}" for entry in rows])


def point_in_words(point: Sequence[float]) -> str:
    """The coordinates of a point, without round-off."""
    return "(" + ", ".join(f"{round(x, 9) + 0.0:.6g}" for x in point) + ")"
