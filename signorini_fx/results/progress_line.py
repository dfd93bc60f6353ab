"""One line that shows the progress of a solve on a terminal or in a notebook; nothing elsewhere."""

from __future__ import annotations

import sys
import time
from contextlib import AbstractContextManager
from typing import Any

from mpi4py import MPI

from signorini_fx.machine import parallel, terminal
from signorini_fx.records import IterationRecord, Record, StepRecord
from signorini_fx.tuned import PROGRESS_PAUSE

_ERASE = "\r\x1b[K"


class ProgressLine(AbstractContextManager["ProgressLine"]):
    """A line that shows the progress of a solve: the mesh or the load step, and the last linear
    solve.

    It is an observer::

        with ProgressLine() as line:
            solution = solve(scene, observers=[line])

    Rank 0 of all ranks shows it: below the cell of a notebook, or at the bottom of a terminal
    (standard error). It is erased at the end, and before anything else is printed ``erase`` must be
    called. Without either nothing is written.

    Examples:
        >>> with sfx.ProgressLine() as line:
        ...     result = sfx.solve(scene, observers=[line])
        >>> print(np.round(result.contact.forces[0], 6))
        [0. 4.]
    """

    def __init__(self) -> None:
        self._shown = False
        self._next = 0.0
        self._begin = ""  # mesh or load step
        interactive: Any = sys.modules.get("IPython")
        in_notebook = interactive is not None and hasattr(interactive.get_ipython(), "kernel")
        self._display = (
            interactive.display.display if in_notebook else None
        )  # shows below the cell that runs
        self._output: Any = None
        seen = self._display is not None or terminal.is_terminal(sys.stderr)
        self._silent = not (parallel.is_root(MPI.COMM_WORLD) and seen)

    def __exit__(self, *raised: object) -> None:
        self.erase()

    def __call__(self, record: Record) -> None:
        """Show the progress, unless the last update was a moment ago."""
        if isinstance(record, StepRecord) or (
            isinstance(record, str) and record.startswith("level ")
        ):
            self._begin = f"{record}, "
        seconds = time.perf_counter()
        if isinstance(record, IterationRecord) and not self._silent and seconds >= self._next:
            self._next = seconds + PROGRESS_PAUSE
            self._shown = True
            self._show(f"{self._begin}linear solve {record.solve}, residual {record.residual:.1e}")

    def erase(self) -> None:
        """Remove the line."""
        if self._shown:
            self._show("")
            self._shown = False
            self._next = 0.0

    def _show(self, text: str) -> None:
        if self._display is None:
            print(f"{_ERASE}{text}", end="", file=sys.stderr, flush=True)
        elif self._output is None:
            self._output = self._display({"text/plain": text}, raw=True, display_id=True)
        else:
            self._output.update({"text/plain": text}, raw=True)
