"""Deferral of signals to moments when Python code can end in good order.

Python handles a signal between any two instructions, also in a function that C code has called.
What the handler raises there, such as ``KeyboardInterrupt``, arrives in C as an error code or is
lost.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# Signals that a terminal, mpirun, a batch system or a timer sends.
_DEFERRED = (
    signal.SIGINT,
    signal.SIGTERM,
    signal.SIGHUP,
    signal.SIGALRM,
    signal.SIGUSR1,
    signal.SIGUSR2,
)
_handlers: dict[int, Any] = {}
# Deferred signals: number, and the frame that Python was executing.
arrived: list[tuple[int, FrameType | None]] = []
_deferring = False


@contextmanager
def deferred() -> Iterator[None]:
    """Defer signals that have a Python handler until ``serve`` is called, or to the end of the
    ``with`` block.
    """
    global _deferring
    if (
        _deferring or threading.current_thread() is not threading.main_thread()
    ):  # other threads get no signals
        yield
        return
    try:
        _deferring = True
        for number in _DEFERRED:
            handler = signal.getsignal(number)
            if callable(handler) and handler is not _note:
                _handlers[number] = handler
                signal.signal(number, _note)
        yield
    finally:
        _deferring = False
        for taken, handler in _handlers.items():
            signal.signal(taken, handler)
        serve()


def serve() -> None:
    """Call the handlers of the deferred signals; each may raise an exception, such as
    ``KeyboardInterrupt``.
    """
    while arrived:
        number, frame = arrived.pop(0)
        _handlers[number](number, frame)


def _note(number: int, frame: FrameType | None) -> None:
    """Record a signal; call its former handler if it arrives while the handlers are restored."""
    if _deferring:
        arrived.append((number, frame))
    else:
        _handlers[number](number, frame)
