"""How exactly a number was printed."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from signorini_fx.mechanics.mesh.files.shape import Floats

# Fortran leaves out the letter before an exponent of three digits.
_NUMBER = re.compile(r"\s*[-+]?(\d*)\.?(\d*)(?:[eEdD]?([-+]\d+)|[eEdD](\d+))?\s*")
_WITHOUT_LETTER = re.compile(r"(?<=[\d.])(?:[dD]([-+]?)|([-+]))(?=\d+\s*$)")


def printed_number(word: str) -> float:
    """A number as Fortran and C print it.

    Raises:
        ValueError: it is none.
    """
    return float(_WITHOUT_LETTER.sub(r"E\1\2", word))


def last_digit(word: str) -> float:
    """The unit of the last digit of a number as it was printed; 0 for none, for one that is too large to be finite, and
    for zero, which is exact.
    """
    match = _NUMBER.fullmatch(word)
    if match is None or not (match[1] + match[2]).strip("0") or math.isinf(printed_number(word)):
        return 0.0
    return float(f"1e{int(match[3] or match[4] or 0) - len(match[2])}")


def units_of_column(words: Sequence[str]) -> Floats:
    """The unit of the last digit of each number of a column, of which some may end in zeros that are not printed.

    Without exponents all have as many decimals as the longest one; with exponents as many digits, shape (n,).
    """
    units = np.array([last_digit(word) for word in words])
    if not units.any():
        return units
    if not any(letter in word for word in words for letter in "eEdD"):
        return np.where(units > 0, units[units > 0].min(), 0.0)
    values = np.array([abs(printed_number(word)) for word in words])
    powers = np.floor(np.log10(np.where(units > 0, values, 1.0)))
    digits = (powers - np.round(np.log10(np.where(units > 0, units, 1.0))))[units > 0].max()
    return np.where(units > 0, 10.0 ** (powers - digits), 0.0)


def significant_digits(values: Floats, half_units: Floats) -> int | None:
    """How many digits the largest of some numbers was printed with; None: more than are needed to know it.

    Args:
        values: any shape.
        half_units: half a unit of the last digit of each.
    """
    row = int(np.argmax(np.abs(values)))
    value, half = float(np.abs(values).ravel()[row]), float(half_units.ravel()[row])
    if not half > 0 or not value > 0:
        return None
    return int(np.floor(np.log10(value))) - int(np.round(np.log10(2 * half))) + 1
