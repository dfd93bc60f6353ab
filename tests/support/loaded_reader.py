"""The program that reads foreign files, loaded once and forked for each file.

A new program takes 0.3 s to load gmsh or meshio, and the tests read some hundreds of files.  A fork does the same with
each file as the program: it runs ``reading_process.main``, within its limits and in its sandbox.  The tests of the
sandbox run the program itself, see ``test_foreign_files.py``.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import socket
import subprocess
import sys
import tempfile

from signorini_fx.mechanics.mesh.files import reading, reading_process

_LONGEST = 1 << 17  # bytes of a request


class LoadedReader:
    """Takes the place of ``reading._run``; the process begins with the first file."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._line: socket.socket | None = None

    def __call__(self, request, source, output, folder, seconds):
        if self._process is None:
            self._begin()
        self._line.settimeout(seconds)
        try:
            socket.send_fds(self._line, [json.dumps([request, folder]).encode()], [source.fileno(), output.fileno()])
            return int(self._line.recv(100))
        except TimeoutError:
            self.end()
            raise subprocess.TimeoutExpired(request, seconds) from None
        except BaseException:  # interrupted: the next answer would be that to this request
            self.end()
            raise

    def _begin(self) -> None:
        self._line, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with other, tempfile.TemporaryDirectory() as home:
            self._process = subprocess.Popen(
                [sys.executable, __file__, str(other.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=reading._environment(home),
                pass_fds=[other.fileno()],
                start_new_session=True,
            )
        self._line.recv(100)  # it is loaded: the time for a file begins now

    def end(self) -> None:
        """End the process, if it has begun."""
        if self._process is not None:
            self._line.close()
            self._process.kill()
            self._process.wait()
            self._process = None


def serve(line: socket.socket) -> None:
    """Fork for each request, one after the other, and answer how the fork ended."""
    with contextlib.suppress(ImportError, OSError):
        importlib.import_module("gmsh")
    with contextlib.suppress(ImportError, OSError):
        importlib.import_module("meshio")
        importlib.import_module("h5py")
    for name in ("gmsh_reader", "meshio_reader", "sandbox"):
        importlib.import_module(f"signorini_fx.mechanics.mesh.files.{name}")
    gc.freeze()  # a collection would copy the pages that forks share
    line.send(b"loaded")
    while True:
        message, files, *_ = socket.recv_fds(line, _LONGEST, 2)
        if not message:
            return
        request, folder = json.loads(message)
        process = os.fork()
        if process == 0:
            code = 1
            with contextlib.suppress(BaseException):
                line.close()
                os.dup2(files[0], 0)
                os.dup2(files[1], 1)
                os.chdir(folder)
                os.environ.update(reading._environment(folder))
                code = reading_process.main([request])
            os._exit(code)
        for number in files:
            os.close(number)
        line.send(str(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])).encode())


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))
