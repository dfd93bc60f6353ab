"""Parts of the report page, made from templates.  Text that is no markup is escaped and loses its
control characters.
"""

from __future__ import annotations

import base64
import math
import re
import struct
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from signorini_fx.arrays import Plain
from signorini_fx.errors import InstallationError
from signorini_fx.machine.terminal import printable
from signorini_fx.tuned import BROAD_PICTURE

try:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup as Markup
except ImportError:
    raise InstallationError(
        "a report needs Jinja (pip install jinja2; on Debian: python3-jinja2)"
    ) from None

_WIDE_TABLE = 8  # columns from which on the print uses small letters
_WIDE_CELL = 16  # letters from which on a cell is broken into lines
_MOST_ENTRIES = 8  # of a list in a cell
_NOTHING: tuple[Any, ...] = (None, "", [], {}, ())


@cache
def _templates() -> Environment:
    def safe(value: Plain) -> Plain:
        return (
            printable(value) if isinstance(value, str) and not isinstance(value, Markup) else value
        )

    folder = str(resources.files(__package__).joinpath("templates"))
    environment = Environment(
        loader=FileSystemLoader(folder), autoescape=True, undefined=StrictUndefined, finalize=safe
    )
    environment.filters["anchor"] = lambda heading: heading.lower().replace(" ", "-")
    return environment


def rendered(name: str, /, **values: Plain) -> Markup:
    """Return a template rendered with values."""
    return Markup(_templates().get_template(f"{name}.html").render(values).strip())


def part(name: str, *values: Any) -> Markup:
    """Return a macro of ``parts.html`` rendered with its arguments."""
    return Markup(getattr(_templates().get_template("parts.html").module, name)(*values))


def joined(parts: Iterable[Markup]) -> Markup:
    """Return the parts concatenated."""
    return Markup("").join(parts)


def shown(value: Plain) -> str:
    """Return a value as the text of a table cell."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        return f"{value + 0.0:.6g}"
    if isinstance(value, list | tuple):
        return (
            f"({', '.join(map(shown, value))})"
            if len(value) <= _MOST_ENTRIES
            else f"{len(value)} entries"
        )
    if isinstance(value, Mapping):
        texts = {key: shown(item) for key, item in value.items() if item not in _NOTHING}
        # What belongs to an inner table stands in braces, as in the scene file.
        inner = {key: f"{{{texts[key]}}}" for key in texts if isinstance(value[key], Mapping)}
        return ", ".join(f"{key} = {text}" for key, text in {**texts, **inner}.items())
    return value if isinstance(value, str) else str(value)


_POWERS = str.maketrans(
    "0123456789-", "\u2070\xb9\xb2\xb3\u2074\u2075\u2076\u2077\u2078\u2079\u207b"
)


def in_text(text: str) -> str:
    """Return a text with its numbers in powers of ten that no line break divides: 2.8e-08 becomes
    2.8 times 10 to the -8.
    """

    def power(match: re.Match[str]) -> str:
        factor = "" if match[1] == "1" else f"{match[1]}\N{MULTIPLICATION SIGN}"
        return f"{factor}10{str(int(match[2])).translate(_POWERS)}"

    return re.sub(r"\b(\d+(?:\.\d+)?)e([+-]\d+)\b", power, text)


def is_number(value: Plain) -> bool:
    """Return whether a value is a number, or None in a column of numbers."""
    return value is None or (
        isinstance(value, int | float | np.number) and not isinstance(value, bool)
    )


def table(
    columns: Sequence[str], rows: Sequence[Sequence[Plain]], classes: Sequence[str] = ()
) -> Markup:
    """Return a table that scrolls sideways if it is wider than the page; columns of numbers are
    flush right.
    """
    numeric = [all(is_number(row[k]) for row in rows) for k in range(len(columns))]
    head = [(name, "number" if right else "") for name, right in zip(columns, numeric, strict=True)]
    body = []
    for row, class_ in zip(rows, classes or [""] * len(rows), strict=True):
        cells = []
        for value, right in zip(row, numeric, strict=True):
            text = shown(value)
            cells.append((text, "number" if right else "words" * (len(text) > _WIDE_CELL)))
        body.append((class_, cells))
    return part("table", head, body, len(columns) > _WIDE_TABLE)


def folded(title: str, *parts: str) -> Markup:
    """Return parts that are shown on demand only, and not printed."""
    return part("folded", title, parts)


def picture(data: bytes, alternative: str, caption: str) -> Markup:
    """Return a PNG file embedded in the page; a broad one can be scrolled on a narrow screen."""
    width, height = struct.unpack(">II", data[16:24])
    source = f"data:image/png;base64,{base64.b64encode(data).decode('ascii')}"
    return part("picture", source, alternative, caption, width > BROAD_PICTURE * height)
