"""Extensions by other packages: objects that they name as entry points, or that a program
registers.

The optional add-ons of this package are such a group of entry points, too.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, TypeVar

from signorini_fx.errors import InstallationError, MissingPackageError

ADD_ONS = "signorini_fx.add_ons"
CONTACT_PARTS = "signorini_fx.contact_parts"
EFFECTS = "signorini_fx.effects"
GENERATORS = "signorini_fx.generators"
KINEMATICS = "signorini_fx.kinematics"
LAWS = "signorini_fx.laws"
LINEAR_SOLVERS = "signorini_fx.linear_solvers"
MATERIALS = "signorini_fx.materials"
QUANTITIES = "signorini_fx.quantities"
SHAPES = "signorini_fx.shapes"
STEP_EFFECTS = "signorini_fx.step_effects"
GROUPS = (
    ADD_ONS,
    CONTACT_PARTS,
    EFFECTS,
    GENERATORS,
    KINEMATICS,
    LAWS,
    LINEAR_SOLVERS,
    MATERIALS,
    QUANTITIES,
    SHAPES,
    STEP_EFFECTS,
)
_CHECKOUT = Path(__file__).parents[1] / "pyproject.toml"
_registered: dict[str, dict[str, Any]] = {}
# Functions to call with each name that a program registers in a group.
_listeners: dict[str, list[Callable[[str], None]]] = {}

_Base = TypeVar("_Base")


def register(group: str, name: str, extension: Any) -> None:
    """Make an object of this program available under a name, like an entry point of an installed
    package.

    Args:
        group: the group, such as ``"signorini_fx.linear_solvers"``.
        name: the name in scenes and settings; it replaces an earlier object of the same name.
        extension: the object.

    Raises:
        InstallationError: there is no such group.
    """
    if group not in GROUPS:
        known = ", ".join(GROUPS)
        raise InstallationError(f"{group!r} is no group of extensions; these are: {known}")
    _registered.setdefault(group, {})[name] = extension
    for listener in _listeners.get(group, ()):
        listener(name)


def on_registered(group: str, listener: Callable[[str], None]) -> None:
    """Call a function with each name that a program registers in a group from now on."""
    _listeners.setdefault(group, []).append(listener)


def names_of(group: str) -> tuple[str, ...]:
    """Return the names in a group, sorted."""
    return tuple(sorted({*_installed(tuple(sys.path))[group], *_registered.get(group, {})}))


def load(group: str, name: str) -> Any:
    """Return the object of a name in ``names_of``.

    Raises:
        InstallationError: it cannot be imported.
    """
    if name in _registered.get(group, {}):
        return _registered[group][name]
    entry = _installed(tuple(sys.path))[group][name]
    try:
        return entry.load()
    except Exception as error:
        package = "" if entry.dist is None else f" of {entry.dist.name}"
        raise InstallationError(
            f"{name!r}, {entry.value}{package}, cannot be imported: {error}"
        ) from error


def load_class(group: str, name: str, base: type[_Base]) -> type[_Base]:
    """Return the class of a name in ``names_of``.

    Raises:
        InstallationError: it is not a class derived from ``base``.
    """
    extension = load(group, name)
    if not (isinstance(extension, type) and issubclass(extension, base)):
        article = "an" if base.__name__[0] in "AEIOU" else "a"
        raise InstallationError(
            f"{name!r}, which another package adds, is not {article} {base.__name__}"
        )
    return extension


def is_of_package(kind: type) -> bool:
    """Return whether a class belongs to this package."""
    return kind.__module__.partition(".")[0] == __name__.partition(".")[0]


def add_on(name: str) -> Any:
    """Return the object of an add-on of this package by its name in pyproject.toml.

    Raises:
        InstallationError: the add-on, or a package that it needs, is not installed.
    """
    entry = _installed(tuple(sys.path))[ADD_ONS].get(name)
    if entry is None:
        raise InstallationError(f"{name!r} is an add-on of signorini_fx that is not installed")
    try:
        return entry.load()
    except ModuleNotFoundError as error:
        if str(error.name).startswith("signorini_fx."):
            raise InstallationError(
                f"{name!r} needs {error.name}, an add-on that is not installed"
            ) from None
        package = str(error.name).partition(".")[0]
        raise MissingPackageError(
            f"{name!r} needs {package}, which is not installed: pip install {package}"
        ) from None


@cache
def _installed(_path: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Return the entry points by group; those of this package also if it is not installed.

    The result is cached for each Python path, as the search takes milliseconds.
    """
    stated = tomllib.loads(_CHECKOUT.read_text(encoding="utf-8")) if _CHECKOUT.is_file() else {}
    own: dict[str, dict[str, str]] = stated.get("project", {}).get("entry-points", {})
    found = dict[str, dict[str, Any]]()
    installed = entry_points()
    for group in GROUPS:
        entries = [EntryPoint(name, value, group) for name, value in own.get(group, {}).items()]
        found[group] = {entry.name: entry for entry in (*entries, *installed.select(group=group))}
    return found
