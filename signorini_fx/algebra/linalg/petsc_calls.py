"""Calls to C functions of PETSc without a binding in petsc4py, callbacks from PETSc to Python, and
reasons of failed linear solves.

C functions are looked up in petsc4py's own library, hence in the same PETSc that petsc4py uses.

If a Python function that PETSc calls raises an exception, the solve ends, and the exception is
raised again when PETSc has returned.  An exception that passes through PETSc becomes an error code
there, which may come back as another exception or as none; so the first one is kept.  PETSc must
hold bound methods weakly: petsc4py stores a callback in the PETSc object, where Python's garbage
collector finds it only in some builds, so a solver that PETSc holds would never be freed.

Lack of memory is distinguished from a singular matrix.
"""

from __future__ import annotations

import ctypes
import gc
import re
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from typing import ParamSpec, TypeVar, TypeVarTuple

from petsc4py import PETSc

from signorini_fx.machine import signals

_OUT_OF_MEMORY, _IN_LIBRARY = 55, 76  # PETSC_ERR_MEM, PETSC_ERR_LIB
# PETSc's message for errors of CHOLMOD: -2 is out of memory, -3 an integer overflow due to the
# size.
_BY_CHOLMOD = re.compile(r"CHOLMOD \w+ failed.* with status -[23]\b")
# dolfinx's message for an error of PETSc.
_BY_DOLFINX = re.compile(rf"error code is: {_OUT_OF_MEMORY}\b")


@cache
def _library() -> ctypes.CDLL:
    return ctypes.CDLL(PETSc.__file__)


def call(name: str, *arguments: object) -> None:
    """Call a C function; petsc4py objects are passed by their handles.

    Raises:
        PETSc.Error: the function returned an error code.
    """
    converted = [ctypes.c_void_p(a.handle) if isinstance(a, PETSc.Object) else a for a in arguments]
    code = getattr(_library(), name)(*converted)
    if code:
        raise PETSc.Error(code)


def memory_ended(error: BaseException) -> bool:
    """Return whether an error reports a lack of memory."""
    if isinstance(error, PETSc.Error):
        return error.ierr == _OUT_OF_MEMORY or (
            error.ierr == _IN_LIBRARY and bool(_BY_CHOLMOD.search(str(error)))
        )
    return isinstance(error, MemoryError) or (
        isinstance(error, RuntimeError) and _BY_DOLFINX.search(str(error)) is not None
    )


def factor_lacks_memory(ksp: PETSc.KSP) -> bool:
    """Return whether a factorisation that raises no error has failed by lack of memory;
    collective.
    """
    return bool(ksp.getPC().getFailedReason() == PETSc.PC.FailedReason.FACTOR_OUTMEMORY)


def unlock(vector: PETSc.Vec) -> None:
    """Unlock a vector that PETSc has locked against writing for a function which has raised an
    error.
    """
    locked = ctypes.c_int()
    call("VecLockGet", vector, ctypes.byref(locked))
    for _ in range(locked.value):
        call("VecLockReadPop", vector)


@contextmanager
def unprinted() -> Iterator[None]:
    """Suppress PETSc's printing of errors inside the ``with`` block; they are still reported as
    outcomes or exceptions.
    """
    printer = ctypes.c_void_p.in_dll(_library(), "PetscErrorPrintf")
    usual = printer.value
    printer.value = ctypes.cast(_library().PetscErrorPrintfNone, ctypes.c_void_p).value
    try:
        yield
    finally:
        printer.value = usual


P = ParamSpec("P")
T = TypeVar("T")
_Arguments = TypeVarTuple("_Arguments")
_raised: list[BaseException] = []


def called_back(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function that PETSc calls during a solve: its first exception is kept for
    ``solve``.
    """

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            if signals.arrived:
                signals.serve()
            return function(*args, **kwargs)
        except BaseException as error:
            _raised.append(error)
            # If garbage is collected while an exception passes through C, Python loses it and
            # crashes.
            gc.disable()
            raise

    return guarded


def weakly(method: Callable[P, T]) -> Callable[P, T]:
    """Return a callback for a bound method that does not keep its object alive."""
    held = weakref.WeakMethod(method)

    def alive(*args: P.args, **kwargs: P.kwargs) -> T:
        bound = held()
        assert bound is not None, "PETSc calls a solver that is gone"
        return bound(*args, **kwargs)

    return alive


def solve(solver: Callable[[*_Arguments], None], *arguments: *_Arguments) -> None:
    """Call a PETSc solver that calls Python functions, such as ``snes.solve``, and raise the first
    exception that one of these functions has raised.
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
