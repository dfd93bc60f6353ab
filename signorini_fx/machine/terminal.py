"""Output to the terminal in any encoding, robust against closed streams, and the environment that
launchers of ranks (mpirun, srun) set.  MPI is not imported here.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from mpi4py import MPI

_RANK = ("PMIX_RANK", "OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID")
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")
_lost = False
# Width of a default terminal, for which short answers are written.
COLUMNS = 80
# Control characters of ASCII and of Latin-1, those that change the direction of writing, and whole
# escape sequences.
_CONTROL = re.compile(
    r"\x1b\[[0-?]*[ -/]*[@-~]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)"
    r"|[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]"
)


def printable(text: str) -> str:
    """Return a text without control characters, except line ends and tabs.

    Titles, names and messages from elsewhere may contain control characters, which would change the
    state of a terminal, and which no page or table can show.
    """
    return _CONTROL.sub("", text)


def prepare() -> None:
    """Let standard output and standard error accept any text: characters outside their encoding are
    written as escapes.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # absent where the stream is closed or replaced
            stream.reconfigure(errors="backslashreplace")


def is_terminal(stream: TextIO | None) -> bool:
    """Return whether this stream is a terminal; False for ranks of Open MPI, to which mpirun gives
    pseudo terminals.
    """
    pseudo_terminals = "OMPI_COMM_WORLD_SIZE" in os.environ  # wherever mpirun writes
    return stream is not None and stream.isatty() and not pseudo_terminals


@dataclass(frozen=True)
class TerminalLine:
    """A line of output: its beginning, in the colour of its kind on a terminal, and the text after
    it.
    """

    begin: str  # how it begins, on a terminal in the colour of its kind
    text: str = ""  # prose behind that
    kind: str = ""  # ``error``, ``warning``, ``advice``, ``good``, or "" without a colour

    def __str__(self) -> str:
        return f"{self.begin}{self.text}"

    def coloured(self) -> str:
        """Return the line with the escape sequences for its colour."""
        code = _COLOURS.get(self.kind)
        begin = (
            printable(self.begin) if code is None else f"\x1b[{code}m{printable(self.begin)}\x1b[0m"
        )
        return begin + printable(self.text)


_COLOURS = {
    "error": "31;1",
    "warning": "33;1",
    "advice": "1",
    "good": "32;1",
}  # red, yellow, bold, green


def say(output: str | Iterable[TerminalLine], *, error: bool = False) -> None:
    """Print on standard output or standard error; after a write error the stream is redirected to
    the null device.

    Args:
        output: a text, printed as it is, or lines, which a terminal shows in colour.
        error: whether to print on standard error.
    """
    stream = sys.stderr if error else sys.stdout
    try:
        if isinstance(output, str):
            shown = [printable(output)]
        elif (
            is_terminal(stream)
            and "NO_COLOR" not in os.environ
            and os.environ.get("TERM") != "dumb"
        ):
            shown = [line.coloured() for line in output]
        else:
            shown = [printable(str(line)) for line in output]
        print("\n".join(shown), file=stream, flush=True)
    except OSError as reason:
        _give_up(stream, reason)


def say_once(comm: MPI.Comm, output: str | Iterable[TerminalLine], *, error: bool = False) -> None:
    """Print on rank 0 only."""
    if comm.rank == 0:
        say(output, error=error)


def output_lost() -> bool:
    """Return whether something could not be printed although its reader still exists."""
    return _lost


def _give_up(stream: TextIO, reason: OSError) -> None:
    """Redirect a stream to the null device after an error, so that results are not lost.

    Nothing is reported if the reader has ended (``| head``).
    """
    global _lost
    with contextlib.suppress(OSError, ValueError):  # a stream without a descriptor
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(
            nowhere, stream.fileno()
        )  # what is still in the buffer would be written again at the end
        os.close(nowhere)
    if stream is sys.stdout and not isinstance(reason, BrokenPipeError):
        _lost = True
        print(f"signorini-fx: the output cannot be written: {reason.strerror}", file=sys.stderr)


def started_as_root() -> bool:
    """Return whether this process is the first rank, or the only one, according to its
    environment.
    """
    return next((os.environ[name] for name in _RANK if name in os.environ), "0") == "0"


def limit_threads() -> None:
    """Set one thread for each rank, unless the environment sets another number.

    More threads do not help, as the fronts of the factorisations are small.  Call it before BLAS is
    loaded.
    """
    if not any(name in os.environ for name in _THREADS):
        os.environ["OMP_NUM_THREADS"] = "1"
