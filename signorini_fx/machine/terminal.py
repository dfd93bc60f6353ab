"""Text for the terminal: printed once, in any encoding, and without an error if nobody reads it.  No MPI here."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import sys
import textwrap
from typing import TextIO

from signorini_fx.machine import launcher

_lost = False


def prepare() -> None:
    """Let both streams accept any text: characters that their encoding does not have are written as escapes."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # absent where the stream is closed or replaced
            stream.reconfigure(errors="backslashreplace")


def is_terminal(stream: TextIO | None) -> bool:
    """Whether somebody reads this stream on a terminal; of a rank of mpirun that is not known, and it counts as no."""
    return stream is not None and stream.isatty() and not launcher.gives_pseudo_terminals()


def say(text: str, *, error: bool = False) -> None:
    """Print ``text`` on standard output, or on standard error; a stream that cannot be written is given up."""
    stream = sys.stderr if error else sys.stdout
    try:
        if is_terminal(stream):
            plain = "NO_COLOR" in os.environ or os.environ.get("TERM") == "dumb"
            text = wrapped(text, shutil.get_terminal_size().columns)
            text = text if plain else coloured(text)
        print(text, file=stream, flush=True)
    except OSError as reason:
        _give_up(stream, reason)


_NARROWEST = 40  # columns
_NAME = re.compile(r"  \S.{15} (?=\S)")  # of a line of the summary
_COLOURS = [
    (re.compile(r"^(signorini-fx: [^:\n]+)", re.MULTILINE), "31;1"),  # red
    (re.compile(r"(DOES NOT HOLD)"), "31;1"),
    (re.compile(r"^( +warning\b)", re.MULTILINE), "33;1"),  # yellow
    (re.compile(r"^( +what to do)", re.MULTILINE), "1"),  # bold
    (re.compile(r"(?<=: )(converged)$", re.MULTILINE), "32;1"),  # green
]


def wrapped(text: str, width: int) -> str:
    """Prose broken into lines of this width, with its own indentation; rows of tables stay as they are.

    Args:
        text: lines of any length.
        width: columns of the terminal.
    """
    lines = []
    for line in text.split("\n"):
        name = _NAME.match(line)
        start = name.end() if name else len(line) - len(line.lstrip()) + 4
        table = re.search(r"\S {2,}\S", line[start:])
        if len(line) <= width or table or start > width // 2 or width < _NARROWEST:
            lines.append(line)
            continue
        rest = textwrap.wrap(line[start:], width - start, break_long_words=False, break_on_hyphens=False)
        lines += [" " * start * (number > 0) + line[:start] * (number == 0) + part for number, part in enumerate(rest)]
    return "\n".join(lines)


def coloured(text: str) -> str:
    """Text with errors in red, warnings in yellow and success in green, as a terminal shows them."""
    for pattern, code in _COLOURS:
        text = pattern.sub(f"\x1b[{code}m" + r"\1" + "\x1b[0m", text)
    return text


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
