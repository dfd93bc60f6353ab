"""gmsh within this process: with the same options everywhere, and beside a session that the caller has open."""

from __future__ import annotations

import contextlib
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from signorini_fx.errors import InstallationError

# gmsh writes the options that differ from their defaults one to a line.
_OPTION = re.compile(r"^([A-Z]\w*\.[\w.]+) = ([\"{]?)", re.MULTILINE)


def loaded_gmsh() -> Any:
    """The module gmsh.

    Raises:
        InstallationError: it is not installed, or its wheel lacks a library of the system.
    """
    try:
        import gmsh
    except ImportError:
        raise InstallationError(
            "this mesh is made by gmsh, which is not installed: pip install gmsh, or apt install python3-gmsh"
        ) from None
    except OSError as error:
        raise InstallationError(
            f"this mesh is made by gmsh, which cannot be loaded: {error}; its wheel needs libraries of the system, on "
            "Debian and Ubuntu: apt install libgl1 libglu1-mesa libxcursor1 libxft2 libxinerama1"
        ) from None
    return gmsh


@contextlib.contextmanager
def gmsh_session() -> Iterator[Any]:
    """The module gmsh with an empty model and the same options for everybody: silent, and no file of options is read.

    A session that is open already is afterwards as it was: its models, the current one of them, and its options.
    (Of several models with the same name, gmsh can make only the last one the current one.)

    Raises:
        InstallationError: see ``loaded_gmsh``.
    """
    gmsh = loaded_gmsh()
    if gmsh.isInitialized():
        with _of_the_caller(gmsh):
            yield gmsh
        return
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        _silence(gmsh)
        yield gmsh
    finally:
        if gmsh.isInitialized():  # what is drawn is written by others
            gmsh.finalize()


def _silence(gmsh: Any) -> None:
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.RandomSeed", 1)


@contextlib.contextmanager
def _of_the_caller(gmsh: Any) -> Iterator[None]:
    current, count = gmsh.model.getCurrent(), len(gmsh.model.list())
    changed = _changed_options(gmsh)
    # gmsh.py keeps alive only the size function that was set last, whichever model has it.
    callback = getattr(gmsh, "api_callback_", None)
    gmsh.option.restoreDefaults()
    gmsh.option.setNumber("General.AbortOnError", 2)  # otherwise no error of gmsh becomes an exception
    _silence(gmsh)
    gmsh.model.add("signorini_fx")
    try:
        yield
    finally:
        for name in gmsh.model.list()[count:]:
            gmsh.model.setCurrent(name)
            gmsh.model.remove()
        gmsh.model.setCurrent(current)
        gmsh.api_callback_ = callback
        gmsh.option.restoreDefaults()
        for set_option, name, values in changed:
            set_option(name, *values)


def _changed_options(gmsh: Any) -> list[tuple[Any, str, tuple[Any, ...]]]:
    """The options that differ from their defaults: how to set each, its name and its value."""
    option = gmsh.option
    # The two that writing the others involves.
    changed = [(option.setNumber, name, (option.getNumber(name),)) for name in ("General.Terminal", "Print.Format")]
    option.setNumber("General.Terminal", 0)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "session.opt"
        gmsh.write(str(file))
        text = file.read_text(encoding="utf-8", errors="replace")
    for name, kind in dict(_OPTION.findall(text)).items():
        with contextlib.suppress(Exception):  # some cannot be read or set, such as gmsh's version
            if kind == "{":
                changed.append((option.setColor, name, tuple(option.getColor(name))))
            elif kind:
                changed.append((option.setString, name, (option.getString(name),)))
            elif name not in ("General.Terminal", "Print.Format"):
                changed.append((option.setNumber, name, (option.getNumber(name),)))
    return changed
