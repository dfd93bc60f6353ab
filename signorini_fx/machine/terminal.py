"""Text for the terminal: printed once, in any encoding, and lost without harm where nobody reads it.  No MPI here."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TextIO

_lost = False


def prepare() -> None:
    """Let both streams take any text: what their encoding does not have is written as an escape."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # absent where the stream is closed or replaced
            stream.reconfigure(errors="backslashreplace")


def say(text: str, *, error: bool = False) -> None:
    """Print ``text`` on standard output, or on standard error; a stream that takes no more is given up."""
    stream = sys.stderr if error else sys.stdout
    try:
        print(text, file=stream, flush=True)
    except OSError as reason:
        _give_up(stream, reason)


def output_lost() -> bool:
    """Whether something could not be printed although somebody reads on."""
    return _lost


def _give_up(stream: TextIO, reason: OSError) -> None:
    """Go on in silence where nobody reads on (``| head``) or nothing can be written: results are worth more than text.

    What the stream still holds would be written at the end once more, so its descriptor leads nowhere from now on.
    """
    global _lost
    with contextlib.suppress(OSError, ValueError):  # a stream without a descriptor
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
    if stream is sys.stdout and not isinstance(reason, BrokenPipeError):
        _lost = True
        print(f"signorini-fx: the output cannot be written: {reason.strerror}", file=sys.stderr)
