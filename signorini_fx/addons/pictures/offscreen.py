"""Pictures of surfaces in 3D, drawn in a process of its own that needs neither a screen nor MPI.

VTK ends its process where it finds no display, and may quarrel with the libraries of a solve.  The process is started
with the first picture and draws those that follow; it ends with the one that started it.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import os
import pickle
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.pictures.solid import Solid, image
from signorini_fx.addons.pictures.view import Camera
from signorini_fx.errors import PYVISTA, PictureError
from signorini_fx.tuned import DISPLAY_PATIENCE, PICTURE_PATIENCE

# What a launcher of MPI tells its processes: another one that read it would take itself for a rank.
_OF_MPI = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "HYDRA_", "MPI_")


class _Painter:
    """The process that draws."""

    def __init__(self) -> None:
        environment = {name: value for name, value in os.environ.items() if not name.startswith(_OF_MPI)}
        root = str(Path(__file__).resolve().parents[3])
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, (root, environment.get("PYTHONPATH"))))
        self._output = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", "signorini_fx.addons.pictures.offscreen"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._output,
            env=environment,
            start_new_session=True,  # an interrupt from the keyboard is for the solve
        )

    def ask(self, *request: Any) -> Any:
        """The answer of the process.

        Raises:
            PictureError: it ended instead.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        alarm = threading.Timer(PICTURE_PATIENCE, self._process.kill)
        alarm.start()
        try:
            pickle.dump(request, self._process.stdin)
            self._process.stdin.flush()
            answer = pickle.load(self._process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise PictureError(f"what draws bodies in 3D ended ({self.close()}): it needs {PYVISTA}") from None
        finally:
            alarm.cancel()
        return answer

    def close(self) -> str:
        """End the process, and return its last words."""
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()
        self._process.wait()
        with self._output as output:
            output.seek(0)
            return (output.read().decode(errors="replace").strip().splitlines() or ["no word"])[-1]


_painter: _Painter | None = None


def drawn(solid: Solid, camera: Camera, width: int) -> npt.NDArray[np.uint8]:
    """A picture on a white ground, shape (h, w, 3).

    Args:
        solid: what is drawn.
        camera: how it is seen.
        width: pixels across.

    Raises:
        PictureError: PyVista is missing, or finds nothing to draw on.
    """
    global _painter
    if find_spec("pyvista") is None:
        raise PictureError(f"a body in 3D is drawn by {PYVISTA}")
    if _painter is None:
        _painter = _Painter()
    try:
        return np.asarray(_painter.ask(solid, camera, width))
    except PictureError:
        _painter = None
        raise


@atexit.register
def _end() -> None:
    if _painter is not None:
        _painter.close()


# --- the process itself ----------------------------------------------------------------------------------------------


def _serve() -> None:
    """Draw what comes in until there is no more."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no answer
    display = _display()
    try:
        while True:
            try:
                solid, camera, width = pickle.load(sys.stdin.buffer)
            except EOFError:
                break
            pickle.dump(image(solid, camera, width), answers)
            answers.flush()
    finally:
        if display is not None:
            display.terminate()
            display.wait()


def _display() -> subprocess.Popen[bytes] | None:
    """A display without a screen if this machine has one; VTK from 9.4 on does without, older ones do not."""
    server = shutil.which("Xvfb")
    if server is None:
        return None
    number, write_end = os.pipe()
    size = ["-screen", "0", "64x64x24", "-nolisten", "tcp"]
    display = subprocess.Popen(
        [server, "-displayfd", str(write_end), *size],
        pass_fds=[write_end],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=lambda: ctypes.CDLL(None).prctl(1, signal.SIGTERM),  # it ends with this process
    )
    os.close(write_end)
    name = b""
    while not name.endswith(b"\n") and select.select([number], [], [], DISPLAY_PATIENCE)[0]:
        name += (part := os.read(number, 20))
        if not part:
            break
    os.close(number)
    if not name.endswith(b"\n"):
        display.kill()
        display.wait()
        return None
    os.environ["DISPLAY"] = f":{name.decode().strip()}"
    return display


if __name__ == "__main__":
    _serve()
