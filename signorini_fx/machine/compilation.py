"""Compilation of forms by dolfinx: a clear error on all ranks if the machine lacks something for it."""

from __future__ import annotations

import os
import shlex
import shutil
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from signorini_fx.errors import MachineError
from signorini_fx.machine import signals


@contextmanager
def compiling() -> Iterator[None]:
    """Report what the machine lacks if a form inside the ``with`` block cannot be compiled.

    Raises:
        MachineError: there is no compiler, or the folder of compiled forms cannot be written.
    """
    from cffi import VerificationError

    try:
        with signals.deferred():  # a compilation that is cut off leaves a lock that later runs wait for
            yield
    except (OSError, RuntimeError, VerificationError) as error:  # dolfinx raises the second on all ranks but one
        raise MachineError(f"a form cannot be compiled: {_no_folder() or _no_compiler() or error}") from error


def _no_compiler() -> str | None:
    command = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
    compiler = (shlex.split(command) or ["cc"])[0]
    if shutil.which(compiler) is not None:
        return None
    return f"there is no C compiler, {compiler!r} is not on PATH: install one (apt install gcc)"


def _no_folder() -> str | None:
    from dolfinx import jit

    try:
        folder = Path(jit.get_options()["cache_dir"])
        folder.mkdir(parents=True, exist_ok=True)
        trial = folder / f".signorini_fx.{os.getpid()}"
        trial.write_bytes(bytes(1 << 20))  # an empty file can be written to a full disk
        trial.unlink()
    except (OSError, RuntimeError) as error:  # no home at all
        return (
            f"the folder of compiled forms cannot be written ({error}): "
            "set XDG_CACHE_HOME to a folder that can be written, or free space there"
        )
    return None
