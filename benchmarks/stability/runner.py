"""Runs groups of cases in separate processes, so that a hang or a crash gives a red row and the others continue."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from typing import Any

from benchmarks.stability.case import CRASHED, RED, TOO_LONG, Row
from benchmarks.stability.worker import MARK

# Imports and compilation of forms before the first case.
_START_SECONDS = 120.0


class Runner(contextlib.AbstractContextManager["Runner"]):
    """Runs groups one after the other, those of one number of ranks in one worker as long as that lives.

    Args:
        short: only the few cheap cases that the tests run.
        show: is told the current case.
    """

    def __init__(self, *, short: bool, show: Callable[[str], None] = lambda text: None) -> None:
        self._short, self._show = short, show
        self._worker: _Worker | None = None

    def group(self, group: str, ranks: int) -> Iterator[Row]:
        """The rows of one group for one number of ranks; a worker that hangs is killed and replaced."""
        done = 0
        while True:
            if self._worker is None or self._worker.ranks != ranks:
                self._end()
                self._worker = _Worker(ranks, self._short)
            worker = self._worker
            worker.begin(group, done)
            message = worker.next(_START_SECONDS)
            if message is None or isinstance(message, str):
                yield _lost(group, "(start)", ranks, message or TOO_LONG, _START_SECONDS, worker.complaint())
                self._end()
                return
            names = message["cases"]
            for name, seconds in names[done:]:
                self._show(f"{group}: {name}")
                message = worker.next(seconds)
                while isinstance(message, dict) and "row" not in message:
                    message = worker.next(seconds)
                done += 1
                if isinstance(message, dict):
                    yield Row.from_json(message["row"])
                else:
                    yield _lost(group, name, ranks, message or TOO_LONG, seconds, worker.complaint())
                    self._end()
                    break
            if done >= len(names):
                return

    def _end(self) -> None:
        if self._worker is not None:
            self._worker.end()
            self._worker = None

    def __exit__(self, *_: object) -> None:
        self._end()


class _Worker:
    """A worker process and its messages."""

    def __init__(self, ranks: int, short: bool) -> None:
        self.ranks = ranks
        launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        command = [*launcher, sys.executable, "-m", "benchmarks.stability.worker", str(ranks)]
        self._errors = tempfile.TemporaryFile(mode="w+", encoding="utf-8", errors="replace")  # noqa: SIM115
        self._process = subprocess.Popen(
            [*command, *(["--short"] if short else [])],
            stdout=subprocess.PIPE,
            stderr=self._errors,
            stdin=subprocess.PIPE,
            text=True,
            errors="replace",
            start_new_session=True,
        )
        self._lines: queue.Queue[str | None] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def begin(self, group: str, skip: int) -> None:
        """Ask for the cases of a group except the first ones; a worker that has ended will say nothing."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            self._process.stdin.write(f"{group} {skip}\n")
            self._process.stdin.flush()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def next(self, seconds: float) -> dict[str, Any] | str | None:
        """The next message; None after ``seconds``; how the process ended if it did."""
        try:
            while (line := self._lines.get(timeout=seconds)) is not None:
                if line.startswith(MARK):
                    message: dict[str, Any] = json.loads(line[len(MARK) :])
                    return message
        except queue.Empty:
            return None
        self._process.wait()
        return CRASHED

    def complaint(self) -> str:
        """The last line of its standard error."""
        self._errors.seek(0)
        lines = [line.strip() for line in self._errors.read().splitlines() if line.strip()]
        code = self._process.poll()
        return "; ".join([*([f"exit code {code}"] if code else []), *lines[-1:]])

    def end(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        # mpirun ends its ranks when it is terminated; otherwise it is killed.
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._reader.join(10)
        if self._process.stdout is not None and not self._reader.is_alive():
            self._process.stdout.close()
        self._errors.close()


def _lost(group: str, name: str, ranks: int, outcome: str, seconds: float, complaint: str) -> Row:
    return Row(group, name, outcome, 0, None, None, None, "", ranks, seconds, RED, complaint)
