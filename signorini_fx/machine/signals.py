"""Signals at moments when Python code can end in good order.

Python serves a signal between any two instructions, also in a function that C code has called: what the handler raises
there, such as ``KeyboardInterrupt``, arrives in C as an error code, or is lost.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpi4py import MPI

# Those that a terminal, mpirun, a batch system or a timer sends.
_DEFERRED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM, signal.SIGUSR1, signal.SIGUSR2)
_handlers: dict[int, Any] = {}
# Those that wait to be served: number, and what Python ran.
arrived: list[tuple[int, FrameType | None]] = []
_deferring = _together = False


@contextmanager
def deferred() -> Iterator[None]:
    """Signals that have a handler in Python wait for ``serve``, or for the end of the ``with`` block."""
    global _deferring
    if _deferring or threading.current_thread() is not threading.main_thread():  # other threads get no signals
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


@contextmanager
def together(comm: MPI.Comm) -> Iterator[None]:
    """On several ranks signals wait for ``agree``, or for the end of the ``with`` block; on one rank nothing changes.

    What a handler raises on one rank alone would leave the others waiting in MPI for ever.
    """
    global _together
    if comm.size == 1 or _together:
        yield
        return
    with deferred():
        _together = True
        try:
            yield
        finally:
            _together = False


def waiting() -> int:
    """The number of signals that wait for ``agree`` on this rank."""
    return len(arrived) if _together else 0


def agree(comm: MPI.Comm, count: int | None = None) -> None:
    """Call the handlers of the signals that wait on any rank; ``count``: the sum of ``waiting`` over the ranks, if it
    is known; collective.

    Raises:
        BaseException: what a handler raises on any rank, on all of them.
    """
    if comm.size == 1 or not (comm.allreduce(waiting()) if count is None else count):
        return
    error: BaseException | None = None
    try:
        _call()
    except BaseException as raised:
        error = raised
    # Not every exception can be sent.
    kinds = comm.allgather(None if error is None else (isinstance(error, SystemExit), str(error)))
    first = next((kind for kind in kinds if kind is not None), None)
    if error is None and first is not None:
        error = SystemExit(first[1]) if first[0] else KeyboardInterrupt(first[1])
    if error is not None:
        raise error


def serve() -> None:
    """Call the handlers of the signals that wait, but for those that wait for ``agree``.

    Raises:
        BaseException: what a handler raises, such as ``KeyboardInterrupt``.
    """
    if not _together:
        _call()


def _call() -> None:
    while arrived:
        number, frame = arrived.pop(0)
        _handlers[number](number, frame)


def _note(number: int, frame: FrameType | None) -> None:
    """In place of a handler, which it still calls if a signal comes while handlers are put back."""
    if _deferring:
        arrived.append((number, frame))
    else:
        _handlers[number](number, frame)
