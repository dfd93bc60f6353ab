"""Scenes from TOML files and from plain data; every mistake gets its path and a sentence, all at once."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from signorini_fx.errors import SceneError
from signorini_fx.scene.model import MeshFile, Scene, Table
from signorini_fx.scene.values import shown


def parse_scene(data: Mapping[str, Any], source: str = "scene", folder: Path | None = None) -> Scene:
    """A validated scene from plain data.

    Args:
        data: the scene as nested mappings, as ``tomllib`` gives them.
        source: what to call it in messages.
        folder: mesh files are looked up relative to it.

    Raises:
        SceneError: with every mistake at once.
    """
    try:
        scene = Scene.model_validate(dict(data))
    except ValidationError as error:
        raise SceneError(_problems(error, data), source) from None
    if folder is not None and isinstance(scene.mesh, MeshFile) and not scene.mesh.file.is_absolute():
        scene = scene.model_copy(update={"mesh": scene.mesh.model_copy(update={"file": folder / scene.mesh.file})})
    return scene


_LARGEST_FILE = 1_000_000


# A key of many parts, with dots between, which takes the time of its parts squared; no table is so deep.
_DEEP_KEY = re.compile(r"""(?<![\w."'-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){50}""")


def read_scene_text(path: Path) -> str:
    """The text of a scene file.

    Raises:
        SceneError: the file cannot be read as text, or has no end.
    """
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
        raise SceneError([("file", f"is no scene: it is longer than {_LARGEST_FILE:,} characters")], str(path))
    return text


def parse_scene_text(text: str, path: Path, overrides: Mapping[str, Mapping[str, Any]] | None = None) -> Scene:
    """A validated scene from the text of the TOML file at ``path``.

    Args:
        text: the scene.
        path: where it comes from; mesh files are looked up beside it.
        overrides: entries that replace those of the text, table by table.

    Raises:
        SceneError: syntax error with line and column, or every mistake of the content at once.
    """
    if found := _DEEP_KEY.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise SceneError([("syntax", f"a key of more than 50 parts (at line {line})")], str(path))
    try:
        data = tomllib.loads(text)
    except ValueError as error:  # TOMLDecodeError, or a number with thousands of digits
        raise SceneError([("syntax", str(error))], str(path)) from None
    except RecursionError:
        raise SceneError([("syntax", "nested too deeply")], str(path)) from None
    for table, entries in (overrides or {}).items():
        if isinstance(said := data.get(table, {}), Mapping):  # else it is refused below
            data[table] = {**said, **entries}
    return parse_scene(data, str(path), path.parent)


def read_scene(path: str | Path) -> Scene:
    """A validated scene from a TOML file (see ``parse_scene_text`` for the errors)."""
    path = Path(path)
    return parse_scene_text(read_scene_text(path), path)


_MESSAGES = {
    "extra_forbidden": "unknown key",
    "unexpected_keyword_argument": "unknown key",
    "missing": "is missing",
    "union_tag_not_found": "is missing",
}


def plain_message(detail: Any) -> str:
    """What pydantic complains of, in the words of this package."""
    match detail:
        case {"type": str(kind)} if kind in _MESSAGES:
            return _MESSAGES[kind]
        case {"type": "model_type"}:
            return "must be a table"
        case {"type": "union_tag_invalid", "ctx": {"tag": tag, "expected_tags": known}}:
            return f"must be one of {known}, got {tag!r}"
    message = str(detail["msg"]).removeprefix("Value error, ")
    return re.sub(r"^Input should be( a valid)?", lambda found: "must be a" if found[1] else "must be", message)


# What an unknown key was perhaps to be takes a while to find out: more mistakes than this are not shown anyway.
_MOST_GUESSES = 50


def _problems(error: ValidationError, data: Mapping[str, Any]) -> list[tuple[str, str]]:
    """One entry a path: where pydantic tried several types, what each of them would have wanted."""
    found: dict[str, list[str]] = {}
    for number, detail in enumerate(error.errors()):
        path, message = _problem(detail, data, guess=number < _MOST_GUESSES)
        found.setdefault(path, []).append(message)
    return [(path, "; or: ".join(dict.fromkeys(messages))) for path, messages in found.items()]


def _problem(detail: Any, data: Mapping[str, Any], *, guess: bool) -> tuple[str, str]:
    """Path and sentence for one pydantic error: list positions as [i], without pydantic's own union labels."""
    path = ""
    node: Any = data
    for part in detail["loc"]:
        if isinstance(part, int):
            path += f"[{part}]" if isinstance(node, Sequence) else ""
            node = node[part] if isinstance(node, Sequence) and part < len(node) else node
        elif (isinstance(node, Mapping) and part in node) or (
            detail["type"] == "missing" and part == detail["loc"][-1]
        ):
            name = part or '""'
            path += f".{name}" if path else name
            node = node[part] if isinstance(node, Mapping) and part in node else node
    message = plain_message(detail)
    given = detail.get("input")
    if detail["type"] == "extra_forbidden" and guess:
        message += _meant(str(detail["loc"][-1]))
    if detail["type"].startswith("union_tag"):
        path += ".law" if "law" in detail["ctx"]["discriminator"] else ".kind"
    if detail["type"] not in _MESSAGES and isinstance(given, str | int | float) and shown(given) not in message:
        message += f", got {shown(given)}"
    return path or "scene", message


def _meant(key: str) -> str:
    """Where an unknown key belongs, or what it was perhaps to be."""
    if key in Scene.model_fields:
        return f" here: {key!r} belongs to the top level of the scene, above the first [table]"
    tables = {name: getattr(field.annotation, "model_fields", {}) for name, field in Scene.model_fields.items()}
    home = next((name for name, fields in tables.items() if key in fields), None)
    if home is not None:
        return f" here: it belongs to [{home}]"
    similar = difflib.get_close_matches(key, _keys(Table), n=1, cutoff=0.75)
    return f": did you mean {similar[0]!r}?" if similar and similar[0] != key else ""


def _keys(model: type[BaseModel]) -> set[str]:
    """All keys of a table and of those that derive from it."""
    return set(model.model_fields).union(*map(_keys, model.__subclasses__()))
