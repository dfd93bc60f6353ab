"""Compilation of forms by dolfinx, made safe against concurrent and killed processes.

Processes that compile the same form wait for each other.  If the machine lacks something for it,
all ranks raise a clear error.

A process that is killed leaves a C file that FFCx takes for work in progress in every later run.
Therefore a form is locked while it is compiled, by a lock that ends with the process: an unfinished
file without a lock is compiled again.
"""

from __future__ import annotations

import fcntl
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from signorini_fx.errors import MachineError
from signorini_fx.machine import signals
from signorini_fx.tuned import PROGRESS_PAUSE

_LOCKS = ".signorini_fx.locks"
_NEEDED = (
    "it takes a C compiler, such as gcc, and a folder that can be written, which "
    "XDG_CACHE_HOME names"
)
# Forms that this process has loaded, by folder and name: FFCx would list the folder, which may hold
# thousands of files.
_LOADED: dict[tuple[str, str], Any] = {}
# Wall seconds spent on compilation by this process, and the start time of a running compilation.
_SPENT = [0.0]
_BEGUN: list[float] = []


def seconds_compiled() -> float:
    """Return the wall seconds that this process has spent on compilation so far."""
    return _SPENT[0]


@contextmanager
def compiling(failed: str = "a form cannot be compiled") -> Iterator[None]:
    """Lock the form that is compiled inside the ``with`` block.

    Raises:
        MachineError: the compilation failed; the message names what the machine needs.
    """
    from cffi import VerificationError

    from signorini_fx.machine.compat import shared_cells

    try:
        # An exception of a signal handler during a compilation would look like a mistake in the
        # form.
        with signals.deferred(), _locks(), shared_cells():
            try:
                yield
            finally:
                if _BEGUN:
                    _SPENT[0] += time.perf_counter() - _BEGUN[0]
                    _BEGUN.clear()
    except (
        OSError,
        RuntimeError,
        VerificationError,
    ) as error:  # dolfinx raises the second on all ranks but one
        raise MachineError(f"{failed}: {error}: {_NEEDED}") from error


@contextmanager
def _locks() -> Iterator[None]:
    """Make FFCx request a lock before it looks for a compiled form; locks are held to the end of
    the ``with`` block.
    """
    from ffcx.codegeneration import jit

    look: Callable[..., Any] = jit.get_cached_module
    with ExitStack() as held:

        def locked(module: str, objects: list[str], folder: Path, timeout: int) -> Any:
            key = (str(folder), module)
            if key in _LOADED:
                return _LOADED[key]
            prepare(Path(folder), module, float(timeout), held)
            loaded = look(module, objects, folder, timeout)
            if loaded[0] is not None:
                _LOADED[key] = loaded
            elif not _BEGUN:  # it has to be compiled
                _BEGUN.append(time.perf_counter())
            return loaded

        jit.get_cached_module = locked
        try:
            yield
        finally:
            jit.get_cached_module = look


def prepare(folder: Path, module: str, patience: float, held: ExitStack) -> None:
    """Wait until no other process compiles a form, and remove unfinished files of a process that
    has ended.

    Args:
        folder: the cache of compiled forms.
        module: name of the form.
        patience: time after which an unfinished file of a program without locks is removed, s.
        held: receives the lock; none is taken if the form is compiled already, or if the folder
            does not support locks.
    """
    if _compiled(folder, module):
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = held.enter_context((folder / _LOCKS).open("ab"))
        fcntl.lockf(file, fcntl.LOCK_UN)  # a file system may know no locks
    except OSError:
        return
    # One byte of the file stands for one form.
    byte = zlib.crc32(module.encode())
    while not _compiled(folder, module):  # its compiler may still hold the lock
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, byte)
        except OSError:  # another process holds the lock
            pass
        else:
            # A program without locks is assumed to have ended after ``patience``.
            if not 0.0 <= _age(_files(folder, module)[0]) < patience:
                for unfinished in _files(folder, module):
                    unfinished.unlink(missing_ok=True)
                return
        signals.serve()
        time.sleep(PROGRESS_PAUSE)


def library(
    folder: Path, name: str, declarations: str, source: str, arguments: Sequence[str]
) -> Any:
    """Return a module of C functions, with ``lib`` and ``ffi`` of cffi, compiled unless it is in
    the cache.

    Args:
        folder: the cache, beside the forms.
        name: of the module; it must differ for different sources.
        declarations: C declarations of the functions.
        source: C source of the functions.
        arguments: for the compiler.
    """
    from cffi import FFI

    with compiling("C functions cannot be compiled"), ExitStack() as held:
        prepare(folder, name, 0.0, held)
        if not _compiled(folder, name):
            builder = FFI()
            builder.cdef(declarations)
            builder.set_source(name, source, extra_compile_args=list(arguments))
            builder.compile(tmpdir=str(folder))
            _files(folder, name)[1].touch()
    file = next(
        path for suffix in EXTENSION_SUFFIXES if (path := folder / f"{name}{suffix}").exists()
    )
    found = spec_from_file_location(name, file)
    assert found is not None
    assert found.loader is not None
    module = module_from_spec(found)
    found.loader.exec_module(module)
    return module


def _files(folder: Path, module: str) -> tuple[Path, Path]:
    """Return the paths of the source, and of the file that FFCx writes after compilation."""
    return folder / f"{module}.c", folder / f"{module}.c.cached"


def _compiled(folder: Path, module: str) -> bool:
    libraries = (folder / f"{module}{suffix}" for suffix in EXTENSION_SUFFIXES)
    return all(map(Path.exists, _files(folder, module))) and any(map(Path.exists, libraries))


def _age(path: Path) -> float:
    """Return the seconds since a file was written; -1 if it does not exist."""
    try:
        return max(time.time() - path.stat().st_mtime, 0.0)
    except OSError:
        return -1.0
