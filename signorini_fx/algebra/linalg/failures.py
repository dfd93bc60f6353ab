"""Why a linear solve has failed: memory that has ended is told from a matrix that is singular."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator
from contextlib import contextmanager

from petsc4py import PETSc

from signorini_fx.algebra.linalg.petsc_c import address, call, pointer

_OUT_OF_MEMORY, _IN_LIBRARY = 55, 76  # PETSC_ERR_MEM, PETSC_ERR_LIB
# What PETSc says of CHOLMOD, whose numbers below 0 are errors: -2 out of memory, -3 integer overflow by the size.
_BY_CHOLMOD = re.compile(r"CHOLMOD \w+ failed.* with status -[23]\b")
# What dolfinx says of an error of PETSc.
_BY_DOLFINX = re.compile(rf"error code is: {_OUT_OF_MEMORY}\b")


def memory_ended(error: BaseException) -> bool:
    """Whether an error says that there was not enough memory."""
    if isinstance(error, PETSc.Error):
        return error.ierr == _OUT_OF_MEMORY or (error.ierr == _IN_LIBRARY and bool(_BY_CHOLMOD.search(str(error))))
    return isinstance(error, MemoryError) or (
        isinstance(error, RuntimeError) and _BY_DOLFINX.search(str(error)) is not None
    )


def factor_lacks_memory(ksp: PETSc.KSP) -> bool:
    """Whether the factorisation of a linear solver, one that raises no error, had not enough memory; collective."""
    return bool(ksp.getPC().getFailedReason() == PETSc.PC.FailedReason.FACTOR_OUTMEMORY)


def unlock(*vectors: PETSc.Vec) -> None:
    """Let vectors be written that PETSc has locked for a function which has raised an error."""
    locked = ctypes.c_int()
    for vector in vectors:
        call("VecLockGet", vector, ctypes.byref(locked))
        for _ in range(locked.value):
            call("VecLockReadPop", vector)


@contextmanager
def unprinted() -> Iterator[None]:
    """Let PETSc print no errors of the packages: they come as outcomes or exceptions."""
    printer = pointer("PetscErrorPrintf")
    usual, printer.value = printer.value, address("PetscErrorPrintfNone")
    try:
        yield
    finally:
        printer.value = usual
