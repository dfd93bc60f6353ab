"""PETSc options of one problem: those in the database with its prefix, and those that it is given."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from petsc4py import PETSc

from signorini_fx.algebra.linalg.petsc_options import PREFIX, refuse_exchanged, refused


@contextmanager
def applied(prefix: str, problem_options: Mapping[str, Any]) -> Iterator[None]:
    """Put the options of a problem where its solver objects read them, without its prefix; those of the database take
    precedence.

    Raises:
        OptionsError: PETSc fails with them, or would run another method than ours with one of them.
    """
    database = PETSc.Options()
    wanted = {name: str(value) if value is not None else "" for name, value in problem_options.items()}
    wanted |= {name.removeprefix(prefix): value for name, value in database.getAll().items() if name.startswith(prefix)}
    ours = PETSc.Options(PREFIX)
    refuse_exchanged({name: value or "" for name, value in {**ours.getAll(), **wanted}.items()})
    saved = {name: value for name, value in database.getAll().items() if name.startswith(PREFIX)}
    for name, value in wanted.items():
        ours[name] = value or None
    try:
        yield
    except PETSc.Error as error:
        raise refused(error) or error from None
    finally:
        for name in wanted:
            ours.delValue(name)
        for name, value in saved.items():
            database[name] = value or None
