"""All quantities: those of this package, and those of other packages and programs."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from typing import Any

from signorini_fx.errors import InstallationError, SceneError
from signorini_fx.extensions import QUANTITIES, load, names_of
from signorini_fx.quantities.families import FAMILIES
from signorini_fx.quantities.quantity import Quantity
from signorini_fx.quantities.run import RowOfSteps, Run

# Keys of a summary that say how it was computed, and columns of steps.csv.
RESERVED = {*Run.model_fields, *RowOfSteps.model_fields}


def quantities() -> tuple[Quantity, ...]:
    """All of them, in the order in which they are shown.

    Raises:
        InstallationError: one of another package cannot be used.
    """
    return (*of_package(), *(_usable(name, load(QUANTITIES, name)) for name in names_of(QUANTITIES)))


@cache
def of_package() -> tuple[Quantity, ...]:
    """Those of this package."""
    return tuple(
        quantity for name in FAMILIES for quantity in import_module(f"{__package__}.families.{name}").QUANTITIES
    )


@cache
def _usable(name: str, extension: Any) -> Quantity:
    """A quantity from an object, or from a class that needs no arguments.

    Raises:
        InstallationError: it is none, or its key is taken.
    """
    quantity: Quantity = extension() if isinstance(extension, type) else extension
    key, title = getattr(quantity, "key", None), getattr(quantity, "title", None)
    if Quantity not in type(quantity).__mro__ or not isinstance(title, str):
        raise InstallationError(f"the quantity {name!r} is no signorini_fx.Quantity with a key and a title")
    if key != name or not name.isidentifier() or name in RESERVED or name in {known.key for known in of_package()}:
        raise InstallationError(f"the quantity {name!r} needs a key that is its name, an identifier that is not taken")
    return quantity


def error_of(summary: Mapping[str, Any], key: str) -> float | None:
    """The estimated relative error of a figure of a summary; None: it has no estimate."""
    return next((quantity.error(dict(summary)) for quantity in quantities() if quantity.key == key), None)


def requested(text: str, ask: Callable[[Quantity, tuple[str, ...]], Any], subject: str) -> Any:
    """What a quantity answers to a request such as ``force top y``.

    Args:
        text: first the name, behind it what the quantity wants to know.
        ask: is called with the quantity and the words behind its name; returns None if it has no answer, and raises
            ValueError if the words do not fit.
        subject: what is asked for, for the message.

    Raises:
        SceneError: there is no such quantity, or it has no answer.
    """
    try:
        kind, *words = shlex.split(text)
    except ValueError:
        kind, words = text, []
    for quantity in quantities():
        if name_of(quantity) == kind:
            try:
                answer = ask(quantity, tuple(words))
            except ValueError:
                break
            if answer is None:
                break
            return answer
    known = [quantity.request or quantity.key for quantity in quantities() if has(quantity, subject)]
    raise SceneError([(f"of {text!r}", f"is no result; there are {', '.join(map(repr, known))}")])


def name_of(quantity: Quantity) -> str:
    """By what it is asked for."""
    return (quantity.request or quantity.key).split()[0]


def has(quantity: Quantity, method: str) -> bool:
    """Whether a quantity has a derivative (``functional``) or ``bounds`` of its own."""
    return getattr(type(quantity), method) is not getattr(Quantity, method)
