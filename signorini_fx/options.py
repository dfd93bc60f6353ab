"""PETSc options: one prefix, and the user's always win."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

PREFIX = "sfx_"


# These only watch.
_WATCHING = ("monitor", "view", "converged_reason")


def user_sets(start: str) -> bool:
    """Whether the user has set any option whose name begins with ``start`` (without the prefix), but to watch."""
    names = (name for name in PETSc.Options().getAll() if name.startswith(PREFIX + start))
    return any(not any(word in name for word in _WATCHING) for name in names)


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
