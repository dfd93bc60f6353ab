"""PETSc options: one prefix, and the user's take precedence over the defaults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

PREFIX = "sfx_"
# These only show something.
_WATCHING = ("monitor", "view", "converged_reason")


def user_sets(*starts: str) -> bool:
    """Whether the user has set any option whose name begins with one of these (without prefix), monitors excepted."""
    names = [name.removeprefix(PREFIX) for name in PETSc.Options().getAll() if name.startswith(PREFIX)]
    return any(name.startswith(starts) and not watches(name) for name in names)


def user_chooses_solver() -> bool:
    """Whether the user has set any option of the linear solvers and their matrices."""
    return user_sets("pc_", "ksp_", "mat_")


def watches(name: str) -> bool:
    """Whether an option of this name only shows something."""
    return any(word in name for word in _WATCHING)


@contextmanager
def defaults(values: Mapping[str, str]) -> Iterator[None]:
    """Set options while PETSc reads them, unless the user has set them."""
    options = PETSc.Options(PREFIX)
    ours = [name for name in values if not options.hasName(name)]
    for name in ours:
        options[name] = values[name]
    try:
        yield
    finally:
        for name in ours:
            options.delValue(name)
