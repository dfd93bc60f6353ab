"""Entries of a scene that are changed by their path, such as ``contact[0].friction.coefficient=0.3``."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any, Literal, get_origin

from pydantic import BaseModel

from signorini_fx.errors import SceneError

# Path of an entry, as messages name it -> its value.
Changes = Mapping[str, Any]
PATH = re.compile(r"[A-Za-z_]\w*(\[\d{1,9}\])?(\.[A-Za-z_]\w*(\[\d{1,9}\])?)*")
_PATH_PART = re.compile(r"([A-Za-z_]\w*)|\[(\d+)\]")


def parsed_change(text: str) -> tuple[str, Any]:
    """``PATH=VALUE``: the path, and the value as TOML has it; what is no TOML is a text, which needs no quotes here.

    Raises:
        ValueError: it has another form.
    """
    path, equals, value_text = text.partition("=")
    path = path.strip()
    if not equals or not PATH.fullmatch(path):
        raise ValueError(f"PATH=VALUE is expected, such as contact[0].friction.coefficient=0.3, got {text!r}")
    try:
        return path, tomllib.loads(f"value = {value_text}")["value"]
    except ValueError:
        return path, value_text.strip()


def way_of(path: str) -> list[str | int]:
    """The keys and numbers in lists that a path leads through."""
    return [int(number) if number else name for name, number in _PATH_PART.findall(path)]


def changed(data: Any, changes: Changes) -> Any:
    """A scene as plain data, or a ``Scene``, of which plain data are made on the way, with other entries; tables on the
    way that it does not have are made.

    Raises:
        SceneError: a path leads through an entry that is no table, or to a place that a list does not have.
    """
    for path, value in changes.items():
        data = _with(data, way_of(path), value, "")
    return data


def _with(entry: Any, way: list[str | int], value: Any, at: str) -> Any:
    """The entry at a path, in which another value stands at the end of the way from there."""
    if not way:
        return value
    entry = _opened(entry)
    key, *inner_way = way
    if isinstance(key, int):
        if isinstance(entry, Mapping) and key == 0:  # one table is a list of one
            return _with(entry, inner_way, value, f"{at}[0]")
        if not isinstance(entry, list) or key >= len(entry):
            reason = f"has {len(entry)}, counted from 0" if isinstance(entry, list) else "is no list"
            raise SceneError([(f"{at}[{key}]", f"is not there: {at} {reason}")])
        return [*entry[:key], _with(entry[key], inner_way, value, f"{at}[{key}]"), *entry[key + 1 :]]
    if isinstance(entry, list) and all(isinstance(element, Mapping | BaseModel) for element in entry):
        if len(entry) != 1:
            raise SceneError([(at, f"is a list of {len(entry)}: say which is meant, from {at}[0] on")])
        return [_with(entry[0], way, value, f"{at}[0]")]
    if not isinstance(entry, Mapping | None):
        raise SceneError([(at, "must be a table")])
    return {**(entry or {}), key: _with((entry or {}).get(key), inner_way, value, f"{at}.{key}".lstrip("."))}


def _opened(entry: Any) -> Any:
    """A validated table as plain data, with the keys that it has been given, and a tuple of tables as a list."""
    if isinstance(entry, BaseModel):
        fields, given = type(entry).model_fields, entry.model_fields_set
        kept = [key for key, field in fields.items() if key in given or get_origin(field.annotation) is Literal]
        return {key: getattr(entry, key) for key in kept}
    return list(entry) if isinstance(entry, tuple) else entry
