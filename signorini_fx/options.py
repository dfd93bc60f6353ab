"""PETSc options: one prefix, and the user's always win."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

PREFIX = "sfx_"


def user_sets(start: str) -> bool:
    """Whether the user has set any option whose name begins with ``start`` (without the prefix)."""
    return any(name.startswith(PREFIX + start) for name in PETSc.Options().getAll())


@contextmanager
def defaults(values: Mapping[str, str]) -> Iterator[None]:
    """Set options for as long as PETSc reads them, unless the user has set them."""
    options = PETSc.Options(PREFIX)
    ours = [name for name in values if not options.hasName(name)]
    for name in ours:
        options[name] = values[name]
    try:
        yield
    finally:
        for name in ours:
            options.delValue(name)
