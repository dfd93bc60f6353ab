"""Names in CSV files: a spreadsheet would compute what begins like a formula, wherever a name comes from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signorini_fx.machine.terminal import printable

# The columns of a table by name, arrays of one entry per row.
Table = Mapping[str, Any]
# What begins a formula in Excel, LibreOffice or Google Sheets; the apostrophe is their sign for text.
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")
_TEXT = "'"


def as_text(name: str) -> str:
    """A name without control characters, with an apostrophe where it would be a formula, or seems to have got one."""
    name = printable(name)
    return f"{_TEXT}{name}" if name.lstrip(_TEXT).startswith(_FORMULA) else name


def as_name(text: str) -> str:
    """The name that ``as_text`` was given."""
    return text[len(_TEXT) :] if text.startswith(_TEXT) and text.lstrip(_TEXT).startswith(_FORMULA) else text
