"""Functions of PETSc that petsc4py has no binding for, called in C, and its variables.

They are looked up in petsc4py's own library, hence in the same PETSc that petsc4py uses.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

from petsc4py import PETSc


@cache
def _library() -> ctypes.CDLL:
    return ctypes.CDLL(PETSc.__file__)


def call(name: str, *arguments: Any) -> None:
    """Call a C function; petsc4py objects are passed by their handles.

    Raises:
        PETSc.Error: the function returned an error code.
    """
    converted = [ctypes.c_void_p(a.handle) if isinstance(a, PETSc.Object) else a for a in arguments]
    code = getattr(_library(), name)(*converted)
    if code:
        raise PETSc.Error(code)


def address(name: str) -> int | None:
    """Of a C function."""
    return ctypes.cast(getattr(_library(), name), ctypes.c_void_p).value


def pointer(name: str) -> ctypes.c_void_p:
    """A variable of PETSc that holds a pointer; to set its ``value`` changes it."""
    return ctypes.c_void_p.in_dll(_library(), name)
