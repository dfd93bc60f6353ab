"""Scenes from TOML files and from plain data; all errors are reported at once, each with its
path.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from datetime import date, time
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, get_origin

from pydantic import BaseModel, ValidationError

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.base import problems_of
from signorini_fx.mechanics.statement.mesh_sources import MeshInMemory
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.scenes.scene import Scene

if TYPE_CHECKING:
    from mpi4py import MPI

    from signorini_fx.arrays import Plain

# Values by the paths of their entries, such as contact[0].gap.
Changes = Mapping[str, Any]
PATH = re.compile(r"[A-Za-z_]\w*(\[\d{1,9}\])?(\.[A-Za-z_]\w*(\[\d{1,9}\])?)*")
_PATH_PART = re.compile(r"([A-Za-z_]\w*)|\[(\d+)\]")


def parse_scene(
    data: Mapping[str, Any], source: str = "scene", folder: Path | None = None
) -> Scene:
    """Return a validated scene from nested mappings, such as those of ``tomllib``.

    Args:
        data: the scene.
        source: name of the scene in messages.
        folder: the folder that paths of files in the scene are relative to.

    Raises:
        SceneError: the data are wrong; it lists all errors.
    """
    try:
        scene = Scene.model_validate(dict(data))
    except ValidationError as error:
        raise SceneError(problems_of(error, data, Scene), source) from None
    if folder is None:
        return scene
    contact = [
        effect.model_copy(update={"foundation": _found_from(folder, effect.foundation)})
        for effect in scene.contact
    ]
    effects = {
        key: tuple(_found_from(folder, effect) for effect in entries)
        for key, entries in scene.statement.effects.items()
        if any(isinstance(getattr(effect, "file", None), Path) for effect in entries)
    }
    mesh = _found_from(folder, scene.mesh)
    body = tuple(
        entry.model_copy(update={"mesh": _found_from(folder, entry.mesh)}) for entry in scene.body
    )
    return scene.model_copy(
        update={"mesh": mesh, "body": body, "contact": tuple(contact), **effects}
    )


def _found_from(folder: Path, table: Any) -> Any:
    """Return the table with the path of its file, if it has one, relative to a folder."""
    file = getattr(table, "file", None)
    return table.model_copy(update={"file": folder / file}) if isinstance(file, Path) else table


def read_scene_text(path: Path) -> str:
    """Return the text of a scene file."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise SceneError.at("file", "is not a text file (UTF-8)", str(path)) from None
    except (OSError, ValueError) as error:  # ValueError: a null byte in the path
        reason = getattr(error, "strerror", None) or error
        raise SceneError.at("file", f"cannot be read: {reason}", str(path)) from None


def parse_scene_text(text: str, path: Path, changes: Changes = MappingProxyType({})) -> Scene:
    """Return a validated scene from the text of a TOML file.

    Args:
        text: the text.
        path: the file, to whose folder paths of mesh files are relative.
        changes: values that replace entries, by path.
    """
    try:
        data = tomllib.loads(text)
    except (
        ValueError,
        RecursionError,
    ) as error:  # TOMLDecodeError, a number with thousands of digits, deep nesting
        raise SceneError.at("syntax", _syntax(text, str(error)), str(path)) from None
    return parse_scene(changed(data, changes), str(path), path.parent)


def _syntax(text: str, message: str) -> str:
    """Return the message of a syntax error, with a hint if the cause is known."""
    if complete := re.match(r"Cannot mutate immutable namespace \('(.*)',?\)(.*)", message):
        name = complete[1].replace("', '", ".")
        return (
            f"{name} is complete with its braces: write all of its keys into them, or begin a "
            f"table [{name}] with a line for each{complete[2]}"
        )
    return f"{message}{_unquoted(text, message)}"


def _unquoted(text: str, message: str) -> str:
    """Return a hint if the wrong line has an expression without quotes, otherwise ""."""
    location = re.search(r"at line (\d+)", message)
    line = (
        text.splitlines()[int(location[1]) - 1]
        if location and int(location[1]) <= text.count("\n") + 1
        else ""
    )
    assignment = re.fullmatch(r"\s*([\w.]+)\s*=\s*([^\"'\[{#][^\"'#]*?)\s*(#.*)?", line)
    if assignment is None or not re.search(r"x\[\d\]|\bif\b|[*/(]", assignment[2]):
        return ""
    return f': an expression stands in quotes, as in {assignment[1]} = "{assignment[2][:60]}"'


def read_scene(path: str | Path) -> Scene:
    """Return the validated scene of a TOML file.

    Raises:
        TypeError: the argument is not a path.
        SceneError: a syntax error with line and column, or all errors of the content at once.

    Examples:
        >>> import tempfile
        >>> file = tempfile.mkdtemp() + "/scene.toml"
        >>> with open(file, "w") as out:
        ...     print("mesh = { generator = 'rectangle', parameters = { nx = 8 } }", file=out)
        ...     print("material = { young = 1000.0, poisson = 0.3 }", file=out)
        ...     print("contact = { boundary = 'bottom' }", file=out)
        >>> print(sfx.read_scene(file).material[0].young)
        1000.0
    """
    if not isinstance(path, str | Path):
        raise TypeError(f"the path of a scene file is expected, not {kind_of(path)}")
    return _scene_of_file(Path(path), None)


