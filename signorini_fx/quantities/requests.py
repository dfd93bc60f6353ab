"""The words behind the name of a quantity whose derivative or bounds are asked for."""

from __future__ import annotations

from typing import Any

from signorini_fx.errors import SceneError


def axis_of(dimension: int, name: str) -> int:
    """The number of an axis.

    Raises:
        ValueError: there is no such axis.
    """
    if len(name) != 1:
        raise ValueError(name)
    return "xyz"[:dimension].index(name)


def direction_of(dimension: int, axis: str) -> tuple[float, ...]:
    """The unit vector along an axis, see ``axis_of``."""
    number = axis_of(dimension, axis)
    return tuple(float(k == number) for k in range(dimension))


def contact_of(statement: Any, boundary: str) -> int:
    """The number of the contact of a boundary.

    Raises:
        SceneError: it has none.
    """
    names = [effect.boundary for effect in statement.contact]
    if boundary not in names:
        raise SceneError([(f"of {boundary!r}", f"is no contact boundary; there are: {', '.join(names)}")])
    return names.index(boundary)


def power_of(asked: str, usual: float, words: list[str]) -> float:
    """A power that smooths a quantity.

    Args:
        asked: what it is of, for the message.
        usual: the power if none is asked for.
        words: it as it is written, or nothing.

    Raises:
        SceneError: it is too small or too large.
        ValueError: it is no number, or there are several.
    """
    text = " ".join(words)
    power = float(text) if words else usual
    if not 1 < power <= 1000:
        raise SceneError([(f"of {asked} {text}", "the power must be above 1, and 1000 at most")])
    return power
