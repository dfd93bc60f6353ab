"""Foreign files are read in a process of their own.

A file may come from anywhere.  Some broken files end the whole process that reads them, or make it allocate whatever
memory they request; others refer to other files, or would run commands.  So the process has limits, gives up what it
does not need (see ``sandbox``), and hands over plain arrays.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import IO, Any

from signorini_fx.errors import MeshError
from signorini_fx.machine import launcher
from signorini_fx.mechanics.mesh.files import reading_process
from signorini_fx.mechanics.mesh.files.raw import RawMesh
from signorini_fx.mechanics.mesh.files.size_field import SizeField

# CPU seconds for reading a file: a constant, and a part per megabyte.
_READ_SECONDS, _SECONDS_PER_MEGABYTE = 60, 5
# Address space: the libraries, and the memory of a mesh for each byte of its file.
_BASE_BYTES, _BYTES_PER_BYTE = 3 << 30, 200
# Whether the process may do nothing else; tests switch it off to see that a file is refused before.
SANDBOX = True


def read_separately(
    file: Path,
    reader: str,
    settings: dict[str, Any],
    *,
    place: Path | None = None,
    seconds: int | None = None,
    memory: int | None = None,
    hint: str = "",
    sizes: SizeField | None = None,
) -> RawMesh:
    """Let the other process read a file.

    Args:
        file: an existing file.
        reader: ``gmsh`` or ``meshio``.
        settings: of its function ``read``.
        place: the path by which the process gets the file; None: its own.
        seconds: limit on its computing time; None: by the size of the file.
        memory: limit on its address space, bytes; None: by the size of the file.
        hint: what else the user can do if it takes too long.
        sizes: lengths of the cells that gmsh makes; None: its own.

    Raises:
        MeshError: it cannot be read; the message says why.
    """
    try:
        size = file.stat().st_size
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror or error}") from None
    seconds = seconds or _READ_SECONDS + _SECONDS_PER_MEGABYTE * (size >> 20)
    memory = memory or _BASE_BYTES + _BYTES_PER_BYTE * size
    request = {"file": str(place or file.absolute()), "reader": reader, "settings": settings, "sandbox": SANDBOX}
    request |= {"seconds": seconds, "bytes": memory, "sized": sizes is not None}
    with (
        tempfile.TemporaryFile() as source,
        tempfile.TemporaryFile() as output,
        tempfile.TemporaryDirectory() as empty,
    ):
        if sizes is not None:
            sizes.save(source)
            source.seek(0)
        try:
            code = _run(json.dumps(request), source, output, empty, 4.0 * seconds)
        except subprocess.TimeoutExpired:
            code = -signal.SIGXCPU
        output.seek(0)
        if code == reading_process.REFUSED:
            message = output.read(4000).decode(errors="replace")[:1000]
            raise MeshError(f"{file}: {message.replace(str(place or file.absolute()), file.name)}")
        if code == 0:
            try:
                return RawMesh.load(output)
            except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
                raise MeshError(f"{file}: {reader} cannot read it: it ends before there is a mesh") from None
    if -code in (signal.SIGXCPU, signal.SIGKILL):
        raise MeshError(f"{file}: {reader} cannot read it: it took more than {seconds} s{hint}")
    reason = f"it crashes on this file or needs more than {memory / 1e9:.1f} GB (exit code {code})"
    raise MeshError(f"{file}: {reader} cannot read it: {reason}")


def _run(request: str, source: IO[bytes], output: IO[bytes], folder: str, seconds: float) -> int:
    """Let the program read the file in an empty folder; the tests fork it from one that is loaded already.

    Returns:
        Its exit code; minus the number of the signal that ended it.

    Raises:
        TimeoutExpired: it took longer than this many seconds.
    """
    return subprocess.run(
        [sys.executable, "-P", reading_process.__file__, request],
        stdin=source,
        stdout=output,
        stderr=subprocess.DEVNULL,
        cwd=folder,
        env=_environment(folder),
        timeout=seconds,
        check=False,
    ).returncode


def _environment(home: str) -> dict[str, str]:
    """The environment of the process: no rank of MPI, no threads of libraries, no settings in the user's folders."""
    single_threaded = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    inherited = {
        name: value for name, value in launcher.environment_of_no_rank().items() if not name.startswith("HDF5_")
    }
    return {**inherited, **single_threaded, "HOME": home, "GMSH_HOME": home, "HDF5_PLUGIN_PRELOAD": "::"}
