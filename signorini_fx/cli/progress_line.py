"""One line of a terminal that says where a solve is; nothing where there is no terminal."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from signorini_fx.records import Progress

# Seconds between two changes of the line.
_PAUSE = 0.2
_ERASE = "\r\x1b[K"


class ProgressLine:
    """The line, at the bottom of what is printed; its owner erases it before anything else is."""

    def __init__(self) -> None:
        self._shown = False
        self._next = 0.0

    def __call__(self, progress: Progress) -> None:
        """Show where the solve is, if the last time is some time ago."""
        now = time.perf_counter()
        if now >= self._next:
            self._next = now + _PAUSE
            self._shown = True
            print(f"{_ERASE}{told(progress, now)}", end="", file=sys.stderr, flush=True)

    def erase(self) -> None:
        """Remove the line."""
        if self._shown:
            print(_ERASE, end="", file=sys.stderr, flush=True)
            self._shown = False
            self._next = 0.0


def told(progress: Progress, now: float) -> str:
    """Where a solve is, in words.

    Args:
        progress: where it is.
        now: seconds on the clock of ``progress.end``.
    """
    p = progress
    parts = []
    if p.meshes != 1:
        parts.append(f"mesh {p.mesh}" + (f" of {p.meshes}" if p.meshes else ""))
    if p.dofs:
        parts.append(f"{p.dofs:,} unknowns")
    if p.steps > 1:
        parts.append(f"load step {p.step} of {p.steps}")
    parts.append(f"linear solve {p.solve}")
    if p.krylov:
        parts.append(f"{p.krylov} Krylov steps")
    if p.end is not None and p.end > now:
        parts.append(f"about {_duration(p.end - now)} left")
    return ", ".join(parts)


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
