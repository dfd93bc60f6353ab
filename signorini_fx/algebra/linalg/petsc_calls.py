"""Calls from us to PETSc and back: functions in C that petsc4py has no binding for, and functions
of ours that PETSc calls; and why a linear solve has failed: memory that has ended is told from a
matrix that is singular.

Those in C are looked up in petsc4py's own library, hence in the same PETSc that petsc4py uses.

What a function raises that PETSc calls ends the solve, and is raised again when PETSc has returned.
An exception that passes through PETSc becomes an error code there, which may come back as another
exception or as none; so the first one is kept.  PETSc holds bound methods weakly: petsc4py stores
what it calls in the PETSc object, where Python's collector of cycles sees it only in some builds,
and a solver that PETSc holds would never be freed.
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
# What PETSc says of CHOLMOD, whose numbers below 0 are errors: -2 out of memory, -3 integer
# overflow by the size.
_BY_CHOLMOD = re.compile(r"CHOLMOD \w+ failed.* with status -[23]\b")
# What dolfinx says of an error of PETSc.
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
    """Return whether an error says that there was not enough memory."""
    if isinstance(error, PETSc.Error):
        return error.ierr == _OUT_OF_MEMORY or (
            error.ierr == _IN_LIBRARY and bool(_BY_CHOLMOD.search(str(error)))
        )
    return isinstance(error, MemoryError) or (
        isinstance(error, RuntimeError) and _BY_DOLFINX.search(str(error)) is not None
    )


def factor_lacks_memory(ksp: PETSc.KSP) -> bool:
    """Return whether the factorisation of a linear solver, one that raises no error, had not enough
    memory; collective.
    """
    return bool(ksp.getPC().getFailedReason() == PETSc.PC.FailedReason.FACTOR_OUTMEMORY)


def unlock(vector: PETSc.Vec) -> None:
    """Let a vector be written that PETSc has locked for a function which has raised an error."""
    locked = ctypes.c_int()
    call("VecLockGet", vector, ctypes.byref(locked))
    for _ in range(locked.value):
        call("VecLockReadPop", vector)


@contextmanager
def unprinted() -> Iterator[None]:
    """Let PETSc print no errors of the packages: they come as outcomes or exceptions."""
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
    """Mark a function that PETSc calls during a solve."""

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            if signals.arrived:
                signals.serve()
            return function(*args, **kwargs)
        except BaseException as error:
            _raised.append(error)
            # Python loses an exception that passes through C while garbage is collected, and
            # crashes
            gc.disable()
            raise

    return guarded


def weakly(method: Callable[P, T]) -> Callable[P, T]:
    """Return a bound method for PETSc to call, which does not keep its object."""
    held = weakref.WeakMethod(method)

    def alive(*args: P.args, **kwargs: P.kwargs) -> T:
        bound = held()
        assert bound is not None, "PETSc calls a solver that is gone"
        return bound(*args, **kwargs)

    return alive


def solve(solver: Callable[[*_Arguments], None], *arguments: *_Arguments) -> None:
    """Call a solver of PETSc that calls back, such as ``snes.solve``; the first exception that a
    function raised that PETSc called is raised.
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
