"""Text for the terminal: printed once, in any encoding, and without an error if nobody reads it.  No MPI here."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TextIO

_lost = False


def prepare() -> None:
    """Let both streams accept any text: characters that their encoding does not have are written as escapes."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # absent where the stream is closed or replaced
            stream.reconfigure(errors="backslashreplace")


def say(text: str, *, error: bool = False) -> None:
    """Print ``text`` on standard output, or on standard error; a stream that cannot be written is given up."""
    stream = sys.stderr if error else sys.stdout
    try:
        print(text, file=stream, flush=True)
    except OSError as reason:
        _give_up(stream, reason)


def output_lost() -> bool:
    """Whether something could not be printed although the reader is still there."""
    return _lost


def _give_up(stream: TextIO, reason: OSError) -> None:
    """Go on silently if the reader has ended (``| head``) or nothing can be written, in order not to lose results.

    What is still in the buffer would be written again at the end, so the descriptor is redirected to nowhere.
    """
    global _lost
    with contextlib.suppress(OSError, ValueError):  # a stream without a descriptor
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
    if stream is sys.stdout and not isinstance(reason, BrokenPipeError):
        _lost = True
        print(f"signorini-fx: the output cannot be written: {reason.strerror}", file=sys.stderr)
