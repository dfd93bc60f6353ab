"""Parts of the page: every text passes through a template, which escapes what is not markup."""

from __future__ import annotations

import base64
import math
import re
import struct
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.addons.report.templating import Markup, part
from signorini_fx.tuned import BROAD_PICTURE

_WIDE_TABLE = 8  # columns from which on the print uses small letters
_WIDE_CELL = 16  # letters from which on a cell is broken into lines
_MOST_ROWS = 400  # of a table; the CSV file has all rows


def joined(parts: Iterable[Markup]) -> Markup:
    """One after the other."""
    return Markup("").join(parts)


def shown(value: Any) -> str:
    """A value of a table."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        return f"{value + 0.0:.6g}"
    if isinstance(value, list | tuple):
        return f"({', '.join(map(shown, value))})"
    if isinstance(value, Mapping):
        texts = {key: shown(item) for key, item in value.items() if item is not None}
        # What belongs to an inner table stands in braces, as in the scene file.
        inner = {key: f"{{{texts[key]}}}" for key in texts if isinstance(value[key], Mapping)}
        return ", ".join(f"{key} = {text}" for key, text in {**texts, **inner}.items())
    return str(value)


_NUMBER = re.compile(r"-?\d+(\.\d+)?(e[+-]\d+)?|")  # as ``digits.figure`` writes it, or nothing
_VECTOR = re.compile(r"\([-+.,e\d ]+\)( [^ ,]+){0,2}")  # perhaps with its unit
_POWERS = str.maketrans("0123456789-", "\u2070\xb9\xb2\xb3\u2074\u2075\u2076\u2077\u2078\u2079\u207b")


def in_text(text: str) -> str:
    """Text whose numbers have powers of ten that no line break tears apart: 2.8e-08 is 2.8 times 10 to the -8."""

    def power(match: re.Match[str]) -> str:
        factor = "" if match[1] == "1" else f"{match[1]}\N{MULTIPLICATION SIGN}"
        return f"{factor}10{str(int(match[2])).translate(_POWERS)}"

    return re.sub(r"\b(\d+(?:\.\d+)?)e([+-]\d+)\b", power, text)


def is_number(value: Any) -> bool:
    """Whether a value is a number, or missing among numbers."""
    return value is None or (isinstance(value, int | float | np.number) and not isinstance(value, bool))


def table(columns: Sequence[str], rows: Sequence[Sequence[Any]], classes: Sequence[str] = ()) -> Markup:
    """A table that scrolls sideways if it is wider than the page; columns of numbers are flush right."""
    numeric = [all(is_number(row[k]) or _NUMBER.fullmatch(str(row[k])) for row in rows) for k in range(len(columns))]
    head = [(name, "number" if right else "") for name, right in zip(columns, numeric, strict=True)]
    body = []
    for row, class_ in zip(rows, classes or [""] * len(rows), strict=True):
        cells = []
        for value, right in zip(row, numeric, strict=True):
            text = shown(value)
            words = not right and len(text) > _WIDE_CELL and not _VECTOR.fullmatch(text)
            cells.append((_breakable(text) if words else text, "words" if words else "number" * right))
        body.append((class_, cells))
    return part("table", head, body, len(columns) > _WIDE_TABLE)


def _breakable(text: str) -> Markup:
    """Words of which a long one may be broken behind its underscores, as names of boundaries may be of any length."""
    if isinstance(text, Markup):
        return text
    return part("breakable", re.split(r"(?<=_)(?=[^_])", text))


def long_table(title: str, columns: Mapping[str, Any], file: str) -> Markup:
    """Columns of a CSV file; folded; a very long one shows its two ends."""
    rows = list(zip(*columns.values(), strict=True))
    remark: list[Markup] = []
    if len(rows) > _MOST_ROWS:
        half = _MOST_ROWS // 2
        text = f"The first and the last {half} of {len(rows)} rows; {file} has all of them."
        remark, rows = [part("note", text)], [*rows[:half], *rows[-half:]]
    # Behind a blank there is the name of a boundary, which stays as it is.
    names = [
        " ".join([first.replace("_", " "), *boundary_name])
        for first, *boundary_name in (name.split(" ", 1) for name in columns)
    ]
    return folded(f"{title}, {len(rows)} row{'s' * (len(rows) != 1)}", *remark, table(names, rows))


def folded(title: str, *parts: str) -> Markup:
    """What is shown on demand only, and not printed."""
    return part("folded", title, parts)


def picture(data: bytes, kind: str, alternative: str, caption: str, class_: str = "still") -> Markup:
    """A figure with its data in the page itself; a broad one is scrolled on a narrow screen, so that it can be read."""
    if kind == "png":
        width, height = struct.unpack(">II", data[16:24])
        class_ += " broad" if width > BROAD_PICTURE * height else ""
    source = f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
    return part("picture", source, alternative, caption, class_)


def drawn_by(draw: Callable[..., None], *arguments: Any, caption: str, class_: str = "still", **options: Any) -> Markup:
    """A figure with what a drawing function writes: ``draw(path, *arguments, **options)``."""
    with tempfile.TemporaryDirectory() as folder:
        draw(Path(folder) / "picture", *arguments, suffixes=[".svg"], **options)
        data = (Path(folder) / "picture.svg").read_bytes()
    return picture(data, "svg+xml", caption, caption, class_)
