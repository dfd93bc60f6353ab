"""Cases that must give red rows, for the tests of the suite; they are not a part of it."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator

from benchmarks.stability.case import CONVERGED, Case, Finding


def cases(*, short: bool) -> Iterator[Case]:
    """One of each kind, and good ones between, which must not be affected."""
    yield Case("good", lambda: Finding(CONVERGED, 1, 1e-9, 0.0), target=1e-8)
    yield Case("hangs", _hang, seconds=1.0)
    yield Case("good after a hang", lambda: Finding(CONVERGED, 1, 1e-9, 0.0), target=1e-8)
    yield Case("crashes", _crash)
    yield Case("raises", _raise)
    yield Case("wrong answer", lambda: Finding(CONVERGED, 1, 1e-9, 1e-3), target=1e-8)
    yield Case("no answer", lambda: Finding(CONVERGED, 1, 1e-9, None), target=1e-8)
    yield Case("not a number", lambda: Finding(CONVERGED, 1, 1e-9, float("nan")), target=1e-8)
    yield Case("no certificate", lambda: Finding(CONVERGED, 1, 1e-3, 0.0), target=1e-8)
    yield Case("another outcome", lambda: Finding("slides"))
    yield Case("allowed outcome", lambda: Finding("slides"), allowed=("slides",), note="why")
    yield Case("good at the end", lambda: Finding(CONVERGED, 1, 1e-9, 0.0), target=1e-8)


def _hang() -> Finding:
    time.sleep(600)
    return Finding(CONVERGED)


def _crash() -> Finding:
    os.kill(os.getpid(), signal.SIGKILL)
    return Finding(CONVERGED)


def _raise() -> Finding:
    raise ZeroDivisionError("on purpose")
