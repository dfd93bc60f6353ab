"""PETSc options: one prefix, and the user's always win."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from petsc4py import PETSc

PREFIX = "sfx_"


def user_sets(start: str) -> bool:
    """Whether the user has set any option whose name begins with ``start`` (without the prefix)."""
    return any(name.startswith(PREFIX + start) for name in PETSc.Options().getAll())


@contextmanager
def default(name: str, value: str) -> Iterator[None]:
    """Set an option for the time of a ``setFromOptions``, unless the user has set it."""
    options = PETSc.Options(PREFIX)
    ours = not options.hasName(name)
    if ours:
        options[name] = value
    try:
        yield
    finally:
        if ours:
            options.delValue(name)
