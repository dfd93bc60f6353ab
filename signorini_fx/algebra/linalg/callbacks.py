"""Functions of ours that PETSc calls: what they raise ends the solve, and is raised again when PETSc has returned.

An exception that passes through PETSc becomes an error code there, which may come back as another exception or as none;
so the first one is kept.  PETSc holds bound methods weakly: petsc4py stores what it calls in the PETSc object, where
Python's collector of cycles sees it only in some builds, and a solver that PETSc holds would never be freed.
"""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from signorini_fx.machine import signals

P = ParamSpec("P")
T = TypeVar("T")
_raised: list[BaseException] = []


def called_back(function: Callable[P, T]) -> Callable[P, T]:
    """Mark a function that PETSc calls during a solve."""

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            if signals.arrived:
                signals.serve()
            return function(*args, **kwargs)
        except BaseException as error:
            _raised.append(error)
            gc.disable()  # Python loses an exception that passes through C while garbage is collected, and crashes
            raise

    return guarded


def weakly(method: Callable[..., T]) -> Callable[..., T]:
    """A bound method for PETSc to call, which does not keep its object."""
    held = weakref.WeakMethod(method)

    def call(*args: Any, **kwargs: Any) -> T:
        alive = held()
        assert alive is not None, "PETSc calls a solver that is gone"
        return alive(*args, **kwargs)

    return call


def solve(solver: Callable[..., object], *arguments: Any) -> None:
    """Call a solver of PETSc that calls back, such as ``snes.solve``; the first exception that a function raised that
    PETSc called is raised.
    """
    _raised.clear()
    collecting = gc.isenabled()
    with signals.deferred():
        try:
            solver(*arguments)
        except BaseException:
            if not _raised:
                raise
        finally:
            if collecting:
                gc.enable()
    if _raised:
        del _raised[1:]
        raise _raised.pop()
