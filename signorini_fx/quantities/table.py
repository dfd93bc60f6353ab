"""The quantities as a table of the documentation."""

from __future__ import annotations

from typing import get_args

from pydantic import BaseModel

from signorini_fx.quantities.quantity import Quantity
from signorini_fx.quantities.registry import has, quantities

_HEADER = ("key", "unit", "what", "shown in", "derivative, bounds")


def markdown() -> str:
    """A row for each quantity, those of others included."""
    rows = [_HEADER, tuple("---" for _ in _HEADER), *map(_row, quantities())]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _row(quantity: Quantity) -> tuple[str, ...]:
    classes = [kind for kind in (quantity.kind, *get_args(quantity.kind)) if isinstance(kind, type)]
    names = [f"`{name}`" for kind in classes if issubclass(kind, BaseModel) for name in kind.model_fields]
    what = f"{quantity.title.rstrip('.')}: {', '.join(names)}" if names else quantity.title.rstrip(".")
    shown = {
        "`summary.json`": quantity.stage != "never",
        "terminal": bool(quantity.terminal),
        "report": bool(quantity.report),
        "`steps.csv`": bool(quantity.steps),
    }
    ways = {"derivative": has(quantity, "functional"), "bounds": has(quantity, "bounds")}
    asked = f"`{quantity.request or quantity.key}`: {' and '.join(way for way, known in ways.items() if known)}"
    places = ", ".join(place for place, known in shown.items() if known)
    return (f"`{quantity.key}`", quantity.unit, what, places, asked if any(ways.values()) else "")
