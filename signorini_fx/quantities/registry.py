"""All quantities: those of this package, and those of other packages and programs."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from typing import Any

from pydantic import TypeAdapter
from pydantic.errors import PydanticUserError

from signorini_fx.errors import InstallationError, SceneError
from signorini_fx.extensions import QUANTITIES, load, names_of
from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.families import FAMILIES
from signorini_fx.quantities.quantity import Card, Quantity, Summary
from signorini_fx.quantities.text import row


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
    from signorini_fx.quantities.summary_schema import RowOfSteps, Run

    # Keys of a summary that say how it was computed, and columns of steps.csv.
    reserved = {*Run.model_fields, *RowOfSteps.model_fields}
    quantity: Quantity = extension() if isinstance(extension, type) else extension
    key, title = getattr(quantity, "key", None), getattr(quantity, "title", None)
    if Quantity not in type(quantity).__mro__ or not isinstance(title, str):
        raise InstallationError(f"the quantity {name!r} is no signorini_fx.Quantity with a key and a title")
    if key != name or not name.isidentifier() or name in reserved or name in {known.key for known in of_package()}:
        raise InstallationError(f"the quantity {name!r} needs a key that is its name, an identifier that is not taken")
    try:
        TypeAdapter(quantity.kind).json_schema()
    except PydanticUserError as error:
        reason = str(error).splitlines()[0]
        raise InstallationError(f"the kind of the quantity {name!r} is no type of values in JSON: {reason}") from None
    return quantity


def is_added(quantity: Quantity) -> bool:
    """Whether it is not of this package: what it does is tried, and its failure costs nothing else."""
    return quantity not in of_package()


def at_stage(stage: str) -> list[Quantity]:
    """Those that are computed at a stage: one that is added once the results stand, if ever."""
    added = quantities()[len(of_package()) :] if stage == "afterwards" else ()
    ours = [quantity for quantity in of_package() if quantity.stage == stage]
    return [*ours, *(quantity for quantity in added if quantity.stage != "never")]


def shown_lines(quantity: Quantity, summary: Summary) -> list[TerminalLine]:
    """What ``solve`` prints of a quantity; of one that is added, and whose own method fails, the reason."""
    if not is_added(quantity):
        return quantity.lines(summary)
    lines = _shown(quantity, "lines", TerminalLine, summary)
    return [row(quantity.key, lines, "warning")] if isinstance(lines, str) else lines


def shown_cards(quantity: Quantity, summary: Summary) -> list[Card]:
    """What the report shows large of a quantity, likewise."""
    if not is_added(quantity):
        return quantity.cards(summary)
    cards = _shown(quantity, "cards", Card, summary)
    return [Card(quantity.key, "not shown", remark=cards)] if isinstance(cards, str) else cards


def _shown(quantity: Quantity, method: str, kind: type, summary: Summary) -> Any:
    """What a method returns, a list of such entries; else why it does not, in words."""
    try:
        entries = list(getattr(quantity, method)(summary))
    except Exception as error:
        return f"is not shown, as {method} fails: {type(error).__name__}: {error}"
    wrong = next((entry for entry in entries if not isinstance(entry, kind)), None)
    return (
        entries if wrong is None else f"is not shown, as {method} has a {type(wrong).__name__}, not a {kind.__name__}"
    )


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
