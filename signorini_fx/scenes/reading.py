"""Scenes from TOML files and from plain data; all errors are reported at once, each with its path."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import ValidationError

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.base import problems_of
from signorini_fx.mechanics.statement.changes import Changes, changed
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.scenes.scene import Scene


def parse_scene(data: Mapping[str, Any], source: str = "scene", folder: Path | None = None) -> Scene:
    """A validated scene from plain data.

    Args:
        data: the scene as nested mappings, as ``tomllib`` gives them.
        source: name of the scene in messages.
        folder: the folder that paths of files in the scene are relative to.

    Raises:
        SceneError: with all errors at once.
    """
    try:
        scene = Scene.model_validate(dict(data))
    except ValidationError as error:
        raise SceneError(problems_of(error, data, Scene.described()), source) from None
    if folder is None:
        return scene
    contact = [
        effect.model_copy(update={"foundation": _found_from(folder, effect.foundation)}) for effect in scene.contact
    ]
    effects = {
        key: tuple(_found_from(folder, effect) for effect in entries)
        for key, entries in scene.statement.effects.items()
        if any(isinstance(getattr(effect, "file", None), Path) for effect in entries)
    }
    mesh = _found_from(folder, scene.mesh)
    body = tuple(entry.model_copy(update={"mesh": _found_from(folder, entry.mesh)}) for entry in scene.body)
    return scene.model_copy(update={"mesh": mesh, "body": body, "contact": tuple(contact), **effects})


def _found_from(folder: Path, table: Any) -> Any:
    """A table whose file, if it has one, is found from a folder."""
    file = getattr(table, "file", None)
    return table.model_copy(update={"file": folder / file}) if isinstance(file, Path) else table


_LARGEST_FILE = 1_000_000


def read_scene_text(path: Path) -> str:
    """The text of a scene file."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            text = file.read(_LARGEST_FILE + 1)
    except OSError as error:
        raise SceneError([("file", f"cannot be read: {error.strerror}")], str(path)) from None
    except UnicodeDecodeError:
        raise SceneError([("file", "is not a text file (UTF-8)")], str(path)) from None
    except ValueError as error:  # a null byte in the path
        raise SceneError([("file", f"cannot be read: {error}")], str(path)) from None
    if len(text) > _LARGEST_FILE:
        raise SceneError([("file", f"is not a scene: it is longer than {_LARGEST_FILE:,} characters")], str(path))
    return text


def parse_scene_text(text: str, path: Path, changes: Changes = MappingProxyType({})) -> Scene:
    """A validated scene from the text of the TOML file at ``path``.

    Args:
        text: the scene.
        path: its file; paths of mesh files are relative to the folder of this file.
        changes: entries that replace those of the text, by their paths.

    Raises:
        SceneError: a syntax error with line and column, or all errors of the content at once.
    """
    try:
        data = tomllib.loads(text)
    except ValueError as error:  # TOMLDecodeError, or a number with thousands of digits
        raise SceneError([("syntax", f"{error}{_unquoted(text, str(error))}")], str(path)) from None
    except RecursionError:
        raise SceneError([("syntax", "nested too deeply")], str(path)) from None
    return parse_scene(changed(data, changes), str(path), path.parent)


def _unquoted(text: str, message: str) -> str:
    """What to do if the line that is wrong has an expression without quotes; "" if it has none."""
    location = re.search(r"at line (\d+)", message)
    line = text.splitlines()[int(location[1]) - 1] if location and int(location[1]) <= text.count("\n") + 1 else ""
    assignment = re.fullmatch(r"\s*([\w.]+)\s*=\s*([^\"'\[{#][^\"'#]*?)\s*(#.*)?", line)
    if assignment is None or not re.search(r"x\[\d\]|\bif\b|[*/(]", assignment[2]):
        return ""
    return f': an expression stands in quotes, as in {assignment[1]} = "{assignment[2][:60]}"'


def read_scene(path: str | Path) -> Scene:
    """A validated scene from a TOML file (see ``parse_scene_text`` for the errors).

    Raises:
        TypeError: the argument is not a path.
    """
    if not isinstance(path, str | Path):
        raise TypeError(f"the path of a scene file is expected, not {kind_of(path)}")
    path = Path(path)
    return parse_scene_text(read_scene_text(path), path)


def as_scene(scene: object) -> Scene:
    """A scene from a ``Scene``, the path of its file, or nested mappings.

    Raises:
        SceneError: it is wrong.
        TypeError: it is none of these.
    """
    match scene:
        case Scene():
            return scene
        case str() | Path():
            return read_scene(scene)
        case Mapping():
            return parse_scene(scene)
    raise TypeError(f"a Scene or the path of a scene file is expected, not {kind_of(scene)}")
