"""PETSc started with the options of the command line; files of options are looked at first, before it breaks down."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from mpi4py import MPI

from signorini_fx.errors import OptionsError
from signorini_fx.machine import parallel

_FILE_OPTIONS = ("-options_file", "-options_file_yaml")
# What PETSc reads where nothing is asked for.
_USUAL_FILES = ("~/.petscrc", ".petscrc", "petscrc")


def start_petsc(comm: MPI.Comm, options: Sequence[str]) -> None:
    """Start PETSc, once; ``options``: as on a command line, without the name of the program; collective.

    Raises:
        OptionsError: a file of options is none, or PETSc does not start with the options.
    """
    parallel.on_root(comm, lambda: _check_files(options))
    import petsc4py

    try:
        petsc4py.init(["signorini-fx", "-no_signal_handler", *options])
    except Exception as error:  # petsc4py.PETSc.Error; the module cannot be imported before it has started
        raise OptionsError(f"PETSc does not start with the options {' '.join(options)!r}: {error}") from None


def _check_files(options: Sequence[str]) -> None:
    try:
        words = [*shlex.split(os.environ.get("PETSC_OPTIONS", "")), *options]
    except ValueError as error:
        raise OptionsError(f"PETSC_OPTIONS in the environment: {error}") from None
    for name, file in _named(words):
        if not file:
            raise OptionsError(f"PETSc option {name}: the name of a file is missing after it")
        _check_file(Path(file), f"PETSc option {name} {file}", yaml=name.endswith("yaml"))
    if "-skip_petscrc" not in words:
        for usual in _USUAL_FILES:
            file = os.path.expanduser(usual)
            if os.path.isfile(file):
                _check_file(Path(file), f"PETSc reads {file}", yaml=False)


def _named(words: Sequence[str]) -> Iterator[tuple[str, str]]:
    for word, following in pairwise([*words, ""]):
        if word in _FILE_OPTIONS:
            yield word, "" if following.startswith("-") else following.removesuffix(":yaml")


def _check_file(file: Path, source: str, *, yaml: bool) -> None:
    """Every line of a file of options is a comment, or begins with an option."""
    try:
        text = file.read_text(encoding="utf-8", errors="replace") if file.is_file() else None
    except (OSError, ValueError) as error:
        raise OptionsError(f"{source}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if text is None:
        raise OptionsError(f"{source}: there is no such file")
    if yaml or file.suffix in (".yaml", ".yml"):
        return
    for number, line in enumerate(text.splitlines(), start=1):
        first = line.split(maxsplit=1)[0] if line.strip() else "#"
        if not first.startswith(("-", "#", "%", "!")) and first != "alias":
            raise OptionsError(f"{source}: line {number} is no option, {first[:40]!r}: an option begins with -")