def _scene_of_file(path: Path, comm: MPI.Comm | None) -> Scene:
    """Return the scene of a file; with ``comm``, the first rank reads it for all; collective."""
    if comm is None:
        return parse_scene_text(read_scene_text(path), path)
    from signorini_fx.machine import parallel

    return parse_scene_text(parallel.on_root(comm, lambda: read_scene_text(path)), path)


def as_scene(scene: object, comm: MPI.Comm | None = None) -> Scene:
    """Return a scene from a ``Scene``, the path of its file, or nested mappings.

    Args:
        scene: any of these.
        comm: the ranks, if given: then the call is collective, meshes in memory are distributed,
            and the contacts of ``general_contact`` are found.
    """
    match scene:
        case Scene():
            found = scene
        case str() | Path():
            found = _scene_of_file(Path(scene), comm)
        case Mapping():
            found = parse_scene(scene)
        case _:
            wrong = f"a Scene or the path of a scene file is expected, not {kind_of(scene)}"
            raise TypeError(wrong)
    if comm is None:
        return found
    if any(isinstance(mesh, MeshInMemory) for mesh in found.meshes):
        from signorini_fx.mechanics.mesh.tagged import read_mesh

        found = found.with_meshes(
            read_mesh(mesh, comm) if isinstance(mesh, MeshInMemory) else mesh
            for mesh in found.meshes
        )
    if found.general_contact is None:
        return found
    from signorini_fx.scenes.found_contacts import with_found_contacts

    return with_found_contacts(found, comm)


# --- entries that are changed by their path, such as contact[0].friction.coefficient=0.3 ----------


def parsed_change(text: str) -> tuple[str, Plain]:
    """Return the path and the value of a text ``PATH=VALUE``.

    The value is TOML, or otherwise a text, which needs no quotes.
    """
    path, equals, value_text = text.partition("=")
    path = path.strip()
    if not equals or not PATH.fullmatch(path):
        raise ValueError(
            f"PATH=VALUE is expected, such as contact[0].friction.coefficient=0.3, got {text!r}"
        )
    try:
        value = tomllib.loads(f"value = {value_text}")["value"]
    except ValueError:
        return path, value_text.strip()
    # A scene has no dates: 10:40:16 is a range.
    return path, value_text.strip() if isinstance(value, date | time) else value


def way_of(path: str) -> list[str | int]:
    """Return the keys and list indices along a path."""
    return [int(number) if number else name for name, number in _PATH_PART.findall(path)]


def changed(data: Any, changes: Changes) -> Any:
    """Return a scene, given as plain data or a ``Scene``, with changed entries; missing tables are
    added.
    """
    for path, value in changes.items():
        data = _with(data, way_of(path), value, "")
    return data


def _with(entry: Any, way: list[str | int], value: Any, at: str) -> Any:
    """Return an entry in which ``value`` replaces what is at the end of the path ``way``.

    Args:
        entry: the entry.
        way: keys and list indices.
        value: the new value.
        at: path of the entry, for messages.
    """
    if not way:
        return value
    entry = _opened(entry)
    key, *inner_way = way
    if isinstance(key, int):
        if isinstance(entry, Mapping) and key == 0:  # one table is a list of one
            return _with(entry, inner_way, value, f"{at}[0]")
        if not isinstance(entry, list) or key >= len(entry):
            reason = (
                f"has {len(entry)}, counted from 0" if isinstance(entry, list) else "is no list"
            )
            raise SceneError.at(f"{at}[{key}]", f"is not there: {at} {reason}")
        return [
            *entry[:key],
            _with(entry[key], inner_way, value, f"{at}[{key}]"),
            *entry[key + 1 :],
        ]
    if isinstance(entry, list) and all(
        isinstance(element, Mapping | BaseModel) for element in entry
    ):
        if len(entry) != 1:
            raise SceneError.at(at, f"is a list of {len(entry)}: give a number, from {at}[0] on")
        return [_with(entry[0], way, value, f"{at}[0]")]
    if not isinstance(entry, Mapping | None):
        raise SceneError.at(at, "must be a table")
    return {
        **(entry or {}),
        key: _with((entry or {}).get(key), inner_way, value, f"{at}.{key}".lstrip(".")),
    }


def _opened(entry: Any) -> Any:
    """Return a validated table as a dictionary of the keys that were set, and a tuple as a list."""
    if isinstance(entry, BaseModel):
        fields = type(entry).model_fields
        given = entry.model_fields_set
        kept = [
            key
            for key, field in fields.items()
            if key in given or get_origin(field.annotation) is Literal
        ]
        return {key: getattr(entry, key) for key in kept}
    return list(entry) if isinstance(entry, tuple) else entry
