"""Quantities that other packages and programs add to the results."""

from __future__ import annotations

from functools import cache
from typing import Any

from signorini_fx.errors import InstallationError
from signorini_fx.extensions import QUANTITIES, load, names_of
from signorini_fx.quantities.summary import RowOfSteps, Summary


class Quantity:
    """A result of one's own: a class with this as its base sets ``key`` and ``title`` and has the method ``value``.

    It is in summary.json, on the terminal, in the report, and in steps.csv if it is a number.

    Attributes:
        key: its name in summary.json.
        title: what it is, in words.
        unit: what it is measured in, a word of ``units.names_of`` such as ``force``; "": it has no unit.
    """

    key: str
    title: str
    unit: str = ""

    def value(self, solution: Any) -> float | list[float] | None:
        """A number or a list of numbers; None: this solution has none; collective.

        Args:
            solution: a ``Solution``, of a load step if there are several.
        """
        raise NotImplementedError


def own_quantities() -> tuple[Quantity, ...]:
    """Those that are installed or registered.

    Raises:
        InstallationError: one of them cannot be used.
    """
    return tuple(_usable(name, load(QUANTITIES, name)) for name in names_of(QUANTITIES))


@cache
def _usable(name: str, extension: Any) -> Quantity:
    """A quantity from an object, or from a class that needs no arguments.

    Raises:
        InstallationError: it is none, or its key is taken.
    """
    quantity = extension() if isinstance(extension, type) else extension
    if not isinstance(quantity, Quantity) or not isinstance(getattr(quantity, "title", None), str):
        raise InstallationError(f"the quantity {name!r} is no signorini_fx.Quantity with a key and a title")
    taken = {*Summary.model_fields, *RowOfSteps.model_fields}
    if getattr(quantity, "key", None) != name or not name.isidentifier() or name in taken:
        raise InstallationError(f"the quantity {name!r} needs a key that is its name, an identifier that is not taken")
    return quantity
