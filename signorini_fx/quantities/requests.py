"""Results whose derivative or bounds are asked for by a text, such as ``force top y``."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from typing import Any

from signorini_fx.errors import SceneError


def requested(text: str, known: Mapping[str, Callable[..., Any]]) -> Any:
    """What is asked for.

    Args:
        text: the name, and behind it the other words.
        known: functions of these words by the name with the words that they expect, such as ``force BOUNDARY AXIS``;
            they raise ValueError or TypeError if the words do not fit.

    Raises:
        SceneError: there is nothing of this name, or the words do not fit.
    """
    try:
        name, *words = shlex.split(text)
    except ValueError:
        name, words = text, []
    for request, function in known.items():
        if request.split()[0] == name:
            try:
                return function(*words)
            except (TypeError, ValueError):
                break
    raise SceneError([(f"of {text!r}", f"is no result; there are {', '.join(map(repr, known))}")])


def bounds_of(solution: Any, text: str) -> Any:
    """Guaranteed bounds of a result, or why there are none, see ``Solution.bounds``; collective."""
    from signorini_fx.quantities.proved_statements import Interval

    def of_force(boundary: str, axis: str) -> Any:
        dimension = solution.model.dimension
        number = axis_of(dimension, axis)
        return solution.force_bounds(boundary, tuple(float(k == number) for k in range(dimension)))

    def of_energy() -> Any:
        bound = solution.error_bound
        if bound is None or isinstance(bound, str):
            return bound
        low, high = bound.strain_energy
        return Interval(low, high, bound.assumed)

    return requested(text, {"force BOUNDARY AXIS": of_force, "strain_energy": of_energy})


def axis_of(dimension: int, name: str) -> int:
    """The number of an axis.

    Raises:
        ValueError: there is no such axis.
    """
    if len(name) != 1:
        raise ValueError(name)
    return "xyz"[:dimension].index(name)


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
